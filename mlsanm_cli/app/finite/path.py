"""The path of one body without contact at finite strain: stage by stage, its equations renewed as it
deforms."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.app.finite.verdict import check_deformation, path_failure
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.finite.exact import Pressed
from mlsanm_cli.continuation import AnmOptions, Branch, NewtonOptions, Step, correct, follow
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.problem import FiniteProblem

RENEW = 1.25
"""The equations are renewed behind a step at whose end some node is stretched by more than this, or by less
than 1 over it, against the state that they are of. Block of 289 nodes, 40 % down
between platens that stick: with those of the reference all along 24 steps, at degree 4 onto another branch;
renewed, two steps, whether from 1.15 or 1.5."""
TURNED = 1.2
"""Or has turned by more than this angle: J_0^T W^2 J(u) loses its sign with rotations beyond a right angle. A
column that buckled until its end had turned by 100 degrees met limit points that there are not, and went back
to negative loads."""
MENDS = 25
"""Updates with the new equations' own factor that take a state to them; each leaves about a fifth."""
UNLIMITED = 1_000_000
PARTS = 8
"""Parts of a step of power series over which work is added up: by its ends alone it was 0.7 % off where a
column with two spacings across, bent beyond a right angle, was 9 % too stiff."""
SAME_LEVEL, SAME_STATE = 1e-12, 1e-3
"""Load factors, and displacements over the scene's length, of one state as two paths find it."""
SAMPLES = 65
"""Places of a step at which the slope of the load factor is looked at, to find where it turns."""


@dataclass(frozen=True)
class FiniteState:
    """One state of the path: position, load factors (L,), nodal displacement (2N,) of all bodies in turn,
    residual; in contact also ``pressed``, what Newton's method found there, and of friction the slips (c,) so
    far and the work (c,) per length of the slave that it has dissipated."""

    position: float
    factors: FloatArray
    displacement: FloatArray
    residual: float
    pressed: Pressed | None = None
    slip: FloatArray = field(default_factory=lambda: np.zeros(0))
    work: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def stability(self) -> float:
        """How well the contacts resist pressures that change from node to node."""
        return np.inf if self.pressed is None else self.pressed.stability

    def shown(self, scene: FiniteScene) -> FloatArray:
        """The displacements (2N,) by which bodies are shown."""
        return scene.shown(self.displacement, self.pressed.surface) if self.pressed else self.displacement

    @property
    def whole(self) -> FloatArray:
        """Load factors and free motions (L + d,)."""
        return self.factors if self.pressed is None else np.append(self.factors, self.pressed.free)

    @property
    def traction(self) -> FloatArray:
        """Nominal tractions (2s,) at the nodes of all sides in contact."""
        return np.zeros(0) if self.pressed is None else self.pressed.traction


@dataclass(frozen=True)
class Turn:
    """A limit point: where the load factors turn back, and whether it is a maximum of them."""

    position: float
    maximum: bool


@dataclass(frozen=True)
class FiniteStep:
    """A finished step: the state at its end, wanted states in it as they follow each other (its end may be
    one), what it cost, limit points in it, and states on the ``way`` of a power series.

    ``renewed`` means that the equations were renewed at its end; ``mark`` is what the path continues from.
    """

    state: FiniteState
    saved: tuple[FiniteState, ...] = ()
    length: float = 0.0
    order: int = 0
    iterations: int = 0
    factorizations: int = 0
    solves: int = 0
    turns: tuple[Turn, ...] = ()
    renewed: bool = False
    mark: FiniteMark | None = None
    way: tuple[FiniteState, ...] = ()


