"""Pictures of friction: tractions with their limits, and force-displacement loops."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.io.plots.figures import COLOURS, REFERENCE_LINE, picture
from mlsanm_cli.io.plots.plots import shown_up_to, visible_range

STICK, SLIP = 1, 2
_ZONES = {STICK: ("stick", COLOURS[2]), SLIP: ("slip", COLOURS[1])}


def plot_traction(
    path: Path,
    contact: str,
    label: str,
    arc: FloatArray,
    traction: FloatArray,
    limit: FloatArray,
    status: NDArray[np.int8],
    *,
    arc_label: str,
    traction_label: str,
    highest: float,
) -> None:
    """Draws the traction at the nodes of a contact with its friction limits, and the stick and slip zones.
    ``arc``, ``traction``, ``limit`` (mu p) and ``status`` (0 open, 1 stick, 2 slip) are (m,). Values far
    above ``highest`` are cut off. Raises RunError if ``path`` cannot be written."""
    left, right = visible_range(arc, limit[None, :], None)
    with picture(path, 7.2, 3.8) as figure:
        axes = figure.subplots()
        for side in (1.0, -1.0):
            named = "friction limit" if side > 0.0 else None
            axes.plot(arc, side * limit, label=named, **REFERENCE_LINE)
        _draw_zones(axes, arc, status)
        axes.plot(arc, traction, color=COLOURS[0], marker="o", markersize=2.5, label="traction")
        axes.set_title(f"Tangential traction, {contact}, {label}")
        axes.set_xlabel(arc_label)
        axes.set_ylabel(traction_label)
        axes.set_xlim(left, right)
        high = shown_up_to(axes, float(np.maximum(limit, np.abs(traction)).max(initial=0.0)), highest)
        axes.set_ylim(-1.05 * high or None, 1.05 * high or None)
        figure.legend(loc="outside right upper")


def _draw_zones(axes: Any, arc: FloatArray, status: NDArray[np.int8]) -> None:
    """Shades stick and slip zones, which end half-way between nodes."""
    if len(arc) < 2:
        return
    middle = 0.5 * (arc[1:] + arc[:-1])
    borders = np.concatenate([[arc[0]], middle, [arc[-1]]])
    for kind, (name, colour) in _ZONES.items():
        inside = np.concatenate([[False], status == kind, [False]]).astype(np.int64)
        first = np.flatnonzero(np.diff(inside) == 1)
        last = np.flatnonzero(np.diff(inside) == -1)
        for number, (begin, end) in enumerate(zip(first, last, strict=True)):
            label = name if number == 0 else None
            axes.axvspan(borders[begin], borders[end], color=colour, alpha=0.15, linewidth=0.0, label=label)


def plot_loop(
    path: Path,
    displacement: FloatArray,
    force: FloatArray,
    x_label: str,
    title: str,
    *,
    force_label: str,
) -> None:
    """Draws the tangential force of a contact against a displacement along the load path, both (S+1,). Raises
    RunError if ``path`` cannot be written."""
    with picture(path, 5.2, 4.2) as figure:
        axes = figure.subplots()
        axes.plot(displacement, force, color=COLOURS[0], marker="o", markersize=2.0)
        axes.plot(displacement[:1], force[:1], color=COLOURS[1], marker="s", linestyle="none", label="start")
        axes.plot(displacement[-1:], force[-1:], color=COLOURS[2], marker="^", linestyle="none", label="end")
        axes.set_title(title)
        axes.set_xlabel(x_label)
        axes.set_ylabel(force_label)
        axes.legend(loc="best")
