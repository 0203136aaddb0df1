"""``mlsanm compare``: several methods on the same scene and operators, by the rules of
docs/methods-compared.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mlsanm_cli.app.checks.references import read_case
from mlsanm_cli.app.comparison.methods import ACTIVE_SET, Comparison, Measured, refuse
from mlsanm_cli.app.context import Clock, Console, RunContext
from mlsanm_cli.app.output.recorder import attributes
from mlsanm_cli.case import LoadedCase
from mlsanm_cli.inputs import results_of
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.files import write_json_atomic
from mlsanm_cli.io.plots.curves import Curve, Panel, Picture, draw
from mlsanm_cli.io.plots.figures import REFERENCE_LINE


def compare(
    case_path: Path,
    *,
    methods: Sequence[str] = (),
    analytic: bool = False,
    levels: int = 10,
    tolerance: float | None = None,
    repeat: int = 1,
    picture: bool = True,
    overrides: tuple[str, ...] = (),
    out: Path | None = None,
    force: bool = False,
    threads: int = 1,
    console: Console,
    argv: tuple[str, ...] = (),
) -> Mapping[str, Any]:
    """Solves a case by several methods and writes comparison.json and a picture.

    ``methods`` besides ANM; ``analytic``: errors against the reference of the case; ``levels`` per stage at
    which states are compared; ``tolerance``: largest difference between methods with the same law (None: from
    solver.tolerance); ``repeat``: repetitions of each path; ``picture``: whether to draw the diagram.

    Returns the mapping of comparison.json with the ``directory`` added; its ``status`` is "agree", "disagree"
    (or a method other than ANM failed) or "failed" (ANM failed). Raises CaseError or RunError, with nothing
    written, for an invalid case or an unsuitable method, NumericalError for a scene that cannot be set up.
    """
    context = RunContext(Clock(), console)

    def changed(*changes: str) -> LoadedCase:
        return read_case(case_path, (*overrides, *changes))

    loaded, directory = changed(), out or results_of(case_path)
    refuse(loaded.case, methods, analytic)
    run_dir.check_comparison(directory, force)
    # Ends of stages, positions of the case, and even levels; rounded, so that equal ones are one number.
    stages = range(len(loaded.case.stage))
    even = {round(stage + i / levels, 12) for stage in stages for i in range(1, levels + 1)}
    even |= {position for position in loaded.case.output.at if position > 0.0}
    scene = Comparison(methods, context, changed, sorted(even))
    rows = []
    for name in scene.methods:
        console.phase(f"following the path: {name}")
        rows.append(scene.measure(name, repeat))
    scene.judge(rows[0])
    limits = scene.limits(tolerance)
    table = [figures(scene, row, rows, context.clock, analytic, limits) for row in rows]
    agree = all(row["status"] == "done" and row.get("agrees", True) for row in table)
    result = {
        "case": str(loaded.path),
        "title": loaded.case.title,
        "overrides": list(overrides),
        "status": "failed" if rows[0].failure else "agree" if agree else "disagree",
        "levels": sorted(rows[0].states),
        "limits": limits,
        **scene.sizes,
        "methods": table,
    }
    curves = scene.curves(rows) if picture and not rows[0].failure else {}
    result |= {"precision": curves} if curves else {}
    for warning in scene.warnings:
        console.warning(warning)
    result |= {
        "warnings": scene.warnings,
        "seconds": context.clock.seconds,
        "provenance": attributes(loaded, argv, threads),
    }
    run_dir.prepare_comparison(directory, force)
    if curves.get("smooth"):
        draw_precision(directory, curves)
    write_json_atomic(directory / run_dir.COMPARISON_FILE, result)
    return {**result, "directory": str(directory)}


def figures(
    scene: Comparison,
    row: Measured,
    rows: Sequence[Measured],
    clock: Clock,
    analytic: bool,
    limits: Mapping[str, float],
) -> dict[str, Any]:
    """One method as in comparison.json, with the seconds of its set-up, and its differences from the
    first of the preceding methods with the same law, else from ANM."""
    own, exact = (row.factorizations, row.solves), row.name == ACTIVE_SET
    dense, sparse = (own, scene.condensed) if exact else ((0, 0), own)
    setup = ("cloud", "operators", *(("factorization", "condensation") if exact else ()))
    found: dict[str, Any] = {
        "method": row.name,
        "law": row.law,
        "status": "failed" if row.failure else "done",
        "steps": row.steps,
        "iterations": row.iterations,
        "dense_factorizations": dense[0],
        "sparse_factorizations": sparse[0],
        "dense_solves": dense[1],
        "sparse_solves": sparse[1],
        "seconds_setup": sum(clock.seconds[phase] for phase in setup),
        "seconds_path": row.seconds,
    }
    if row.failure:
        return found | {"reason": row.failure, "hint": row.hint}
    if analytic:
        found["reference_error"] = scene.reference_error(row)
    before = [one for one in rows[: rows.index(row)] if not one.failure]
    against = next(iter([*(one for one in before if one.law == row.law), *before]), None)
    if against is None:
        return found
    same = against.law == row.law
    limit = next(iter(limits.values())) if same else limits["other_law"]
    apart = scene.difference(row.states, against.states)
    agrees = all(value <= limit for value in apart.values())
    found |= {"against": against.name, "difference": apart, "limit": limit, "agrees": agrees}
    return found if same or agrees else found | scene.convergence(row, against)


def draw_precision(directory: Path, curves: Mapping[str, Any]) -> None:
    """Draws errors against CPU seconds and against factorisations, one curve per method, in the directory of
    comparison.json. The cost for the exact law, the reference of the errors, is a vertical line."""
    errors = [point["error"] for points in curves["smooth"].values() for point in points]
    panels = []
    labels = {"seconds": "CPU seconds of the path", "factorizations": "factorisations of tangents"}
    for key, label in labels.items():
        drawn, notes = [], []
        for name, points in curves["smooth"].items():
            cost, error = (np.array([point[part] for point in points]) for part in (key, "error"))
            drawn.append(Curve(cost, error, name))
            if key == "factorizations":
                notes += [(f"eta {one['eta']:.2g}", one[key], one["error"]) for one in points]
        if curves["exact"] and errors:
            cost = np.full(2, curves["exact"][key])
            ends = np.array([min(errors), max(errors)])
            drawn.append(Curve(cost, ends, "active set, exact law", REFERENCE_LINE))
        panels.append(Panel(drawn, label, "pressure, error against the exact law", notes=notes, scale="log"))
    picture = Picture(panels, "", "outside upper center", (8.4, 3.8), beside=True)
    draw(directory / run_dir.picture_name("comparison", "png"), picture)
