"""Mirror-symmetric clouds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.roundoff import ROUND_OFF
from mlsanm_cli.startup import cKDTree


@dataclass(frozen=True)
class SymmetryLine:
    """A line of symmetry: coordinate ``axis`` (0 for x, 1 for y) equals ``at``."""

    axis: int
    at: float

    def __str__(self) -> str:
        return f"{'xy'[self.axis]} = {self.at:g}"

    def reflect(self, points: FloatArray) -> FloatArray:
        """Mirror images (n, 2) of ``points`` (n, 2)."""
        reflected = points.copy()
        reflected[:, self.axis] = 2.0 * self.at - points[:, self.axis]
        return reflected

    @property
    def signs(self) -> FloatArray:
        """Factors (2,) of a vector's components under reflection."""
        signs = np.ones(2)
        signs[self.axis] = -1.0
        return signs

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

    def derivative_signs(self, kinds: int) -> FloatArray:
        """Factors under reflection of value, d/dx, d/dy, d2/dx2, d2/dxdy, d2/dy2, the first ``kinds`` of
        them."""
        x, y = self.line.signs
        return np.array([1.0, x, y, 1.0, x * y, 1.0])[:kinds]
