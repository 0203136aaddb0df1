"""Compressed compliance of many unknowns: near entries, far and smooth low-rank products. It behaves like a
matrix: products and submatrices use its factors, everything else converts it to a dense array first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import Any, cast

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.geometry.clusters import Chain

COMPRESSED_CONTACT, COMPRESSED_TOTAL = 800, 3000
"""Numbers of unknowns of one contact, or of all, above which frictionless compliances are compressed; below,
dense ones are faster. Six disks in a shaft with 1,420 pressures in all took 54 s compressed, 6 s dense: with
floating bodies that transmit forces to each other, active-set searches take many products."""
BLOCK_SIZE = 256
"""Columns of the dense array computed at once."""
SMOOTH_RANK = 32
"""Rank of the approximation of the smooth part for single entries."""


@dataclass(frozen=True)
class Singular:
    """Singular part of a contact's compliance beyond its near pairs: index ``first`` of its places among the
    unknowns, their arc lengths ``place`` (m,), integrals ``weighted`` (m, 2) of the directions with the hats,
    and the tensors ``log`` and ``turn`` (2, 2)."""

    first: int
    place: FloatArray
    weighted: FloatArray
    log: FloatArray
    turn: FloatArray

    def between(self, one: IntArray, other: IntArray) -> FloatArray:
        """Approximate double integrals (e,) with the hats of distant pairs."""
        way = self.place[one] - self.place[other]
        near = way == 0.0
        size = np.where(near, 0.0, np.log(np.abs(np.where(near, 1.0, way))))
        found = np.zeros(len(way))
        for values, table in ((size, self.log), (np.sign(way), self.turn)):
            turned = self.weighted @ table.T
            found += values * (self.weighted[one] * turned[other]).sum(axis=1)
        return found


@dataclass(frozen=True, eq=False)
class Compressed:
    """A matrix (r, m): entries ``near`` (r, m), plus matrix products ``far``, zero at near entries, and
    ``smooth``. If it is square, multiplication by ``weight`` (r,) makes its singular part symmetric;
    ``singular`` gives single entries of that."""

    near: sparse.csr_array
    far: tuple[Chain, ...]
    smooth: tuple[Chain, ...]
    weight: FloatArray
    singular: tuple[Singular, ...] = ()

    @classmethod
    def product(cls, left: FloatArray, right: FloatArray, weight: FloatArray) -> Compressed:
        """The product of a ``left`` (r, k) and a ``right`` (k, m) factor."""
        return cls(sparse.csr_array((len(left), right.shape[1])), (), ((left, right),), weight)

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of rows and columns."""
        rows, columns = self.near.shape
        return rows, columns

    def __len__(self) -> int:
        return self.shape[0]

    def __matmul__(self, values: FloatArray) -> FloatArray:
        total = self.near @ values
        for chain in (*self.far, *self.smooth):
            total += _applied(chain, values)
        return np.asarray(total)

    def __getitem__(self, key: Any) -> Any:
        """Some rows, compressed, or any other part as an array."""
        if not isinstance(key, tuple):
            rows = np.arange(len(self))[key]
            if len(rows) == len(self) and (np.diff(rows) == 1).all():
                return self
            far, smooth = (
                tuple((chain[0][rows], *chain[1:]) for chain in chains) for chains in (self.far, self.smooth)
            )
            return replace(self, near=self.near[rows], far=far, smooth=smooth, weight=self.weight[rows])
        rows, columns = (np.arange(count)[one].ravel() for one, count in zip(key, self.shape, strict=True))
        found = self.near[rows][:, columns].toarray()
        for chain in (*self.far, *self.smooth):
            ends = chain[0][rows], *chain[1:-1], chain[-1][:, columns]
            found += _dense(reduce(lambda one, other: one @ other, ends))
        return np.asarray(found)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> FloatArray:
        count = self.shape[1]
        found = np.empty(self.shape, dtype=dtype)
        for first in range(0, count, BLOCK_SIZE):
            some = slice(first, min(first + BLOCK_SIZE, count))
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
        self, near: sparse.csr_array, far: Sequence[Chain], smooth: Sequence[Chain], singular: Singular
    ) -> Compressed:
        """Add the singular compliance (m, m) of a contact, whose hats come first in the rows, divided by the
        weights, and from ``singular.first`` on in the columns."""
        count = near.shape[0]
        scale = sparse.diags_array(1.0 / self.weight[:count], format="csr")
        rows = sparse.csr_array(sparse.eye_array(len(self), count, format="csr") @ scale)
        columns = sparse.csr_array(sparse.eye_array(count, self.shape[1], k=singular.first, format="csr"))

        def placed(chain: Chain) -> Chain:
            return rows @ chain[0], *chain[1:-1], chain[-1] @ columns

        return replace(
            self,
            near=_sorted(self.near + rows @ near @ columns),
            far=(*self.far, *map(placed, far)),
            smooth=(*self.smooth, *map(placed, smooth)),
            singular=(*self.singular, singular),
        )

    @cached_property
    def _keys(self) -> IntArray:
        """Keys, row by row, of the near entries."""
        rows = np.repeat(np.arange(len(self)), np.diff(self.near.indptr))
        return np.asarray(rows * self.shape[1] + self.near.indices)

    @cached_property
    def _about(self) -> tuple[FloatArray, FloatArray]:
        """Approximate factors (r, SMOOTH_RANK) and (SMOOTH_RANK, m) of the smooth part (Halko, Martinsson and
        Tropp 2011, doi:10.1137/090771806)."""
        random = np.random.default_rng(0).standard_normal((self.shape[1], SMOOTH_RANK))
        basis = np.linalg.qr(np.sum([_applied(chain, random) for chain in self.smooth], axis=0))[0]
        parts = [reduce(lambda left, one: left @ one, chain, basis.T) for chain in self.smooth]
        return basis, np.sum(parts, axis=0)

    def weighted(self, places: IntArray) -> FloatArray:
        """Approximate symmetrised weighted entries (n, q, q) among rows of ``places`` (n, q)."""
        left, right = self._about
        smooth = (self.weight[:, None] * left)[places] @ right.T[places].transpose(0, 2, 1)
        found = 0.5 * (smooth + smooth.transpose(0, 2, 1))
        a, b = np.triu_indices(places.shape[1])
        one, other = places[:, a], places[:, b]
        keys = one * self.shape[1] + other
        place = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        near = self._keys[place] == keys
        values = np.where(near, self.weight[one] * self.near.data[place], 0.0)
        for contact in self.singular:
            first, last = contact.first, contact.first + len(contact.place)
            far = ~near & (one >= first) & (one < last) & (other >= first) & (other < last)
            values[far] = contact.between(one[far] - first, other[far] - first)
        found[:, a, b] += values
        beside = a < b
        found[:, b[beside], a[beside]] += values[:, beside]
        return np.asarray(found)


