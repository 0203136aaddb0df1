"""Curves of one or several runs in one picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.io.plots.figures import COLOURS, MARKERS, picture

_STYLES = ("-", "--", ":", "-.")


@dataclass(frozen=True)
class PlotCurve:
    """Values ``y`` (k,), nan where there are none, at ``x`` (k,); ``joined`` by a line or single points."""

    x: FloatArray
    y: FloatArray
    label: str
    joined: bool = True


def plot_curves(path: Path, curves: Sequence[PlotCurve], x_label: str, y_label: str, title: str) -> None:
    """Draws curves in one picture, distinguished by colours, then by line styles.

    Raises ValueError for arrays of different lengths or no curve, RunError if ``path`` cannot be written.
    """
    if not curves:
        raise ValueError("no curve to draw")
    with picture(path, 7.2, 4.2) as figure:
        axes = figure.subplots()
        for index, curve in enumerate(curves):
            if curve.x.shape != curve.y.shape:
                raise ValueError(f"{curve.label}: x has shape {curve.x.shape}, y {curve.y.shape}")
            axes.plot(
                curve.x,
                curve.y,
                label=curve.label,
                color=COLOURS[index % len(COLOURS)],
                linestyle=_STYLES[index // len(COLOURS) % len(_STYLES)] if curve.joined else "none",
                marker=MARKERS[index % len(MARKERS)],
                markersize=2.2 if curve.joined else 5.0,
                markeredgewidth=0.0,
                linewidth=1.0,
            )
        axes.set_title(title)
        axes.set_xlabel(x_label)
        axes.set_ylabel(y_label)
        if len(curves) > 1:
            axes.legend(loc="best")
