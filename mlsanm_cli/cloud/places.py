"""Points at which nodes are wanted, on the outline or inside."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.curves import Outline
from mlsanm_cli.cloud.membership import inside_body
from mlsanm_cli.cloud.mirror import IMAGE_TOLERANCE, SymmetryLine
from mlsanm_cli.cloud.spacing import MIN_DISTANCE, Spacing
from mlsanm_cli.cloud.surface import Surface, boundary_of


@dataclass(frozen=True)
class Places:
    """Wanted ``points`` (k, 2), the index ``curve`` (k,) of the outline curve they lie on or next to (-1
    inside), and the arc length ``arc`` (k,) of the closest point there."""

    points: FloatArray
    curve: IntArray
    arc: FloatArray

    @classmethod
    def of(cls, outline: Outline, spacing: Spacing, points: FloatArray) -> Places:
        """Locate ``points`` (k, 2)."""
        number, arc, least = np.full(len(points), -1), np.zeros(len(points)), np.full(len(points), np.inf)
        for k, curve in enumerate(outline.curves if len(points) else ()):
            s = curve.closest(points)
            away = np.hypot(*(curve.points(s) - points).T)
            nearer = away < least
            number[nearer], arc[nearer], least[nearer] = k, s[nearer], away[nearer]
        number[least > MIN_DISTANCE * spacing.at(points)] = -1
        return cls(points, number, arc)

    def along(self, number: int) -> FloatArray:
        """Arc lengths of the points on curve ``number``."""
        return np.asarray(self.arc[self.curve == number])

    def upon(self, line: SymmetryLine) -> bool:
        """Whether all interior points are on a ``line``."""
        points = self.points[self.curve < 0]
        size = np.abs(points).max(initial=0.0) + abs(line.at)
        return bool((np.abs(points[:, line.axis] - line.at) <= IMAGE_TOLERANCE * size).all())

    def inside(self, boundary: FloatArray, surfaces: Mapping[str, Surface], spacing: Spacing) -> FloatArray:
        """Interior points (m, 2) in the body of ``boundary`` nodes (b, 2), not too close to each other."""
        points = self.points[self.curve < 0]
        if not len(points):
            return points
        room = MIN_DISTANCE * spacing.at(points)
        kept = inside_body(boundary, *boundary_of(surfaces.values()), points)
        for k in np.flatnonzero(kept):
            others = np.flatnonzero(kept[:k])
            kept[k] = (np.hypot(*(points[others] - points[k]).T) > room[k]).all()
        return np.ascontiguousarray(points[kept])
