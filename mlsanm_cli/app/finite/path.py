"""Path of one body without contact at finite strain; its equations are renewed as it deforms, and it leaves a
bifurcation along a stable branch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from mlsanm_cli.app.finite.accuracy import missed_alone
from mlsanm_cli.app.finite.checks import path_failure
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation import follow
from mlsanm_cli.continuation.corrector import Correction, Effort, correct, iterate
from mlsanm_cli.continuation.path import Step, StopReason
from mlsanm_cli.continuation.problem import AnmOptions, NewtonOptions, SingularTangentError
from mlsanm_cli.continuation.series import Branch, root
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.finite.body import far_from
from mlsanm_cli.mechanics.finite.projector import FiniteProblem
from mlsanm_cli.mechanics.finite.stability import STILL, SoftMotion
from mlsanm_cli.roundoff import FINE_ROUND_OFF
from mlsanm_cli.solve.state import Bifurcation, Checkpoint, PathStep, State

MAX_UPDATES = 25
"""Largest number of updates with the factor of the new equations that correct a state; each leaves about a
fifth."""
WORK_PARTS = 8
"""Parts of a step of power series over which work is integrated by the trapezoidal rule."""
SAME_STATE = 1e-3
"""Largest distance of the states that two paths find at a load factor, over the typical displacement."""
BIFURCATION_PRECISION = 1e-3
"""Precision of a bifurcation's place, as a part of the step."""
BRANCH_STEP, BRANCH_TRIALS = 0.01, 6
"""Distance from a bifurcation to the first state on the other branch, over the extent of the body, which is
halved if no state is found there, and number of trials."""

Legs = Sequence[tuple[Step, SoftMotion]]


def finite_path(
    scene: FiniteScene,
    checkpoint: Checkpoint | None = None,
    renewals: Sequence[State] | None = None,
    at: tuple[float, ...] = (),
) -> Iterator[PathStep]:
    """All steps from the initial state on, or those after a ``checkpoint``. The equations are renewed
    in the states ``renewals`` of another path, or where the deformation requires it. Further positions ``at``
    are saved.

    NumericalError if the path cannot be continued, if det F <= 0, or if the law has lost ellipticity."""
    most, steps, path = scene.case.solver.max_steps, 0, _Path(scene, renewals)
    wanted = sorted({*(scene.case.output.at or [float(len(scene.stages) - 1)]), *at})
    if checkpoint is None:
        first = State(0.0, scene.stages[0], displacement=path.x)
        start = Checkpoint(first, {"base_state": path.x})
        yield PathStep(first, (first,) if 0.0 in wanted else (), checkpoint=start)
    goes_on = checkpoint if checkpoint is not None and checkpoint.heading.size else None
    for stage in range(int(goes_on.history["stage"]) if goes_on is not None else 0, len(scene.stages) - 1):
        path.begin(stage, [position - stage for position in wanted if stage < position <= stage + 1])
        if goes_on is not None:
            path.take_up(goes_on, [position - stage for position in at if stage < position <= stage + 1])
            goes_on = None
        for step in path.steps():
            steps += 1
            if steps > most:
                message = f"max steps, more than {most} steps come before the end"
                raise NumericalError(f"the path stopped: {message}", "raise solver.max_steps")
            yield step


