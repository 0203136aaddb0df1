"""The load path of the regularised contact laws; with friction that has a memory from event to event."""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.contact_status import ContactStatus
from mlsanm_cli.contact.laws.coupling import DenseCoupling
from mlsanm_cli.contact.laws.regularized_friction import FactorisationCount, RegularizedFriction
from mlsanm_cli.contact.laws.set_search import NoStateError
from mlsanm_cli.contact.laws.sliding import SlidingError, slides_freely
from mlsanm_cli.contact.monolithic.system import SparseCoupling
from mlsanm_cli.continuation import (
    AnmOptions,
    Branch,
    Correction,
    Follower,
    NewtonOptions,
    Step,
    StopReason,
    correct,
    follow,
)
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.regularized_events import EventFlags, EventLocator, continued
from mlsanm_cli.solve.regularized_points import (
    RETURNS,
    Point,
    between,
    checkpoint_at,
    inside,
    moved,
    restored,
    series_of,
    state_of,
)
from mlsanm_cli.solve.series import (
    ContactProblem,
    at,
    at_target,
    coupling_of,
    drawn,
    levels_in,
    path_options,
    path_step,
    previous_piece,
    problem_of,
    regularization,
    start_point,
    states_in,
    stopped,
)
from mlsanm_cli.solve.state import Checkpoint, PathStep, State, output_positions

STANDSTILL = 1e-12
"""Events this close to each other, as parts of a stage, do not move the path on."""
WIDER = (1e4, 1e3, 1e2, 1e1, 1.0)
"""Lengths of the law, in its own, with which a start is looked for that its own does not find."""
OPENINGS = 20
FREE = 1e-3
"""Before the first load tractions are below this part of their limits."""
APART = "before the first load friction does not hold what contacts alone hold: the surfaces are drawn apart"
APART_HINT = 'draw the surfaces touching, or use contact.regularization.law = "exact"'


def regularized_path(built: CondensedScene, start: Checkpoint | None) -> Iterator[PathStep]:
    """States of the regularised laws. Wanted ones come from the series of their step, or end one of Newton's.

    Raises NumericalError where the path cannot continue.
    """
    wanted, options = output_positions(built), replace(path_options(built), direction=1)
    if start is None:
        point, first = start_at_rest(built, options)
        saved = (first.state,) if 0.0 in wanted else ()
        yield replace(first, saved=saved, checkpoint=checkpoint_at(point, first.state))
    else:
        point = restored(built, start)
    for stage, (begin, end) in enumerate(zip(built.stages[:-1], built.stages[1:], strict=True)):
        if start is not None and stage < start.stage:
            continue
        path = _StagePath(stage, wanted, options)
        if start is not None and stage == start.stage and start.fraction > 0.0:
            steps = path.continue_stage(point, previous_piece(start, point.x))
        else:
            steps = path.steps(replace(point, problem=point.problem.over(begin, end), lam=0.0))
        try:
            yield from steps
        except NoStateError as error:
            where = f"beyond position {stage + path.point.lam:.9g}"
            if error.sliding:
                raise _slides(stage, path.point.lam) from error
            raise NumericalError(
                f"{error.message} {where}", 'use contact.regularization.law = "exact", which can jump'
            ) from error
        point = path.point


def _slides(stage: int, lam: float) -> SlidingError:
    return SlidingError(lam, f" at position {stage + lam:.9g}")


def start_at_rest(built: CondensedScene, options: AnmOptions | NewtonOptions) -> tuple[Point, PathStep]:
    """The point before the first load and the path's first row. Raises NumericalError where nothing holds a
    body or platen."""
    if len(built.condensed.friction_nodes) and not built.is_holonomic:
        point = _first(built, options)
        assert point.friction is not None
        return point, PathStep(_at_rest(point), (), factorizations=point.friction.tally.taken())
    problem, found = _started(built, coupling_of(built, regularization(built)), options)
    # Dissipation is a matter of history, which the holonomic law does not know.
    point = Point(problem, found.x, 0.0, np.full(problem.n, np.nan))
    return point, PathStep(_at_rest(point), (), 0.0, 0, found.updates, found.factorizations, found.solves)


def _started(
    built: CondensedScene, coupling: DenseCoupling | SparseCoupling, options: AnmOptions | NewtonOptions
) -> tuple[ContactProblem, Correction]:
    """The state before the first load. Where loose bodies are far from where they float, as surfaces overlap
    that are drawn touching elsewhere, the law's length is first made longer, then comes back."""
    problem = problem_of(built, coupling, 0)
    try:
        return problem, correct(problem, start_point(built, problem), 0.0, options)
    except NumericalError as error:
        failure, x = error, None
    for wider in WIDER:
        law = replace(coupling.law, delta=wider * coupling.law.delta)
        problem = problem_of(built, replace(coupling, law=law), 0)
        try:
            found = correct(problem, start_point(built, problem) if x is None else x, 0.0, options)
        except NumericalError:
            raise failure from None
        x = found.x
    return problem, found


