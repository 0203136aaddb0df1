"""Path of the regularised laws along the stages of a case.

With friction a stage is divided into ``solver.increments`` equal parts, at whose ends the stick references
follow the plastic slips; within a part the path is one smooth curve, whatever method follows it.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.complementarity.problem import ContactStatus
from mlsanm_cli.continuation import follow
from mlsanm_cli.continuation.corrector import Effort, correct
from mlsanm_cli.continuation.problem import AnmOptions, NewtonOptions
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.paper.system import System
from mlsanm_cli.records import dataclass
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import Checkpoint, PathStep, State

SYMBOLS = {"pressure": "p", "gap": "h", "motion": "q", "traction": "t"}
"""Unknowns in /series of run.h5, by name."""


def paper_path(built: CondensedScene, start: Checkpoint | None = None) -> Iterator[PathStep]:
    """Path of the scene, or its remaining part. NumericalError if the path cannot be continued."""
    system, stages, solver = System(built), built.stages, built.case.solver
    asked = 10 if solver.increments == "auto" else solver.increments
    parts = asked if len(system.law.mu) else 1
    ends, stage, position = np.arange(1.0, parts + 1.0) / parts, 0, 0.0
    options: AnmOptions | NewtonOptions = NewtonOptions(solver.tolerance)
    if solver.method != "newton":
        options = AnmOptions(solver.tolerance, solver.order, solver.pade)
    if start is None:
        effort = Effort()
        found = correct(system, system.drawn(), 0.0, options, effort)
        point = Point(system, found.x, 0.0, np.zeros(len(system.law.mu)))
        state = point.state(0, found.residual)
        saved = (state,) if 0.0 in built.outputs else ()
        counts = effort["updates"], effort["factorizations"], effort["solves"]
        yield PathStep(state, saved, 0.0, 0, *counts, checkpoint=Checkpoint(state))
    else:
        stage, position = min(start.stage, len(stages) - 2), start.position
        state, x = start.state, np.zeros(system.size)
        x[system.places["u"]] = state.displacement
        for name, symbol in SYMBOLS.items():
            x[system.places[symbol]] = getattr(state, name)
        x = system.with_plastic_slips(x)
        a, b = system.split(x, "ab")
        reference = state.slip + system.law.compliance * state.traction + a - b
        system = system.changed(start=stages[stage], end=stages[stage + 1], reference=reference)
        point = Point(system, x, position - stage, state.work)
        point = replace(point, work=2.0 * state.work - point.dissipated())
        if position in stage + np.append(0.0, ends):
            point = point.with_moved_references()
    while True:
        for end in ends[stage + ends > position]:
            point = yield from _increment(point, stage, float(end), options)
        stage += 1
        if stage == len(stages) - 1:
            return
        system = point.system.changed(start=stages[stage], end=stages[stage + 1])
        point = replace(point, system=system, lam=0.0)


@dataclass(frozen=True, eq=False)
class Point:
    """A point of the path: unknowns, fraction of the stage, and the work (n,) dissipated before."""

    system: System
    x: FloatArray
    lam: float
    work: FloatArray

    def overrun(self) -> FloatArray:
        """Motion (n,) of the stick references that the plastic slips ask for: beyond the elastic slip."""
        (a, b), limit = self.system.split(self.x, "ab"), self.system.law.elastic_slip
        return np.asarray(np.maximum(b - limit, 0.0) - np.maximum(a - limit, 0.0))

    def dissipated(self) -> FloatArray:
        """Work (n,) dissipated so far."""
        return np.asarray(self.work - self.system.split(self.x, "t")[0] * self.overrun())

    def with_moved_references(self) -> Point:
        """The same with stick references that have followed the plastic slips, to be corrected slightly."""
        system, x = self.system, self.x.copy()
        for name in "ab":
            x[system.places[name]] = np.minimum(x[system.places[name]], system.law.elastic_slip)
        system = system.changed(reference=system.reference + self.overrun())
        return Point(system, x, self.lam, self.dissipated())

    def state(self, stage: int, residual: float) -> State:
        """The state at this point. A node is closed if its pressure, in units of the scene, exceeds its gap,
        and slips if it has slipped by more than its asperities deform."""
        law, nodes = self.system.law, self.system.built.condensed.friction_nodes
        p, h, q, t, a, b, u = self.system.split(self.x, "phqtabu")
        closed = p / law.pressure > h / law.gap
        stuck = closed[nodes] & (np.maximum(a, b) < law.elastic_slip)
        status = ContactStatus(closed, stuck, np.sign(t)).status(nodes)
        slip, factors = self.system.reference - law.compliance * t - a + b, self.system.factors(self.lam)
        return State(stage + self.lam, factors, p, h, q, status, residual, t, slip, self.dissipated(), u)


def _increment(
    point: Point, stage: int, end: float, options: AnmOptions | NewtonOptions
) -> Generator[PathStep, None, Point]:
    """Steps to the fraction ``end`` of a stage; returns the point there, with moved references."""
    system = point.system
    wanted = [level for level in system.built.outputs if level <= stage + end]
    levels = [level - stage for level in wanted if stage < level < stage + end]
    follower = follow(system, point.x, point.lam, end, options, levels=levels)
    for step in follower.steps():
        before, point, residual = point, replace(point, x=step.x, lam=step.lam), step.residual
        saved, effort = list[State](), Effort(step.effort)
        for level in [one for one in wanted if stage + before.lam < one <= stage + step.lam]:
            x, lam = step.x, step.lam
            if level < stage + lam:
                x, lam = step.branch.evaluate(step.branch.parameter_at(level - stage))
            # Series only satisfy the tolerance, while results are compared to the last digit.
            better = correct(system, x, lam, options, effort)
            found = replace(before, x=better.x, lam=lam)
            if lam == step.lam:
                point, residual = found, better.residual
            saved.append(replace(found.state(stage, better.residual), position=level))
        series, branch = dict[str, FloatArray](), step.branch
        # Predictors of Newton-Raphson between states are not stored.
        if step.order:
            series["position"] = np.concatenate([[stage + branch.lam[0]], branch.lam[1:]])
            series |= {name: system.split(branch.x, symbol)[0] for name, symbol in SYMBOLS.items()}
            series = {name: values for name, values in series.items() if values.size}
            if branch.denominator is not None:
                series["denominator"] = branch.denominator
        state = point.state(stage, residual)
        yield PathStep(
            state,
            tuple(saved),
            step.arc_length,
            step.order,
            effort["updates"],
            effort["factorizations"],
            effort["solves"],
            series=series,
            series_attributes={"length": branch.length, "stage": stage},
            limit_points=tuple((stage + branch.load_factor(a), high) for a, high in step.limit_points),
            checkpoint=Checkpoint(state),
        )
    if not follower.reached:
        raise NumericalError(
            f"the path stopped at position {stage + follower.lam:.6g}: {follower.reason.value}",
            f'{follower.message}; raise contact.regularization.eta, or use its law = "exact"',
        )
    return point.with_moved_references()
