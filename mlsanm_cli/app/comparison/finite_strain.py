"""``mlsanm compare`` at finite strain: power series and Newton's method, on the same equations."""

from __future__ import annotations

import statistics
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mlsanm_cli.app.clock import Clock
from mlsanm_cli.app.comparison.differences import agreement, same_law_limit
from mlsanm_cli.app.comparison.methods import ANM, NEWTON
from mlsanm_cli.app.console import Console
from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.finite.path import finite_path
from mlsanm_cli.app.finite.scene import FiniteScene, finite_scene
from mlsanm_cli.app.finite.states import FiniteState, FiniteStep, renewals_of
from mlsanm_cli.app.output.provenance import attributes
from mlsanm_cli.app.scene.build import build_scene
from mlsanm_cli.app.scene.imported import load_with_files
from mlsanm_cli.case import LoadedCase
from mlsanm_cli.errors import NumericalError, RunError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.summary import write_json_atomic

OTHER_EQUATIONS_LIMIT = 1e-2
"""Largest difference, relative to the largest displacement, if Newton's method could not use the equations of
the power series and renewed them in other states: a part of the discretisation error."""


@dataclass(frozen=True)
class MethodPath:
    """The path of one method: its steps, CPU seconds, and the failure, if any."""

    method: str
    steps: tuple[FiniteStep, ...]
    seconds: float
    failure: NumericalError | None

    @property
    def states(self) -> dict[float, FiniteState]:
        """Saved states by position, where the path first reaches it."""
        return {state.position: state for step in reversed(self.steps) for state in reversed(step.saved)}


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
    series = _followed(scene, ANM, repeat, None)
    renewals = renewals_of(series.steps)
    console.phase(f"following the path: {NEWTON}")
    newton = _followed(scene, NEWTON, repeat, renewals)
    rows = [series, newton]
    shared = len(renewals_of(newton.steps)) == len(renewals)
    limit = same_law_limit(wanted.case) if shared else OTHER_EQUATIONS_LIMIT
    limit = limit if tolerance is None else tolerance
    table = [_figures(row, rows, limit, clock) for row in rows]
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
) -> MethodPath:
    """The path by one method, with equations renewed at the given states, and its median time."""
    changes = {"method": method}
    solver = scene.case.solver.model_copy(update=changes)
    chosen = replace(scene, case=scene.case.model_copy(update={"solver": solver}))
    times: list[float] = []
    steps: list[FiniteStep] = []
    failure: NumericalError | None = None
    for _ in range(repeat):
        begun, steps, failure = time.process_time(), [], None
        try:
            steps.extend(finite_path(chosen, renewals=renewals))
        except NumericalError as error:
            failure = error
        times.append(time.process_time() - begun)
    return MethodPath(method, tuple(steps), statistics.median(times), failure)


def _figures(row: MethodPath, rows: list[MethodPath], limit: float, clock: Clock) -> dict[str, Any]:
    """One method as in comparison.json."""
    found: dict[str, Any] = {
        "method": row.method,
        "law": "finite strain",
        "status": "failed" if row.failure else "done",
        "steps": max(len(row.steps) - 1, 0),
        "iterations": sum(step.iterations for step in row.steps),
        "dense_factorizations": 0,
        "sparse_factorizations": sum(step.factorizations for step in row.steps),
        "dense_solves": 0,
        "sparse_solves": sum(step.solves for step in row.steps),
        "seconds_setup": sum(clock.seconds[phase] for phase in ("cloud", "operators")),
        "seconds_path": row.seconds,
    }
    if row.failure:
        return found | {"reason": row.failure.message, "hint": row.failure.hint}
    base = rows[0]
    if row is base or base.failure:
        return found
    apart = _apart(row.states, base.states)
    return found | {
        "against": base.method,
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
