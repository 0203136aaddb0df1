"""Quadrature over a cloud's triangles for functions with singular points on the outline."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.membership import cross

REFINE_DISTANCE = 2.0
"""A triangle closer to a singular point than this times its longest side is divided into four, ..."""
MAX_REFINEMENTS = 2
"""... up to this many times."""


def graded_quadrature(cloud: Cloud, singular: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Midpoint rule: points (e, 2) and areas (e,), graded towards the ``singular`` points (k, 2)."""
    tree, corners = cKDTree(singular), cloud.points[cloud.triangles]
    points, areas = [], []
    for time in range(MAX_REFINEMENTS + 1):
        middle = corners.mean(axis=1)
        sides = corners - np.roll(corners, 1, axis=1)
        size = np.hypot(*np.moveaxis(sides, 2, 0)).max(axis=1)
        close = (tree.query(middle)[0] < REFINE_DISTANCE * size) & (time < MAX_REFINEMENTS)
        (a, b) = np.moveaxis(sides[~close, 1:], 1, 0)
        points.append(middle[~close])
        areas.append(0.5 * np.abs(cross(a, b)))
        whole = corners[close]
        middles = 0.5 * (whole + np.roll(whole, -1, axis=1))
        before = np.roll(middles, 1, axis=1)
        ends = [np.stack([whole[:, i], middles[:, i], before[:, i]], axis=1) for i in range(3)]
        corners = np.concatenate([middles, *ends])
    return np.concatenate(points), np.concatenate(areas)
