"""Mirror-symmetric clouds."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF


@dataclass(frozen=True)
class SymmetryLine:
    """A line of symmetry: coordinate ``axis`` (0 for x, 1 for y) equals ``at``."""

    axis: int
    at: float

    def __str__(self) -> str:
        return f"{'xy'[self.axis]} = {self.at:g}"

    def reflect(self, points: FloatArray) -> FloatArray:
        """Mirror images (n, 2) of ``points`` (n, 2)."""
        return self.signs * points + self.shift

    @property
    def signs(self) -> FloatArray:
        """Factors (2,) of a vector's components under reflection."""
        signs = np.ones(2)
        signs[self.axis] = -1.0
        return signs

    @property
    def shift(self) -> FloatArray:
        """Mirror image (2,) of the origin."""
        return self.at * (1.0 - self.signs)

    def contains(self, points: FloatArray) -> bool:
        """Whether all ``points`` (n, 2) are on the line."""
        size = np.abs(points).max(initial=0.0) + abs(self.at)
        return bool((np.abs(points[:, self.axis] - self.at) <= ROUND_OFF * size).all())

    def images(self, points: FloatArray, size: FloatArray) -> IntArray | None:
        """Indices (n,) of the images of ``points`` (n, 2), within ROUND_OFF times ``size`` (n,); None
        if the points are not mirror-symmetric."""
        away, image = nearest(cKDTree(points), self.reflect(points))
        found: IntArray = np.asarray(image, dtype=np.int64)
        paired = np.array_equal(found[found], np.arange(len(points)))
        return found if paired and (np.asarray(away) <= ROUND_OFF * size).all() else None

    def mirror(self, points: FloatArray, size: FloatArray, edges: IntArray) -> Mirror | None:
        """The symmetry of ``points``, as in :meth:`images`; None also if the line runs along one of the
        ``edges`` (e, 2) of their outline."""
        image = self.images(points, size)
        if image is None:
            return None
        own = image == np.arange(len(image))
        if own[edges].all(axis=1).any():
            return None
        side = np.where(own, 0, np.sign(points[:, self.axis] - self.at)).astype(np.int64)
        return Mirror(self, image, side)


@dataclass(frozen=True)
class Mirror:
    """A cloud's symmetry about a ``line``. ``image`` (n,) is the image of every node (itself on the line),
    ``side`` (n,) the sign of its distance from the line."""

    line: SymmetryLine
    image: IntArray
    side: IntArray

    @cached_property
    def own(self) -> IntArray:
        """Nodes (h,) on the line and on its positive side; the others are their images."""
        return np.flatnonzero(self.side >= 0)

    @cached_property
    def place(self) -> IntArray:
        """Position (n,) of every node, or else of its image, in :attr:`own`."""
        place = np.empty(len(self.image), dtype=np.int64)
        place[self.own] = np.arange(len(self.own))
        beyond = self.side < 0
        place[beyond] = place[self.image[beyond]]
        return place

    def extended(self, count: int, upon: int) -> Mirror:
        """Symmetry of ``count`` nodes ordered as: these nodes, ``upon`` nodes on the line, further nodes on
        the positive side, their images."""
        first = len(self.image)
        on = np.arange(first, first + upon)
        adjacent, beyond = np.split(np.arange(first + upon, count), 2)
        image = np.concatenate([self.image, on, beyond, adjacent])
        side = [self.side, np.zeros_like(on), np.ones_like(adjacent), -np.ones_like(beyond)]
        return Mirror(self.line, image, np.concatenate(side))

    def derivative_signs(self, kinds: int) -> FloatArray:
        """Factors under reflection of value, d/dx, d/dy, d2/dx2, d2/dxdy, d2/dy2, the first ``kinds`` of
        them."""
        x, y = self.line.signs
        return np.array([1.0, x, y, 1.0, x * y, 1.0])[:kinds]
