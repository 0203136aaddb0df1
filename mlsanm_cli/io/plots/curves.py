"""Pictures of curves, described as values: panels with curves, shaded bands and limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.io.plots.figures import COLOURS, MARKERS, picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OUTSIDE = "outside right upper"
_STYLES = ("-", "--", ":", "-.")
Limits = tuple[float | None, float | None]


class Curve(NamedTuple):
    """Values ``y`` (k,) or nan at ``x`` (k,), points or ``joined``; ``look`` is in matplotlib's terms."""

    x: FloatArray
    y: FloatArray
    label: str = ""
    look: Mapping[str, Any] | None = None
    joined: bool = True


class Panel(NamedTuple):
    """Axes with curves; ``bands`` are start, end, colour and label, ``notes`` texts with coordinates."""

    curves: Sequence[Curve]
    x_label: str
    y_label: str
    x_limits: Limits = (None, None)
    y_limits: Limits = (None, None)
    bands: Sequence[tuple[float, float, str, str]] = ()
    cut_off: str = ""
    notes: Sequence[tuple[str, float, float]] = ()
    scale: str = "linear"


class Picture(NamedTuple):
    """Panels below or ``beside`` each other; ``legend`` is its place in matplotlib's terms, "" for none."""

    panels: Sequence[Panel]
    title: str = ""
    legend: Any = ""
    size: tuple[float, float] = (7.2, 3.8)
    beside: bool = False


def draw(path: Path, wanted: Picture) -> None:
    """Draws a picture of curves. Raises RunError if ``path`` cannot be written."""
    with picture(path, *wanted.size) as figure:
        draw_curves(figure, wanted)


def draw_curves(figure: Figure, wanted: Picture) -> None:
    """Draws the panels of a picture into a figure."""
    count, place = len(wanted.panels), wanted.legend
    shared: Any = {"sharex": True, "height_ratios": [3] * (count > 1) + [1]}
    shape, shared = ((1, count), {"sharey": True}) if wanted.beside else ((count, 1), shared)
    panels = figure.subplots(*shape, squeeze=False, **shared).ravel()
    for axes, panel in zip(panels, wanted.panels, strict=True):
        for number, curve in enumerate(panel.curves):
            colour, marker = COLOURS[number % len(COLOURS)], MARKERS[number % len(MARKERS)]
            line = _STYLES[number // len(COLOURS) % len(_STYLES)]
            numbered = {"color": colour, "linestyle": line, "marker": marker, **node_marks(len(curve.x))}
            look = dict(numbered if curve.look is None else curve.look)
            look |= {} if curve.joined else {"linestyle": "none", "markersize": 5.0}
            axes.plot(curve.x, curve.y, label=curve.label or None, **look)
        for begin, end, colour, label in panel.bands:
            axes.axvspan(begin, end, color=colour, alpha=0.15, linewidth=0.0, label=label or None)
        for text, x, y in panel.notes:
            axes.annotate(text, (x, y), (5, 3), textcoords="offset points", fontsize=7.5)
        if panel.cut_off:
            centred: Any = {"transform": axes.transAxes, "ha": "center", "va": "top"}
            axes.text(0.5, 0.98, panel.cut_off, fontsize=8, color="#555555", **centred)
        axes.set(xscale=panel.scale, yscale=panel.scale)
        if panel.scale == "linear":
            # Labels of small numbers, as 0.00025, would overlap: a power of ten stands at the axis.
            axes.ticklabel_format(scilimits=(-2, 4))
            axes.locator_params(axis="x", nbins=7)
        axes.set(xlim=panel.x_limits, ylim=panel.y_limits, xlabel=panel.x_label, ylabel=panel.y_label)
    panels[0].set_title(wanted.title)
    for axes in panels[1:] if wanted.beside else panels[:-1]:
        axes.set_ylabel("") if wanted.beside else axes.set_xlabel("")
    if place.startswith("outside"):
        columns = len(wanted.panels[0].curves) if "center" in place else 1
        figure.legend(*panels[0].get_legend_handles_labels(), loc=place, ncols=columns)
    elif place:
        panels[0].legend(loc=place)
    figure.align_ylabels()


def node_marks(count: int) -> dict[str, Any]:
    """Line and marker sizes at which ``count`` nodes remain distinguishable."""
    size = 4.0 if count <= 40 else 2.8 if count <= 120 else 1.6
    return {"markersize": size, "linewidth": 0.9, "markeredgewidth": 0.0}


def shades(count: int) -> list[Any]:
    """Blue for one level; from light to dark for several, which keeps their order in grey prints."""
    if count == 1:
        return [COLOURS[0]]
    from matplotlib import colormaps

    return [colormaps["viridis"](0.82 * (1.0 - index / (count - 1))) for index in range(count)]


def visible_range(
    arc: FloatArray, values: FloatArray, loaded: FloatArray | None = None
) -> tuple[float, float]:
    """The part of a surface with ``values`` (k, m) above 0.001 of the peak or ``loaded``, with margins."""
    peak = float(np.nanmax(values, initial=0.0))
    shown = arc[(values > 1e-3 * peak).any(axis=0)] if peak > 0.0 else arc
    shown = shown if loaded is None else np.concatenate([shown, loaded])
    first, last = float(arc.min(initial=np.inf)), float(arc.max(initial=-np.inf))
    if not first < last:
        return (first - 0.5, first + 0.5) if len(arc) else (0.0, 1.0)
    left, right = float(shown.min()), float(shown.max())
    margin = 0.25 * (right - left) or 0.25 * (last - first)
    return max(left - margin, first), min(right + margin, last)


def cut_off_above(peak: float, highest: float) -> tuple[float, str]:
    """Upper limit for values with a ``peak``, and the words that those above 1.5 ``highest`` are cut off."""
    if highest >= peak:
        return peak, ""
    return 1.5 * highest, f"singular ends up to {peak:.4g} are cut off"
