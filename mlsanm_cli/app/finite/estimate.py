"""Estimated errors at finite strain: of the energy by residuals; of displacements, pressures and forces by
fits of the next degree."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.app.finite.accuracy import Missing
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.mechanics.finite.estimate import energy, missing_work, unaccounted
from mlsanm_cli.solve.state import State

PRESSED_DISTANCE = 1.5
"""Distance in spacings from pressed nodes within which the estimate is not evaluated: the near field of
pressures is known in closed form, independent of the cloud."""
RECOMMENDED_REFINEMENT = 8.0
"""Factor by which the message of a large estimate proposes to refine."""


@dataclass(frozen=True)
class EnergyError:
    """Contributions (n,) of the nodes to the error, by body, and the ``energy`` of all bodies."""

    nodal: dict[str, FloatArray]
    energy: float

    @classmethod
    def of(cls, scene: FiniteScene, state: State) -> EnergyError:
        """Estimate of a state."""
        acting, parts = scene.acting(state.driven, state.side_traction), scene.parts(state.displacement)
        pressed = {name: [np.zeros(0, dtype=np.int64)] for name in scene.bodies}
        for side, here in scene.contacts.sides:
            pressed[side.body].append(side.nodes[state.side_traction[here].reshape(-1, 2).any(axis=1)])
        found, total = {}, 0.0
        for name, body in scene.bodies.items():
            found[name] = unaccounted(body, parts[name], acting[name])
            total += energy(body, parts[name], acting[name])
            cloud, nodes = body.elastic.model.cloud, np.concatenate(pressed[name])
            if len(nodes):
                away = nearest(cKDTree(cloud.points[nodes]), cloud.points)[0]
                found[name][away <= PRESSED_DISTANCE * cloud.spacing] = 0.0
        return cls(found, total)

    @property
    def total(self) -> float:
        """Estimated error."""
        return sum(float(one.sum()) for one in self.nodal.values())

    def message(self, scene: FiniteScene, estimate: float, kept: float) -> tuple[str, str]:
        """Message and hint for a relative ``estimate``, with the place of its largest contribution, or that
        most of it is due to residuals ``kept`` by equations."""
        message = f"estimated error of the energy: {100.0 * estimate:.2g} % (forces may be as far off), "
        if kept > 0.5 * estimate:
            message += f"{100.0 * kept:.2g} % of it due to residuals that renewed equations keep next to "
            return f"{message}crushed corners", "make the loads smaller, or round these corners"
        name = max(self.nodal, key=lambda one: float(self.nodal[one].max()))
        cloud, node = scene.bodies[name].elastic.model.cloud, int(np.argmax(self.nodal[name]))
        x, y = np.round(cloud.points[node] / scene.size, 9) * scene.size + 0.0
        return (
            f"{message}most of it at ({x:.6g}, {y:.6g}) of body {name}",
            f"refine there and at similar places, with slow growth, as in [[body.refine]] at = "
            f"[{x:.6g}, {y:.6g}], spacing = {cloud.spacing[node] / RECOMMENDED_REFINEMENT:.2g}, radius = 0, "
            f"growth = 0.1",
        )


def missing_works(scene: FiniteScene, before: State, now: State) -> dict[str, float]:
    """Internal less external work from one state to another, by body. By the principle of virtual work the
    two are equal for every stress in equilibrium, whether or not it derives from a strain. Bodies without
    supports are rotated back first: rigid motions do no work."""
    found, then, at = {}, scene.parts(before.displacement), scene.parts(now.displacement)
    factors = [scene.acting(one.driven, one.side_traction) for one in (before, now)]
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


def missing_figures(scene: FiniteScene, state: State, missing: Missing) -> dict[str, Any]:
    """Estimated errors of a state for summary.json by what its fits are ``missing``: of all displacements
    (root mean square), and by contact of the pressures (L2 norm) and of the force over the largest one."""
    size = float(np.linalg.norm(state.displacement))
    found: dict[str, Any] = {
        "displacement": float(np.linalg.norm(missing.displacement)) / size if size else None
    }
    if not scene.in_increments:
        return found
    pressure, force = {}, {}
    for contact, here, there in scene.contacts.each:
        weight = contact.slave.weight
        tractions = (
            one[there].reshape(-1, 2)[: len(weight)] for one in (state.side_traction, missing.traction)
        )
        if state.pressure[here].any():
            part = weight @ missing.pressure[here] ** 2 / (weight @ state.pressure[here] ** 2)
            pressure[contact.name] = float(np.sqrt(part))
            force[contact.name] = [float(np.hypot(*(weight @ one))) for one in tractions]
    largest = max((whole for whole, _ in force.values()), default=0.0)
    return found | {
        "pressure": pressure,
        "contacts": {name: change / largest for name, (_, change) in force.items() if largest},
    }


def energy_estimate(tally: Mapping[str, Any]) -> float:
    """Largest estimated error of the energy over the largest energy on the path."""
    return float(tally["unaccounted"] / tally["energy"]) if tally["energy"] else 0.0


def work_error(tally: Mapping[str, Any]) -> float:
    """Internal less external work of the bodies over the largest energy."""
    works = tally["missing"].values()
    return sum(map(abs, works)) / (0.5 * tally["energy"]) if tally["energy"] else 0.0
