"""Path of the regularised laws along the stages of a case.

With friction a stage is divided into ``solver.increments`` equal parts, at whose ends the stick references follow
the plastic slips; within a part the path is one smooth curve, the same for power series and Newton-Raphson.
"""

from __future__ import annotations

import sys
from collections.abc import Generator, Iterator
from dataclasses import dataclass, replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.contact_status import STICK, ContactStatus
from mlsanm_cli.continuation import AnmOptions, Branch, NewtonOptions, correct, follow
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.paper.system import Increment, System
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import Checkpoint, FrictionHistory, PathStep, State, output_positions

HINT = 'raise contact.regularization.eta or solver.tolerance, or use contact.regularization.law = "exact"'


@dataclass(frozen=True, eq=False)
class Point:
    """A point of the path: unknowns, fraction of the stage, and dissipated work (n,)."""

    problem: Increment
    x: FloatArray
    lam: float
    work: FloatArray

    def moved(self, x: FloatArray, lam: float) -> Point:
        """A later point of the same increment, with the work of the tractions on the plastic slips."""
        split = self.problem.system.split
        (a0, b0, t0), (a1, b1, t1) = split(self.x, "abt"), split(x, "abt")
        return replace(self, x=x, lam=lam, work=self.work + 0.5 * (t0 + t1) * (a1 - a0 - b1 + b0))

    def with_moved_references(self) -> Point:
        """The same with stick references that have followed the plastic slips, to be corrected slightly."""
        system = self.problem.system
        a, b = system.split(self.x, "ab")
        rest = system.law.moved_reference(self.problem.reference, a, b)
        x = self.x.copy()
        for name in "ab":
            x[system.places[name]] = np.minimum(x[system.places[name]], system.law.elastic_slip)
        return replace(self, problem=replace(self.problem, reference=rest), x=x)

    def state(self, stage: int, residual: float) -> State:
        """The state at this point. A node is closed if its pressure, in units of the scene, exceeds its gap; it
        slips if it has slipped by more than its asperities deform."""
        system, law, lam = self.problem.system, self.problem.system.law, self.lam
        p, h, q, t, a, b, u = system.split(self.x, "phqtabu")
        closed = p / law.pressure > h / law.gap
        nodes = system.built.condensed.friction_nodes
        stuck = closed[nodes] & (np.maximum(a, b) < law.elastic_slip)
        status = ContactStatus(closed, stuck, np.sign(t)).status(nodes)
        slip = self.problem.slip(self.x, lam)
        factors = self.problem.factors(lam)
        return State(stage + lam, factors, p, h, q, status, residual, t, slip, self.work, u)


def paper_path(built: CondensedScene, start: Checkpoint | None = None) -> Iterator[PathStep]:
    """Path of the scene, or its remaining part. Requested states are evaluated from the series of their step, or
    are ends of Newton steps. NumericalError if the path cannot be continued."""
    system, options, stages = System.of(built), _options(built), built.stages
    first, position, previous = 0, 0.0, None
    if start is None:
        still = np.zeros(len(system.law.mu))
        problem = Increment(system, stages[0], stages[1], still)
        found = correct(problem, system.drawn(), 0.0, options)
        point = Point(problem, found.x, 0.0, still)
        state = point.state(0, found.residual)
        saved = (state,) if 0.0 in output_positions(built) else ()
        counts = found.updates, found.factorizations, found.solves
        yield PathStep(state, saved, 0.0, 0, *counts, checkpoint=_checkpoint(point, state, None))
    else:
        first, position = min(start.stage, len(stages) - 2), start.position
        point, previous = _restored(system, start, first)
    parts = built.case.solver.increments if len(system.law.mu) else 1
    for stage in range(first, len(stages) - 1):
        if stage > first:
            problem = replace(point.problem, start=stages[stage], end=stages[stage + 1])
            point, previous = replace(point, problem=problem, lam=0.0), None
        for end in np.arange(1.0, parts + 1.0) / parts:
            if stage + end > position:
                point, previous = yield from _increment(point, stage, float(end), previous, options)