def _applied(chain: Chain, values: FloatArray) -> FloatArray:
    """A product of matrices applied to ``values`` (m, ...)."""
    return np.asarray(reduce(lambda right, one: one @ right, reversed(chain), values))


def _dense(matrix: Any) -> FloatArray:
    """A matrix as an array."""
    return matrix if isinstance(matrix, np.ndarray) else np.asarray(matrix.toarray())


def _sorted(matrix: sparse.csr_array) -> sparse.csr_array:
    """A matrix with sorted column indices."""
    found = sparse.csr_array(matrix)
    found.sort_indices()
    return found


def as_array(matrix: Compressed) -> FloatArray:
    """A compressed matrix typed as an array."""
    return cast(FloatArray, matrix)


def compressed(matrix: FloatArray) -> Compressed | None:
    """The compressed matrix behind an array type; None for an array."""
    whole: object = matrix
    return whole if isinstance(whole, Compressed) else None


def stacked(parts: Sequence[FloatArray]) -> FloatArray:
    """Stack matrices vertically; compressed if all that have rows are."""
    some = [part for part in parts if len(part)]
    if len(some) == 1:
        return some[0]
    alike = [one for one in map(compressed, some) if one is not None]
    if not alike or len(alike) < len(some):
        return np.concatenate([np.asarray(part) for part in parts])
    ends = np.cumsum([0, *map(len, alike)]).tolist()
    places = [
        sparse.csr_array(sparse.eye_array(ends[-1], len(one), k=-first, format="csr"))
        for one, first in zip(alike, ends[:-1], strict=True)
    ]
    far, smooth = (
        tuple(
            (place @ chain[0], *chain[1:])
            for place, chains in zip(places, both, strict=True)
            for chain in chains
        )
        for both in ([one.far for one in alike], [one.smooth for one in alike])
    )
    near = _sorted(sparse.vstack([one.near for one in alike], format="csr"))
    weight = np.concatenate([one.weight for one in alike])
    singular = tuple(one for part in alike for one in part.singular)
    return as_array(Compressed(near, far, smooth, weight, singular))


def largest(matrix: FloatArray) -> float:
    """Largest modulus of the entries, 0 if empty; for a compressed matrix, that of the diagonal and of a
    sample of rows and columns."""
    own = compressed(matrix)
    if own is None:
        return float(np.abs(matrix).max(initial=0.0))
    some = [np.unique(np.linspace(0, count - 1, SMOOTH_RANK).astype(np.int64)) for count in own.shape]
    return float(max(np.abs(own.diagonal()).max(), np.abs(own[np.ix_(*some)]).max()))