def _at_rest(point: Point) -> State:
    return state_of(point, 0, float(np.abs(point.problem.residual(point.x, 0.0)).max()))


def _first(built: CondensedScene, options: AnmOptions | NewtonOptions) -> Point:
    """The state before the first load: as drawn, no traction anywhere.

    Pressed nodes stick from the very start; friction of the others begins when they reach the law's
    threshold. Raises NumericalError where nothing holds a body or platen.
    """
    c, coupling = built.condensed, coupling_of(built, regularization(built)).with_stick_compliance()
    law = coupling.law
    nothing, begin = np.zeros(len(c.friction_nodes)), built.stages[0]
    x = np.concatenate([drawn(built, coupling), nothing])
    pressure = x[: len(c.weight)]
    full, tally = law.threshold, FactorisationCount()

    def problem_at(pressure: FloatArray, sticking: bool, stick_reference: FloatArray) -> RegularizedFriction:
        pressed = np.zeros(len(pressure), dtype=bool)
        pressed[c.friction_nodes] = pressure[c.friction_nodes] > -FREE * law.eta[c.friction_nodes]
        stuck = pressed[c.friction_nodes] & sticking
        own = 0.5 * np.maximum(pressure[c.friction_nodes], 0.0)
        threshold = np.where(stuck, np.minimum(full, own), full)
        base = replace(coupling, law=replace(law, threshold=threshold))
        return RegularizedFriction(
            base, begin, begin, ContactStatus(pressed, stuck, nothing), stick_reference, tally
        )

    drawn_x, stick_reference, pressure = x, nothing, x[: len(c.weight)]
    for _ in range(OPENINGS):
        problem = problem_at(pressure, True, stick_reference)
        try:
            x = correct(problem, x, 0.0, options).x
        except NumericalError as error:
            if not len(c.balance.constant):
                raise
            raise NumericalError(APART, APART_HINT) from error
        pressure, _, motion, traction = problem.split(x)
        limit = FREE * c.friction * np.maximum(pressure[c.friction_nodes], 0.0)
        if (np.abs(traction) <= limit)[problem.sets.stuck].all():
            break
        traction[:] = 0.0
        # Condensed slips know that the tractions are gone; displacements among the unknowns do not.
        stick_reference = c.slip(begin, coupling.split_motions(motion)[0], pressure, nothing)
    else:
        # Tractions that go from node to node, as in wedges and grooves: normals alone may hold the bodies.
        free = _without_friction(problem_at(drawn_x[: len(c.weight)], False, nothing), drawn_x, options)
        if free is None:
            problem = problem_at(pressure, True, stick_reference)
            return inside(Point(problem, correct(problem, x, 0.0, options).x, 0.0, nothing))
        pressure, _, motion, _ = free[0].split(free[1])
        rest = c.slip(begin, coupling.split_motions(motion)[0], pressure, nothing)
        return Point(problem_at(pressure, True, rest), free[1], 0.0, nothing)
    return Point(problem, x, 0.0, nothing)


def _without_friction(
    problem: RegularizedFriction,
    x: FloatArray,
    options: AnmOptions | NewtonOptions,
) -> tuple[RegularizedFriction, FloatArray] | None:
    """The state before the first load where nothing rubs; None where only friction holds bodies."""
    try:
        return problem, correct(problem, x, 0.0, options).x
    except (NumericalError, np.linalg.LinAlgError):
        return None


