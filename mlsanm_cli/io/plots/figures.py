"""Common style and saving of pictures, without a display; matplotlib is imported on first use."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mlsanm_cli import __version__
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.files import replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


# The palette of Okabe and Ito for colour-blind readers, without yellow, which is too pale on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
MARKERS = ("o", "s", "^", "D", "v", "P")
REFERENCE_LINE: Any = {"color": "#000000", "linestyle": "--", "linewidth": 1.0}

# Any: the type of the keys differs between versions of matplotlib.
_STYLE: Any = {
    "axes.grid": True,
    "axes.linewidth": 0.8,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 10,
    "axes.labelsize": 9.5,
    "figure.constrained_layout.use": True,
    "figure.dpi": 200,
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "grid.color": "#e2e2e2",
    "grid.linewidth": 0.6,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "lines.linewidth": 1.2,
    "pdf.fonttype": 42,
    "savefig.dpi": 200,
    "svg.hashsalt": "mlsanm",
}
# A later run recognises its own pictures by this; without dates equal runs give equal files.
_METADATA: dict[str, dict[str, Any]] = {
    ".png": {"Software": f"mlsanm {__version__}"},
    ".svg": {"Creator": f"mlsanm {__version__}", "Date": None},
    ".pdf": {"Creator": f"mlsanm {__version__}", "CreationDate": None},
}


@contextmanager
def style() -> Iterator[None]:
    """A block whose figures have the common style."""
    from matplotlib import rc_context

    with rc_context(_STYLE):
        yield


@contextmanager
def resolution(dpi: int) -> Iterator[None]:
    """A block whose pictures have this resolution."""
    before = _STYLE["savefig.dpi"]
    _STYLE["savefig.dpi"] = dpi
    try:
        yield
    finally:
        _STYLE["savefig.dpi"] = before


def refuse_suffix(file: Path, suffixes: Sequence[str]) -> None:
    """Raises RunError for a file whose suffix is not one of these."""
    if file.suffix.lower() not in suffixes:
        raise RunError(f"{file}: picture formats are {', '.join(suffixes)}", "the suffix selects the format")


@contextmanager
def picture(path: Path, width: float, height: float) -> Iterator[Figure]:
    """Yields an empty figure (inches), saved after the block in the format of its suffix. Raises RunError."""
    suffix = path.suffix.lower()
    refuse_suffix(path, list(_METADATA))
    # pyplot would need a window system, and keeps figures open.
    from matplotlib.figure import Figure

    with style():
        figure = Figure(figsize=(width, height))
        yield figure
        with replacing(path) as temporary:
            # Axes with equal scales are narrower than their room, and labels may stick out of the figure.
            room: Any = {"bbox_inches": "tight", "pad_inches": 0.05}
            figure.savefig(temporary, format=suffix[1:], metadata=_METADATA[suffix], **room)


_HELD, _LOAD, _OBSTACLE = COLOURS[2], COLOURS[1], "#4d4d4d"
_ARROW, _TICK = 0.09, 0.02
"""Lengths of arrows and of ticks, relative to the size of the scene."""


class ConditionMarks(NamedTuple):
    """Symbols over bodies: points (k, 2) and outward normals of ``held`` boundaries, held ``nodes``, points,
    unit directions, outward normals and names of ``arrows``, and lines (k, 2) of ``obstacles``."""

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
            words: Any = {"color": _LOAD, "fontsize": 8, "annotation_clip": True, "zorder": 5}
            axes.annotate(name, tuple(far), (3.0, 3.0), textcoords="offset points", **words)
