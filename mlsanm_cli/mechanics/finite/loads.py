"""Loads on a body at finite strain: prescribed displacements, dead and follower loads, by load factors. Dead
loads keep their direction and their amount per reference length or volume. A follower pressure acts per
current length along the current normal: its nominal traction is - p cof(F) N, linear in F in the plane."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.eigenstress import Heating
from mlsanm_cli.mechanics.finite.faces import FacePoints, outline_points
from mlsanm_cli.mechanics.springs import FREE
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class Turning:
    """A rigid plate that rotates by ``rate`` (L,) per load factor: nodes with the ``rows`` (b,) of a
    displacement ``component`` x (0) or y (1) have ``arms`` (b, 2) from its centre."""

    rate: FloatArray
    component: int
    rows: IntArray
    arms: FloatArray

    def moved(self, cos: float, sin: float) -> FloatArray:
        """Displacements (b,) of points whose arms are multiplied by a rotation matrix of entries cos and
        sin."""
        x, y = self.arms.T
        return np.asarray(cos * x - sin * y if self.component == 0 else sin * x + cos * y)


@dataclass(frozen=True)
class Loads:
    """All loads on a body, with ``count`` load factors (L).

    ``sources`` (r, L) are right-hand sides of the nodes' rows: displacements, tractions, minus forces per
    volume. ``tractions[surface]`` (g, 2, L) are dead ones at the FINE points of a surface, ``force`` (n, 2,
    L) is per volume, linear between nodes unless its force and moment on the undeformed pieces are ``known``
    (3k, L); ``pressing[surface]`` are follower pressures at its nodes (b, L) and its FINE points (g, L),
    ``turning`` plates with finite rotation, ``warming`` temperature changes."""

    count: int
    sources: FloatArray
    tractions: Mapping[str, FloatArray] = field(default_factory=dict)
    force: FloatArray | None = None
    pressing: Mapping[str, tuple[FloatArray, FloatArray]] = field(default_factory=dict)
    known: FloatArray | None = None
    warming: Sequence[Heating] = ()
    turning: Sequence[Turning] = ()


@dataclass(frozen=True)
class Applied:
    """Loads at the quadrature points of a ``body``'s pieces: ``dead`` (2, q, L) forces, follower ``pressure``
    (q, L); at its nodes ``pressed`` (r, L) for every traction row, 0 for others. Soft springs have the
    stiffness ``pulling`` (2, q)."""

    points: FacePoints
    dead: FloatArray
    pressure: FloatArray
    pressed: FloatArray
    pulling: FloatArray

    @classmethod
    def on(cls, body: ElasticBody, loads: Loads) -> Applied:
        """Locate the points and evaluate the loads there."""
        surfaces = dict.fromkeys([*loads.tractions, *loads.pressing, *body.soft_springs])
        kept = {name: [not one for one in body.restrained.get(name, FREE)] for name in surfaces}
        points = outline_points(body, kept, FINE)
        dead = np.zeros((2, points.count, loads.count))
        pressure = np.zeros((points.count, loads.count))
        pressed = np.zeros((body.rows, loads.count))
        pulling = np.zeros((2, points.count))
        for name, here in points.along.items():
            length = Halves.of(body.model.cloud.surfaces[name], FINE).length
            if name in body.soft_springs:
                pulling[:, here] = np.outer(body.soft_springs[name], length)
            if name in loads.tractions:
                dead[:, here] += length[:, None] * loads.tractions[name].transpose(1, 0, 2)
        dead *= points.kept.T[:, :, None]
        for name, (nodal, between) in loads.pressing.items():
            pressure[points.along[name]] += between
            for component in (0, 1):
                if not body.held.get(name, FREE)[component]:
                    pressed[body.condition_rows(name, component)] += nodal
        pulling *= points.kept.T
        return cls(points, dead, pressure, pressed, pulling)

    @property
    def follows(self) -> bool:
        """Whether there are follower loads."""
        return bool(self.pressure.any() or self.pressed.any())


def cofactor_normal(gradient: FloatArray, normal: FloatArray) -> FloatArray:
    """cof(F) N (2, n) from the components 11, 12, 21, 22 of F (4, n) and N (n, 2); linear in F."""
    xx, xy, yx, yy = gradient
    return np.stack([yy * normal[:, 0] - yx * normal[:, 1], -xy * normal[:, 0] + xx * normal[:, 1]])
