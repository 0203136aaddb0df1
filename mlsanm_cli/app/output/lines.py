"""Contact surfaces and obstacles as lines, for files and pictures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.case import AnyObstacle, Case, DiskObstacle, ObstacleMotion, PlaneObstacle

CIRCLE_POINTS = 181
PLANE_LENGTH = 0.75
"""Length of a plane to both sides, in diameters of the scene."""


def obstacles(case: Case, low: FloatArray, high: FloatArray) -> dict[str, tuple[FloatArray, IntArray]]:
    """Points (k, 2) and pairs of neighbours (e, 2) of the obstacle of every contact before loading. Planes
    are drawn with a length relative to the scene, whose box is from ``low`` (2,) to ``high`` (2,)."""
    return {
        contact.name: _drawn(contact.obstacle, low, high)
        for contact in case.contact
        if contact.obstacle is not None
    }


def obstacle_shift(case: Case, contact: str, moved: Mapping[str, FloatArray]) -> FloatArray:
    """Displacement (2,) of an obstacle, from the displacements ``moved`` by load, which are all equal."""
    names = [load.name for load in case.load if isinstance(load, ObstacleMotion) and load.obstacle == contact]
    return next((moved[name] for name in names if name in moved), np.zeros(2))


def contact_data(record: Mapping[str, Any], arc: FloatArray, friction: bool) -> dict[str, NDArray[Any]]:
    """The values of a ``record`` at the nodes of a contact at ``arc`` lengths (c,)."""
    data: dict[str, NDArray[Any]] = {
        "pressure": record["pressure"],
        "traction": record["traction"],
        "gap": record["gap"],
        "status": record["status"].astype(np.int32),
        "arc_length": arc,
    }
    # Without friction the slip is not computed; viewers cannot show nan.
    return data | {"slip": record["slip"]} if friction else data


def _drawn(obstacle: AnyObstacle, low: FloatArray, high: FloatArray) -> tuple[FloatArray, IntArray]:
    if isinstance(obstacle, PlaneObstacle):
        normal = np.array(obstacle.normal) / np.hypot(*obstacle.normal)
        middle = 0.5 * (low + high)
        foot = middle - ((middle - np.array(obstacle.point)) @ normal) * normal
        reach = PLANE_LENGTH * float(np.hypot(*(high - low))) * np.array([normal[1], -normal[0]])
        points = np.array([foot - reach, foot + reach])
    elif isinstance(obstacle, DiskObstacle):
        angle = np.linspace(0.0, 2.0 * np.pi, CIRCLE_POINTS)
        ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        points = np.array(obstacle.center) + obstacle.radius * ring
    else:
        points = np.array(obstacle.points)
    numbers = np.arange(len(points), dtype=np.int64)
    return points, np.stack([numbers[:-1], numbers[1:]], axis=1)
