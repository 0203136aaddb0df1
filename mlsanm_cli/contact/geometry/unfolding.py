"""Ranges of contacts that end at planes of symmetry, reflected at these.

With the coordinate s* of the reflected point and the reflection R of vectors, the response of a body with a
plane of symmetry is that of the whole body to a force and its image::

    G(s, s') = N(s, s') + N(s, s'*) R + S(s, s'),    S(s*, s') = R S(s, s'),    S(s, s'*) = S(s, s') R

Of displacements the normal component is even about the plane, the tangential one odd, and likewise of
tractions. At one plane the range is doubled. Two planes at an angle of pi / p, or parallel (p = 1), make 2 p
copies of the range, which close to a ring of circumference 2 p l.

Equation (7) of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.geometry.grid import Hats, chebyshev, lagrange
from mlsanm_cli.mechanics.symmetry import SymmetryPlane, copies_around
from mlsanm_cli.records import dataclass

Planes: TypeAlias = tuple[SymmetryPlane | None, SymmetryPlane | None]
"""The planes of symmetry at the first and the last end of a range."""


@dataclass(frozen=True)
class Unfolding:
    """The range from ``first`` to ``last`` with ``count`` samples, reflected at ``planes``."""

    first: float
    last: float
    count: int
    planes: Planes

    @property
    def length(self) -> float:
        return self.last - self.first

    @cached_property
    def _around(self) -> int | None:
        """Number of lengths of the ring that two planes make."""
        first, last = self.planes
        return None if first is None or last is None else copies_around(first, last)

    @property
    def period(self) -> float | None:
        """Circumference of this ring."""
        return None if self._around is None else self._around * self.length

    @cached_property
    def copies(self) -> tuple[tuple[float, float, FloatArray], ...]:
        """Sign and offset of the coordinate, and matrix (2, 2) of vectors, of all copies in order."""
        first, last = self.planes
        own = 1.0, 0.0, np.eye(2)
        if first is None:
            return (own,) if last is None else (own, (-1.0, 2.0 * self.last, last.image.matrix))
        image = -1.0, 2.0 * self.first, first.image.matrix
        if last is None:
            return image, own
        found, turn, shift = [], np.eye(2), 0.0
        for _ in range((self._around or 2) // 2):
            found += [(-1.0, image[1] + shift, turn @ image[2]), (1.0, shift, turn)]
            turn, shift = turn @ last.image.matrix @ first.image.matrix, shift + 2.0 * self.length
        return tuple(found)

    @cached_property
    def samples(self) -> FloatArray:
        """Coordinates (k,) of the samples: Chebyshev points of the range, or of the doubled one those within
        the range; between two planes equidistant."""
        if self.period is not None:
            return self.first + self.length * (np.arange(self.count) + 0.5) / self.count
        return self._every[self._kept]

    @cached_property
    def _every(self) -> FloatArray:
        """Chebyshev points of the range, or of the doubled one."""
        before, after = (plane is not None for plane in self.planes)
        first, last = self.first - before * self.length, self.last + after * self.length
        return chebyshev(first, last, self.count * (1 + (before or after)))

    @property
    def _kept(self) -> slice:
        """The samples among them."""
        return slice(self.count, None) if self.planes[0] is not None else slice(self.count)

    def cardinals(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Functions (e, k) at ``s`` (e,) that interpolate even, and odd, values at the samples."""
        if self.period is not None:
            order, angle = np.arange(self.count + 1), np.pi / self.length * (s - self.first)
            nodes = np.pi * (np.arange(self.count) + 0.5) / self.count
            weight = np.where((order == 0) | (order == self.count), 1.0, 2.0) / self.count
            cosines = weight[:-1, None] * np.cos(np.outer(order[:-1], nodes))
            even = np.cos(np.outer(angle, order[:-1])) @ cosines
            odd = np.sin(np.outer(angle, order)) @ (weight[:, None] * np.sin(np.outer(order, nodes)))
            return even, odd
        values = lagrange(s, self._every)
        if self.planes == (None, None):
            return values, values
        own, image = values[:, self._kept], values[:, ::-1][:, self._kept]
        return own + image, own - image

    def spectrum(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Coefficients (k, ...) of the expansions that interpolate even, and odd, ``values`` (k, ...) at the
        samples, from the first to the last order: Chebyshev polynomials, or cosines and sines."""
        if self.planes == (None, None):
            found = _cosines(self.count, np.arange(self.count)) @ values
            return found, found
        if self.period is not None:
            angle = np.pi * (np.arange(self.count) + 0.5) / self.count
            sines = np.sin(np.outer(np.arange(1, self.count + 1), angle)) * (2.0 / self.count)
            return _cosines(self.count, np.arange(self.count)) @ values, sines @ values
        even, odd = (
            2.0 * _cosines(2 * self.count, 2 * np.arange(self.count) + parity)[:, self._kept] @ values
            for parity in (0, 1)
        )
        return even, odd

    def waves(self, order: int) -> tuple[FloatArray, FloatArray]:
        """Even, and odd, functions (k, n) at the samples, up to an ``order`` per length of the range."""
        every = np.pi * (np.arange(self.count) + 0.5) / self.count
        even, odd = np.arange(order + 1), np.arange(1, order + 1)
        if self.period is not None:
            return np.cos(np.outer(every, even)), np.sin(np.outer(every, odd))
        angle = np.pi * (np.arange(2 * self.count) + 0.5)[self._kept, None] / (2 * self.count)
        return np.cos(angle * (2 * even)), np.cos(angle * (2 * odd - 1))

    def hats(self, hats: Hats) -> Hats:
        """The hats of all copies; at planes, half hats on both sides."""
        places = [np.sort(sign * hats.place + offset) for sign, offset, _ in self.copies]
        outer = [np.sort(sign * hats.nodes[[0, -1]] + offset) for sign, offset, _ in self.copies]
        return Hats(np.concatenate([outer[0][:1], *places, outer[-1][1:]]), self.period or hats.period)

    def fold(self, count: int) -> sparse.csr_array:
        """Matrix (m c, m) that repeats values at ``count`` m hats on the c copies."""
        order = np.arange(count)
        columns = np.concatenate([order[:: int(sign)] for sign, _, _ in self.copies])
        entries = np.ones(len(columns)), (np.arange(len(columns)), columns)
        return sparse.csr_array(entries, shape=(len(columns), count))

    def located(self, points: FloatArray) -> tuple[FloatArray, IntArray]:
        """Coordinates (e,) within the range of ``points`` (e,) of the copies, and the copy (e,) of each."""
        starts = [min(sign * s + offset for s in (self.first, self.last)) for sign, offset, _ in self.copies]
        number = np.searchsorted(np.array(starts[1:]), points, side="right")
        sign, offset = (np.array([one[k] for one in self.copies])[number] for k in (0, 1))
        return np.clip(sign * (points - offset), self.first, self.last), number

    def turned(self, directions: FloatArray, number: IntArray) -> FloatArray:
        """Vectors (e, 2) of the range as they are in copies ``number`` (e,)."""
        matrices = np.array([matrix for *_, matrix in self.copies])
        return np.asarray(np.einsum("ecd,ed->ec", matrices[number], directions))


def _cosines(count: int, order: Sequence[int] | IntArray) -> FloatArray:
    """Rows (n, k) for Chebyshev, or cosine, coefficients of an ``order`` (n,) of ``count`` k values."""
    angle = np.pi * (np.arange(count) + 0.5) / count
    return np.asarray(np.cos(np.outer(order, angle)) * (2.0 / count))
