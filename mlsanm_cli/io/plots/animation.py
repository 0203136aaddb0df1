"""Pictures that move: GIF files, frame by frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli import __version__
from mlsanm_cli.io.atomic import replacing
from mlsanm_cli.io.plots.cloud import CloudBody, draw_cloud, range_of, window_of
from mlsanm_cli.io.plots.figures import COLOURS, style
from mlsanm_cli.io.plots.plots import visible_range

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]
DPI = 100
SHADES = 64
"""Colours of a GIF: pictures of curves need few, and their number decides the size of the file."""
MILLISECONDS, LAST = 80, 1500
"""For how long a frame is shown, and the last one."""


def animate_pressure(
    path: Path,
    contact: str,
    arc: FloatArray,
    pressure: FloatArray,
    titles: Sequence[str],
    arc_label: str,
    pressure_label: str,
) -> None:
    """Write a GIF of the pressures (frames, m) at places ``arc`` (m,) of a contact.

    Raises ValueError for wrong shapes, RunError if the file cannot be written.
    """
    if pressure.shape != (len(titles), len(arc)) or not len(arc):
        raise ValueError(f"pressure has shape {pressure.shape}, expected {(len(titles), len(arc))}")
    left, right = visible_range(arc, pressure, None)
    highest = float(pressure.max(initial=0.0)) or 1.0

    def frames() -> Iterator[Figure]:
        for values, title in zip(pressure, titles, strict=True):
            figure = _figure(6.4, 3.8)
            axes = figure.subplots()
            axes.fill_between(arc, values, color=COLOURS[0], alpha=0.2, linewidth=0.0)
            axes.plot(arc, values, color=COLOURS[0], marker="o", markersize=2.0, linewidth=1.0)
            axes.set_xlim(left, right)
            axes.set_ylim(0.0, 1.05 * highest)
            axes.set_xlabel(arc_label)
            axes.set_ylabel(pressure_label)
            axes.set_title(f"Contact pressure, {contact}, {title}")
            yield figure

    _write(path, frames)


def animate_bodies(
    path: Path, states: Sequence[Sequence[CloudBody]], label: str, titles: Sequence[str], scale: float
) -> None:
    """Write a GIF of the deformed bodies in several states, all with the same colours and the same section.

    Raises ValueError for no state, RunError if the file cannot be written.
    """
    if not states:
        raise ValueError("no state to draw")
    everything = [body for bodies in states for body in bodies]
    limits, window = range_of(everything), window_of(everything, scale)

    def frames() -> Iterator[Figure]:
        for bodies, title in zip(states, titles, strict=True):
            figure = _figure(6.4, 4.8)
            draw_cloud(figure, bodies, label, title, scale, [window], limits)
            yield figure

    _write(path, frames)


def _figure(width: float, height: float) -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained", dpi=DPI)
    FigureCanvasAgg(figure)
    return figure


def _write(path: Path, frames: Any) -> None:
    # Comes with matplotlib, whose own writer keeps no comment by which a run knows its pictures.
    from PIL import Image

    shown = []
    with style():
        for figure in frames():
            figure.canvas.draw()
            pixels = np.asarray(figure.canvas.buffer_rgba())[:, :, :3]
            image = Image.fromarray(np.ascontiguousarray(pixels))
            shown.append(image.quantize(SHADES, dither=Image.Dither.NONE))
    times = [MILLISECONDS] * (len(shown) - 1) + [LAST]
    with replacing(path) as temporary:
        shown[0].save(
            temporary,
            format="GIF",
            save_all=True,
            append_images=shown[1:],
            duration=times,
            loop=0,
            comment=f"mlsanm {__version__}".encode(),
        )
