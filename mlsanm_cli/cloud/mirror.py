"""Clouds that are their own mirror images."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.startup import cKDTree

IMAGE_TOLERANCE = 1e-9
"""Distance from a mirror image, in spacings, below which points coincide with it."""


@dataclass(frozen=True)
class SymmetryLine:
    """A line of symmetry: the coordinate ``axis``, 0 for x and 1 for y, is ``at`` there."""

    axis: int
    at: float

    def __str__(self) -> str:
        return f"{'xy'[self.axis]} = {self.at:g}"

    def reflect(self, points: FloatArray) -> FloatArray:
        """The mirror images (n, 2) of ``points`` (n, 2)."""
        reflected = points.copy()
        reflected[:, self.axis] = 2.0 * self.at - points[:, self.axis]
        return reflected

    @property
    def signs(self) -> FloatArray:
        """What a vector's components (2,) are multiplied by in the mirror."""
        signs = np.ones(2)
        signs[self.axis] = -1.0
        return signs

    def images(self, points: FloatArray, size: FloatArray) -> IntArray | None:
        """Which of ``points`` (n, 2) is the image (n,) of each, nearer to it than IMAGE_TOLERANCE of ``size``
        (n,); None where they are not their own mirror images."""
        away, image = nearest(cKDTree(points), self.reflect(points))
        found: IntArray = np.asarray(image, dtype=np.int64)
        paired = np.array_equal(found[found], np.arange(len(points)))
        return found if paired and (np.asarray(away) <= IMAGE_TOLERANCE * size).all() else None


@dataclass(frozen=True)
class Mirror:
    """A cloud's symmetry about a ``line``: ``image`` (n,) of every node, itself on the line, and of every
    surface the name of its image and, node by node (b,), which one of that surface is the node's."""

    line: SymmetryLine
    image: IntArray
    side: IntArray
    surfaces: Mapping[str, tuple[str, IntArray]]

    @cached_property
    def own(self) -> IntArray:
        """The nodes (h,) on the line and on its side 1; the others are images of these."""
        return np.flatnonzero(self.side >= 0)

    @cached_property
    def place(self) -> IntArray:
        """Where every node (n,), or its image, is among :attr:`own`."""
        place = np.empty(len(self.image), dtype=np.int64)
        place[self.own] = np.arange(len(self.own))
        beyond = self.side < 0
        place[beyond] = place[self.image[beyond]]
        return place

    def derivative_signs(self, kinds: int) -> FloatArray:
        """What value, d/dx, d/dy, d2/dx2, d2/dxdy and d2/dy2, the first ``kinds`` of them, are multiplied by
        in the mirror."""
        x, y = self.line.signs
        return np.array([1.0, x, y, 1.0, x * y, 1.0])[:kinds]
