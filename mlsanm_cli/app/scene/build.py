"""From a case to the condensed problem, phase by phase."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

from mlsanm_cli.app.clock import Clock
from mlsanm_cli.app.console import Console
from mlsanm_cli.app.scene.assemble import NOTHING, SceneModel, assemble_bodies, prepare
from mlsanm_cli.app.scene.causes import pull_hint
from mlsanm_cli.app.scene.clouds import clouds
from mlsanm_cli.app.scene.contact_pairs import refuse_overlap
from mlsanm_cli.app.scene.direct_solver import direct_solver
from mlsanm_cli.app.scene.size_estimate import refuse_too_large, refuse_too_many_contacts
from mlsanm_cli.app.scene.symmetry import line_of
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, LoadedCase, resolved_mapping
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.laws.active_set import ExactState
from mlsanm_cli.contact.laws.set_search import EndlessError, NoStateError, UnbalancedError
from mlsanm_cli.contact.response.condensed import Condensed, condense
from mlsanm_cli.errors import CaseError, NumericalError
from mlsanm_cli.kernels.jit import Loaded, is_warm, load
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.memo import NO_CACHE, Memo, digest
from mlsanm_cli.solve.coercivity import check_candidates_coercivity, check_coercivity
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.contact_grids import find_grids
from mlsanm_cli.solve.limit_loads import beyond_limit
from mlsanm_cli.solve.load_factors import stage_factors
from mlsanm_cli.solve.stage_ends import _exact_ends, _searched, _touched, reach_error

MANY = 50_000
"""Scenes of more nodes are announced: they take a while, and may be a typing error."""
WIDER = 1.5
WIDENINGS = 6
_WITHOUT_SIZE = {"load", "stage", "output"}
_CONTACTS_WITHOUT_SIZE = {"friction", "regularization"}
"""What of a case and of its contacts does not change its size."""
BETWEEN = 8
"""Between the ends of a stage contacts are looked at so many times less one, whether they pass beyond the
ranges of their grids."""


def load_kernels(clock: Clock, console: Console) -> Loaded:
    """Load the compiled kernels; say so where they have to be compiled first, or cannot be kept."""
    with clock.phase("jit"):
        if not is_warm():
            console.phase("compiling kernels, once for this installation (about 15 s)")
        loaded = load()
    if loaded.note:
        console.warning(loaded.note)
    return loaded


def build_scene(loaded: LoadedCase, clock: Clock, console: Console, memo: Memo = NO_CACHE) -> SceneModel:
    """All that can show that a case cannot be run as written, on its own clouds.

    Raises CaseError for a scene that memory cannot hold, a solver that is not installed, and contacts and
    platens without sense.
    """
    load_kernels(clock, console)
    try:
        direct_solver(loaded.case)
        with clock.phase("cloud"):
            size = memo.value("size", _size_key(loaded.case), partial(refuse_too_large, loaded.case))
        if sum(size.nodes.values()) > MANY:
            nodes, memory = sum(size.nodes.values()), size.memory_mb / 1024
            console.note(f"about {nodes:.2g} nodes, which need about {memory:.2g} GB of memory")
        prepared = place(loaded.case, clock, console, memo=memo)
        refuse_too_many_contacts(loaded.case, prepared.pairings)
        refuse_overlap(prepared.pairings)
        if loaded.case.model.strain == "finite":
            from mlsanm_cli.app.scene.finite_support import refuse_unsupported

            refuse_unsupported(prepared)
    except CaseError as error:
        raise loaded.located(error) from error
    return prepared


def _size_key(case: Case) -> str:
    """Equal for cases of the same size."""
    content = {key: part for key, part in resolved_mapping(case).items() if key not in _WITHOUT_SIZE}
    contacts = [
        {key: part for key, part in contact.items() if key not in _CONTACTS_WITHOUT_SIZE}
        for contact in content.pop("contact", [])
    ]
    return digest(content, contacts)


def place(
    case: Case,
    clock: Clock,
    console: Console,
    zones: tuple[Zone, ...] = (),
    memo: Memo = NO_CACHE,
    before: SceneModel | None = None,
) -> SceneModel:
    """Clouds, stencils, pairs and conditions; ``zones`` refine every body beyond what the case says, and
    bodies that come out as ``before`` stay."""
    with clock.phase("cloud"):
        console.phase("placing nodes")
        placed = clouds(case, zones, memo, line_of(case))
    with clock.phase("operators"):
        console.phase("building operators")
        return prepare(case, placed, memo, before.models if before is not None else NOTHING)


def condense_scene(
    case: Case,
    prepared: SceneModel,
    clock: Clock,
    console: Console,
    memo: Memo = NO_CACHE,
    before: Scene | None = None,
) -> CondensedScene:
    """Set up the bodies' systems, condense, and find the reach of every contact.

    Bodies whose models are those of the scene ``before`` keep their systems.
    """
    try:
        return _completed(case, prepared, clock, console, memo, before)
    except (UnbalancedError, NoStateError) as error:
        hint = pull_hint(case, prepared.pairings)
        if not hint:
            raise
        raise NumericalError(error.message, hint) from error


def _completed(
    case: Case, prepared: SceneModel, clock: Clock, console: Console, memo: Memo, before: Scene | None
) -> CondensedScene:
    @contextmanager
    def factorising() -> Iterator[None]:
        with clock.phase("factorization"):
            console.phase("factorising")
            yield

    with clock.phase("operators"):
        bodies = before.bodies if before is not None else NOTHING
        scene = assemble_bodies(case, prepared, direct_solver(case), factorising, memo, bodies)
    stages = stage_factors(case)
    found = None
    if prepared.clear:
        with clock.phase("condensation"):
            console.phase("finding the contacts' grids")
            search = partial(_searched, case, scene, stages)
            found = find_grids(case, scene, prepared.pairings, prepared.clear, search, memo)
    if found is None:
        if prepared.clear:
            with clock.phase("operators"):
                placed = {name: model.cloud for name, model in prepared.models.items()}
                prepared = prepare(case, placed, memo, prepared.models, grids=False)
                scene = assemble_bodies(case, prepared, direct_solver(case), factorising, memo)
        condensed, ends = _condense(case, scene, prepared.pairings, stages, clock, console, memo)
    else:
        condensed, ends = found
    with clock.phase("condensation"):
        stability = check_coercivity(case, scene, condensed, ends, memo)
    return CondensedScene(case, scene, condensed, stages, ends, stability)


def _condense(
    case: Case,
    scene: Scene,
    pairings: tuple[Pairing, ...],
    stages: FloatArray,
    clock: Clock,
    console: Console,
    memo: Memo,
) -> tuple[Condensed, tuple[ExactState, ...]]:
    """Condense; where a contact's reach is automatic, widen it until no node left out touches."""
    fixed = {contact.name: contact.reach for contact in case.contact}
    for _ in range(WIDENINGS):
        with clock.phase("condensation"):
            console.phase(f"condensing on {sum(int(p.candidate.sum()) for p in pairings)} contact nodes")
            condensed = condense(scene, pairings, memo)
            if not condensed.pairings:
                return condensed, ()
            try:
                ends = _exact_ends(condensed, stages)
            except EndlessError:
                check_candidates_coercivity(case, scene, condensed, memo)
                raise
            except UnbalancedError as error:
                raise beyond_limit(scene, condensed, stages, error) from error
            touched = _touched(condensed, ends)
        if not any(mask.any() for mask in touched.values()):
            return condensed, ends
        for pairing in condensed.pairings:
            if touched[pairing.name].any() and fixed[pairing.name] != "auto":
                raise reach_error(pairing.name, float(pairing.gap[touched[pairing.name]].max()))
        pairings = tuple(
            pairing
            if pairing.bonded
            else pairing.with_reach(
                WIDER * float(pairing.gap[touched[pairing.name] | pairing.candidate].max())
            )
            for pairing in pairings
        )
    raise NumericalError(
        f"the contact zone was still growing after {WIDENINGS} enlargements",
        "refine the surfaces over the whole zone that comes into contact, or set contact.NAME.reach",
    )
