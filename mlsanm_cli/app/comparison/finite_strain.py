"""``mlsanm compare`` at finite strain: power series and Newton's method, on the same equations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from mlsanm_cli.app.checks.check import Verdicts
from mlsanm_cli.app.comparison.compare import Changed, CompareOptions
from mlsanm_cli.app.comparison.measure import (
    ANM,
    NEWTON,
    Measured,
    Method,
    agreement,
    compared,
    measure_path,
    same_law_limit,
)
from mlsanm_cli.app.context import Clock, RunContext
from mlsanm_cli.app.finite.path import finite_path
from mlsanm_cli.app.finite.scene import FiniteScene, finite_scene
from mlsanm_cli.app.finite.states import deformation
from mlsanm_cli.app.scene.build import build_scene
from mlsanm_cli.case import Case
from mlsanm_cli.errors import RunError
from mlsanm_cli.solve.state import PathStep, State

OTHER_EQUATIONS_LIMIT = 1e-2
"""Largest difference, relative to the largest displacement, if Newton's method could not use the equations of
the power series and renewed them in other states: a part of the discretisation error."""


def followed(
    options: CompareOptions, context: RunContext, changed: Changed, with_levels: Changed
) -> tuple[dict[str, Any], Mapping[str, Any]]:
    """Follows the path by both methods; entries of comparison.json, and no curves of the picture."""
    loaded = with_levels()
    prepared = build_scene(loaded, context)
    with context.phase("operators"):
        scene = finite_scene(loaded.case, prepared)
    context.console.phase(f"following the path: {ANM}")
    series, renewals = _followed(scene, ANM, options.repeat, None)
    context.console.phase(f"following the path: {NEWTON}")
    newton, renewed = _followed(scene, NEWTON, options.repeat, renewals)
    shared = len(renewed) == len(renewals)
    limit = same_law_limit(loaded.case) if shared else OTHER_EQUATIONS_LIMIT
    limit = limit if options.tolerance is None else options.tolerance
    table = [_figures(row, series, limit, context.clock) for row in (series, newton)]
    entries = {
        "status": agreement(table),
        "levels": sorted(series.states),
        "limits": {"displacement": limit},
        "nodes": scene.unknowns // 2,
        "contact_unknowns": 0,
        "methods": table,
    }
    return entries, {}


def refuse(case: Case, options: CompareOptions) -> None:
    """Raises RunError for methods not available at finite strain, and if there is only one."""
    if case.contact or len(case.body) > 1:
        raise RunError(
            "finite strain with contact or several bodies has a single method: there is nothing to compare"
        )
    for name in options.methods:
        if name != "newton":
            raise RunError(f"--{name}: finite strain has power series and Newton's method only", "--newton")
    if options.analytic:
        raise RunError("--analytic: there is no closed formula for finite strain", "--newton")
    if not options.methods:
        raise RunError("nothing to compare ANM with", "add --newton")


def _followed(
    scene: FiniteScene, method: str, repeat: int, renewals: tuple[State, ...] | None
) -> tuple[Measured, tuple[State, ...]]:
    """The path by one method, with equations renewed at the given states, and the states where they were."""
    solver = scene.case.solver.model_copy(update={"method": method})
    chosen = replace(scene, case=scene.case.model_copy(update={"solver": solver}))
    steps, verdicts = list[PathStep](), Verdicts(lambda check: None)

    def take(step: PathStep) -> None:
        steps.append(step)
        verdicts.judge(deformation(chosen, step.state))

    def path() -> Iterator[PathStep]:
        steps.clear()
        return finite_path(chosen, renewals=renewals)

    found = measure_path(Method(method, ()), "finite strain", path, repeat, take)
    return found, _renewals(steps)


def _renewals(steps: Sequence[PathStep]) -> tuple[State, ...]:
    """The states in which a path has renewed its equations, in order."""
    bases = [step.checkpoint.history["base_state"] for step in steps if step.checkpoint]
    pairs = zip(steps, pairwise(bases), strict=False)
    return tuple(step.state for step, ends in pairs if not np.array_equal(*ends))


def _figures(row: Measured, base: Measured, limit: float, clock: Clock) -> dict[str, Any]:
    """One method as in comparison.json."""
    found = row.row(sum(clock.seconds[phase] for phase in ("cloud", "operators")))
    if row is base or not (row.done and base.done):
        return found
    apart = _apart(row.states, base.states)
    differences = {"pressure": 0.0, "traction": 0.0, "displacement": apart}
    return found | compared(base.method.name, differences, limit)


def _apart(one: Mapping[float, State], other: Mapping[float, State]) -> float:
    """Largest difference of displacements relative to the largest one, over all common levels."""
    shared = sorted(one.keys() & other.keys())
    largest = max((float(np.abs(other[level].displacement).max()) for level in shared), default=0.0)
    differences = [float(np.abs(one[k].displacement - other[k].displacement).max()) for k in shared]
    return max(differences, default=0.0) / largest if largest else 0.0
