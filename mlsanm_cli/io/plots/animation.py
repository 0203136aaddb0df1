"""Animations: GIF files, and MP4 files where ffmpeg is installed."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli import __version__
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.files import replacing
from mlsanm_cli.io.plots.cloud import BodyPicture, draw_bodies, range_of
from mlsanm_cli.io.plots.curves import Picture, draw_curves
from mlsanm_cli.io.plots.figures import refuse_suffix, style

LAST_FRAME_MS = 1500
"""Duration in milliseconds of the last frame."""


def animate(path: Path, frames: Sequence[Picture | BodyPicture]) -> None:
    """Writes pictures as a GIF or MP4; bodies have common colours and axes. Raises RunError."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    refuse_suffix(path, (".gif", ".mp4"))
    states = [frame for frame in frames if isinstance(frame, BodyPicture)]
    windows = np.array([state.window for state in states] or np.zeros((1, 4)))
    (x0, _, y0, _), (_, x1, _, y1) = windows.min(axis=0).tolist(), windows.max(axis=0).tolist()
    limits = range_of([body for state in states for body in state.bodies], states[0].rest if states else 0.0)
    pixels = []
    with style():
        for frame in frames:
            size = (6.4, 4.8) if isinstance(frame, BodyPicture) else frame.size
            figure = Figure(figsize=size, layout="constrained", dpi=100)
            if isinstance(frame, BodyPicture):
                draw_bodies(figure, frame, [(x0, x1, y0, y1)], limits)
            else:
                draw_curves(figure, frame)
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
        colours = 256 if states else 64
        first, *others = (Image.fromarray(frame).quantize(colours, dither=dither) for frame in pixels)
        times: Any = {"duration": [milliseconds] * len(others) + [LAST_FRAME_MS], "loop": 0}
        first.save(temporary, format="GIF", save_all=True, append_images=others, comment=comment, **times)


def _write_mp4(path: Path, pixels: Sequence[NDArray[np.uint8]], milliseconds: int) -> None:
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
