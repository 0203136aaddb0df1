"""Picture of the deformed bodies, coloured by a nodal scalar, with the nodes and the reference outlines."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli import __version__
from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.files import replacing
from mlsanm_cli.io.plots.curves import Picture, draw_curves
from mlsanm_cli.io.plots.figures import (
    COLOURS,
    ConditionMarks,
    draw_marks,
    ends,
    picture,
    refuse_suffix,
    style,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Window = tuple[float, float, float, float]

_OUTLINE_COLOUR = "#8c8c8c"


class CloudBody(NamedTuple):
    """A body: reference points and displacements (n, 2), a scalar (n,), and triangles (t, 3) filling it."""

    points: FloatArray
    displacement: FloatArray
    scalar: FloatArray
    triangles: IntArray


class ColourRange(NamedTuple):
    """Values ``low`` and ``high`` between which colours change, and the ``least`` and ``largest`` value."""

    low: float
    high: float
    least: float
    largest: float


class BodyPicture(NamedTuple):
    """Deformed bodies coloured by a scalar called ``label``, which is ``rest`` without loads. ``scale``
    multiplies displacements; ``unit`` is that of lengths; ``detail`` (x0, x1, y0, y1) has a second panel."""

    bodies: Sequence[CloudBody]
    label: str
    title: str
    scale: float = 1.0
    marks: ConditionMarks = ConditionMarks()
    unit: str = ""
    detail: Window | None = None
    rest: float = 0.0

    @property
    def window(self) -> Window:
        """The box around undeformed and deformed nodes and the marks, with a margin of 3 percent."""
        deformed = [body.points + self.scale * body.displacement for body in self.bodies]
        points = np.concatenate([*deformed, *(body.points for body in self.bodies)])
        size = float(np.ptp(points, axis=0).max())
        points = np.concatenate([points, ends(self.marks, size)])
        margin = 0.03 * size or 1.0
        (x0, y0), (x1, y1) = (points.min(axis=0) - margin).tolist(), (points.max(axis=0) + margin).tolist()
        return x0, x1, y0, y1


def plot_bodies(path: Path, wanted: BodyPicture) -> None:
    """Draws deformed bodies, their nodes as dots and undeformed outlines as grey lines. Raises RunError."""
    views = [wanted.window] if wanted.detail is None else [wanted.window, wanted.detail]
    # Panels of equal height.
    total, count = sum(map(_aspect, views)), len(views)
    height = min((9.0 if count > 1 else 6.0) / total, 7.0)
    with picture(path, max(height * total, 3.0) + 0.7 * count + 0.8, height + 0.9) as figure:
        draw_bodies(figure, wanted, views, range_of(wanted.bodies, wanted.rest))


def draw_bodies(figure: Figure, wanted: BodyPicture, views: Sequence[Window], limits: ColourRange) -> None:
    """Draws the bodies into a figure with a panel for each view and colours between the ``limits``."""
    from matplotlib.collections import EllipseCollection, LineCollection
    from matplotlib.patches import Rectangle
    from matplotlib.tri import Triangulation

    bodies, scale = wanted.bodies, wanted.scale
    shapes = [spacing_and_outline(body) for body in bodies]
    size = float(np.ptp(np.concatenate([body.points for body in bodies]), axis=0).max())
    panels = figure.subplots(1, len(views), squeeze=False, width_ratios=list(map(_aspect, views)))[0]
    unit = f" [{wanted.unit}]" if wanted.unit else ""
    for axes, view in zip(panels, views, strict=True):
        for body, (spacing, outline) in zip(bodies, shapes, strict=True):
            deformed = body.points + scale * body.displacement
            mesh = Triangulation(deformed[:, 0], deformed[:, 1], body.triangles)
            colours = axes.tripcolor(mesh, body.scalar, shading="gouraud", cmap="viridis", rasterized=True)
            colours.set_clim(limits.low, limits.high)
            for points, colour, width in ((body.points, _OUTLINE_COLOUR, 0.8), (deformed, "black", 0.5)):
                axes.add_collection(LineCollection(list(points[outline]), colors=colour, linewidths=width))
            # Dots with a size proportional to the spacing darken fine and coarse regions equally.
            size_of = (0.25 * spacing).tolist()
            look: Any = {"facecolors": "black", "linewidths": 0.0, "alpha": 0.6, "rasterized": True}
            look |= {"units": "xy", "offsets": deformed, "offset_transform": axes.transData}
            axes.add_collection(EllipseCollection(size_of, size_of, [0.0] * len(size_of), **look))
        # Arrows have a length relative to the scene, too long for a detail.
        shown = wanted.marks if view is views[0] else ConditionMarks(obstacles=wanted.marks.obstacles)
        draw_marks(axes, shown, size)
        axes.grid(False)
        axes.set(xlim=view[:2], ylim=view[2:], aspect="equal", xlabel=f"x{unit}", ylabel=f"y{unit}")
        axes.locator_params(axis="x", nbins=6)
    times = "" if scale == 1.0 else f", displacements x {scale:g}"
    panels[0].set_title(f"{wanted.title}{times}")
    if len(views) > 1:
        x0, x1, y0, y1 = views[1]
        frame = Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, edgecolor=COLOURS[1], linewidth=1.0)
        panels[0].add_patch(frame)
        panels[1].set_title("detail in the frame")
    # The values beyond the ends of the colour bar, in words.
    beyond = {}
    if limits.least < limits.low:
        beyond["min"] = f"down to {limits.least:.3g}"
    if limits.largest > limits.high:
        beyond["max"] = f"up to {limits.largest:.3g}"
    extend = "both" if len(beyond) == 2 else next(iter(beyond), "neither")
    shape: Any = {"pad": 0.02, "shrink": 0.9, "extend": extend}
    bar = figure.colorbar(colours, ax=list(panels), label=wanted.label, **shape)
    if beyond:
        bar.ax.set_title("\n".join(beyond.values()), fontsize=7, color="#555555")


def _aspect(view: Window) -> float:
    return (view[1] - view[0]) / (view[3] - view[2])


def spacing_and_outline(body: CloudBody) -> tuple[FloatArray, IntArray]:
    """Distances to the nearest node (n,), and the edges (k, 2) of the triangles that are part of one only."""
    sides = body.triangles[:, [[0, 1], [1, 2], [2, 0]]]
    lengths = np.linalg.norm(body.points[sides[..., 1]] - body.points[sides[..., 0]], axis=2)
    # The nearest neighbour of a node is always connected to it by an edge of a Delaunay triangle.
    spacing = np.full(len(body.points), np.inf)
    for end in (0, 1):
        np.minimum.at(spacing, sides[..., end].ravel(), lengths.ravel())
    unique, counts = np.unique(np.sort(sides.reshape(-1, 2), axis=1), axis=0, return_counts=True)
    return spacing, unique[counts == 1]


def range_of(bodies: Sequence[CloudBody], rest: float = 0.0) -> ColourRange:
    """Range of the colours, which contains the value at ``rest`` and all values but singular ones."""
    values = np.concatenate([[rest], *(body.scalar for body in bodies)])
    low, high = rest - _usual_peak(rest - values), rest + _usual_peak(values - rest)
    return ColourRange(low, high if high > low else low + 1.0, float(values.min()), float(values.max()))


def _usual_peak(values: FloatArray) -> float:
    """The largest value, or the 99 % quantile if it is more than twice that, as at corners."""
    largest, usual = float(values.max()), float(np.quantile(values, 0.99))
    return usual if 0.0 < 2.0 * usual < largest else largest


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
