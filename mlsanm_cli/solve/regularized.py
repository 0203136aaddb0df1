"""Load path of the regularised contact laws; friction with memory from event to event."""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.complementarity.problem import ContactStatus
from mlsanm_cli.contact.laws.coupling import DenseCoupling
from mlsanm_cli.contact.laws.failures import NoStateError, SlidingError
from mlsanm_cli.contact.laws.limit_load import limit_load, slides_freely
from mlsanm_cli.contact.laws.regularized_friction import FactorisationCount, RegularizedFriction
from mlsanm_cli.contact.monolithic.system import SparseCoupling
from mlsanm_cli.continuation import AnmOptions, Branch, NewtonOptions, Step, StopReason, correct, follow
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.roundoff import FINE_ROUND_OFF
from mlsanm_cli.solve import series
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.regularized_events import EventFlags, EventLocator, continued
from mlsanm_cli.solve.state import Checkpoint, PathStep, output_positions

FIRST_SOFTNESS, MAX_SOFTNESS = 1e3, 1e9
"""Compliance of asperities before the first load over that of the bodies, initially and at most."""
CARRIED_TARGET, CARRIED_ACCEPTED = 0.01, 0.3
"""They are reset until they carry less than the first part of the possible friction, or the second if a reset
does not halve it."""
MIN_TENSION = 1e-3
"""Tension, relative to that of the law, below which nodes stick before the first load."""
APART = "friction cannot hold a body held by contact only before the first load: the surfaces are drawn apart"
APART_HINT = 'draw the surfaces touching, or use contact.regularization.law = "exact"'


def regularized_path(built: CondensedScene, start: Checkpoint | None) -> Iterator[PathStep]:
    """Path of the regularised laws. Requested states are evaluated from the series of their step, or are ends
    of Newton steps. NumericalError if the path cannot be continued."""
    wanted, options = output_positions(built), replace(series.path_options(built), direction=1)
    if start is None:
        point, first = start_at_rest(built, options)
        saved = (first.state,) if 0.0 in wanted else ()
        yield replace(first, saved=saved, checkpoint=series.checkpoint_at(point, first.state))
    else:
        point = series.restored(built, start)
    for stage, (begin, end) in enumerate(zip(built.stages[:-1], built.stages[1:], strict=True)):
        if start is not None and stage < start.stage:
            continue
        path = _StagePath(stage, wanted, options)
        if start is not None and stage == start.stage and start.fraction > 0.0:
            steps = path.continue_stage(point, series.previous_piece(start, point.x))
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


def start_at_rest(
    built: CondensedScene, options: AnmOptions | NewtonOptions
) -> tuple[series.PathPoint, PathStep]:
    """Initial point before the first load, and the first row of the path. NumericalError if a body or platen
    is not held."""
    if len(built.condensed.friction_nodes) and not built.is_holonomic:
        point = _first(built, options)
        assert point.friction is not None
        first, count = series.state_of(point, 0, point.residual), point.friction.tally.reset()
        return point, PathStep(first, (), factorizations=count)
    problem = series.problem_of(built, series.coupling_of(built, series.regularization(built)), 0)
    found = correct(problem, series.start_point(built, problem), 0.0, options)
    # The holonomic law does not define dissipation.
    point = series.PathPoint(problem, found.x, 0.0, np.full(problem.n, np.nan))
    first = series.state_of(point, 0, point.residual)
    return point, PathStep(first, (), 0.0, 0, found.updates, found.factorizations, found.solves)


