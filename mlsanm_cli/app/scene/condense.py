"""The condensed problem of a scene at small strain."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.scene.assemble import NOTHING, SceneModel, assemble_bodies, prepare
from mlsanm_cli.app.scene.materials import flow_laws
from mlsanm_cli.app.scene.pulls import pull_hint
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.laws.contact_state import ContactState
from mlsanm_cli.contact.laws.failures import EndlessError, NoStateError, UnbalancedError
from mlsanm_cli.contact.response.condensation import condense
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.solve.coercivity import check_candidates_coercivity, check_coercivity
from mlsanm_cli.solve.condensed_scene import CondensedScene, stage_factors
from mlsanm_cli.solve.contact_grids import find_grids
from mlsanm_cli.solve.limit_loads import beyond_limit
from mlsanm_cli.solve.plastic_path import touching_states
from mlsanm_cli.solve.stage_ends import exact_ends, reach_error, searched_ends, touched_nodes

REACH_GROWTH = 1.5
MAX_ENLARGEMENTS = 6


def condense_scene(
    case: Case, prepared: SceneModel, context: RunContext, before: Scene | None = None
) -> CondensedScene:
    """Assembles the systems of the bodies, condenses, and determines the reach of every contact. Bodies with
    the same model as in the scene ``before`` keep their systems."""
    try:
        return _condensed_scene(case, prepared, context, before)
    except (UnbalancedError, NoStateError) as error:
        hint = pull_hint(case, prepared.pairings)
        if not hint:
            raise
        raise NumericalError(error.message, hint) from error


def _condensed_scene(
    case: Case, prepared: SceneModel, context: RunContext, before: Scene | None
) -> CondensedScene:
    @contextmanager
    def factorising() -> Iterator[None]:
        with context.phase("factorization", "factorising"):
            yield

    with context.phase("operators"):
        bodies = before.bodies if before is not None else NOTHING
        scene = assemble_bodies(case, prepared, case.solver.linear, factorising, context.memo, bodies)
    stages, laws = stage_factors(case), flow_laws(case)
    if prepared.ranges:
        with context.phase("condensation", "refining contact grids"):
            search = partial(searched_ends, case, scene, stages)
            path = partial(touching_states, case, scene, stages, laws) if laws else None
            found = find_grids(case, scene, prepared.pairings, prepared.ranges, search, context.memo, path)
        if found is None:
            return _condensed_scene(case, _without_grids(prepared, context), context, None)
        condensed, ends = found
    else:
        condensed, ends = _condense(case, scene, prepared.pairings, stages, context)
    with context.phase("condensation"):
        stability = check_coercivity(case, scene, condensed, ends, context.memo)
    return CondensedScene(case, scene, condensed, stages, ends, stability, laws)


def _without_grids(prepared: SceneModel, context: RunContext) -> SceneModel:
    """A scene whose contact grids do not converge, with nodal pressures."""
    placed = {name: model.cloud for name, model in prepared.models.items()}
    with context.phase("operators"):
        return prepare(prepared.boundaries, placed, context.memo, prepared.models, grids=False)


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
                ends = exact_ends(scene, condensed, stages)
            except EndlessError:
                check_candidates_coercivity(case, scene, condensed, context.memo)
                raise
            except UnbalancedError as error:
                raise beyond_limit(scene, condensed, stages, error) from error
            touched = touched_nodes(condensed, ends)
        if not any(mask.any() for mask in touched.values()):
            return condensed, ends
        for pairing in condensed.pairings:
            if touched[pairing.name].any() and fixed[pairing.name] != "auto":
                raise reach_error(pairing.name, float(pairing.gap[touched[pairing.name]].max()))
        pairings = tuple(
            pairing
            if pairing.bonded
            else pairing.with_reach(
                REACH_GROWTH * float(pairing.gap[touched[pairing.name] | pairing.candidate].max())
            )
            for pairing in pairings
        )
    raise NumericalError(
        f"the contact zone was still growing after {MAX_ENLARGEMENTS} enlargements",
        "refine the surfaces over the whole contact zone, or set contact.NAME.reach",
    )
