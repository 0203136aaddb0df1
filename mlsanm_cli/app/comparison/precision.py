"""The picture of a comparison: cost of the methods against their error relative to the exact law."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mlsanm_cli.io import run_dir
from mlsanm_cli.io.plots.curves import Curve, Panel, Picture, draw
from mlsanm_cli.io.plots.figures import REFERENCE_LINE

FACTORIZATIONS = "factorisations of tangents"


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
