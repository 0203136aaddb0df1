"""The load path: states at its start, after every step, and at the positions where fields are wanted.

Positions count stages: 1.25 is a quarter of the way through the second stage.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from mlsanm_cli.app.build import Built
from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.active_set import ExactState, solve_exact
from mlsanm_cli.contact.hyperbolic import HyperbolicContact, Regularization
from mlsanm_cli.contact.scales import regularize
from mlsanm_cli.continuation import AnmOptions, Branch, Step, correct, follow
from mlsanm_cli.errors import NumericalError

BRANCH_HINT = (
    'raise contact.regularization.eta or solver.tolerance, or use contact.regularization.law = "exact"'
)


@dataclass(frozen=True)
class State:
    """One state: load factors (L,), pressures and gaps (m,), unknown motions (k,), closed nodes (m,)."""

    position: float
    factors: FloatArray
    pressure: FloatArray
    gap: FloatArray
    motion: FloatArray
    closed: BoolArray
    residual: float

    @property
    def unknowns(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Load factors, motions and pressures, as linear maps take them."""
        return self.factors, self.motion, self.pressure


@dataclass(frozen=True)
class PathStep:
    """A finished step: the state at its end, the wanted states in it (its end included), what it cost.

    ``series`` holds the arrays from which any state of the step can be had again (ANM only).
    """

    state: State
    saved: tuple[State, ...]
    length: float = 0.0
    order: int = 0
    factorizations: int = 0
    solves: int = 0
    series: Mapping[str, FloatArray] = field(default_factory=dict)
    series_attributes: Mapping[str, float | str] = field(default_factory=dict)


def wanted_positions(built: Built) -> tuple[float, ...]:
    """Where fields are asked for, in order; the end of the path where nothing is said."""
    return tuple(sorted(set(built.case.output.at))) or (float(len(built.case.stage)),)


def _stops(built: Built) -> list[float]:
    """The start, the stages' ends and the wanted positions, in order."""
    ends = np.arange(0.0, len(built.case.stage) + 1.0).tolist()
    return sorted({*ends, *wanted_positions(built)})


def factors_at(stages: FloatArray, position: float) -> FloatArray:
    """Load factors (L,) at a path position."""
    stage = min(int(position), len(stages) - 2)
    fraction = position - stage
    result: FloatArray = (1.0 - fraction) * stages[stage] + fraction * stages[stage + 1]
    return result


def path_of(built: Built) -> Iterator[PathStep]:
    """The path of the scene by the method its contact law asks for."""
    if not built.case.contact:
        return linear_path(built)
    if built.case.contact[0].regularization.law == "exact":
        return exact_path(built)
    return anm_path(built)


def linear_path(built: Built) -> Iterator[PathStep]:
    """A scene without contact: every state is a combination of the loads' own solutions."""
    wanted = wanted_positions(built)
    condensed = built.condensed
    for position in _stops(built):
        factors = factors_at(built.stages, position)
        nothing = np.zeros(0)
        motion: FloatArray = np.zeros(len(condensed.balance.constant))
        if len(motion):
            solved = np.linalg.solve(condensed.balance.motion, -condensed.balance.load @ factors)
            motion = np.asarray(solved, dtype=np.float64)
        closed = np.zeros(0, dtype=bool)
        state = State(position, factors, nothing, nothing, motion, closed, 0.0)
        yield PathStep(
            state, (state,) if position in wanted else (), solves=0 if position else condensed.solves
        )


def exact_path(built: Built) -> Iterator[PathStep]:
    """Exact contact at the stages' ends and wherever fields are wanted, each from the set before."""
    wanted = wanted_positions(built)
    start = _unloaded(built)
    yield PathStep(start, (start,) if 0.0 in wanted else ())
    active: BoolArray | None = None
    for position in _stops(built)[1:]:
        exact = solve_exact(built.condensed, factors_at(built.stages, position), active)
        active = exact.active
        state = _state_of(exact, position)
        saved = (state,) if position in wanted else ()
        yield PathStep(state, saved, factorizations=exact.solves, solves=2 * exact.solves)


def _unloaded(built: Built) -> State:
    """The start of the path: as drawn, unless the surfaces overlap there."""
    gap, factors = built.condensed.gap, built.stages[0]
    if gap.constant.min() >= 0.0:
        zero = np.zeros(len(gap.constant))
        motion = np.zeros(len(built.condensed.balance.constant))
        return State(0.0, factors, zero, gap.constant, motion, gap.constant <= 0.0, 0.0)
    return _state_of(solve_exact(built.condensed, factors), 0.0)


def _state_of(exact: ExactState, position: float) -> State:
    return State(
        position, exact.factors, exact.pressure, exact.gap, exact.motion, exact.active, exact.residual
    )


