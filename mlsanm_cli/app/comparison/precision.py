"""Work-precision curves: cost of the methods against their error relative to the exact law."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from mlsanm_cli.app.comparison.differences import surface_error
from mlsanm_cli.app.comparison.measure import ACTIVE_SET, Measured, Method, measure, method_of
from mlsanm_cli.case import Case
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.plots.plots import WorkCurve, plot_precision
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import State

ETA_FACTORS = (100.0, 10.0)
"""Multiples of the eta of the case at which the regularised methods are also measured."""
MAX_ETA = 0.1
"""For larger eta the regularised law does not represent contact."""


def precision_curves(
    built: CondensedScene, rows: Sequence[Measured], case_of: Callable[[Method], Case]
) -> dict[str, Any]:
    """L2 error against the exact law, CPU seconds and factorisations, of the regularised (``smooth``) methods
    by name and eta, and cost of the ``exact`` method, if measured. ``case_of`` returns
    the case of a method. A method that fails at some eta has no point there; there are no points if the exact
    law has no states."""
    case = built.case
    exact = next((row for row in rows if row.done and row.method.is_exact), None)

    def measured(name: str, factor: float = 1.0) -> Measured:
        method = method_of(case, name, factor)
        return measure(built, method, case_of(method))

    of_law = measured(ACTIVE_SET) if exact is None else exact
    if not of_law.done:
        return {"smooth": {}, "exact": None}
    eta = max(contact.regularization.eta for contact in case.touching)
    smooth = {}
    for row in rows:
        if row.method.is_exact:
            continue
        points = [(f * eta, measured(row.method.name, f)) for f in ETA_FACTORS if f * eta <= MAX_ETA]
        points.append((eta, row))
        smooth[row.method.name] = [
            _point(built, of_law.states, value, one) for value, one in points if one.done
        ]
    cost = exact and {"seconds": exact.seconds, "factorizations": exact.factorizations}
    return {"smooth": smooth, "exact": cost}


def _point(
    built: CondensedScene, exact: Mapping[float, State], eta: float, row: Measured
) -> dict[str, float]:
    return {
        "eta": eta,
        "error": surface_error(built, row.states, exact),
        "seconds": row.seconds,
        "factorizations": row.factorizations,
    }


def draw_precision(directory: Path, curves: Mapping[str, Any]) -> None:
    """Draws the picture in the directory of comparison.json."""
    plot_precision(
        directory / run_dir.picture_name("comparison", "png"),
        [
            WorkCurve(
                name,
                [point["error"] for point in points],
                [point["seconds"] for point in points],
                [point["factorizations"] for point in points],
                [f"eta {point['eta']:.2g}" for point in points],
            )
            for name, points in curves["smooth"].items()
        ],
        curves["exact"] and (curves["exact"]["seconds"], curves["exact"]["factorizations"]),
    )