def _increment(
    point: Point, stage: int, end: float, previous: Branch | None, options: AnmOptions | NewtonOptions
) -> Generator[PathStep, None, tuple[Point, Branch | None]]:
    """Steps to the fraction ``end`` of a stage, in the direction of a ``previous`` piece; returns the point there
    with the references moved, and the last piece."""
    problem = point.problem
    wanted = [one for one in output_positions(problem.system.built) if stage < one <= stage + end]
    levels = [one - stage for one in wanted if one < stage + end]
    follower = follow(problem, point.x, point.lam, end, options, previous, levels=levels)
    for step in follower.steps():
        before, last = point, step.lam == end
        x, residual, more = step.x, step.residual, 0
        if last and step.order:
            x, residual = _sharpened(problem, x, end)
            more += 1
        point = point.moved(x, step.lam)
        state, saved = point.state(stage, residual), []
        for level in wanted:
            if not stage + before.lam < level <= stage + step.lam:
                continue
            if step.order and level < stage + step.lam:
                x, lam = step.branch.evaluate(step.branch.parameter_at(level - stage))
                x, residual = _sharpened(problem, x, lam)
                more += 1
                # The series has the position up to round-off.
                saved.append(replace(before.moved(x, lam).state(stage, residual), position=level))
            else:
                saved.append(replace(state, position=level))
        piece = follower.outcome.piece
        if last:
            point = point.with_moved_references()
        yield PathStep(
            state,
            tuple(saved),
            step.arc_length,
            step.order,
            step.iterations + more,
            step.factorizations + more,
            step.solves + more,
            # Predictors of Newton-Raphson between states are not stored.
            series=_series(problem.system, step.branch, stage) if step.order else {},
            series_attributes={"length": step.branch.length, "stage": stage},
            checkpoint=_checkpoint(point, state, piece),
        )
    outcome = follower.outcome
    if not outcome.reached:
        where = f"the path stopped at position {stage + outcome.lam:.6g}"
        raise NumericalError(f"{where}: {outcome.reason.value} ({outcome.message})", HINT)
    return point, outcome.piece


def _options(built: CondensedScene) -> AnmOptions | NewtonOptions:
    """Method and options of the case; steps are counted over the whole path."""
    solver = built.case.solver
    if solver.method == "newton":
        return NewtonOptions(tolerance=solver.tolerance, max_steps=sys.maxsize)
    return AnmOptions(order=solver.order, tolerance=solver.tolerance, pade=solver.pade, max_steps=sys.maxsize)


def _sharpened(problem: Increment, x: FloatArray, lam: float) -> tuple[FloatArray, float]:
    """Unknowns of a state from a series after one Newton update, if that is better, and their residual. Series
    only satisfy the tolerance, while results are compared to the last digit."""
    defect = problem.residual(x, lam)
    better = x - problem.tangent(x, lam).solve(defect)
    before, after = (float(np.abs(rows).max()) for rows in (defect, problem.residual(better, lam)))
    return (better, after) if after < before and problem.admissible(better, lam) else (x, before)


def _series(system: System, branch: Branch, stage: int) -> dict[str, FloatArray]:
    """Coefficients of position and unknowns in the path parameter a, 0 <= a <= length; with ``denominator`` of the
    Pade form."""
    position = branch.lam.copy()
    position[0] += stage
    names = {"pressure": "p", "gap": "h", "motion": "q", "traction": "t"}
    found = {name: system.split(branch.x, symbol)[0] for name, symbol in names.items()}
    found = {name: values for name, values in found.items() if name != "traction" or values.size}
    ratio = {} if branch.denominator is None else {"denominator": branch.denominator}
    return {"position": position, **found, **ratio}


def _checkpoint(point: Point, state: State, piece: Branch | None) -> Checkpoint:
    """Checkpoint at a point with its state and references, and the direction of the last ``piece``."""
    stuck = state.status[point.problem.system.built.condensed.friction_nodes] == STICK
    history = FrictionHistory(ContactStatus(state.closed, stuck, np.sign(state.traction)), point.problem.reference)
    found = Checkpoint(state, history)
    if piece is None:
        return found
    return replace(found, heading=np.append(piece.x[1], piece.lam[1]), pace=piece.length)


def _restored(system: System, start: Checkpoint, stage: int) -> tuple[Point, Branch | None]:
    """The point of a checkpoint, and the linear piece of path before it."""
    state, history = start.state, start.history
    assert history is not None
    lam, x = start.position - stage, np.zeros(len(system.scale))
    unknowns = (state.displacement, state.gap, state.pressure, state.traction, state.motion)
    for name, values in zip("uhptq", unknowns, strict=True):
        x[system.places[name]] = values
    x = system.with_plastic_slips(x)
    begin, end = system.built.stages[stage : stage + 2]
    point = Point(Increment(system, begin, end, history.stick_reference), x, lam, state.work)
    if not len(start.heading) or start.fraction == 0.0:
        return point, None
    ends = np.array([x, start.heading[:-1]]), np.array([lam, start.heading[-1]])
    return point, Branch(*ends, start.pace)
