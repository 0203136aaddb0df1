"""The estimated error of the energy of a scene at finite strain, node by node."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mlsanm_cli.app.assessment.energy import thin_part
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.app.finite.states import FiniteState
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.mechanics.finite.estimate import energy, missing_work, unaccounted
from mlsanm_cli.startup import cKDTree

ESTIMATE_WARNING = 0.015
"""Estimated errors of the energy above this are warned of. Sound scenes have 0.0001 to 0.01; blocks between
bonded plates, 30 % down with nu = 0.44, have 0.06 to 0.13 with even spacings and are 3 to 12 % too stiff,
with automatic ones 0.017, and the one 2 x 1 is 2.8 % too stiff."""
WORK_WARNING = 0.03
"""Work that is missing by more than this part of the energy is warned of. Sound scenes have up to 0.02, with
few nodes in a contact up to 0.04; a ring with two spacings across, 9 % too stiff, has 0.04."""
SERIES_WARNING = 0.01
"""The same where the way is known as power series: sound scenes have up to 0.004, a column with two spacings
across, 9 % too stiff, 0.02, blocks with even nodes at crushed corners 0.02, too."""
BESIDE = 1.5
"""Nodes up to so many spacings from those that are pressed do not count: what pressures do there is known in
closed form, and no matter of the cloud. A pad with chamfers that slides had an estimate of 0.10, most of it
where its pressure ends at a corner, and forces right to 0.006."""
FINER = 8.0
"""So many times finer nodes are recommended: a block 2 x 1 between bonded plates, 12 % too stiff, is then
within 3 %, and its estimate 0.03 instead of 0.13."""


@dataclass(frozen=True)
class EnergyError:
    """What every body's nodes (n,) add to the error, by name, and the ``energy`` of all bodies together."""

    nodal: dict[str, FloatArray]
    energy: float

    @classmethod
    def of(cls, scene: FiniteScene, state: FiniteState) -> EnergyError:
        """In a state."""
        acting, parts = scene.acting(state.whole, state.traction), scene.parts(state.displacement)
        pressed, first = {name: [np.zeros(0, dtype=np.int64)] for name in scene.bodies}, 0
        for side in (one for contact in scene.contacts for one in contact.sides):
            own = state.traction[first : first + 2 * side.count].reshape(-1, 2)
            first += 2 * side.count
            pressed[side.body].append(side.nodes[: len(own)][own.any(axis=1)])
        found, total = {}, 0.0
        for name, body in scene.bodies.items():
            found[name] = unaccounted(body, parts[name], acting[name])
            total += energy(body, parts[name], acting[name])
            cloud, nodes = body.elastic.model.cloud, np.concatenate(pressed[name])
            if len(nodes):
                away = nearest(cKDTree(cloud.points[nodes]), cloud.points)[0]
                found[name][away <= BESIDE * cloud.spacing] = 0.0
        return cls(found, total)

    @property
    def total(self) -> float:
        """The error."""
        return sum(float(one.sum()) for one in self.nodal.values())

    def warning(self, scene: FiniteScene, estimate: float) -> str:
        """What a run says of an ``estimate``, with the place that most of it comes from."""
        name = max(self.nodal, key=lambda one: float(self.nodal[one].max()))
        cloud, node = scene.bodies[name].elastic.model.cloud, int(np.argmax(self.nodal[name]))
        x, y = np.round(cloud.points[node] / scene.size, 9) * scene.size + 0.0
        return (
            f"estimated error of the energy: {100.0 * estimate:.2g} % (forces may be as far off), most of it "
            f"at ({x:.6g}, {y:.6g}) of body {name}: refine there and at similar places, with slow "
            f"growth, as in [[body.refine]] at = [{x:.6g}, {y:.6g}], "
            f"spacing = {cloud.spacing[node] / FINER:.2g}, radius = 0, growth = 0.1"
        )


def missing_works(scene: FiniteScene, before: FiniteState, now: FiniteState) -> dict[str, float]:
    """By body, the work of its stress from one state to another less that of all forces on it.

    Every stress in balance does on any small way what the forces do, and on a long one, too; that the stress
    is that of a strain does not matter. Bodies that nothing holds are turned back first, as they turn on the
    whole: rigid motions do nothing.
    """
    found, then, at = {}, scene.parts(before.displacement), scene.parts(now.displacement)
    factors = [scene.acting(one.whole, one.traction) for one in (before, now)]
    for name, body in scene.bodies.items():
        nodes, elastic = body.elastic.model.nodes, body.elastic
        turn = 0.0
        if not any(map(any, elastic.held.values())) and len(elastic.held_nodes) == body.pins:
            turn = body.turn(at[name]) - body.turn(then[name])
        cos, sin = np.cos(turn), np.sin(turn)
        ahead = np.array([[cos, sin], [-sin, cos]])
        first, last = nodes + then[name].reshape(-1, 2), nodes + at[name].reshape(-1, 2)
        ways = ((last @ ahead.T - first).ravel(), (last - first @ ahead).ravel())
        found[name] = 0.5 * sum(
            missing_work(body, one[name], acting[name], way)
            for one, acting, way in zip((then, at), factors, ways, strict=True)
        )
    return found


def check_work(scene: FiniteScene, missing: Mapping[str, float], error: float) -> str:
    """A warning where the work of the stresses differs from that of the forces by a part ``error`` of all
    energy, most of it ``missing`` on one body, "" where it does not."""
    if not error > (SERIES_WARNING if scene.by_series else WORK_WARNING):
        return ""
    worst = max(missing, key=lambda name: abs(missing[name]))
    thin = thin_part(scene.bodies[worst].elastic.model.cloud)
    message = f"the work of stresses in body {worst} differs from that of its forces by {100.0 * error:.2g} %"
    hint = f"make body.{worst}.spacing smaller, above all {thin or 'where it is held and where it touches'}"
    return f"{message}: forces may be as far off; {hint}"
