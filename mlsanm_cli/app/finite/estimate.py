"""Estimated errors at finite strain: of the energy by residuals; of displacements, pressures and forces by
fits of the next degree."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mlsanm_cli.app.finite.accuracy import Missing, near_pressed
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.finite.estimate import energy, missing_work, unaccounted
from mlsanm_cli.solve.state import State


def energy_errors(scene: FiniteScene, state: State) -> tuple[dict[str, FloatArray], float]:
    """Contributions (n,) of the nodes to the estimated error of the energy, by body, and the energy."""
    acting, parts = scene.acting(state.driven, state.side_traction), scene.parts(state.displacement)
    near = near_pressed(scene.bodies, scene.contacts.sides, state.side_traction)
    nodal, total = {}, 0.0
    for name, body in scene.bodies.items():
        nodal[name] = unaccounted(body, parts[name], acting[name])
        total += energy(body, parts[name], acting[name])
        nodal[name][near[name]] = 0.0
    return nodal, total


def missing_works(scene: FiniteScene, before: State, now: State) -> dict[str, float]:
    """Internal less external work from one state to another, by body. By the principle of virtual work the
    two are equal for every stress in equilibrium, whether or not it derives from a strain. Bodies without
    supports are rotated back first: rigid motions do no work."""
    found, then, at = {}, scene.parts(before.displacement), scene.parts(now.displacement)
    factors = [scene.acting(one.driven, one.side_traction) for one in (before, now)]
    both = np.abs(before.side_traction) + np.abs(now.side_traction)
    near = near_pressed(scene.bodies, scene.contacts.sides, both)
    for name, body in scene.bodies.items():
        nodes, elastic = body.elastic.model.cloud.points, body.elastic
        turn = 0.0
        if not any(map(any, elastic.held.values())) and len(elastic.held_nodes) == body.pins:
            turn = body.turn(at[name]) - body.turn(then[name])
        cos, sin = np.cos(turn), np.sin(turn)
        ahead = np.array([[cos, sin], [-sin, cos]])
        first, last = nodes + then[name].reshape(-1, 2), nodes + at[name].reshape(-1, 2)
        ways = ((last @ ahead.T - first).ravel(), (last - first @ ahead).ravel())
        found[name] = 0.5 * sum(
            missing_work(body, one[name], acting[name], way, near[name])
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
