"""Symbols of supports, loads and obstacles, drawn over bodies."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.io.plots.figures import COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_HELD, _LOAD, _OBSTACLE = COLOURS[2], COLOURS[1], "#4d4d4d"
_ARROW, _TICK = 0.09, 0.02
"""Lengths of arrows and of ticks, relative to the size of the scene."""


class ConditionMarks(NamedTuple):
    """Symbols drawn over the bodies, in the undeformed configuration.

    ``held`` are points (k, 2) with outward normals (k, 2) of supported boundaries, ``nodes`` supported points
    (2,); ``arrows`` points (2,) where loads act, unit directions (2,), outward normals (2,) and names;
    ``obstacles`` lines (k, 2) in their current position.
    """

    held: tuple[tuple[FloatArray, FloatArray], ...] = ()
    nodes: tuple[FloatArray, ...] = ()
    arrows: tuple[tuple[FloatArray, FloatArray, FloatArray, str], ...] = ()
    obstacles: tuple[FloatArray, ...] = ()


def ends(marks: ConditionMarks, size: float) -> FloatArray:
    """Outer ends (k, 2) of the symbols on a scene of this ``size``."""
    arrows = [
        point + (-1.0 if direction @ normal < 0.0 else 1.0) * _ARROW * size * direction
        for point, direction, normal, _ in marks.arrows
    ]
    ticks = [points + _TICK * size * normals for points, normals in marks.held]
    return np.concatenate([np.zeros((0, 2)), *ticks, *(arrow[None] for arrow in arrows)])


def draw_marks(axes: Axes, marks: ConditionMarks, size: float) -> None:
    """Draws the symbols on a scene of this ``size``."""
    from matplotlib.collections import LineCollection

    for line in marks.obstacles:
        axes.plot(line[:, 0], line[:, 1], color=_OBSTACLE, linewidth=1.6, zorder=3)
    for points, normals in marks.held:
        outside = points + _TICK * size * normals
        ticks = list(np.stack([points, outside], axis=1))
        axes.add_collection(LineCollection(ticks, colors=_HELD, linewidths=1.0, zorder=3))
    for point in marks.nodes:
        axes.plot(*point, marker="^", color=_HELD, markersize=6.0, zorder=4)
    named: set[str] = set()
    for point, direction, normal, name in marks.arrows:
        step = _ARROW * size * direction
        # An arrow that pushes ends on the surface, one that pulls starts there.
        tail, tip = (point - step, point) if direction @ normal < 0.0 else (point, point + step)
        look = {"arrowstyle": "-|>", "color": _LOAD, "linewidth": 1.2, "shrinkA": 0.0, "shrinkB": 0.0}
        axes.annotate("", xy=tuple(tip), xytext=tuple(tail), arrowprops=look, annotation_clip=True, zorder=4)
        if name not in named:
            named.add(name)
            far = tail if direction @ normal < 0.0 else tip
            axes.annotate(
                name,
                xy=tuple(far),
                xytext=(3.0, 3.0),
                textcoords="offset points",
                color=_LOAD,
                fontsize=8,
                annotation_clip=True,
                zorder=5,
            )