@dataclass(frozen=True)
class FiniteMark:
    """What a path continues from: a ``state``; the ``station`` (2N,) of the equations of all bodies in turn,
    and ``acting`` (l,), the factors of the bodies' loads there, in turn; the ``pace``, of contacts the next
    increment, of power series the length of the last step.

    Power series also know the ``stage`` and the part ``lam`` of it, the ``direction`` (2N + 1,) of the path,
    ``levels`` of the stage still to come, and whether equations are to be ``renewed`` first.
    """

    state: FiniteState
    station: FloatArray
    acting: FloatArray
    pace: float
    stage: int = 0
    lam: float = 0.0
    direction: FloatArray = field(default_factory=lambda: np.zeros(0))
    levels: FloatArray = field(default_factory=lambda: np.zeros(0))
    renewed: bool = False

    @property
    def branch(self) -> Branch | None:
        """The direction as a straight piece of path, if there is any."""
        if not self.direction.size:
            return None
        x = np.stack([self.state.displacement, self.direction[:-1]])
        return Branch(x, np.array([self.lam, self.direction[-1]]), self.pace)


def finite_path(
    scene: FiniteScene, mark: FiniteMark | None = None, renewals: Sequence[FiniteState] | None = None
) -> Iterator[FiniteStep]:
    """All steps, the start first, or those behind a ``mark``. The equations are renewed in the states of
    another path (``renewals_of``), or where the deformation asks for it.

    Raises NumericalError where the path breaks off, or where a state has no sense: det F <= 0, or a law that
    has lost ellipticity."""
    stages, case = scene.stages, scene.case
    wanted = sorted(set(case.output.at)) or [float(len(stages) - 1)]
    problem, x = _first_problem(scene), np.zeros(scene.unknowns)
    if mark is None:
        first = FiniteState(0.0, stages[0], x, 0.0)
        start = FiniteMark(first, x, stages[0], 0.0, levels=np.array(wanted))
        yield FiniteStep(first, (first,) if 0.0 in wanted else (), mark=start)
    elif mark.direction.size:
        x, problem = mark.state.displacement, _taken_up(scene, problem, mark)
    steps, begun = 0, mark.stage if mark is not None else 0
    for stage in range(begun, len(stages) - 1):
        problem = replace(problem, start=stages[stage], end=stages[stage + 1])
        levels = [position - stage for position in wanted if stage < position <= stage + 1]
        path = _Stage(scene, problem, stage, levels, renewals)
        if mark is not None and stage == begun and mark.direction.size:
            path.take_up(mark)
        for step in path.steps(x):
            steps += 1
            if steps > case.solver.max_steps:
                message = f"max steps, more than {case.solver.max_steps} steps come before the end"
                raise NumericalError(f"the path stopped: {message}", "raise solver.max_steps")
            yield step
        x, problem = path.x, path.problem


def renewals_of(steps: Sequence[FiniteStep]) -> tuple[FiniteState, ...]:
    """The states in which a path has renewed its equations, in their order."""
    return tuple(
        before.state
        for before, after in pairwise(steps)
        if before.mark and after.mark and not np.array_equal(before.mark.station, after.mark.station)
    )


def _first_problem(scene: FiniteScene) -> FiniteProblem:
    """The equations of the reference state, scaled by what the linear body would do."""
    (name, body), stages = scene.alone, scene.stages
    still = np.zeros(body.unknowns)
    projector = scene.projector(name, still, stages[0])
    problem = FiniteProblem(body, projector, stages[0], stages[0], 1.0)
    size = scene.size
    moved = [
        float(np.abs(replace(problem, end=factors).load_derivative(still, 0.0)).max())
        for factors in stages[1:]
        if factors.any()
    ]
    largest = max(moved, default=0.0)
    return replace(problem, length=min(largest, size) if largest else size)


def _taken_up(scene: FiniteScene, problem: FiniteProblem, mark: FiniteMark) -> FiniteProblem:
    """The equations of a ``mark``: those that its state solves."""
    start = replace(problem, start=mark.state.factors)
    for keeps in (False, True):
        projector = scene.projector(scene.alone[0], mark.station, mark.acting, keeps)
        problem = replace(start, projector=projector)
        left = np.abs(problem.residual(mark.state.displacement, 0.0)).max()
        if left <= scene.case.solver.tolerance:
            break
    return problem


