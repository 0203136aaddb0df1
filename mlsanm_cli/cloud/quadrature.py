"""Areas of a cloud's triangles for functions that are singular at places of the outline."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.startup import cKDTree

SINGULAR_DISTANCE = 2.0
"""Triangles within this multiple of their longest side of a singular point are divided into four, ..."""
MAX_DIVISIONS = 2
"""... at most so many times."""


def graded_quadrature(cloud: Cloud, singular: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points (e, 2) of the triangles and their areas (e,), smaller ones towards the ``singular`` places
    (k, 2), none of which is a point."""
    tree, corners = cKDTree(singular), cloud.points[cloud.triangles]
    points, areas = [], []
    for time in range(MAX_DIVISIONS + 1):
        middle = corners.mean(axis=1)
        sides = corners - np.roll(corners, 1, axis=1)
        size = np.hypot(*np.moveaxis(sides, 2, 0)).max(axis=1)
        close = (tree.query(middle)[0] < SINGULAR_DISTANCE * size) & (time < MAX_DIVISIONS)
        (a, b) = np.moveaxis(sides[~close, 1:], 1, 0)
        points.append(middle[~close])
        areas.append(0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))
        corners = _quarters(corners[close])
    return np.concatenate(points), np.concatenate(areas)


def _quarters(corners: FloatArray) -> FloatArray:
    """The four triangles (4e, 3, 2) that the middles of the sides make of each (e, 3, 2)."""
    middles = 0.5 * (corners + np.roll(corners, -1, axis=1))
    before = np.roll(middles, 1, axis=1)
    ends = [np.stack([corners[:, i], middles[:, i], before[:, i]], axis=1) for i in range(3)]
    return np.concatenate([middles, *ends])
