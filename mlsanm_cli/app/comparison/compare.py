"""``mlsanm compare``: several methods on the same scene and operators. The rules of the comparison are in
docs/methods-compared.md."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from mlsanm_cli.app.checks.references import check_reference
from mlsanm_cli.app.comparison.precision import draw_precision
from mlsanm_cli.app.context import Clock, Console, RunContext
from mlsanm_cli.app.output.checkpoint import attributes
from mlsanm_cli.app.run import RESULTS
from mlsanm_cli.app.scene.imported import load_with_files
from mlsanm_cli.case import Case, LoadedCase
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.summary import write_json_atomic
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class CompareOptions:
    """Options of a comparison.

    ``methods`` besides ANM; ``analytic``: errors against the reference of the case; ``levels`` per stage at
    which states are compared; ``tolerance``: largest difference between methods with the same law (None: from
    solver.tolerance); ``repeat``: repetitions of each path; ``picture``: whether to draw the diagram.
    """

    methods: tuple[str, ...] = ()
    analytic: bool = False
    levels: int = 10
    tolerance: float | None = None
    repeat: int = 1
    picture: bool = True


Changed = Callable[..., LoadedCase]
"""Returns the case with further changes."""


def compare(
    case_path: Path,
    options: CompareOptions,
    *,
    overrides: tuple[str, ...] = (),
    out: Path | None = None,
    force: bool = False,
    threads: int = 1,
    console: Console,
    argv: tuple[str, ...] = (),
) -> Mapping[str, Any]:
    """Solves a case by several methods and writes comparison.json and a picture.

    Returns the mapping of comparison.json with the ``directory`` added; its ``status`` is "agree", "disagree"
    (or a method other than ANM failed) or "failed" (ANM failed). Raises CaseError or RunError, with nothing
    written, for an invalid case or an unsuitable method, NumericalError for a scene that cannot be set up.
    """
    context = RunContext(Clock(), console)

    def changed(*changes: str) -> LoadedCase:
        return load_with_files(case_path, (*overrides, *changes))

    loaded, directory = changed(), out or RESULTS / case_path.stem
    check_reference(loaded)
    if loaded.case.model.strain == "small":
        from mlsanm_cli.app.comparison.small_strain import followed, refuse
    else:
        from mlsanm_cli.app.comparison.finite_strain import followed, refuse
    refuse(loaded.case, options)
    run_dir.check_comparison(directory, force)
    levels = f"output.at={_levels(loaded.case, options.levels)!r}"
    found, curves = followed(options, context, changed, partial(changed, levels))
    result = {
        "case": str(loaded.path),
        "title": loaded.case.title,
        "overrides": list(overrides),
        "warnings": [],
        **found,
        "seconds": context.clock.seconds,
        "provenance": attributes(loaded, argv, threads),
    }
    for warning in result["warnings"]:
        console.warning(warning)
    run_dir.prepare_comparison(directory, force)
    if curves.get("smooth"):
        draw_precision(directory, curves)
    write_json_atomic(directory / run_dir.COMPARISON_FILE, result)
    return {**result, "directory": str(directory)}


def _levels(case: Case, count: int) -> list[float]:
    """Ends of stages, positions of the case, and ``count`` even levels per stage."""
    stages = range(len(case.stage))
    # Rounded, so that equal levels of the case are the same number.
    even = {round(stage + i / count, 12) for stage in stages for i in range(1, count + 1)}
    return sorted(even | {position for position in case.output.at if position > 0.0})