class _Stage:
    """The way through one stage."""

    def __init__(
        self,
        scene: FiniteScene,
        problem: FiniteProblem,
        stage: int,
        levels: list[float],
        renewals: Sequence[FiniteState] | None,
    ) -> None:
        self._scene, self.problem, self._stage = scene, problem, stage
        self._levels = list(levels)
        self._renewals = (
            None if renewals is None else [one for one in renewals if stage < one.position < stage + 1]
        )
        self.x = np.zeros(0)
        self._lam = 0.0
        self._station, self._acting = problem.projector.station, problem.start
        self._previous: Branch | None = None
        self._spent = 0

    def take_up(self, mark: FiniteMark) -> None:
        """Go on behind a ``mark``."""
        self.x, self._lam, self._previous = mark.state.displacement, mark.lam, mark.branch
        self._acting, self._levels = mark.acting, mark.levels.tolist()
        if mark.renewed:
            self._renew()

    def steps(self, x: FloatArray) -> Iterator[FiniteStep]:
        """The steps from a state ``x`` (2N,) at the stage's start to its end, or from what was taken up."""
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
            )
            moved = 0
            for step in follower.steps():
                moved += 1
                self._check(step)
                finished = self._finished(step)
                self.x, self._lam, self._previous = step.x, step.lam, step.branch
                if step.lam != 1.0 and self._is_renewed_behind(step):
                    follower.stop()
                    finished = replace(finished, renewed=True, factorizations=finished.factorizations + 1)
                yield replace(finished, mark=self._mark(finished, step))
            outcome = follower.outcome
            if outcome.reached:
                return
            if outcome.reason.value != "stopped by caller":
                if (fresh and not moved) or np.array_equal(self._station, self.x):
                    where = (self._stage + self._lam, self.problem.factors(self._lam))
                    raise path_failure(self._scene, *where, self.x, outcome)
                fresh = True
            self._renew()

    def _renewal_level(self) -> list[float]:
        """The load factor of the next of the given renewals, if there is one."""
        return [one.position - self._stage for one in (self._renewals or ())[:1]]

    def _is_renewed_behind(self, step: Step) -> bool:
        if self._renewals is None:
            return far_from(self.problem.body, step.x, self._station)
        if not self._renewals or abs(step.lam - self._renewal_level()[0]) > SAME_LEVEL:
            return False
        # A path that turns back passes a load factor more than once.
        apart = np.abs(step.x - self._renewals[0].displacement).max()
        if apart > SAME_STATE * self.problem.length:
            return False
        self._renewals.pop(0)
        return True

    def _check(self, step: Step) -> None:
        position = self._stage + step.lam
        check_deformation(self._scene, position, self.problem.factors(step.lam), step.x)

    def _mark(self, finished: FiniteStep, step: Step) -> FiniteMark:
        branch, levels = step.branch, np.array(self._levels)
        direction = np.append(branch.x[1], branch.lam[1])
        place = (self._stage, step.lam, direction, levels, finished.renewed)
        return FiniteMark(finished.state, self._station, self._acting, branch.length, *place)

    def _renew(self) -> None:
        """Take the equations of the present state, and the state to them. Next to crushed corners that way
        may lead nowhere: then they keep what their rows are left with, and the state solves them as it is."""
        factors = self.problem.factors(self._lam)
        self._station, self._acting = self.x, factors
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
        """The state next to the present one that solves the equations of a ``problem``; NumericalError where
        none is found."""
        x, rest = self.x, problem.residual(self.x, self._lam)
        options = _options(self._scene)
        for _ in range(MENDS):
            if np.abs(rest).max() <= options.goal:
                break
            better = x - problem.length * rest
            left = problem.residual(better, self._lam)
            # Where the way is longer than the station's own tangent is good for, Newton's method goes it.
            if not np.abs(left).max() < np.abs(rest).max():
                break
            x, rest = better, left
        found = correct(problem, x, self._lam, options)
        self._spent += found.factorizations
        return found.x

    def _finished(self, step: Step) -> FiniteStep:
        state = self._state(step.lam, step.x, step.residual)
        saved, left = [], []
        for level in self._levels:
            at = step.branch.first_crossing(level) if step.order else None
            if level == step.lam:
                saved.append((step.branch.length, state))
            elif at is not None:
                x = step.branch.evaluate(at)[0]
                residual = float(np.abs(self.problem.residual(x, level)).max())
                saved.append((at, self._state(level, x, residual)))
            else:
                left.append(level)
        self._levels = left
        passed = tuple(one for _, one in sorted(saved, key=lambda pair: pair[0]))
        turns = _turns(step.branch, self._stage) if step.order else ()
        spent, self._spent = step.factorizations + self._spent, 0
        counts = (step.order, step.iterations, spent, step.solves)
        parts = np.arange(1.0, PARTS) / PARTS * step.branch.length if step.order else ()
        points = (step.branch.evaluate(part) for part in parts)
        way = tuple(self._state(lam, x, 0.0) for x, lam in points)
        return FiniteStep(state, passed, step.arc_length, *counts, turns, way=way)

    def _state(self, lam: float, x: FloatArray, residual: float) -> FiniteState:
        position = self._stage + lam
        return FiniteState(position, self.problem.factors(lam), x, residual)


