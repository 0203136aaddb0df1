"""Quantities linear in load factors, rigid motions, pressures and tractions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from operator import add, neg
from typing import Any, TypeAlias

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.records import dataclass

Counts: TypeAlias = tuple[int, int, int, int]
"""Numbers of load factors, motions, pressures and tractions."""


@dataclass(frozen=True)
class LinearMap:
    """``constant`` (r,) + ``load`` (r, L) f + ``motion`` (r, k) q + ``pressure`` (r, m) p + ``traction``
    (r, n) t. ``pressure`` may be :class:`Compressed`, which behaves like an array."""

    constant: FloatArray
    load: FloatArray
    motion: FloatArray
    pressure: FloatArray
    traction: FloatArray

    @classmethod
    def of_rows(cls, rows: FloatArray, counts: Counts) -> LinearMap:
        """A dense array (r, L + k + m + n) as a linear map."""
        return cls(np.zeros(len(rows)), *np.split(rows, np.cumsum(counts[:3]), axis=1))

    @classmethod
    def zeros(cls, rows: int, counts: Counts) -> LinearMap:
        """The zero map."""
        return cls.of_rows(np.zeros((rows, sum(counts))), counts)

    @classmethod
    def of_loads(cls, load: FloatArray, counts: Counts) -> LinearMap:
        """A map (r, L) of the load factors alone."""
        return replace(cls.zeros(len(load), counts), load=load)

    @property
    def counts(self) -> Counts:
        """Numbers of load factors, motions, pressures and tractions."""
        loads, motions, pressures, tractions = (part.shape[1] for part in self.parts[1:])
        return loads, motions, pressures, tractions

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

    def combined(self, factors: Any) -> LinearMap:
        """Linear combinations of the rows with ``factors`` (s, r)."""
        return LinearMap(*(factors @ part for part in self.parts))

    def take(self, rows: IntArray | BoolArray | slice) -> LinearMap:
        """A selection of rows."""
        return LinearMap(*(part[rows] for part in self.parts))

    def shifted(self, change: FloatArray) -> LinearMap:
        """The map with ``change`` (r,) added to its constant."""
        return replace(self, constant=self.constant + change)

    @property
    def matrix(self) -> FloatArray:
        """All coefficients (r, 1 + L + k + m + n) of 1, f, q, p and t."""
        return np.column_stack(self.parts)


def stack(maps: Sequence[LinearMap], counts: Counts) -> LinearMap:
    """Stack maps vertically."""
    each = [LinearMap.zeros(0, counts).parts, *(one.parts for one in maps)]
    return LinearMap(*(np.concatenate(parts) for parts in zip(*each, strict=True)))
