"""Compressed compliance of many unknowns: near entries, far and smooth low-rank products. It behaves like a
matrix: products and submatrices use its factors, everything else converts it to a dense array first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from operator import add, neg
from typing import Any, Protocol, TypeAlias, cast

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.geometry.clusters import Chain
from mlsanm_cli.operators.system import BLOCK_COLUMNS
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF

COMPRESSED_CONTACT, COMPRESSED_TOTAL = 800, 3000
"""Numbers of unknowns of one contact, or of all, above which frictionless compliances are compressed; below,
dense ones are faster."""
SAMPLES = 32
"""Rows and columns sampled for the largest entry."""
OWN_DISTANCE = 0.44
"""Distance over a hat's width at which the kernel stands for the compliance of a node itself."""
SINGULAR = 1e-15
"""Reciprocal condition number of a singular matrix."""


@dataclass(frozen=True, eq=False)
class Compressed:
    """A matrix (m, m): entries ``near``, plus matrix products ``far``, zero at near entries, and ``smooth``.
    Times ``weight`` (m,) its singular part is symmetric. ``places`` are arc lengths of each contact."""

    near: sparse.csr_array
    far: tuple[Chain, ...]
    smooth: tuple[Chain, ...]
    weight: FloatArray
    places: tuple[FloatArray, ...] = ()

    @classmethod
    def product(cls, left: FloatArray, right: FloatArray, weight: FloatArray) -> Compressed:
        """The product of a ``left`` (r, k) and a ``right`` (k, m) factor."""
        return cls(sparse.csr_array((len(left), right.shape[1])), (), ((left, right),), weight)

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of rows and columns."""
        rows, columns = self.near.shape
        return rows, columns

    def __matmul__(self, values: FloatArray) -> FloatArray:
        total = self.near @ values
        for chain in (*self.far, *self.smooth):
            total += reduce(lambda right, one: one @ right, reversed(chain), values)
        return np.asarray(total)

    def __getitem__(self, key: tuple[Any, ...]) -> FloatArray:
        """A part as an array."""
        rows, columns = (np.arange(count)[one].ravel() for one, count in zip(key, self.shape, strict=True))
        found = self.near[rows][:, columns].toarray()
        for chain in (*self.far, *self.smooth):
            ends = chain[0][rows], *chain[1:-1], chain[-1][:, columns]
            found += _dense(reduce(lambda one, other: one @ other, ends))
        return np.asarray(found)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> FloatArray:
        count = self.shape[1]
        found = np.empty(self.shape, dtype=dtype)
        for first in range(0, count, BLOCK_COLUMNS):
            some = slice(first, min(first + BLOCK_COLUMNS, count))
            found[:, some] = self @ np.eye(count, some.stop - some.start, -first)
        return found

    def diagonal(self) -> FloatArray:
        """The diagonal (m,), to which far products do not contribute."""
        total = self.near.diagonal()
        for chain in self.smooth:
            left = reduce(lambda one, other: one @ other, chain[:-1])
            total += np.einsum("ik,ki->i", _dense(left), _dense(chain[-1]))
        return np.asarray(total)

    def plus(
        self,
        near: sparse.csr_array,
        far: Sequence[Chain],
        smooth: Sequence[Chain],
        first: int,
        place: FloatArray,
    ) -> Compressed:
        """Add the singular compliance (m, m) of a contact, divided by the weights, whose hats at ``place``
        (m,) are the unknowns from ``first`` on."""
        count = near.shape[0]
        columns = sparse.csr_array(sparse.eye_array(count, self.shape[1], k=first, format="csr"))
        scale = sparse.diags_array(1.0 / self.weight[first : first + count], format="csr")
        rows = sparse.csr_array(columns.T @ scale)

        def placed(chain: Chain) -> Chain:
            return rows @ chain[0], *chain[1:-1], chain[-1] @ columns

        return replace(
            self,
            near=self.near + rows @ near @ columns,
            far=(*self.far, *map(placed, far)),
            smooth=(*self.smooth, *map(placed, smooth)),
            places=(*self.places, place),
        )

    def weighted(self, numbers: IntArray) -> FloatArray:
        """Rough symmetric weighted entries (n, q, q) among unknowns ``numbers`` (n, q): those of half-planes,
        scaled by the diagonal, and none between contacts."""
        place = np.concatenate(self.places)
        contact = np.repeat(np.arange(len(self.places)), [len(one) for one in self.places])
        span = np.array([2.0 * np.ptp(one) for one in self.places])[contact]
        own = OWN_DISTANCE * self.weight
        size = np.sqrt(self.weight * np.abs(self.diagonal()) / np.log(span / own))[numbers]
        away = np.abs(place[numbers][:, :, None] - place[numbers][:, None, :])
        away = np.where(away > 0.0, away, own[numbers][:, :, None])
        same = contact[numbers][:, :, None] == contact[numbers][:, None, :]
        values = np.where(same, np.log(span[numbers][:, :, None] / away), 0.0)
        return np.asarray(size[:, :, None] * values * size[:, None, :])


def _dense(matrix: Any) -> FloatArray:
    """A matrix as an array."""
    return matrix if isinstance(matrix, np.ndarray) else np.asarray(matrix.toarray())


def as_array(matrix: Compressed) -> FloatArray:
    """A compressed matrix typed as an array."""
    return cast(FloatArray, matrix)


def compressed(matrix: FloatArray) -> Compressed | None:
    """The compressed matrix behind an array type; None for an array."""
    whole: object = matrix
    return whole if isinstance(whole, Compressed) else None


def largest(matrix: FloatArray) -> float:
    """Largest modulus of the entries, 0 if empty; of a compressed matrix, of the diagonal and a sample."""
    own = compressed(matrix)
    if own is None:
        return float(np.abs(matrix).max(initial=0.0))
    some = [np.unique(np.linspace(0, count - 1, SAMPLES).astype(np.int64)) for count in own.shape]
    return float(max(np.abs(own.diagonal()).max(), np.abs(own[np.ix_(*some)]).max()))


class Multiplier(Protocol):
    """An operator that multiplies vectors."""

    def __matmul__(self, vector: FloatArray, /) -> FloatArray: ...


@dataclass(frozen=True, eq=False)
class Bordered:
    """A matrix (m + k, m + k) of blocks: ``own`` (m, m), ``right``, ``below`` and ``last`` (k, k)."""

    own: Multiplier
    right: FloatArray
    below: FloatArray
    last: FloatArray

    def __matmul__(self, vector: FloatArray) -> FloatArray:
        first, rest = np.split(vector, [len(self.right)])
        upper = self.own @ first + self.right @ rest
        return np.concatenate([upper, self.below @ first + self.last @ rest])


def null_space(rows: FloatArray) -> FloatArray:
    """Orthonormal null space (k, d) of ``rows`` (r, k) that are of size 1: up to singular values of
    round-off, which here are not relative to the largest one."""
    if not len(rows):
        return np.eye(rows.shape[1])
    # The R factor has the same singular values and is much smaller.
    _, values, right = np.linalg.svd(np.linalg.qr(rows, mode="r"))
    basis: FloatArray = right[int((values > ROUND_OFF).sum()) :].T
    return basis


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
