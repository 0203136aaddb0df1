"""A-posteriori error estimates of displacements and pressures: the root of the sum of squares of the
differences between the exact state at the end of the path and those with bodies corrected by their defect of
the next degree, without smoothing along contacts, with every second contact node, and of a regularised law.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from functools import partial
from typing import Any

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import finer_nodes
from mlsanm_cli.contact.geometry.grid import l2
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.laws.accuracy import Changes, changes_of, frozen_change, halved_state, roughness_of
from mlsanm_cli.contact.laws.contact_state import ContactState
from mlsanm_cli.contact.laws.frictionless import solve_exact
from mlsanm_cli.contact.response.bonds import Bonds
from mlsanm_cli.contact.response.compressed import LinearMap
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.defect import Corrected, correct
from mlsanm_cli.memo import NO_CACHE, Memo
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, ROUND_OFF
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.grid_fitting import grid_errors
from mlsanm_cli.solve.state import State

ROUGH_SHARE = 0.5
"""Error of pressures due to waves that smoothing keeps, over the change without smoothing."""
LEAST_MOVED = 0.05
"""Probes that move by less than this part of the largest displacement are compared with it."""

Moved = tuple[FloatArray, FloatArray, FloatArray]
"""Changes of motions (k,), pressures (m,) and tractions (n,)."""


@dataclass(frozen=True)
class Accuracy:
    """Estimated errors of ``state``, the exact one at the end of the path; nan, None or empty if not known.
    ``displacement`` is the relative root mean square error over all nodes, of which ``deflection`` is known
    from energies; ``pressures`` are relative L2 errors by contact, due to the bodies and to the contact's own
    spacing; ``largest`` is the largest displacement, ``bodies`` are the corrected ones; ``missing`` says why
    there are no estimates."""

    displacement: float | None
    pressures: Mapping[str, tuple[float, float]]
    state: ContactState
    largest: float | None = None
    bodies: Mapping[str, Corrected] = field(default_factory=dict)
    deflection: float = 0.0
    probes: Mapping[str, float] = field(default_factory=dict)
    forces: Mapping[str, float] = field(default_factory=dict)
    missing: str = ""

    def figures(self, built: CondensedScene, state: State | None = None) -> dict[str, Any]:
        """Estimates for summary.json; with a ``state``, pressures also count their distance from its own."""
        # Tractions of bonds have no estimate.
        condensed, exact = built.condensed, self.state
        pressure: dict[str, float | None] = {one.name: None for one in condensed.bonds.pairings}
        blind = len(condensed.friction_nodes) > 0
        if state is not None and not blind and not np.array_equal(state.factors, exact.factors):
            # The path ended before the state of the other estimates.
            try:
                exact = solve_exact(condensed, state.factors)
            except NumericalError:  # the exact laws have no solution at the end of the path
                unknown = pressure | dict.fromkeys(self.pressures)
                return {"displacement": self.displacement, "pressure": unknown}
        for one in condensed.pairings:
            away = distance(built, one, exact, state.pressure) if state is not None else 0.0
            error = float(np.linalg.norm((*self.pressures[one.name], away)))
            pressure[one.name] = None if np.isnan(error) else error
        found: dict[str, Any] = {"displacement": self.displacement, "pressure": pressure}
        found |= {"force": dict(self.forces)} if self.forces else {}
        for name, error in self.probes.items():
            moved = float(np.hypot(*condensed.quantities["probe"][name](*self.state.unknowns)[:2]))
            size = max(moved, LEAST_MOVED * (self.largest or 0.0))
            relative = float(np.hypot(error / size, self.deflection)) if size > 0.0 else 0.0
            found.setdefault("probes", {})[name] = relative
        return found

    @property
    def bulk_leads(self) -> bool:
        """Whether the errors of the bodies limit the accuracy, if there are contacts in one of them."""
        if self.displacement is None or self.displacement <= ROUND_OFF:
            return False
        return not self.pressures or any(bulk > own for bulk, own in self.pressures.values())


def assess_accuracy(built: CondensedScene) -> Accuracy:
    """Estimate the errors of a solved scene in its last exact state."""
    condensed, scene = built.condensed, built.scene
    state = built.ends[-1] if built.ends else solve_exact(condensed, built.stages[-1])
    without = partial(Accuracy, None, {one.name: (np.nan, np.nan) for one in condensed.pairings}, state)
    blind = len(condensed.friction_nodes) > 0  # friction depends on the path
    if blind and not built.case.adapt.passes:
        return without()
    bodies, missing = dict[str, Corrected](), ""
    try:
        bodies = bodies if blind else _corrected(built, state.unknowns)
    except NumericalError as error:  # the clouds are too small for the next degree
        missing = error.advice
    if not bodies:
        whole = [condensed.displacement(scene, name, state.unknowns) for name in scene.bodies]
        return without(_largest_of(whole), missing=missing)

    def moved(by: Changes) -> Moved:
        after = by.state(condensed, state)
        return after.motion - state.motion, after.pressure - state.pressure, np.zeros_like(state.traction)

    try:
        halved = halved_state(condensed, state) if condensed.nodal else None
        return _estimated(built, state, bodies, moved, halved)
    except NumericalError as error:  # the corrected scene has no contact state
        hint = finer_nodes(built.case, scene.bodies)
        missing = f"with bodies corrected for their errors, {error.message}; {hint}"
        return without(_largest_of([one.displacement for one in bodies.values()]), bodies, missing=missing)


def with_friction(built: CondensedScene, accuracy: Accuracy, state: State, memo: Memo) -> Accuracy:
    """Estimates with friction in the last ``state``, with its stick and slip; no second path is followed."""
    condensed = built.condensed
    if not len(condensed.friction_nodes) or not state.closed.any():
        return accuracy
    last = state.contacts(condensed.friction_nodes)

    def moved(by: Changes) -> Moved:
        change = frozen_change(condensed, last, by)
        return change.motion, change.pressure, change.traction

    try:
        bodies = _corrected(built, state.unknowns, memo)
        return _estimated(built, last, bodies, moved, _halved(built, last))
    except NumericalError as error:  # a cloud too small for the next degree, or a singular contact
        return replace(accuracy, missing=error.advice)


def _halved(built: CondensedScene, state: ContactState) -> tuple[FloatArray, FloatArray] | None:
    """Motions (k,) and pressures (m,) from every second node; what friction resists stays. None without
    a solution or contacts with nodal pressures."""
    condensed = built.condensed
    if not condensed.nodal:
        return None
    maps = condensed.gap, condensed.slip
    across, along = (np.abs(linear.motion).max(axis=0, initial=0.0) for linear in maps)
    free, motion = across >= along, state.motion.copy()

    def pushed(linear: LinearMap) -> LinearMap:
        known = linear.constant + linear.traction @ state.traction + linear.motion[:, ~free] @ motion[~free]
        return replace(linear, constant=known, motion=linear.motion[:, free], traction=linear.traction[:, :0])

    frictionless = replace(
        condensed,
        friction_nodes=condensed.friction_nodes[:0],
        friction=condensed.friction[:0],
        tangential={},
        gap=pushed(condensed.gap),
        slip=pushed(condensed.slip.take(slice(0, 0))),
        balance=pushed(condensed.balance.take(free)),
    )
    try:
        motion[free], pressure = halved_state(frictionless, replace(state, motion=motion[free]))
    except NumericalError:
        return None
    return motion, pressure


def _estimated(
    built: CondensedScene,
    state: ContactState,
    bodies: Mapping[str, Corrected],
    moved: Callable[[Changes], Moved],
    halved: tuple[FloatArray, FloatArray] | None,
) -> Accuracy:
    """Estimates of a ``state`` from corrected ``bodies``, by which contacts ``moved``, and ``halved``."""
    condensed, scene, parts = built.condensed, built.scene, [bodies]
    rough = moved(roughness_of(condensed, scene, bodies))[1]
    if any(one.uncertain.any() for one in bodies.values()):
        parts.append({name: one.missed for name, one in bodies.items()})
    effects, corrected = [], []
    for part in parts:
        by = changes_of(condensed, scene, part)
        change = moved(by)
        effects.append(_effects(built, part, state, by.bonds, change))
        corrected.append(state.pressure + change[1])
    if halved is not None:
        fewer = halved[0] - state.motion, halved[1] - state.pressure, np.zeros_like(state.traction)
        nothing = {name: replace(one, change=np.zeros_like(one.change)) for name, one in bodies.items()}
        effects.append(_effects(built, nothing, state, condensed.bonds, fewer))
    pressures = {}
    for one in condensed.pairings:
        others = (*corrected, state.pressure + ROUGH_SHARE * rough)
        bulk = float(np.linalg.norm([distance(built, one, state, pressure) for pressure in others]))
        own = np.nan if halved is None or not one.nodal else distance(built, one, state, halved[1])
        if not one.nodal:
            own = float(np.linalg.norm(grid_errors(condensed, one.name, state)))
        pressures[one.name] = (bulk, own)
    away, *rest = np.linalg.norm(effects, axis=0).tolist()
    size = float(sum((one.displacement**2).sum() for one in bodies.values()))
    displacement = away / float(np.sqrt(size)) if size > 0.0 else None
    largest = _largest_of([one.displacement for one in bodies.values()])
    probes = dict(zip((one.name for one in scene.probes), rest, strict=False))
    forces = dict(zip((one.name for one in condensed.pairings), rest[len(probes) :], strict=True))
    return Accuracy(displacement, pressures, state, largest, bodies, probes=probes, forces=forces)


def _effects(
    built: CondensedScene, bodies: Mapping[str, Corrected], state: ContactState, bonds: Bonds, moved: Moved
) -> list[float]:
    """Effects of changes on displacements (L2), at probes, and on contact forces over sums of pressures."""
    condensed, scene = replace(built.condensed, bonds=bonds), built.scene
    unknowns, rests, total = (np.zeros(built.stages.shape[1]), *moved), dict[str, FloatArray](), 0.0
    for name, body in scene.bodies.items():
        followed = bodies[name].response(body, condensed.source(name, *unknowns))[:, 0]
        change = bodies[name].change + followed + scene.floating_patterns(name) @ moved[0]
        rests[name] = change.reshape(-1, 2)
        total += float(((rests[name] + condensed.contact_fields(scene, name, unknowns)[0]) ** 2).sum())
    effects = [float(np.sqrt(total))]
    for probe in scene.probes:
        near = condensed.contact_fields(scene, probe.body, unknowns, probe.point)[0]
        values = scene.bodies[probe.body].model.values(probe.point, rests[probe.body])
        effects.append(float(np.hypot(*(values + near)[0])))
    for pairing in condensed.pairings:
        force, span = condensed.quantities["contact"][pairing.name], condensed.spans[pairing.name]
        size = float(condensed.areas[span] @ state.pressure[span])
        apart = float(np.hypot(*(force(*unknowns) - force.constant)))
        effects.append(apart / size if _is_pressed(state, span) else 0.0)
    return effects


def _corrected(
    built: CondensedScene, unknowns: tuple[FloatArray, ...], memo: Memo = NO_CACHE
) -> dict[str, Corrected]:
    """Bodies in a state f, q, p, t with the corrections of their displacements. Raises NumericalError."""
    condensed, scene = built.condensed, built.scene
    plates = {side for constraint, _ in scene.unknown_motions for side in constraint.held}
    bodies = {}
    for name, body in scene.bodies.items():
        moved, source = scene.floating_patterns(name) @ unknowns[1], condensed.source(name, *unknowns)
        bodies[name] = correct(body, source, moved, [side for owner, side in plates if owner == name], memo)
    return bodies


def _largest_of(displacements: Sequence[FloatArray]) -> float:
    return max(float(np.hypot(*u.T).max()) for u in displacements)


def distance(built: CondensedScene, pairing: Pairing, state: ContactState, pressure: FloatArray) -> float:
    """Relative L2 distance of the pressures of a contact from the exact ones; nan without pressure."""
    span, arc = built.condensed.spans[pairing.name], pairing.arc[pairing.candidate]
    exact = state.pressure[span]
    size = l2(arc, exact) if _is_pressed(state, span) else 0.0
    return l2(arc, pressure[span] - exact) / size if size else np.nan


def _is_pressed(state: ContactState, span: slice) -> bool:
    """Whether the pressures of a contact are more than round-off of those of others."""
    return bool(state.pressure[span].max(initial=0.0) > COARSE_ROUND_OFF * state.pressure.max(initial=0.0))
