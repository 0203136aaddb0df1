"""The estimated error of the energy of a scene at finite strain, node by node."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.app.finite.path import FiniteState
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.mechanics.finite.estimate import energy, unaccounted
from mlsanm_cli.startup import cKDTree

ESTIMATE_WARNING = 0.02
"""Estimated errors of the energy above this are warned of. Sound scenes have 0.0001 to 0.005; a block between
bonded plates, 30 % down with nu = 0.44, has 0.06 to 0.13 with even spacings and is 3 to 12 % too stiff."""
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
            f"at ({x:.6g}, {y:.6g}) of body {name}: give it finer nodes there, and at places alike, that "
            f"grow slowly, as with [[body.refine]] at = [{x:.6g}, {y:.6g}], "
            f"spacing = {cloud.spacing[node] / FINER:.2g}, radius = 0, growth = 0.1"
        )
