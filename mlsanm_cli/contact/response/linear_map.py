"""Quantities linear in load factors, rigid motions, pressures and tractions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.response.compressed import stacked


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

    def __call__(
        self, f: FloatArray, q: FloatArray, p: FloatArray, t: FloatArray | None = None
    ) -> FloatArray:
        """Values (r,) in one state; without ``t`` for zero tractions."""
        result: FloatArray = self.constant + self.load @ f + self.motion @ q + self.pressure @ p
        return result if t is None else result + self.traction @ t

    def __add__(self, other: LinearMap) -> LinearMap:
        return LinearMap(
            self.constant + other.constant,
            self.load + other.load,
            self.motion + other.motion,
            self.pressure + other.pressure,
            self.traction + other.traction,
        )

    def __neg__(self) -> LinearMap:
        return LinearMap(-self.constant, -self.load, -self.motion, -self.pressure, -self.traction)

    def combined(self, factors: FloatArray) -> LinearMap:
        """Linear combinations of the rows with ``factors`` (s, r)."""
        return LinearMap(
            factors @ self.constant,
            factors @ self.load,
            factors @ self.motion,
            factors @ self.pressure,
            factors @ self.traction,
        )

    @property
    def matrix(self) -> FloatArray:
        """All coefficients (r, 1 + L + k + m + n) of 1, f, q, p and t."""
        return np.hstack([self.constant[:, None], self.load, self.motion, self.pressure, self.traction])

    def take(self, rows: IntArray | BoolArray | slice) -> LinearMap:
        """A selection of rows."""
        return LinearMap(
            self.constant[rows], self.load[rows], self.motion[rows], self.pressure[rows], self.traction[rows]
        )


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
        return LinearMap(
            np.zeros(len(load)),
            load,
            np.zeros((len(load), self.motions)),
            np.zeros((len(load), self.pressures)),
            np.zeros((len(load), self.tractions)),
        )


def stack(maps: list[LinearMap], columns: Columns) -> LinearMap:
    """Stack maps vertically."""
    parts = [columns.zeros(0), *maps]
    return LinearMap(
        np.concatenate([part.constant for part in parts]),
        np.concatenate([part.load for part in parts]),
        np.concatenate([part.motion for part in parts]),
        stacked([part.pressure for part in parts]),
        np.concatenate([part.traction for part in parts]),
    )