def _options(scene: FiniteScene) -> AnmOptions | NewtonOptions:
    """The case's method; steps are counted over the whole path."""
    solver = scene.case.solver
    if solver.method == "newton":
        return NewtonOptions(tolerance=solver.tolerance, max_steps=UNLIMITED, control="arc-length")
    return AnmOptions(order=solver.order, tolerance=solver.tolerance, pade=solver.pade, max_steps=UNLIMITED)


def _turns(branch: Branch, stage: int) -> tuple[Turn, ...]:
    """The limit points within a step."""
    a = np.linspace(0.0, branch.length, SAMPLES)
    slope = branch.derivative_weights(a) @ branch.terms[1]
    found = []
    for k in np.flatnonzero(slope[:-1] * slope[1:] < 0.0):
        low, high = a[k], a[k + 1]
        for _ in range(50):
            middle = 0.5 * (low + high)
            here = float((branch.derivative_weights(np.array([middle])) @ branch.terms[1])[0])
            low, high = (middle, high) if here * slope[k] > 0.0 else (low, middle)
        found.append(Turn(stage + branch.load_factor(0.5 * (low + high)), bool(slope[k] > 0.0)))
    return tuple(found)


def far_from(body: FiniteBody, displacement: FloatArray, station: FloatArray) -> bool:
    """Whether a body of a ``displacement`` (2N,) is so far from the ``station`` (2N,) of its equations that
    these are renewed: stretched, or turned, somewhere."""
    if most_stretched(body, displacement, station) > RENEW:
        return True
    angles = []
    for one in (displacement, station):
        xx, xy, yx, yy = body.gradient(one)
        angles.append(np.arctan2(yx - xy, 2.0 + xx + yy))
    turned = np.abs(np.exp(1j * angles[0]) - np.exp(1j * angles[1])).max()
    return bool(turned > 2.0 * np.sin(0.5 * TURNED))


def most_stretched(body: FiniteBody, displacement: FloatArray, station: FloatArray) -> float:
    """By how much a node is stretched at most between the ``station`` (2N,) and a ``displacement`` (2N,), or
    1 over by how little."""
    now, then = (
        (body.gradient(u) + np.array([1.0, 0.0, 0.0, 1.0])[:, None]).T.reshape(-1, 2, 2)
        for u in (displacement, station)
    )
    ratios = np.linalg.svd(now @ np.linalg.inv(then), compute_uv=False)
    return float(max(ratios.max(), 1.0 / ratios.min()))
