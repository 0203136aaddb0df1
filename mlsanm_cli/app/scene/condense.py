"""The condensed problem of a scene at small strain, and forces that pull bodies away from their contacts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.scene.assemble import NOTHING, SceneModel, assemble_bodies, prepare
from mlsanm_cli.app.scene.loads import amounts_of
from mlsanm_cli.app.scene.materials import flow_laws
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import AnyLoad, Case, Displacement, Platen
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.laws.contact_state import ContactState, EndlessError, UnbalancedError
from mlsanm_cli.contact.response.coercivity import check_coercivity, contact_coercivity
from mlsanm_cli.contact.response.condensation import condense
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.solve.condensed_scene import CondensedScene, stage_factors
from mlsanm_cli.solve.contact_grids import find_grids
from mlsanm_cli.solve.contact_states import contact_states, reach_error

REACH_GROWTH = 1.5
MAX_ENLARGEMENTS = 6


def condense_scene(
    case: Case, prepared: SceneModel, context: RunContext, before: Scene | None = None
) -> CondensedScene:
    """Assembles the systems of the bodies, condenses, and determines the reach of every contact. Bodies with
    the same model as in the scene ``before`` keep their systems."""
    try:
        return _condensed_scene(case, prepared, context, before)
    except UnbalancedError as error:
        forces = [(load, force) for load in case.load if (force := _force(load)) is not None]
        found = [
            f"load {load.name} pulls {load.owner} away from contact {pairing.name}"
            for load, force in forces
            for pairing in prepared.pairings
            if load.owner in pairing.bodies and (_normals(pairing, load.owner) @ force > 0.0).all()
        ]
        if not found:
            raise
        raise NumericalError(error.message, f"{'; '.join(found)}: change its sign") from error


def _condensed_scene(
    case: Case, prepared: SceneModel, context: RunContext, before: Scene | None
) -> CondensedScene:
    factorising = partial(context.phase, "factorization", "factorising")
    with context.phase("operators"):
        bodies = before.bodies if before is not None else NOTHING
        scene = assemble_bodies(case, prepared, case.solver.linear, factorising, context.memo, bodies)
    stages, laws = stage_factors(case), flow_laws(case)
    if prepared.ranges:
        with context.phase("condensation", "refining contact grids"):
            found = find_grids(case, scene, prepared.pairings, prepared.ranges, stages, context.memo, laws)
        if found is None:
            # Contact grids that do not converge are replaced by nodal pressures.
            placed = prepared.clouds
            with context.phase("operators"):
                nodal = prepare(prepared.boundaries, placed, context.memo, prepared.models, grids=False)
            return _condensed_scene(case, nodal, context, None)
        condensed, ends = found
    else:
        condensed, ends = _condense(case, scene, prepared.pairings, stages, context)
    with context.phase("condensation"):
        closed = np.any([state.closed for state in ends], axis=0) if ends else np.zeros(0, dtype=bool)
        stability = check_coercivity(scene, condensed, closed, context.memo)
    return CondensedScene(case, scene, condensed, stages, ends, stability, laws)


def _condense(
    case: Case, scene: Scene, pairings: tuple[Pairing, ...], stages: FloatArray, context: RunContext
) -> tuple[Condensed, tuple[ContactState, ...]]:
    """Condenses; an automatic reach of a contact is enlarged until no excluded node touches."""
    fixed = {contact.name: contact.reach for contact in case.contact}
    for _ in range(MAX_ENLARGEMENTS):
        with context.phase(
            "condensation", f"condensing on {sum(int(p.candidate.sum()) for p in pairings)} contact nodes"
        ):
            condensed = condense(scene, pairings, context.memo)
            if not condensed.pairings:
                return condensed, ()
            try:
                ends = contact_states(scene, condensed, stages, stages[1:])
            except EndlessError:
                contact_coercivity(scene, condensed, np.ones(len(condensed.weight), dtype=bool), context.memo)
                raise
            masks = [condensed.touched(*state.unknowns) for state in ends]
            touched = {
                one.name: np.any([each[one.name] for each in masks], axis=0) for one in condensed.pairings
            }
        if not any(mask.any() for mask in touched.values()):
            return condensed, ends
        for pairing in condensed.pairings:
            if touched[pairing.name].any() and fixed[pairing.name] != "auto":
                raise reach_error(pairing.name, float(pairing.gap[touched[pairing.name]].max()))
        reach = {
            one.name: REACH_GROWTH * one.gap[touched[one.name] | one.candidate].max()
            for one in condensed.pairings
        }
        pairings = tuple(
            one if one.bonded else replace(one, candidate=one.gap <= reach[one.name]) for one in pairings
        )
    hint = "refine the surfaces over the whole contact zone, or set contact.NAME.reach"
    raise NumericalError(f"the contact zone was still growing after {MAX_ENLARGEMENTS} enlargements", hint)


def pulling_loads(case: Case, pairings: Sequence[Pairing]) -> Iterator[tuple[str, str, str]]:
    """Load, body and contact wherever nothing but one contact holds a body along the axis closest to its
    mean normal, from one side, and no force pushes, but one pulls along this axis at the end of a stage."""
    stages = [dict(zip(case.moved, values, strict=True)) for values in stage_factors(case)[1:].tolist()]
    for body in case.body:
        touching = [pairing for pairing in pairings if body.name in pairing.bodies]
        loads = [load for load in case.load if body.name in load.owners]
        forces = [(load.name, _force(load)) for load in loads]
        if len(touching) != 1 or touching[0].bonded:
            continue
        normals = _normals(touching[0], body.name)
        away = normals.mean(axis=0)
        axis = int(np.argmax(np.abs(away)))
        encloses = (normals[:, axis] * away[axis] <= 0.0).any()
        held = encloses or any(
            support.holds[axis] and body.name in (support.body, support.place and support.place.body)
            for support in case.support
        )
        controls = [load.control for load in loads if isinstance(load, Platen)]
        held |= any(control.get("xy"[axis], ("",))[0] == "displacement" for control in controls)
        known = [(name, away[axis] * force[axis]) for name, force in forces if force is not None]
        if held or len(known) < len(forces):
            continue
        for factors in stages:
            pulls = {name: factors.get(name, 0.0) * pull for name, pull in known}
            strongest = max(pulls, key=lambda name: pulls[name], default="")
            if strongest and pulls[strongest] > 0.0 <= min(pulls.values()):
                yield strongest, body.name, touching[0].name
                break


def _normals(pairing: Pairing, body: str) -> FloatArray:
    """The directions (m, 2) away from the paired nodes of a contact, of one of its bodies."""
    # The normal of a pairing, the master's outward one, points to the slave.
    return np.asarray(pairing.normal * (1.0 if body == pairing.slave_body else -1.0))


def _force(load: AnyLoad) -> FloatArray | None:
    """The direction of the force of a load, None if it is not given by numbers."""
    match load:
        case Displacement():
            return None
        case Platen():
            held = [load.control.get(axis, ("force", 0.0)) for axis in "xy"]
            return np.array([value if how == "force" else 0.0 for how, value in held])
    numbers = [part for part in amounts_of(load) if isinstance(part, int | float)]
    return np.array(numbers) if len(numbers) == 2 else None
