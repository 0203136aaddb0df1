"""``mlsanm compare`` at finite strain: power series and Newton's method, on the same equations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mlsanm_cli.app.comparison.differences import agreement, same_law_limit
from mlsanm_cli.app.comparison.measure import ANM, NEWTON, Measured, Method, measure_path
from mlsanm_cli.app.context import Clock, Console, RunContext
from mlsanm_cli.app.finite.path import finite_path
from mlsanm_cli.app.finite.scene import FiniteScene, finite_scene
from mlsanm_cli.app.finite.states import FiniteState, FiniteStep, renewals_of
from mlsanm_cli.app.output.writer import attributes
from mlsanm_cli.app.scene.build import build_scene
from mlsanm_cli.app.scene.imported import load_with_files
from mlsanm_cli.case import LoadedCase
from mlsanm_cli.errors import RunError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.summary import write_json_atomic

OTHER_EQUATIONS_LIMIT = 1e-2
"""Largest difference, relative to the largest displacement, if Newton's method could not use the equations of
the power series and renewed them in other states: a part of the discretisation error."""


def compare_finite(
    loaded: LoadedCase,
    case_path: Path,
    levels: list[float],
    *,
    overrides: tuple[str, ...],
    tolerance: float | None,
    repeat: int,
    directory: Path,
    force: bool,
    threads: int,
    console: Console,
    argv: tuple[str, ...],
) -> Mapping[str, Any]:
    """Follows the path by both methods; returns the mapping of comparison.json with the directory."""
    clock = Clock()
    wanted = load_with_files(case_path, (*overrides, f"output.at={levels!r}"))
    run_dir.check_comparison(directory, force)
    prepared = build_scene(wanted, RunContext(clock, console))
    with clock.phase("operators"):
        scene = finite_scene(wanted.case, prepared)
    console.phase(f"following the path: {ANM}")
    series, renewals = _followed(scene, ANM, repeat, None)
    console.phase(f"following the path: {NEWTON}")
    newton, renewed = _followed(scene, NEWTON, repeat, renewals)
    rows = [series, newton]
    shared = len(renewed) == len(renewals)
    limit = same_law_limit(wanted.case) if shared else OTHER_EQUATIONS_LIMIT
    limit = limit if tolerance is None else tolerance
    table = [_figures(row, series, limit, clock) for row in rows]
    result = {
        "status": agreement(table),
        "case": str(loaded.path),
        "title": loaded.case.title,
        "overrides": list(overrides),
        "levels": sorted(rows[0].states),
        "limits": {"displacement": limit},
        "nodes": scene.unknowns // 2,
        "contact_unknowns": 0,
        "methods": table,
        "seconds": clock.seconds,
        "provenance": attributes(loaded, argv, threads),
        "warnings": [],
    }
    run_dir.prepare_comparison(directory, force)
    write_json_atomic(directory / run_dir.COMPARISON_FILE, result)
    return {**result, "directory": str(directory)}


def refuse(contact: bool, methods: tuple[str, ...], analytic: bool) -> None:
    """Raises RunError for methods not available at finite strain, and if there is only one."""
    if contact:
        raise RunError(
            "finite strain with contact or several bodies has a single method: there is nothing to compare"
        )
    for name in methods:
        if name != "newton":
            raise RunError(f"--{name}: finite strain has power series and Newton's method only", "--newton")
    if analytic:
        raise RunError("--analytic: there is no closed formula for finite strain", "--newton")
    if not methods:
        raise RunError("nothing to compare ANM with", "add --newton")


def _followed(
    scene: FiniteScene, method: str, repeat: int, renewals: tuple[FiniteState, ...] | None
) -> tuple[Measured, tuple[FiniteState, ...]]:
    """The path by one method, with equations renewed at the given states, and the states where they were."""
    solver = scene.case.solver.model_copy(update={"method": method})
    chosen = replace(scene, case=scene.case.model_copy(update={"solver": solver}))
    steps: list[FiniteStep] = []

    def path() -> Iterator[FiniteStep]:
        steps.clear()
        return finite_path(chosen, renewals=renewals)

    found = measure_path(Method(method, ()), "finite strain", path, repeat, steps.append)
    return found, renewals_of(steps)


def _figures(row: Measured, base: Measured, limit: float, clock: Clock) -> dict[str, Any]:
    """One method as in comparison.json."""
    found = row.row(sum(clock.seconds[phase] for phase in ("cloud", "operators")))
    if row is base or not (row.done and base.done):
        return found
    apart = _apart(row.states, base.states)
    return found | {
        "against": base.method.name,
        "difference": {"pressure": 0.0, "traction": 0.0, "displacement": apart},
        "limit": limit,
        "agrees": apart <= limit,
    }


def _apart(one: Mapping[float, FiniteState], other: Mapping[float, FiniteState]) -> float:
    """Largest difference of displacements relative to the largest one, over all common levels."""
    shared = sorted(one.keys() & other.keys())
    largest = max((float(np.abs(other[level].displacement).max()) for level in shared), default=0.0)
    differences = [float(np.abs(one[k].displacement - other[k].displacement).max()) for k in shared]
    return max(differences, default=0.0) / largest if largest else 0.0
