"""Path of scenes with bodies that flow, in increments chosen by their error.

Every increment is computed at once and in two halves, which are kept. The difference of the strains is
the error of the halves, as the return map is of first order; its norm is at most ``solver.increment_error``
of the largest one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, finer_nodes
from mlsanm_cli.contact.laws.contact_state import ContactState
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.laws.von_mises import VonMises, plastic_stress
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.roundoff import FINE_ROUND_OFF
from mlsanm_cli.solve.condensed_scene import CondensedScene, factors_at
from mlsanm_cli.solve.plastic_flow import Flow, FlowError, PlasticScene
from mlsanm_cli.solve.state import Checkpoint, PathStep, State

GROWTH = 2.0
"""Largest growth of increments."""
LEAST_INCREMENT = 2.0**-10
"""Part of a stage within which a limit load is enclosed."""
COLLAPSE = 10.0
"""Growth of strains over that of elastic bodies at the end of a path that counts as collapse."""
KEPT = ("stress", "history", "work")
"""Quantities of nodes that continue a path, by body."""


def plastic_path(built: CondensedScene, start: Checkpoint | None = None) -> Iterator[PathStep]:
    """The path, or its part after a checkpoint. Raises NumericalError at a limit load."""
    scene = PlasticScene(built)
    if start is None:
        now, position, length, errors = scene.unloaded(), 0.0, 1.0, np.zeros(2)
        yield _step(scene, now, position, 0.0, length, errors)
    else:
        now, position, length = _restored(built, start), start.position, start.pace
        errors, half = start.state.solver["errors"], float(start.history["half"][0])
        if half:
            # The second half of an increment.
            position = _rounded(built, position + half)
            now = scene.advanced(now, factors_at(built.stages, position))
            yield _step(scene, now, position, half, length, errors)
    largest = scene.size(now.strain)
    for halt in built.stops:
        while halt - position > FINE_ROUND_OFF:
            wanted = min(length, halt - position, built.case.solver.largest_increment)
            done, middle, end, error = _increment(scene, now, position, wanted, largest)
            largest = max(largest, scene.size(middle.strain), scene.size(end.strain))
            allowed = built.case.solver.increment_error * largest
            # Errors of increments grow with the square of the length.
            most = min(GROWTH, float(np.sqrt(allowed / error))) if error else GROWTH
            length = max(most * done, length if done == wanted else 0.0)
            half, now = 0.5 * done, end
            added, spatial = error / (largest or 1.0), scene.spatial_error(now)
            errors = np.array([errors[0] + added, max(errors[1], spatial)])
            yield _step(scene, middle, position + half, half, length, errors, half)
            position = _rounded(built, position + done)
            yield _step(scene, now, position, half, length, errors)


def touching_states(
    case: Case, scene: Scene, stages: FloatArray, laws: Mapping[str, VonMises], condensed: Condensed
) -> tuple[ContactState, ...]:
    """The states of the path of a scene, as far as there are any, or up to one whose contacts reach an end of
    a grid that is no end of a surface."""
    built, found = CondensedScene(case, scene, condensed, stages, (), np.nan, laws), list[ContactState]()
    try:
        for step in plastic_path(built):
            state = step.state
            shift = built.at(state).condensed.watched.constant - condensed.watched.constant
            found.append(replace(state.contacts(condensed.friction_nodes), shift=shift))
            if condensed.cut(state.pressure):
                break
    except NumericalError:
        pass
    return tuple(found)


def _rounded(built: CondensedScene, position: float) -> float:
    """A position, or the requested one that it is up to round-off."""
    return next((halt for halt in built.stops if abs(halt - position) <= FINE_ROUND_OFF), position)


def _increment(
    scene: PlasticScene, now: Flow, position: float, length: float, largest: float
) -> tuple[float, Flow, Flow, float]:
    """The longest increment, of at most ``length``, whose error is allowed: its length, the states in its
    middle and at its end, and the error of the strains. Raises NumericalError."""
    built, whole = scene.built, None
    while True:
        try:
            if whole is None:
                whole = scene.advanced(now, factors_at(built.stages, position + length))
            middle = scene.advanced(now, factors_at(built.stages, position + 0.5 * length))
            end = scene.advanced(middle, whole.factors, whole.unknowns)
        except FlowError as failure:
            whole, length = None, 0.5 * length
            if length < LEAST_INCREMENT:
                raise _beyond(built, scene, now, position, failure) from failure
            continue
        apart = {name: whole.strain[name] - end.strain[name] for name in built.laws}
        size, error = max(largest, scene.size(end.strain)), scene.size(apart)
        if error <= built.case.solver.increment_error * size:
            return length, middle, end, error
        whole, length = middle, 0.5 * length


def _beyond(
    built: CondensedScene, scene: PlasticScene, now: Flow, position: float, failure: FlowError
) -> NumericalError:
    """The error of a path that ends at a ``position``: a limit load if strains grow fast, compared with those
    of elastic bodies, and some body does not harden."""
    stage = min(int(position), len(built.stages) - 2)
    change = built.stages[stage + 1] - built.stages[stage]
    loads = ", ".join(
        f"{name} = {factor:.6g}"
        for name, moved, factor in zip(built.scene.loads, change, now.factors, strict=True)
        if moved
    )
    growth = scene.growth(now, change)
    perfect = [f"body {name}" for name, law in built.laws.items() if not law.hardens(now.history[name])]
    if growth < COLLAPSE or not perfect:
        hint = [finer_nodes(built.case, list(built.laws))]
        hint += [f"give {' and '.join(perfect)} some hardening, 1 % of E"] if perfect else []
        return FlowError(
            f"no equilibrium is found beyond position {position:.6g}, {loads}: {failure.message}",
            ", or ".join(hint),
        )
    return NumericalError(
        f"collapse: {' and '.join(perfect)} reached the limit load at position {position:.6g}, {loads}: "
        f"strains grow {growth:.3g} times as fast as elastic ones",
        "prescribe displacements instead of forces to go on, or give the material hardening",
    )


def _step(
    scene: PlasticScene,
    flow: Flow,
    position: float,
    length: float,
    pace: float,
    errors: FloatArray,
    half: float = 0.0,
) -> PathStep:
    """A step that ends at a state, of which another ``half`` follows at once, with ``errors`` (2,) so far:
    the sum of those of the increments, relative, and the largest of displacements by spacings."""
    built, solver = scene.built, {"errors": errors}
    for name in built.laws:
        solver |= {f"{key}.{name}": getattr(flow, key)[name] for key in KEPT}
    nodes = built.condensed.friction_nodes
    state = State.of(flow.contact, nodes, position, scene.residual(flow), solver)
    history = {"half": np.array([half])}
    return PathStep(
        state,
        (state,) if position in built.outputs else (),
        length,
        iterations=flow.updates,
        solves=flow.products,
        checkpoint=Checkpoint(state, history, pace=pace),
    )


def _restored(built: CondensedScene, start: Checkpoint) -> Flow:
    """The state of a checkpoint."""
    state, laws = start.state, built.laws
    contact = state.contacts(built.condensed.friction_nodes)
    stress, history, work = ({name: state.solver[f"{key}.{name}"] for name in laws} for key in KEPT)
    unknowns = [plastic_stress(law.linear, history[name]).T.ravel() for name, law in laws.items()]
    strain = {n: law.elastic_strain(stress[n]) + history[n][:, :4] for n, law in laws.items()}
    first, none = np.concatenate(unknowns), np.zeros(0)
    return Flow(state.factors, first, contact, strain, stress, {}, history, work, none, 0.0)