def _first(built: CondensedScene, options: AnmOptions | NewtonOptions) -> series.PathPoint:
    """State before the first load, in which normals carry the small pressures of the law.

    Very soft asperities prevent weakly resisted motions, as the rotation of a disk in a groove by errors of
    the grid; their slips are reset until they carry nearly nothing. Pressed nodes stick initially; friction
    of the others begins at the threshold of the law. NumericalError if a body or platen is not held.
    """
    c, bare = built.condensed, series.coupling_of(built, series.regularization(built))
    law, begin, tally = bare.law, built.stages[0], FactorisationCount()
    rubbing, nothing = c.friction_nodes, np.zeros(len(c.friction_nodes))
    least = MIN_TENSION * law.eta[rubbing] / np.maximum(c.friction, 1.0)
    elastic = law.slip / (c.friction * law.pressure)

    def sticking(
        base: DenseCoupling | SparseCoupling, x: FloatArray, rest: FloatArray
    ) -> RegularizedFriction:
        """The problem where nodes stick that are pressed in x."""
        closed = np.zeros(len(c.weight), dtype=bool)
        own = x[rubbing]
        closed[rubbing] = stuck = own > -least
        # Parallel faces float without pressures and are not held by friction.
        unpressed = np.ones(len(own), dtype=bool)
        for span in c.tangential.values():
            unpressed[span] = (own <= 2.0 * least)[span].all()
        own = np.where(unpressed, -least, 0.5 * np.maximum(own, 0.0))
        threshold = np.where(stuck, np.minimum(law.threshold, own), law.threshold)
        base = base.with_thresholds(threshold)
        return RegularizedFriction(base, begin, begin, ContactStatus(closed, stuck, nothing), rest, tally)

    x, rest, carried, times = series.drawn(built, bare), nothing, np.inf, FIRST_SOFTNESS
    while times <= MAX_SOFTNESS:
        soft = replace(bare, law=replace(law, stick_compliance=times * elastic)).with_stick_compliance()
        problem = sticking(soft, x, rest)
        try:
            x = correct(problem, x, 0.0, options).x
        except NumericalError as error:
            if not len(c.balance.constant):
                raise
            raise NumericalError(APART, APART_HINT) from error
        pressure, _, motion, traction = problem.split(x)
        before, carried = carried, float(c.weight[rubbing] @ np.abs(traction))
        most = float(c.weight[rubbing] @ (c.friction * (np.maximum(pressure[rubbing], 0.0) + least)))
        slow = carried > 0.5 * before
        if carried <= (CARRIED_ACCEPTED if slow else CARRIED_TARGET) * most:
            break
        times *= 10.0 if slow else 1.0
        # Condensed slips already exclude the tractions; displacements among the unknowns do not.
        rest = c.slip(begin, bare.split_motions(motion)[0], pressure, nothing)
        traction[:] = 0.0
    problem = sticking(bare.with_stick_compliance(), x, nothing)
    return series.inside(series.PathPoint(problem.rested(x, 0.0), x, 0.0, nothing), options.goal)