class _StagePath:
    """One stage: one piece of path, or, where friction has a memory, pieces between events."""

    def __init__(self, stage: int, wanted: tuple[float, ...], options: AnmOptions | NewtonOptions) -> None:
        self.point: Point
        self._stage, self._wanted, self._options = stage, wanted, options
        self._levels = levels_in(wanted, stage)
        self._began, self._standing = 0.0, 0
        self._held: ContactStatus | None = None
        self._previous: Branch | None = None

    def steps(self, point: Point) -> Iterator[PathStep]:
        """Steps from the start of the stage to its end. Raises NoStateError, NumericalError."""
        self.point = point
        if not point.problem.change.any():
            yield from self._waiting()
            return
        if point.friction is not None:
            self._put_on(point, point.friction, EventFlags.none(point.problem.n))
        yield from self._pieces()

    def continue_stage(self, point: Point, previous: Branch | None) -> Iterator[PathStep]:
        """Steps from a point within the stage to its end, the first ones of the ``previous`` piece of path if
        no event has ended that. Raises as `steps` does."""
        self.point, self._began = point, point.lam
        if previous is not None:
            self._previous = previous
            yield from self._piece(replace(self._options, direction=0))
        yield from self._pieces()

    def _pieces(self) -> Iterator[PathStep]:
        while self.point.lam < 1.0:
            if self._loosened() and self._held and slides_freely(self.point.problem.condensed, self._held):
                raise _slides(self._stage, self.point.lam)
            self._began = self.point.lam
            yield from self._piece()

    def _piece(self, options: AnmOptions | NewtonOptions | None = None) -> Iterator[PathStep]:
        """Steps to the next event, or to the end of the stage."""
        begin, friction = self.point, self.point.friction
        locator = None if friction is None else EventLocator(friction)
        follower = follow(
            begin.problem,
            begin.x,
            begin.lam,
            1.0,
            options or self._options,
            self._previous,
            locator,
            self._levels,
        )
        for step in follower.steps():
            if locator is not None and locator.reached:
                yield from self._event(step, locator.hits)
            else:
                step = at_target(begin.problem, step) if step.lam == 1.0 else step
                before, self.point = self.point, moved(self.point, step.x, step.lam)
                yield self._finished(before, step, follower)
        if follower.outcome.reason is not StopReason.EVENT and not follower.outcome.reached:
            raise stopped(self._stage, follower.outcome)
        self._previous = follower.outcome.piece
        self._count()

    def _count(self) -> None:
        """See that the path moves on from event to event. Raises NoStateError."""
        self._standing = self._standing + 1 if self.point.lam - self._began < STANDSTILL else 0
        if self._standing > 4 * self.point.problem.n + 50:
            raise NoStateError(sliding=False)

    def _loosened(self) -> bool:
        """Whether some node has ceased to stick or to touch: nothing else lets a body go that was held."""
        if self.point.friction is None:
            return False
        before, self._held = self._held, self.point.friction.sets
        if before is None:
            return True
        return bool((before.stuck & ~self._held.stuck).any() or (before.closed & ~self._held.closed).any())

    def _put_on(self, point: Point, problem: RegularizedFriction, hits: EventFlags) -> None:
        """Put the path on the sets that hold beyond a point."""
        problem, x = continued(problem, point.x, point.lam, hits)
        # What the event's place, known to the series' tolerance, and the new sets disagree by.
        for _ in range(RETURNS):
            residual = problem.residual(x, point.lam)
            if np.abs(residual).max() <= self._options.goal:
                break
            x = x - problem.tangent(x, point.lam).solve(residual)
        self.point = inside(replace(point, problem=problem, x=x))

    def _event(self, step: Step, hits: EventFlags) -> Iterator[PathStep]:
        """A step that ends at an event, its end already as the path continues from it."""
        before = self.point
        assert before.friction is not None
        point, failure = moved(before, step.x, step.lam), None
        try:
            self._put_on(point, before.friction, hits)
        except NoStateError as error:
            failure = error
            self.point = inside(point)
        residual = float(np.abs(self.point.problem.residual(self.point.x, step.lam)).max())
        yield self._finished(before, replace(step, residual=residual))
        if failure is not None:
            raise failure

    def _finished(self, before: Point, step: Step, follower: Follower | None = None) -> PathStep:
        """The step from ``before`` to where the path is now, of a piece that continues by a follower."""
        stage = self._stage
        end = state_of(self.point, stage, step.residual)
        places = [p for p in self._wanted if stage + before.lam < p <= stage + step.lam]
        # A copy keeps the tangent at hand, which those of the wanted states would take the place of.
        step, states = states_in(copy(before.problem), step, stage, places)
        saved = [state_of(between(before, x, lam), stage, residual) for x, lam, residual in states]
        series = series_of(before.problem, step.branch, stage)
        if self.point.friction is not None:
            # Points share tangents, of which the followers know nothing.
            step = replace(step, factorizations=self.point.friction.tally.taken())
        finished = path_step(step, end, stage, at(places, saved, end), series)
        return replace(finished, checkpoint=checkpoint_at(self.point, end, follower))

    def _waiting(self) -> Iterator[PathStep]:
        """A stage that changes nothing."""
        residual = float(np.abs(self.point.problem.residual(self.point.x, 1.0)).max())
        self.point = replace(self.point, lam=1.0)
        state = state_of(self.point, self._stage, residual)
        places = [p for p in self._wanted if self._stage < p <= self._stage + 1]
        saved = tuple(replace(state, position=position) for position in places)
        yield PathStep(state, saved, checkpoint=checkpoint_at(self.point, state))
