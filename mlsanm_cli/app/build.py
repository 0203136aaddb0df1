"""From a case to the condensed problem, phase by phase."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cached_property, partial

import numpy as np

from mlsanm_cli.app.causes import pull_hint
from mlsanm_cli.app.certificate import certify, certify_candidates
from mlsanm_cli.app.clock import Clock
from mlsanm_cli.app.clouds import clouds
from mlsanm_cli.app.console import Console
from mlsanm_cli.app.contacts import refuse_overlap
from mlsanm_cli.app.estimate import refuse_too_large, refuse_too_many_contacts
from mlsanm_cli.app.fine_views import View, fine_views
from mlsanm_cli.app.limit_named import beyond_limit
from mlsanm_cli.app.linear import direct_solver
from mlsanm_cli.app.near import Wanted, find_grids
from mlsanm_cli.app.scene import NOTHING, Prepared, equip, prepare
from mlsanm_cli.app.stages import factors_at, stage_factors
from mlsanm_cli.app.symmetry import line_of
from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.case import Case, LoadedCase, resolved_mapping
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.contact.active_set import ExactState, solve_exact
from mlsanm_cli.contact.condensed import Condensed, condense
from mlsanm_cli.contact.coulomb import CoulombState, increment, residual, unloaded
from mlsanm_cli.contact.pairing import Pairing
from mlsanm_cli.contact.set_search import EndlessError, NoStateError, UnbalancedError
from mlsanm_cli.contact.sets import Sets
from mlsanm_cli.errors import CaseError, NumericalError
from mlsanm_cli.kernels.jit import Loaded, is_warm, load
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.memo import AFRESH, Memo, digest
from mlsanm_cli.values import dataclass

MANY = 50_000
"""Scenes of more nodes are announced: they take a while, and may be a typing error."""
WIDER = 1.5
WIDENINGS = 6
_WITHOUT_SIZE = {"load", "stage", "output"}
_CONTACTS_WITHOUT_SIZE = {"friction", "regularization"}
"""What of a case and of its contacts does not change its size."""
MOST_LEVELS = 40
"""Of more levels with fields some tell how fine contact grids have to be."""
BETWEEN = 8
"""Between the ends of a stage contacts are looked at so many times less one, whether they pass beyond the
ranges of their grids."""
FIRST_PARTS = (0.5, 0.1, 0.01)
"""Parts of the first stage that give a contact with friction its scales if its end cannot be reached."""


@dataclass(frozen=True)
class Built:
    """A scene ready for its load path.

    ``stages`` (T + 1, L) are the load factors before the first stage and at the end of each; ``ends`` the
    exact contact states there (none without contact), with friction after one increment per stage: good
    enough for scales, reach and refinement. A stage whose end cannot be reached and those after it have none.
    ``stability`` is the certificate.
    """

    case: Case
    scene: Scene
    condensed: Condensed
    stages: FloatArray
    ends: tuple[ExactState, ...]
    stability: float

    @cached_property
    def views(self) -> Mapping[str, View]:
        """Bodies whose fields are written at other points than their nodes."""
        return fine_views(self.case, self.scene, self.condensed, self.ends)

    def shown(self, body: str) -> Cloud:
        """The cloud at whose points a body's fields are written."""
        view = self.views.get(body)
        return self.scene.bodies[body].model.cloud if view is None else view.cloud

    @property
    def is_holonomic(self) -> bool:
        """Whether friction is to depend on the total slip alone."""
        return any(
            contact.friction and contact.regularization.friction_law == "holonomic"
            for contact in self.case.touching
        )


def load_kernels(clock: Clock, console: Console) -> Loaded:
    """Load the compiled kernels; say so where they have to be compiled first, or cannot be kept."""
    with clock.phase("jit"):
        if not is_warm():
            console.phase("compiling kernels, once for this installation (about 15 s)")
        loaded = load()
    if loaded.note:
        console.warning(loaded.note)
    return loaded


def build_scene(loaded: LoadedCase, clock: Clock, console: Console, memo: Memo = AFRESH) -> Prepared:
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
            from mlsanm_cli.app.finite.scene import refuse_unsupported

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
    memo: Memo = AFRESH,
    before: Prepared | None = None,
) -> Prepared:
    """Clouds, stencils, pairs and conditions; ``zones`` refine every body beyond what the case says, and
    bodies that come out as ``before`` stay."""
    with clock.phase("cloud"):
        console.phase("placing nodes")
        placed = clouds(case, zones, memo, line_of(case))
    with clock.phase("operators"):
        console.phase("building operators")
        return prepare(case, placed, memo, before.models if before is not None else NOTHING)


def complete(
    case: Case,
    prepared: Prepared,
    clock: Clock,
    console: Console,
    memo: Memo = AFRESH,
    before: Scene | None = None,
) -> Built:
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
    case: Case, prepared: Prepared, clock: Clock, console: Console, memo: Memo, before: Scene | None
) -> Built:
    @contextmanager
    def factorising() -> Iterator[None]:
        with clock.phase("factorization"):
            console.phase("factorising")
            yield

    with clock.phase("operators"):
        bodies = before.bodies if before is not None else NOTHING
        scene = equip(case, prepared, direct_solver(case), factorising, memo, bodies)
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
                scene = equip(case, prepared, direct_solver(case), factorising, memo)
        condensed, ends = _condense(case, scene, prepared.pairings, stages, clock, console, memo)
    else:
        condensed, ends = found
    with clock.phase("condensation"):
        stability = certify(case, scene, condensed, ends, memo)
    return Built(case, scene, condensed, stages, ends, stability)


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
                certify_candidates(case, scene, condensed, memo)
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


