"""Quantities linear in load factors, rigid motions, pressures and tractions."""

from __future__ import annotations

from dataclasses import replace
from operator import add, neg

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.response.compressed import stacked
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class LinearMap:
    """``constant`` (r,) + ``load`` (r, L) f + ``motion`` (r, k) q + ``pressure`` (r, m) p + ``traction`` t.
    ``traction`` (r, n) multiplies the tractions of frictional contacts. ``pressure`` may be
    :class:`Compressed`, which behaves like an array."""

    constant: FloatArray
    load: FloatArray
    motion: FloatArray
    pressure: FloatArray
    traction: FloatArray

    @property
    def parts(self) -> tuple[FloatArray, ...]:
        """Constant and coefficients."""
        return self.constant, self.load, self.motion, self.pressure, self.traction

    def __call__(
        self, f: FloatArray, q: FloatArray, p: FloatArray, t: FloatArray | None = None
    ) -> FloatArray:
        """Values (r,) in one state; without ``t`` for zero tractions."""
        result: FloatArray = self.constant + self.load @ f + self.motion @ q + self.pressure @ p
        return result if t is None else result + self.traction @ t

    def __add__(self, other: LinearMap) -> LinearMap:
        return LinearMap(*map(add, self.parts, other.parts))

    def __neg__(self) -> LinearMap:
        return LinearMap(*map(neg, self.parts))

    def combined(self, factors: FloatArray) -> LinearMap:
        """Linear combinations of the rows with ``factors`` (s, r)."""
        return LinearMap(*(factors @ part for part in self.parts))

    def take(self, rows: IntArray | BoolArray | slice) -> LinearMap:
        """A selection of rows."""
        return LinearMap(*(part[rows] for part in self.parts))

    @property
    def matrix(self) -> FloatArray:
        """All coefficients (r, 1 + L + k + m + n) of 1, f, q, p and t."""
        return np.column_stack(self.parts)


@dataclass(frozen=True)
class Columns:
    """Numbers of unknowns of each kind, in the order loads, motions, pressures, tractions."""

    loads: int
    motions: int
    pressures: int
    tractions: int = 0

    @property
    def total(self) -> int:
        """Number of all columns."""
        return self.loads + self.motions + self.pressures + self.tractions

    @property
    def motion_places(self) -> slice:
        """Range of the motions."""
        return slice(self.loads, self.loads + self.motions)

    def split(self, rows: FloatArray, constant: FloatArray | None = None) -> LinearMap:
        """A dense array (r, total) as a linear map."""
        ends = np.cumsum([self.loads, self.motions, self.pressures])
        start = np.zeros(len(rows)) if constant is None else constant
        return LinearMap(start, *np.split(rows, ends, axis=1))

    def zeros(self, rows: int) -> LinearMap:
        """The zero map."""
        return self.split(np.zeros((rows, self.total)))

    def of_loads(self, load: FloatArray) -> LinearMap:
        """A map (r, L) of the load factors alone."""
        return replace(self.zeros(len(load)), load=load)


def stack(maps: list[LinearMap], columns: Columns) -> LinearMap:
    """Stack maps vertically."""
    each = [columns.zeros(0).parts, *(one.parts for one in maps)]
    return LinearMap(*(stacked(parts) for parts in zip(*each, strict=True)))
