"""Finer nodes at corners that touch rigid obstacles, where pressures change within short lengths."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mlsanm_cli.app.scene.default_spacing import FLAT, GROWTH, TOUCHING
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.contact.geometry.obstacles import Shape

AT_SHARP = 16.0
"""Spacings far away over those at such corners. Smooth fits leave a trace of strain at the tip, which
pressures answer to within three spacings. A jaw with a foot of 78 degrees felt 3.6 instead of 1.3 beside its
corner on a plane, without, and its pressures were 3 % off (L2); one of 60 degrees felt 3.2 and lifts off."""
RIGHT = 0.05
"""Corners within this angle (radian) of a right one bear pressures that even out."""


def sharp_ends(rest: Sequence[Curve], own: Curve, obstacle: Shape, far: float) -> Iterator[Zone]:
    """Zones at the ends of a surface ``own`` that touch a rigid ``obstacle`` as drawn, if it makes a corner
    other than a right one with a piece of the ``rest`` of its outline there.

    Where bodies touch each other both would need them: a dovetail had twice the nodes and was no better.
    """
    if own.closed:
        return
    ends = np.array([0.0, own.length])
    points, normals = own.points(ends), own.normals(ends)
    partner, _ = obstacle.closest(points, normals)
    for point, normal, gap in zip(points, normals, np.hypot(*(points - partner).T), strict=True):
        for curve in rest:
            both = np.array([0.0, curve.length])
            at = np.hypot(*(curve.points(both) - point).T) <= FLAT * own.length
            turn = np.abs(np.arccos(np.clip(curve.normals(both) @ normal, -1.0, 1.0)) - 0.5 * np.pi)
            oblique = (turn > RIGHT) & (turn < 0.5 * np.pi - RIGHT)
            if gap <= TOUCHING * far and (at & oblique).any():
                yield Zone.around((float(point[0]), float(point[1])), far / AT_SHARP, 0.0, GROWTH)