class _StagePath:
    """Path of one stage: one piece, or with friction with memory pieces between events."""

    def __init__(self, stage: int, wanted: tuple[float, ...], options: AnmOptions | NewtonOptions) -> None:
        self.point: series.PathPoint
        self._stage, self._options = stage, options
        self._wanted = [position for position in wanted if stage < position <= stage + 1]
        self._standing = 0
        self._held: ContactStatus | None = None
        self._previous: Branch | None = None

    def steps(self, point: series.PathPoint) -> Iterator[PathStep]:
        """Steps from the beginning of the stage to its end. NoStateError, NumericalError."""
        self.point = point
        if not point.problem.change.any():
            # A stage that changes nothing.
            self.point = replace(point, lam=1.0)
            state = series.state_of(self.point, self._stage, self.point.residual)
            saved = tuple(replace(state, position=position) for position in self._wanted)
            yield PathStep(state, saved, checkpoint=series.checkpoint_at(self.point, state))
            return
        if point.friction is not None:
            self._put_on(point, point.friction, EventFlags.none(point.problem.n))
        yield from self._pieces()

    def continue_stage(self, point: series.PathPoint, previous: Branch | None) -> Iterator[PathStep]:
        """Steps from a point within the stage to its end, first those of the ``previous`` piece unless an
        event ended it. Errors as `steps`."""
        self.point = point
        if previous is not None:
            self._previous = previous
            yield from self._piece(replace(self._options, direction=0))
        yield from self._pieces()

    def _pieces(self) -> Iterator[PathStep]:
        while self.point.lam < 1.0:
            if self._is_sliding():
                raise _slides(self._stage, self.point.lam)
            yield from self._piece(self._options)

    def _piece(self, options: AnmOptions | NewtonOptions) -> Iterator[PathStep]:
        """Steps to the next event or the end of the stage. NoStateError if events no longer advance the
        path."""
        begin, friction = self.point, self.point.friction
        locator = None if friction is None else EventLocator(friction)
        follower = follow(
            begin.problem,
            begin.x,
            begin.lam,
            1.0,
            options,
            self._previous,
            locator,
            [position - self._stage for position in self._wanted if position < self._stage + 1],
        )
        for step in follower.steps():
            if locator is not None and locator.reached:
                yield from self._event(step, locator.hits)
                continue
            if step.lam == 1.0 and step.order:
                # Newton's method has corrected the end itself.
                x, residual = series.sharpened(begin.problem, step.x, 1.0)
                step = _updated(replace(step, x=x, residual=residual))
            before, self.point = self.point, series.moved(self.point, step.x, step.lam)
            yield self._finished(before, step, follower.outcome.piece)
        if follower.outcome.reason is not StopReason.EVENT and not follower.outcome.reached:
            raise series.stopped(self._stage, follower.outcome)
        self._previous = follower.outcome.piece
        self._standing = self._standing + 1 if self.point.lam - begin.lam < FINE_ROUND_OFF else 0
        if self._standing > 4 * begin.problem.n + 50:
            raise NoStateError(sliding=False)

    def _is_sliding(self) -> bool:
        """Whether some node has ceased to stick or to touch, as only this releases a body, and nothing but
        friction resists some motion, nor anything that it brings into contact."""
        friction = self.point.friction
        if friction is None:
            return False
        before, self._held = self._held, friction.sets
        loosened = before is None or (
            (before.stuck & ~self._held.stuck).any() or (before.closed & ~self._held.closed).any()
        )
        if not loosened or not slides_freely(friction.condensed, friction.sets):
            return False
        limit = limit_load(friction.condensed, friction.start, friction.change)
        return limit is None or not limit.whole

    def _put_on(self, point: series.PathPoint, problem: RegularizedFriction, hits: EventFlags) -> None:
        """Put the path on the sets that hold beyond a point."""
        problem, x = continued(problem.by_pressure_alone(point.x), point.x, point.lam, hits)
        # The place of the event has the tolerance of the series, and the new sets differ slightly.
        self.point = series.inside(replace(point, problem=problem, x=x), self._options.goal)

    def _event(self, step: Step, hits: EventFlags) -> Iterator[PathStep]:
        """A step that ends at an event, its end already as the path continues from it."""
        before = self.point
        assert before.friction is not None
        point, failure = series.moved(before, step.x, step.lam), None
        try:
            self._put_on(point, before.friction, hits)
        except NoStateError as error:
            failure = error
            self.point = series.inside(point, self._options.goal)
        yield self._finished(before, replace(step, residual=self.point.residual))
        if failure is not None:
            raise failure

    def _finished(self, before: series.PathPoint, step: Step, piece: Branch | None = None) -> PathStep:
        """The step from ``before`` to where the path is now, with requested states from its series, on a
        ``piece`` that continues."""
        stage, end = self._stage, series.state_of(self.point, self._stage, step.residual)
        # A copy keeps the factorised tangent, which those of the requested states would replace.
        problem, saved = copy(before.problem), []
        for position in self._wanted:
            if not stage + before.lam < position <= stage + step.lam:
                continue
            if not step.order or position - stage >= step.lam:
                saved.append(replace(end, position=position))
                continue
            x, lam = step.branch.evaluate(step.branch.parameter_at(position - stage))
            x, residual = series.sharpened(problem, x, lam)
            step = _updated(step)
            state = series.state_of(series.between(before, x, lam), stage, residual)
            # The series has the position up to round-off.
            saved.append(replace(state, position=position))
        friction = self.point.friction
        return PathStep(
            state=end,
            saved=tuple(saved),
            length=step.arc_length,
            order=step.order,
            iterations=step.iterations,
            # Points with friction share tangents, which followers do not count.
            factorizations=step.factorizations if friction is None else friction.tally.reset(),
            solves=step.solves,
            # Predictors between states are not stored.
            series=series.series_of(before.problem, step.branch, stage) if step.order else {},
            series_attributes={"length": step.branch.length, "stage": stage},
            checkpoint=series.checkpoint_at(self.point, end, piece),
        )


def _updated(step: Step) -> Step:
    """The step with one more update counted."""
    return replace(
        step,
        iterations=step.iterations + 1,
        factorizations=step.factorizations + 1,
        solves=step.solves + 1,
    )
