"""Path of one body without contact at finite strain; its equations are renewed as it deforms."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from mlsanm_cli.app.finite.accuracy import missed_alone
from mlsanm_cli.app.finite.branches import fork, limit_points, softest
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.app.finite.states import path_failure
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation import AnmOptions, Branch, NewtonOptions, Step, correct, follow
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.finite.body import far_from
from mlsanm_cli.mechanics.finite.problem import FiniteProblem
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
    stages, case = scene.stages, scene.case
    wanted = sorted({*(case.output.at or [float(len(stages) - 1)]), *at})
    problem, x = _first_problem(scene), np.zeros(scene.unknowns)
    if checkpoint is None:
        first = State(0.0, stages[0], displacement=x)
        start = Checkpoint(first, {"base_state": x})
        yield PathStep(first, (first,) if 0.0 in wanted else (), checkpoint=start)
    elif checkpoint.heading.size:
        x, problem = checkpoint.state.displacement, _taken_up(scene, problem, checkpoint)
    steps, begun = 0, int(checkpoint.history.get("stage", 0)) if checkpoint is not None else 0
    soft, folded = STILL, 0
    for stage in range(begun, len(stages) - 1):
        problem = replace(problem, start=stages[stage], end=stages[stage + 1])
        levels = [position - stage for position in wanted if stage < position <= stage + 1]
        path = _Stage(scene, problem, stage, levels, renewals, soft, folded)
        if checkpoint is not None and stage == begun and checkpoint.heading.size:
            path.take_up(checkpoint, [position - stage for position in at if stage < position <= stage + 1])
        for step in path.steps(x):
            steps += 1
            if steps > case.solver.max_steps:
                message = f"max steps, more than {case.solver.max_steps} steps come before the end"
                raise NumericalError(f"the path stopped: {message}", "raise solver.max_steps")
            yield step
        x, problem, soft, folded = path.x, path.problem, path.soft, path.folded


def _first_problem(scene: FiniteScene) -> FiniteProblem:
    """The equations of the undeformed state, scaled by the linear response."""
    (name, body), stages = scene.alone, scene.stages
    still = np.zeros(body.unknowns)
    projector = scene.projector(name, still, stages[0])
    problem = FiniteProblem(projector, stages[0], stages[0], 1.0)
    size = scene.size
    moved = [
        float(np.abs(replace(problem, end=factors).load_derivative(still, 0.0)).max())
        for factors in stages[1:]
        if factors.any()
    ]
    largest = max(moved, default=0.0)
    return replace(problem, length=min(largest, size) if largest else size)


def _taken_up(scene: FiniteScene, problem: FiniteProblem, checkpoint: Checkpoint) -> FiniteProblem:
    """The equations that the state of a checkpoint solves."""
    start, history = replace(problem, start=checkpoint.state.factors), checkpoint.history
    for keeps in (False, True):
        projector = scene.projector(scene.alone[0], history["base_state"], history["acting"], keeps)
        problem = replace(start, projector=projector)
        left = np.abs(problem.residual(checkpoint.state.displacement, 0.0)).max()
        if left <= scene.case.solver.tolerance:
            break
    return problem


class _Stage:
    """Path through one stage."""

    def __init__(
        self,
        scene: FiniteScene,
        problem: FiniteProblem,
        stage: int,
        levels: list[float],
        renewals: Sequence[State] | None,
        soft: SoftMotion,
        folded: int,
    ) -> None:
        self._scene, self.problem, self._stage = scene, problem, stage
        # The softest motion of the present state, and how many motions limit points have left unstable: no
        # load holds the body between them, but the path shows how it comes to snap.
        self.soft, self.folded = soft, folded
        self._levels = list(levels)
        self._renewals = (
            None if renewals is None else [one for one in renewals if stage < one.position < stage + 1]
        )
        self.x = np.zeros(0)
        self._lam = 0.0
        self._previous: Branch | None = None
        self._spent = 0

    def take_up(self, checkpoint: Checkpoint, more: list[float]) -> None:
        """Continue from a checkpoint, with ``more`` levels."""
        history, heading = checkpoint.history, checkpoint.heading
        self.x, self._lam = checkpoint.state.displacement, float(history["lam"])
        x, lam = np.stack([self.x, heading[:-1]]), np.array([self._lam, heading[-1]])
        self._previous = Branch(x, lam, checkpoint.pace)
        self._levels = sorted({*history["levels"].tolist(), *more})
        self.soft, self.folded = softest(self.problem, self.x, self._lam), int(history["folded"])
        if history["renewed"]:
            self._renew()

    def steps(self, x: FloatArray) -> Iterator[PathStep]:
        """Steps from the initial state ``x`` (2N,) of the stage, or from the checkpoint, to its end."""
        self.x, fresh = self.x if self._previous is not None else x, False
        while True:
            follower = follow(
                self.problem,
                self.x,
                self._lam,
                1.0,
                _options(self._scene),
                self._previous,
                levels=[*self._levels, *self._renewal_level()],
                last=self._is_left,
            )
            moved, branches = 0, False
            for whole in follower.steps():
                moved += 1
                ahead = softest(self.problem, whole.x, whole.lam, whole.tangent)
                branch = fork(self.problem, whole, self.soft, ahead, _options(self._scene), self._scene.size)
                branches = branch is not None and bool(branch.legs)
                for step, soft in branch.legs if branch is not None and branch.legs else ((whole, ahead),):
                    finished = self._finished(step, soft)
                    if branch is not None:
                        at = Bifurcation(self._stage + branch.lam, branch.motion, branches, branch.decided)
                        finished, branch = replace(finished, bifurcations=(at,)), None
                    self.x, self._lam, self._previous = step.x, step.lam, step.branch
                    if not branches and self._is_left(step.x, step.lam):
                        follower.stop()
                        if self._renewals is not None:
                            self._renewals.pop(0)
                        renewed = finished.factorizations + 1
                        finished = replace(finished, renewed=True, factorizations=renewed)
                    yield replace(finished, checkpoint=self._checkpoint(finished, step))
                if branches:
                    break
            if branches:
                continue
            outcome = follower.outcome
            if outcome.reached:
                return
            if outcome.reason.value != "stopped by caller":
                if (fresh and not moved) or np.array_equal(self.problem.projector.base_state, self.x):
                    where = (self._stage + self._lam, self.problem.factors(self._lam))
                    raise path_failure(self._scene, *where, self.x, outcome)
                fresh = True
            self._renew()

    def _renewal_level(self) -> list[float]:
        """Load factor of the next given renewal, if there is one."""
        return [one.position - self._stage for one in (self._renewals or ())[:1]]

    def _is_left(self, x: FloatArray, lam: float) -> bool:
        """Whether the equations are renewed at a state ``x`` (2N,), the end of a step, before the path goes
        on."""
        if lam == 1.0:
            return False
        if self._renewals is None:
            return far_from(self.problem.projector.body, x, self.problem.projector.base_state)
        if not self._renewals or abs(lam - self._renewal_level()[0]) > FINE_ROUND_OFF:
            return False
        # A path that turns back passes a load factor more than once.
        apart = np.abs(x - self._renewals[0].displacement).max()
        return bool(apart <= SAME_STATE * self.problem.length)

    def _checkpoint(self, finished: PathStep, step: Step) -> Checkpoint:
        """The equations, the place in the stage, the levels left in it, and the direction of the path."""
        branch, base = step.branch, self.problem.projector
        history = {
            "base_state": base.base_state,
            "acting": base.factors,
            "stage": np.array(self._stage),
            "lam": np.array(step.lam),
            "levels": np.array(self._levels),
            "renewed": np.array(finished.renewed),
            "folded": np.array(self.folded),
        }
        return Checkpoint(finished.state, history, np.append(branch.x[1], branch.lam[1]), branch.length)

    def _renew(self) -> None:
        """Renew the equations at the current state, and correct the state. Next to crushed corners the
        correction may fail: then the equations keep the residual of their rows, which the state solves."""
        factors = self.problem.factors(self._lam)
        name = self._scene.alone[0]
        for keeps in (False, True):
            projector = self._scene.projector(name, self.x, factors, keeps)
            problem = replace(self.problem, projector=projector)
            try:
                self.problem, self.x = problem, self._solving(problem)
                return
            except NumericalError:
                if keeps:
                    raise

    def _solving(self, problem: FiniteProblem) -> FloatArray:
        """The corrected state that solves the equations of a ``problem``. NumericalError if none is found."""
        x, rest = self.x, problem.residual(self.x, self._lam)
        options = _options(self._scene)
        for _ in range(MAX_UPDATES):
            if np.abs(rest).max() <= options.goal:
                break
            better = x - problem.length * rest
            left = problem.residual(better, self._lam)
            # Larger corrections need Newton's method with new tangents.
            if not np.abs(left).max() < np.abs(rest).max():
                break
            x, rest = better, left
        found = correct(problem, x, self._lam, options)
        self._spent += found.factorizations
        return found.x

    def _finished(self, step: Step, soft: SoftMotion) -> PathStep:
        """A step to a state with its softest motion."""
        before, self.soft, turns = self.soft, soft, limit_points(step)
        if turns:
            self.folded = soft.unstable
        hidden = 0 if step.lam in self._levels else self.folded
        state = self._state(step.lam, step.x, step.residual, max(soft.unstable - hidden, 0))
        saved, left = [], []
        for level in self._levels:
            at = step.branch.first_crossing(level)
            if level == step.lam:
                saved.append((step.branch.length, state))
            elif at is not None:
                x = step.branch.evaluate(at)[0]
                if not step.order:
                    x = correct(self.problem, x, level, _options(self._scene)).x
                residual = float(np.abs(self.problem.residual(x, level)).max())
                unstable = (before if turns and at <= turns[0][0] else soft).unstable
                saved.append((at, self._state(level, x, residual, unstable)))
            else:
                left.append(level)
        self._levels = left
        passed = tuple(one for _, one in sorted(saved, key=lambda pair: pair[0]))
        limits = tuple((self._stage + step.branch.load_factor(a), highest) for a, highest in turns)
        spent, self._spent = step.factorizations + self._spent, 0
        counts = (step.order, step.iterations, spent, step.solves)
        parts = np.arange(1.0, WORK_PARTS) / WORK_PARTS * step.branch.length if step.order else ()
        points = (step.branch.evaluate(part) for part in parts)
        way = tuple(self._state(lam, x, 0.0, 0) for x, lam in points)
        missed = partial(missed_alone, self.problem.projector, step.x, state.factors)
        step_end = PathStep(state, passed, step.arc_length, *counts)
        return replace(step_end, limit_points=limits, way=way, missed=missed)

    def _state(self, lam: float, x: FloatArray, residual: float, unstable: int) -> State:
        """A state with a number of ``unstable`` motions."""
        factors, counted = self.problem.factors(lam), {"unstable": np.array(unstable)}
        return State(self._stage + lam, factors, residual=residual, displacement=x, solver=counted)


def _options(scene: FiniteScene) -> AnmOptions | NewtonOptions:
    """Options of the case's method; steps are counted over the whole path, not here."""
    solver = scene.case.solver
    if solver.method == "newton":
        return NewtonOptions(tolerance=solver.tolerance, max_steps=sys.maxsize, control="arc-length")
    return AnmOptions(order=solver.order, tolerance=solver.tolerance, pade=solver.pade, max_steps=sys.maxsize)
