"""Curves: pressure along a contact, quantities along the load path, several runs in one picture, and
work-precision diagrams, the error of methods against their cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.io.plots.figures import COLOURS, MARKERS, REFERENCE_LINE, picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Pressures below this part of the peak do not extend the range shown.
_VISIBLE = 1e-3
# Upper limit of the axis over the largest value of interest, if larger ones are cut off.
_HEADROOM = 1.5


@dataclass(frozen=True)
class ReferenceCurve:
    """A reference solution: ``arc`` (k,) increasing, ``pressure`` (k,), and its label."""

    arc: FloatArray
    pressure: FloatArray
    label: str


def plot_pressure(
    path: Path,
    contact: str,
    arc: FloatArray,
    pressure: FloatArray,
    level_labels: Sequence[str],
    reference: ReferenceCurve | None = None,
    arc_label: str = "arc length",
    *,
    pressure_label: str = "pressure",
    suffix: str = "",
    highest: float | None = None,
) -> None:
    """Draws the pressure at the nodes of a contact for several load levels.

    ``arc`` (m,), ``pressure`` (levels, m), one label per level. Markers show the nodes, and thereby
    oscillations from node to node. With ``reference``, which belongs to the last level, the difference to it
    is drawn below in percent of its peak. ``suffix`` follows the contact in the title. Values far above
    ``highest`` are cut off. Raises RunError if ``path`` cannot be written.
    """
    left, right = visible_range(arc, pressure, reference)
    inside = (arc >= left) & (arc <= right)
    shades = _shades(len(level_labels))
    with picture(path, 7.2, 4.8 if reference else 3.8) as figure:
        if reference is None:
            upper = lower = figure.subplots()
        else:
            upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1])
        for colour, label, values in zip(shades, level_labels, pressure, strict=True):
            upper.plot(arc[inside], values[inside], label=label, color=colour, **_nodes(int(inside.sum())))
        if reference is not None:
            upper.plot(reference.arc, reference.pressure, label=reference.label, **REFERENCE_LINE)
            _draw_difference(lower, arc[inside], pressure[-1][inside], reference, shades[-1])
        alone = len(level_labels) == 1 and reference is None
        parts = [contact, *([level_labels[0]] if alone else []), *([suffix] if suffix else [])]
        upper.set_title(f"Contact pressure, {', '.join(parts)}")
        upper.set_ylabel(pressure_label)
        low = float(pressure[:, inside].min(initial=0.0))
        high = shown_up_to(upper, float(pressure.max(initial=0.0)), highest)
        upper.set_ylim(min(0.0, 1.05 * low), 1.05 * high if high > 0.0 else None)
        if not alone:
            figure.legend(loc="outside right upper")
        lower.set_xlabel(arc_label)
        lower.set_xlim(left, right)
        figure.align_ylabels()


def _draw_difference(
    axes: Axes, arc: FloatArray, pressure: FloatArray, reference: ReferenceCurve, colour: Any
) -> None:
    """Draws the last level minus the reference (zero outside its range) in percent of the peak."""
    expected = np.interp(arc, reference.arc, reference.pressure, left=0.0, right=0.0)
    peak = float(np.abs(reference.pressure).max())
    difference = 100.0 * (pressure - expected) / peak if peak > 0.0 else pressure - expected
    axes.axhline(0.0, **REFERENCE_LINE)
    axes.plot(arc, difference, color=colour, **_nodes(len(arc)))
    axes.set_ylabel("difference\n[% of peak]")


def visible_range(
    arc: FloatArray, pressure: FloatArray, reference: ReferenceCurve | None
) -> tuple[float, float]:
    """The part of the surface to show: the loaded part, extended by a quarter on both sides."""
    peak = float(np.nanmax(pressure, initial=0.0))
    loaded = arc[(pressure > _VISIBLE * peak).any(axis=0)] if peak > 0.0 else arc
    if reference is not None:
        loaded = np.concatenate([loaded, reference.arc[reference.pressure > 0.0]])
    first, last = float(arc.min(initial=np.inf)), float(arc.max(initial=-np.inf))
    if not first < last:
        return (first - 0.5, first + 0.5) if len(arc) else (0.0, 1.0)
    left, right = float(loaded.min()), float(loaded.max())
    margin = 0.25 * (right - left) or 0.25 * (last - first)
    return max(left - margin, first), min(right + margin, last)


def shown_up_to(axes: Axes, peak: float, highest: float | None) -> float:
    """Upper limit of the axis for values with a ``peak``; those above ``highest`` are cut off, which the
    picture says."""
    if highest is None or highest >= peak:
        return peak
    words = f"singular ends up to {peak:.4g} are cut off"
    axes.text(0.5, 0.98, words, transform=axes.transAxes, ha="center", va="top", fontsize=8, color="#555555")
    return _HEADROOM * highest


def _shades(count: int) -> list[Any]:
    """Blue for one level; from light to dark for several, which keeps their order in grey prints."""
    if count == 1:
        return [COLOURS[0]]
    from matplotlib import colormaps

    return [colormaps["viridis"](0.82 * (1.0 - index / (count - 1))) for index in range(count)]


def _nodes(count: int) -> dict[str, Any]:
    """Line and marker sizes at which ``count`` nodes remain distinguishable."""
    size = 4.0 if count <= 40 else 2.8 if count <= 120 else 1.6
    return {"marker": "o", "markersize": size, "linewidth": 0.9, "markeredgewidth": 0.0}


_STYLES = ("-", "--", ":", "-.")


@dataclass(frozen=True)
class PlotCurve:
    """Values ``y`` (k,), nan where there are none, at ``x`` (k,); ``joined`` by a line or single points."""

    x: FloatArray
    y: FloatArray
    label: str
    joined: bool = True


def plot_curves(path: Path, curves: Sequence[PlotCurve], x_label: str, y_label: str, title: str) -> None:
    """Draws curves in one picture, distinguished by colours, then by line styles. Raises RunError if ``path``
    cannot be written."""
    with picture(path, 7.2, 3.8) as figure:
        axes = figure.subplots()
        for index, curve in enumerate(curves):
            style = _nodes(len(curve.x)) | {
                "label": curve.label,
                "color": COLOURS[index % len(COLOURS)],
                "linestyle": _STYLES[index // len(COLOURS) % len(_STYLES)],
                "marker": MARKERS[index % len(MARKERS)],
            }
            style |= {} if curve.joined else {"linestyle": "none", "markersize": 5.0}
            axes.plot(curve.x, curve.y, **style)
        axes.set_title(title)
        axes.set_xlabel(x_label)
        axes.set_ylabel(y_label)
        if len(curves) > 1:
            axes.legend(loc="best")


@dataclass(frozen=True)
class WorkCurve:
    """One method: ``error``, CPU ``seconds``, ``factorizations`` and annotations of its points, (k,) each."""

    label: str
    error: Sequence[float]
    seconds: Sequence[float]
    factorizations: Sequence[float]
    notes: Sequence[str]


def plot_precision(path: Path, curves: Sequence[WorkCurve], exact: tuple[float, float] | None) -> None:
    """Draws errors against CPU seconds and against factorisations, one curve per method. ``exact`` are
    seconds and factorisations for the exact law, shown as a vertical line: it is the reference of the errors.
    Raises RunError if ``path`` cannot be written."""
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
            left.axvline(exact[0], label="active set, exact law", **REFERENCE_LINE)
            right.axvline(exact[1], **REFERENCE_LINE)
        for axes in (left, right):
            axes.set_xscale("log")
            axes.set_yscale("log")
        left.set_xlabel("CPU seconds of the path")
        right.set_xlabel("factorisations of tangents")
        left.set_ylabel("pressure, error against the exact law")
        figure.legend(loc="outside upper center", ncols=len(curves) + (exact is not None))
