"""Work-precision curves: cost of the methods against their error relative to the exact law."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mlsanm_cli.app.comparison.measure import ACTIVE_SET, Measured, Method, measure, method_of, surface_error
from mlsanm_cli.case import Case
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.plots.curves import Curve, Panel, Picture, draw
from mlsanm_cli.io.plots.figures import REFERENCE_LINE
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import State

ETA_FACTORS = (100.0, 10.0)
"""Multiples of the eta of the case at which the regularised methods are also measured."""
MAX_ETA = 0.1
"""For larger eta the regularised law does not represent contact."""
FACTORIZATIONS = "factorisations of tangents"


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
    """Draws errors against CPU seconds and against factorisations, one curve per method, in the directory of
    comparison.json. The cost for the exact law, the reference of the errors, is a vertical line."""
    errors = [point["error"] for points in curves["smooth"].values() for point in points]
    panels = []
    for key, label in (("seconds", "CPU seconds of the path"), ("factorizations", FACTORIZATIONS)):
        drawn, notes = [], []
        for name, points in curves["smooth"].items():
            cost, error = (np.array([point[part] for point in points]) for part in (key, "error"))
            drawn.append(Curve(cost, error, name))
            if label == FACTORIZATIONS:
                notes += [(f"eta {one['eta']:.2g}", one[key], one["error"]) for one in points]
        if curves["exact"] and errors:
            cost = np.full(2, curves["exact"][key])
            drawn.append(
                Curve(cost, np.array([min(errors), max(errors)]), "active set, exact law", REFERENCE_LINE)
            )
        panels.append(Panel(drawn, label, "pressure, error against the exact law", notes=notes, scale="log"))
    picture = Picture(panels, "", "outside upper center", (8.4, 3.8), beside=True)
    draw(directory / run_dir.picture_name("comparison", "png"), picture)
