"""Animations: GIF files, and MP4 files where ffmpeg is installed."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli import __version__
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.files import replacing
from mlsanm_cli.io.plots.cloud import BodyPicture, draw_bodies, range_of
from mlsanm_cli.io.plots.curves import visible_range
from mlsanm_cli.io.plots.figures import COLOURS, refuse_suffix, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ByteArray = NDArray[np.uint8]
LAST_FRAME_MS = 1500
"""Duration in milliseconds of the last frame."""


def animate_pressure(
    path: Path,
    contact: str,
    arc: FloatArray,
    pressure: FloatArray,
    titles: Sequence[str],
    arc_label: str,
    pressure_label: str,
) -> None:
    """Writes a GIF or MP4 of pressures (frames, m) at the arc lengths ``arc`` (m,). Raises RunError."""
    left, right = visible_range(arc, pressure)
    highest = float(pressure.max(initial=0.0)) or 1.0

    def frames() -> Iterator[Figure]:
        figure = _figure(6.4, 3.8)
        axes = figure.subplots()
        (curve,) = axes.plot(arc, arc, color=COLOURS[0], marker="o", markersize=2.0, linewidth=1.0)
        axes.set(xlim=(left, right), ylim=(0.0, 1.05 * highest), xlabel=arc_label, ylabel=pressure_label)
        for values, title in zip(pressure, titles, strict=True):
            curve.set_ydata(values)
            area = axes.fill_between(arc, values, color=COLOURS[0], alpha=0.2, linewidth=0.0)
            axes.set_title(f"Contact pressure, {contact}, {title}")
            yield figure
            area.remove()
            # All frames keep the layout of the first.
            figure.set_layout_engine("none")

    _write(path, frames, colours=64)


def animate_bodies(path: Path, states: Sequence[BodyPicture]) -> None:
    """Writes a GIF or MP4 of deformed bodies, with common colours and axes. Raises RunError."""
    limits = range_of([body for state in states for body in state.bodies], states[0].rest)
    x0, x1, y0, y1 = zip(*(state.window for state in states), strict=True)
    window = (min(x0), max(x1), min(y0), max(y1))

    def frames() -> Iterator[Figure]:
        for state in states:
            figure = _figure(6.4, 4.8)
            draw_bodies(figure, state, [window], limits)
            yield figure

    _write(path, frames, colours=256)


def _figure(width: float, height: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained", dpi=100)


def _write(path: Path, frames: Callable[[], Iterator[Figure]], colours: int) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    refuse_suffix(path, (".gif", ".mp4"))
    pixels = []
    with style():
        for figure in frames():
            canvas: Any = FigureCanvasAgg(figure)
            canvas.draw()
            pixels.append(np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[:, :, :3]))
    # All frames take 3.2 s together, one 0.08 to 0.5 s.
    milliseconds = min(max(3200 // len(pixels), 80), 500)
    with replacing(path) as temporary:
        if path.suffix.lower() == ".mp4":
            _write_mp4(temporary, pixels, milliseconds)
            return
        # Comes with matplotlib, whose own writer drops the comment by which a run recognises its pictures.
        from PIL import Image

        dither, comment = Image.Dither.NONE, f"mlsanm {__version__}".encode()
        first, *others = (Image.fromarray(frame).quantize(colours, dither=dither) for frame in pixels)
        times: Any = {"duration": [milliseconds] * len(others) + [LAST_FRAME_MS], "loop": 0}
        first.save(temporary, format="GIF", save_all=True, append_images=others, comment=comment, **times)


def _write_mp4(path: Path, pixels: Sequence[ByteArray], milliseconds: int) -> None:
    """Writes an MP4 file by ffmpeg. Raises RunError if that is missing or fails."""
    program = shutil.which("ffmpeg")
    if program is None:
        message = "MP4 files need the program ffmpeg, which is not on PATH"
        raise RunError(message, "install it, or write a .gif")
    height, width = pixels[0].shape[:2]
    frames = [*pixels, *[pixels[-1]] * (LAST_FRAME_MS // milliseconds - 1)]
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"1000/{milliseconds}"]
    # Most players support only even sizes and colours at half the resolution.
    coded = ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white", "-pix_fmt", "yuv420p"]
    named = ["-metadata", f"comment=mlsanm {__version__}", "-f", "mp4", str(path)]
    command = [program, "-y", "-loglevel", "error", *raw, "-i", "-", *coded, *named]
    done = subprocess.run(command, input=b"".join(frame.tobytes() for frame in frames), capture_output=True)
    if done.returncode:
        lines = done.stderr.decode(errors="replace").strip().splitlines()
        reason = lines[-1] if lines else f"exit code {done.returncode}"
        raise RunError(f"ffmpeg failed: {reason}", "write a .gif")
