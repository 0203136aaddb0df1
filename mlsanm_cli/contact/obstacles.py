"""Shapes of rigid obstacles: for any point the closest one of the obstacle, and the outward normal there."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.values import dataclass

ROUND_OFF = 1e-9


class Shape(Protocol):
    """What a slave surface can be pressed on."""

    def closest(self, points: FloatArray, outward: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The obstacle's points (n, 2) closest to ``points`` (n, 2), and its unit outward normals (n, 2).

        The points belong to a surface with the normals ``outward`` (n, 2).
        """
        ...


@dataclass(frozen=True)
class Plane:
    """All that lies behind ``point``, seen along the unit ``normal``."""

    point: tuple[float, float]
    normal: tuple[float, float]

    def closest(self, points: FloatArray, outward: FloatArray) -> tuple[FloatArray, FloatArray]:
        normal = np.array(self.normal)
        above = (points - np.array(self.point)) @ normal
        return points - above[:, None] * normal, np.tile(normal, (len(points), 1))


@dataclass(frozen=True)
class Round:
    """A disk, or with ``inside`` all that lies outside it, as around a hole."""

    center: tuple[float, float]
    radius: float
    inside: bool

    def closest(self, points: FloatArray, outward: FloatArray) -> tuple[FloatArray, FloatArray]:
        away = points - np.array(self.center)
        distance = np.hypot(away[:, 0], away[:, 1])
        middle = distance == 0.0
        # The centre is as far from any point of the circle.
        radial = np.where(middle[:, None], [1.0, 0.0], away / np.where(middle, 1.0, distance)[:, None])
        return np.array(self.center) + self.radius * radial, -radial if self.inside else radial


@dataclass(frozen=True)
class Chain:
    """A chain of straight sides through ``points`` (c, 2), with the obstacle on the left of the way along it.

    Around a corner that points outward the normal turns with the direction from the corner.
    """

    points: FloatArray

    def closest(self, points: FloatArray, outward: FloatArray) -> tuple[FloatArray, FloatArray]:
        start, along = self.points[:-1], np.diff(self.points, axis=0)
        length = np.hypot(along[:, 0], along[:, 1])
        tangent = along / length[:, None]
        away = points[:, None, :] - start
        s = np.clip((away * tangent).sum(axis=2), 0.0, length)
        distance = np.linalg.norm(away - s[:, :, None] * tangent, axis=2)
        # Two sides share a corner; the one that is faced more counts, of points just there by their surface.
        nearest = distance <= distance.min(axis=1, keepdims=True) + ROUND_OFF * length.max()
        across = away[:, :, 0] * tangent[:, 1] - away[:, :, 1] * tangent[:, 0]
        facing = outward[:, :1] * tangent[:, 1] - outward[:, 1:] * tangent[:, 0]
        faced = across - ROUND_OFF * length.max() * facing
        side = np.argmax(np.where(nearest, faced, -np.inf), axis=1)
        every = np.arange(len(points))
        s = s[every, side]
        partner = start[side] + s[:, None] * tangent[side]
        normal = np.stack([tangent[side, 1], -tangent[side, 0]], axis=1)
        # Beyond a corner the way there is the normal, above a side it is the side's own to all digits.
        past = points - partner
        beside = np.abs((past * tangent[side]).sum(axis=1))
        size = np.hypot(past[:, 0], past[:, 1])
        corner = (beside > ROUND_OFF * length.max()) & ((past * normal).sum(axis=1) > 0.0)
        inner = ((s == 0.0) & (side > 0)) | ((s == length[side]) & (side < len(length) - 1))
        turned = (corner & inner)[:, None]
        return partner, np.where(turned, past / np.where(size > 0.0, size, 1.0)[:, None], normal)