def anm_path(built: Built) -> Iterator[PathStep]:
    """The hyperbolic law followed by power series; wanted states come from the series of their step."""
    wanted = wanted_positions(built)
    law = regularize(built.condensed, built.ends, built.case.contact[0].regularization.eta)
    solver = built.case.solver
    options = AnmOptions(
        order=solver.order, tolerance=solver.tolerance, pade=solver.pade, max_steps=solver.max_steps
    )
    x = _start_point(built, law)
    for stage in range(len(built.case.stage)):
        problem = HyperbolicContact(built.condensed, law, built.stages[stage], built.stages[stage + 1])
        if stage == 0:
            corrected = correct(problem, x, 0.0, options)
            x = corrected.x
            start = _regularized_state(problem, x, 0.0, stage, corrected.residual)
            yield PathStep(
                start,
                (start,) if 0.0 in wanted else (),
                factorizations=corrected.factorizations,
                solves=corrected.solves,
            )
        if not problem.change.any():
            state = _regularized_state(problem, x, 1.0, stage, float(np.abs(problem.residual(x, 1.0)).max()))
            yield PathStep(state, tuple(replace(state, position=p) for p in wanted if stage < p <= stage + 1))
            continue
        follower = follow(problem, x, 0.0, 1.0, options)
        before = 0.0
        for step in follower.steps():
            if step.lam == 1.0:
                step = _sharpened(problem, step)
            x = step.x
            end = _regularized_state(problem, x, step.lam, stage, step.residual)
            saved = [p for p in wanted if stage + before < p <= stage + step.lam]
            yield _path_step(problem, step, end, stage, tuple(saved))
            before = step.lam
        outcome = follower.outcome
        if not outcome.reached:
            raise NumericalError(
                f"the path stopped at position {stage + outcome.lam:.6g}: "
                f"{outcome.reason.value} ({outcome.message})",
                "raise solver.max_steps" if outcome.reason.value == "max steps" else BRANCH_HINT,
            )


def _sharpened(problem: HyperbolicContact, step: Step) -> Step:
    """The step with one more Newton update at its end, where users compare figures to the last digit.

    The path itself is only followed to its tolerance, and where its steps end depends on round-off.
    """
    try:
        tangent = problem.tangent(step.x, step.lam)
    except np.linalg.LinAlgError:  # a fold at the very target: the step's own end keeps the tolerance
        return step
    x = step.x + tangent.solve(-problem.residual(step.x, step.lam))
    residual = float(np.abs(problem.residual(x, step.lam)).max())
    step = replace(step, factorizations=step.factorizations + 1, solves=step.solves + 1)
    if residual < step.residual and problem.admissible(x, step.lam):
        step = replace(step, x=x, residual=residual)
    return step


def _start_point(built: Built, law: Regularization) -> FloatArray:
    """Open gaps as drawn, closed or overlapping ones opened a little, and the pressures that go with them."""
    gap = np.maximum(built.condensed.gap.constant, 0.1 * law.gap)
    pressure = law.eta * (law.delta / gap - 1.0)
    return np.concatenate([pressure, gap, np.zeros(len(law.motion))])


def _path_step(
    problem: HyperbolicContact, step: Step, end: State, stage: int, wanted: tuple[float, ...]
) -> PathStep:
    saved = []
    for position in wanted:
        if position == end.position:
            saved.append(end)
            continue
        x, lam = step.branch.evaluate(step.branch.parameter_at(position - stage))
        residual = float(np.abs(problem.residual(x, lam)).max())
        # The position asked for, not the one a last bit away that the series was evaluated at.
        saved.append(replace(_regularized_state(problem, x, lam, stage, residual), position=position))
    return PathStep(
        state=end,
        saved=tuple(saved),
        length=step.arc_length,
        order=step.order,
        factorizations=step.factorizations,
        solves=step.solves,
        series=_series(problem, step.branch, stage),
        series_attributes={"length": step.branch.length, "stage": stage},
    )


def _series(problem: HyperbolicContact, branch: Branch, stage: int) -> dict[str, FloatArray]:
    """Coefficients over the path parameter a, 0 <= a <= length; with ``denominator`` the Pade form holds."""
    pressure, gap, motion = problem.split(branch.x)
    position = branch.lam.copy()
    position[0] += stage
    arrays = {"position": position, "pressure": pressure, "gap": gap, "motion": motion}
    return arrays if branch.denominator is None else {**arrays, "denominator": branch.denominator}


def _regularized_state(
    problem: HyperbolicContact, x: FloatArray, lam: float, stage: int, residual: float
) -> State:
    pressure, gap, motion = problem.split(x)
    law = problem.law
    # A node counts as closed where its pressure, in units of the scene, has outgrown its gap.
    closed = pressure / law.pressure > gap / law.gap
    return State(stage + lam, problem.factors(lam), pressure, gap, motion, closed, residual)
