"""Work-precision diagrams: the error of methods against their cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mlsanm_cli.io.plots.figures import COLOURS, MARKERS, REFERENCE_COLOUR, picture

_LINE: Any = {"color": REFERENCE_COLOUR, "linestyle": "--", "linewidth": 1.0}


@dataclass(frozen=True)
class WorkCurve:
    """One method: ``error``, CPU ``seconds``, ``factorizations`` and annotations of its points, (k,) each."""

    label: str
    error: Sequence[float]
    seconds: Sequence[float]
    factorizations: Sequence[float]
    notes: Sequence[str]


def plot_precision(path: Path, curves: Sequence[WorkCurve], exact: tuple[float, float] | None) -> None:
    """Draws errors against CPU seconds and against factorisations, one curve per method.

    ``exact`` are seconds and factorisations for the exact law, shown as a vertical line: it is the reference
    of the errors. Raises RunError if ``path`` cannot be written.
    """
    with picture(path, 8.4, 3.8) as figure:
        left, right = figure.subplots(1, 2, sharey=True)
        for index, curve in enumerate(curves):
            style: Any = {
                "color": COLOURS[index % len(COLOURS)],
                "marker": MARKERS[index % len(MARKERS)],
                "markersize": 5.0,
            }
            left.plot(curve.seconds, curve.error, label=curve.label, **style)
            right.plot(curve.factorizations, curve.error, **style)
            for note, x, y in zip(curve.notes, curve.factorizations, curve.error, strict=True):
                right.annotate(note, (x, y), (5, 3), textcoords="offset points", fontsize=7.5)
        if exact is not None:
            left.axvline(exact[0], label="active set, exact law", **_LINE)
            right.axvline(exact[1], **_LINE)
        for axes in (left, right):
            axes.set_xscale("log")
            axes.set_yscale("log")
        left.set_xlabel("CPU seconds of the path")
        right.set_xlabel("factorisations of tangents")
        left.set_ylabel("pressure, error against the exact law")
        figure.legend(loc="outside upper center", ncols=len(curves) + (exact is not None))