def _searched(
    case: Case, scene: Scene, stages: FloatArray, condensed: Condensed, starts: Sequence[Sets], which: Wanted
) -> tuple[ExactState, ...]:
    """Exact states at the ends of the stages, or every state that counts with those where fields are wanted;
    or some between the ends, but for friction, whose path would have to be followed."""
    factors, every = stages, which != "ends"
    if which == "between":
        if len(condensed.rubbing):
            return ()
        inner = (np.arange(len(stages) - 1)[:, None] + np.arange(1, BETWEEN) / BETWEEN).ravel()
        factors = np.stack([factors_at(stages, float(position)) for position in (0.0, *inner)])
    elif every:
        every_so_many = -(-len(case.output.at) // MOST_LEVELS) or 1
        positions = sorted({*range(len(stages)), *case.output.at[::every_so_many]})
        factors = np.stack([factors_at(stages, position) for position in positions])
    if len(condensed.rubbing):
        return _rubbing_ends(condensed, factors, starts)
    ends: list[ExactState] = []
    for number, wanted in enumerate(factors[1:]):
        start = next(iter(starts[number:]), None)
        first = _last(ends) if start is None else start.closed
        try:
            ends.append(_solved_exactly(condensed, wanted, first))
        except UnbalancedError as error:
            if not every:
                raise beyond_limit(scene, condensed, stages, error) from error
        except NumericalError:
            # A body that floats on its way has no exact state there.
            if not every:
                raise
    return tuple(ends)


def _solved_exactly(condensed: Condensed, factors: FloatArray, first: BoolArray | None) -> ExactState:
    """The exact state, searched from a ``first`` set, or where that lets go of a body from the closest."""
    try:
        return solve_exact(condensed, factors, first)
    except NumericalError:
        return solve_exact(condensed, factors)


def _last(ends: Sequence[ExactState]) -> BoolArray | None:
    return ends[-1].active if ends else None


def _exact_ends(condensed: Condensed, stages: FloatArray) -> tuple[ExactState, ...]:
    if len(condensed.rubbing):
        return _rubbing_ends(condensed, stages)
    ends: list[ExactState] = []
    for factors in stages[1:]:
        ends.append(solve_exact(condensed, factors, ends[-1].active if ends else None))
    return tuple(ends)


def _rubbing_ends(
    condensed: Condensed, stages: FloatArray, starts: Sequence[Sets] = ()
) -> tuple[ExactState, ...]:
    """One increment per stage as far as the loads can be carried; of the first at least a part."""
    ends: list[ExactState] = []
    state = unloaded(condensed, stages[0])
    for number, factors in enumerate(stages[1:]):
        try:
            state, solves = _incremented(condensed, state, factors, next(iter(starts[number:]), None))
        except NoStateError:
            break
        ends.append(_end(condensed, state, solves))
    return tuple(ends) if ends else (_first_end(condensed, state, stages[1]),)


def _incremented(
    condensed: Condensed, state: CoulombState, factors: FloatArray, guess: Sets | None
) -> tuple[CoulombState, int]:
    if guess is not None:
        with suppress(NoStateError):
            return increment(condensed, state, factors, guess=guess)
    try:
        return increment(condensed, state, factors)
    except NoStateError as lost:
        # What touches without friction is near to what does with it, if loads balance without it.
        try:
            free = solve_exact(condensed, factors)
        except NumericalError:
            raise lost from None
        closed, none = free.active, np.zeros(len(condensed.rubbing))
        slip = condensed.slip(factors, free.motion, free.pressure, none) - state.values.slip
        for stuck in (closed[condensed.rubbing], np.zeros(len(none), dtype=bool)):
            sense = np.where(closed[condensed.rubbing] & ~stuck, -np.sign(slip), 0.0)
            with suppress(NoStateError):
                return increment(condensed, state, factors, guess=Sets(closed, stuck, sense))
        raise lost from None


def _first_end(condensed: Condensed, state: CoulombState, end: FloatArray) -> ExactState:
    """The state after a part of a stage whose end cannot be reached."""
    for part in FIRST_PARTS:
        try:
            found, solves = increment(condensed, state, state.factors + part * (end - state.factors))
        except NoStateError as error:
            failure = error
            continue
        return _end(condensed, found, solves)
    raise failure


def _end(condensed: Condensed, state: CoulombState, solves: int) -> ExactState:
    v, stuck = state.values, np.zeros(len(condensed.weight), dtype=bool)
    stuck[condensed.rubbing[state.sets.stuck]] = True
    violation = residual(condensed, state)
    return ExactState(
        state.factors, v.pressure, v.gap, v.motion, v.traction, state.sets.closed, stuck, solves, violation
    )


def _touched(condensed: Condensed, ends: tuple[ExactState, ...]) -> Mapping[str, BoolArray]:
    """Per contact, which paired nodes (w,) are no candidates and yet overlap in one of the states."""
    found = [condensed.touched(state.factors, state.motion, state.pressure, state.traction) for state in ends]
    return {pair.name: np.any([masks[pair.name] for masks in found], axis=0) for pair in condensed.pairings}


def reach_error(contact: str, gap: float) -> NumericalError:
    """A node that was left out of a contact overlaps the other surface."""
    return NumericalError(
        f"contact {contact}: a node left out because of its initial gap has come into contact",
        f'set contact.{contact}.reach above {gap:.3g}, or to "auto"',
    )