class _Path:
    """Current state ``x`` (2N,) of the path at load factor ``lam`` of a stage, and its equations."""

    def __init__(self, scene: FiniteScene, renewals: Sequence[State] | None) -> None:
        self._scene, self._given, self._spent = scene, renewals, Effort()
        solver = scene.case.solver
        # Steps are counted over the whole path, not here.
        self._options: AnmOptions | NewtonOptions = NewtonOptions(solver.tolerance, "arc-length")
        if solver.method != "newton":
            self._options = AnmOptions(solver.tolerance, solver.order, solver.pade)
        self.x, self._lam = np.zeros(scene.unknowns), 0.0
        # The softest motion of the present state, and how many motions limit points have left unstable: no
        # load holds the body between them, but the path shows how it comes to snap.
        self._soft, self._folded = STILL, 0
        # The equations of the undeformed state, scaled by the linear response.
        stages = scene.stages
        projector = scene.projector(scene.alone[0], self.x, stages[0])
        problem, size = FiniteProblem(projector, stages[0], stages[0], 1.0), scene.size
        ends = [factors for factors in stages[1:] if factors.any()]
        moved = [replace(problem, end=end).load_derivative(self.x, 0.0) for end in ends]
        largest = max((float(np.abs(one).max()) for one in moved), default=0.0)
        self._problem = replace(problem, length=min(largest, size) if largest else size)

    def begin(self, stage: int, levels: list[float]) -> None:
        """Begin a ``stage``, with states wanted at the ``levels`` of its load factor."""
        start, end = self._scene.stages[stage : stage + 2]
        self._problem = replace(self._problem, start=start, end=end)
        self._stage, self._levels, self._lam = stage, levels, 0.0
        self._previous: Branch | None = None
        self._renewals = None
        if self._given is not None:
            self._renewals = [one for one in self._given if stage < one.position < stage + 1]

    def take_up(self, checkpoint: Checkpoint, more: list[float]) -> None:
        """Continue from a checkpoint within the stage, with ``more`` levels and the equations that its state
        solves."""
        self.x, history, heading = checkpoint.state.displacement, checkpoint.history, checkpoint.heading
        self._lam, name = float(history["lam"]), self._scene.alone[0]
        for keeps in (False, True):
            projector = self._scene.projector(name, history["base_state"], history["acting"], keeps)
            self._problem = replace(self._problem, projector=projector)
            if np.abs(self._problem.residual(self.x, self._lam)).max() <= self._options.tolerance:
                break
        x, lam = np.stack([self.x, heading[:-1]]), np.array([self._lam, heading[-1]])
        self._previous = Branch(x, lam, checkpoint.pace)
        self._levels = sorted({*history["levels"].tolist(), *more})
        self._soft, self._folded = self._problem.softest(self.x, self._lam), int(history["folded"])
        if history["renewed"]:
            self._renew()

    def steps(self) -> Iterator[PathStep]:
        """Steps from the present state to the end of the stage."""
        fresh = False
        while True:
            levels = [*self._levels, *self._renewal_level()]
            args = (self._problem, self.x, self._lam, 1.0, self._options, self._previous)
            follower = follow(*args, levels=levels, last=self._is_left)
            moved, left, branches = 0, False, False
            for whole in follower.steps():
                moved += 1
                ahead = self._problem.softest(whole.x, whole.lam, whole.tangent)
                fork, legs = self._fork(whole, ahead)
                branches = bool(legs)
                for step, soft in legs or ((whole, ahead),):
                    finished = self._finished(step, soft)
                    if fork is not None:
                        finished, fork = replace(finished, bifurcations=(fork,)), None
                    self.x, self._lam, self._previous = step.x, step.lam, step.branch
                    left = not branches and self._is_left(step.x, step.lam)
                    if left:
                        if self._renewals is not None:
                            self._renewals.pop(0)
                        renewed = finished.factorizations + 1
                        finished = replace(finished, renewed=True, factorizations=renewed)
                    yield replace(finished, checkpoint=self._checkpoint(finished, step))
                if left or branches:
                    break
            if branches:
                continue
            if follower.reached:
                return
            if follower.reason is not StopReason.STOPPED_BY_CALLER:
                if (fresh and not moved) or np.array_equal(self._problem.projector.base_state, self.x):
                    where = (self._stage + self._lam, self._problem.factors(self._lam))
                    raise path_failure(self._scene, *where, self.x, follower)
                fresh = True
            self._renew()

    def _renewal_level(self) -> list[float]:
        """Load factor of the next given renewal, if there is one."""
        return [one.position - self._stage for one in (self._renewals or ())[:1]]

    def _is_left(self, x: FloatArray, lam: float) -> bool:
        """Whether the equations are renewed at a state ``x`` (2N,), the end of a step."""
        if lam == 1.0:
            return False
        projector = self._problem.projector
        if self._renewals is None:
            return far_from(projector.body, x, projector.base_state)
        if not self._renewals or abs(lam - self._renewal_level()[0]) > FINE_ROUND_OFF:
            return False
        # The same load factor may be passed several times.
        apart = np.abs(x - self._renewals[0].displacement).max()
        return bool(apart <= SAME_STATE * self._problem.length)

    def _checkpoint(self, finished: PathStep, step: Step) -> Checkpoint:
        """The equations, the place in the stage, the levels left in it, and the direction of the path."""
        branch, base = step.branch, self._problem.projector
        history = {
            "base_state": base.base_state,
            "acting": base.factors,
            "stage": np.array(self._stage),
            "lam": np.array(step.lam),
            "levels": np.array(self._levels),
            "renewed": np.array(finished.renewed),
            "folded": np.array(self._folded),
        }
        return Checkpoint(finished.state, history, np.append(branch.x[1], branch.lam[1]), branch.length)

    def _renew(self) -> None:
        """Renew the equations at the current state, and correct the state. Next to crushed corners the
        correction may fail: then the equations keep the residual of their rows, which the state solves."""
        for keeps in (False, True):
            factors = self._problem.factors(self._lam)
            projector = self._scene.projector(self._scene.alone[0], self.x, factors, keeps)
            problem = replace(self._problem, projector=projector)
            x, rest = self.x, problem.residual(self.x, self._lam)
            try:
                for _ in range(MAX_UPDATES):
                    if np.abs(rest).max() <= self._options.goal:
                        break
                    better = x - problem.length * rest
                    left = problem.residual(better, self._lam)
                    # Larger corrections need Newton's method with new tangents.
                    if not np.abs(left).max() < np.abs(rest).max():
                        break
                    x, rest = better, left
                self.x = correct(problem, x, self._lam, self._options, self._spent).x
                self._problem = problem
                return
            except NumericalError:
                if keeps:
                    raise

    def _finished(self, step: Step, soft: SoftMotion) -> PathStep:
        """A step to a state with its softest motion."""
        before, self._soft, turns = self._soft, soft, step.limit_points
        if turns:
            self._folded = soft.unstable
        hidden = 0 if step.lam in self._levels else self._folded
        state = self._state(step.lam, step.x, step.residual, max(soft.unstable - hidden, 0))
        saved, left = [], []
        for level in self._levels:
            at = step.branch.first_crossing(level)
            if level == step.lam:
                saved.append((step.branch.length, state))
            elif at is not None:
                x = step.branch.evaluate(at)[0]
                if not step.order:
                    x = correct(self._problem, x, level, self._options).x
                residual = float(np.abs(self._problem.residual(x, level)).max())
                unstable = (before if turns and at <= turns[0][0] else soft).unstable
                saved.append((at, self._state(level, x, residual, unstable)))
            else:
                left.append(level)
        self._levels = left
        updates, factorizations, solves = step.counts
        spent, self._spent = factorizations + self._spent["factorizations"], Effort()
        parts = np.arange(1.0, WORK_PARTS) / WORK_PARTS * step.branch.length if step.order else ()
        points = (step.branch.evaluate(part) for part in parts)
        return PathStep(
            state,
            tuple(one for _, one in sorted(saved, key=lambda pair: pair[0])),
            step.arc_length,
            step.order,
            *(updates, spent, solves),
            limit_points=tuple((self._stage + step.branch.load_factor(a), high) for a, high in turns),
            way=tuple(self._state(lam, x, 0.0, 0) for x, lam in points),
            missed=partial(missed_alone, self._problem.projector, step.x, state.factors),
        )

    def _state(self, lam: float, x: FloatArray, residual: float, unstable: int) -> State:
        """A state with a number of ``unstable`` motions."""
        factors, counted = self._problem.factors(lam), {"unstable": np.array(unstable)}
        return State(self._stage + lam, factors, residual=residual, displacement=x, solver=counted)

    def _fork(self, step: Step, ahead: SoftMotion) -> tuple[Bifurcation | None, Legs]:
        """The bifurcation in a ``step`` to a state whose softest motion is ``ahead``: a loss of stability
        that is no limit point. The steps, with the softest motions at their ends, that lead to it and on to a
        stable state of the other branch; there are none without one nearby."""
        problem, branch, turns = self._problem, step.branch, step.limit_points
        if not self._soft.stable or ahead.unstable <= len(turns):
            return None, ()

        def at(a: float) -> Correction:
            x, lam = branch.evaluate(a)
            # Branches of Newton's method are on the path at their ends only.
            return Correction(x, lam, 0.0) if step.order else correct(problem, x, lam, self._options)

        def resistance(a: float) -> float:
            point = at(a)
            return problem.softest(point.x, point.lam).resistance

        a = 0.0
        if resistance(a) > 0.0:
            a = root(resistance, a, branch.length, BIFURCATION_PRECISION * branch.length)
        if turns and turns[0][0] <= a:
            return None, ()
        point = at(a)
        mode = problem.softest(point.x, point.lam)
        part = mode.part_in(point.x)
        motion = -mode.motion if part < 0.0 else mode.motion
        second = self._branched(point, motion)
        found = Bifurcation(self._stage + point.lam, motion, second is not None, bool(part))
        if second is None:
            return found, ()
        way = step.arc_length * a / branch.length
        first = replace(step, branch=branch.shortened(a), x=point.x, lam=point.lam, arc_length=way)
        return found, ((first, mode), second)

    def _branched(self, point: Correction, mode: FloatArray) -> tuple[Step, SoftMotion] | None:
        """The step from a bifurcation to a stable state of the other branch, and the softest motion there.
        The projection of their difference on the ``mode`` (2N,) is a part of the body's extent."""
        along, size = mode / (mode @ mode), BRANCH_STEP * self._scene.size

        def in_plane(dx: FloatArray, slope: FloatArray) -> float:
            return -float(along @ dx) / float(along @ slope)

        for part in 0.5 ** np.arange(BRANCH_TRIALS):
            effort, start = Effort(), point.x + part * size * mode
            try:
                end = iterate(self._problem, start, point.lam, in_plane, self._options, effort)
            except SingularTangentError:
                continue
            if end.residual <= self._options.tolerance:
                break
        else:
            return None
        if end.lam >= 1.0:
            return None
        soft = self._problem.softest(end.x, end.lam)
        x, lam = np.array([point.x, end.x - point.x]), np.array([point.lam, end.lam - point.lam])
        step = Step(Branch(x, lam, 1.0), end.x, end.lam, end.residual, BRANCH_STEP, effort, 0)
        return (step, soft) if soft.stable else None
