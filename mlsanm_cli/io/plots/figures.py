"""Common style and saving of pictures, without a display; matplotlib is imported on first use."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mlsanm_cli import __version__
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.atomic import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# The palette of Okabe and Ito for colour-blind readers, without yellow, which is too pale on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
MARKERS = ("o", "s", "^", "D", "v", "P")
REFERENCE_LINE: Any = {"color": "#000000", "linestyle": "--", "linewidth": 1.0}
SUFFIXES = (".png", ".svg", ".pdf")

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
    """Yields an empty figure of ``width`` x ``height`` inches and saves it at the end of the block. The
    suffix of ``path`` selects the format: .png, .svg or .pdf. Raises RunError for others, and if the file
    cannot be written."""
    suffix = path.suffix.lower()
    refuse_suffix(path, SUFFIXES)
    # pyplot would need a window system, and keeps figures open.
    from matplotlib.figure import Figure

    with style():
        figure = Figure(figsize=(width, height))
        yield figure
        with replacing(path) as temporary:
            # Axes with equal scales are narrower than their room, and labels may stick out of the figure.
            figure.savefig(
                temporary, format=suffix[1:], metadata=_METADATA[suffix], bbox_inches="tight", pad_inches=0.05
            )
