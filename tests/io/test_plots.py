"""Pictures: valid files without a display, equal for equal data, and curves that show what they claim."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.spatial import Delaunay

from mlsanm_cli.contact.geometry.profile import is_singular, regular_peak
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.plots import cloud, figures
from mlsanm_cli.io.plots import curves as plotted
from mlsanm_cli.io.plots.cloud import BodyPicture, CloudBody, plot_bodies
from mlsanm_cli.io.plots.curves import Curve, Panel, Picture, cut_off_above, draw, visible_range
from mlsanm_cli.io.run_dir import SIGNATURE
from tests.processes import printed

if TYPE_CHECKING:
    from collections.abc import Iterator

ARC = np.linspace(-5.0, 5.0, 101)
CURVES = Picture(
    [Panel([Curve(ARC, ARC, "a"), Curve(ARC, ARC**2, "b", joined=False)], "x", "y")], "t", "best"
)
STACKED = Picture([Panel([Curve(ARC, ARC, "a")], "x", "y")] * 2, "t", "outside right upper", (7.2, 4.8))


def square(count: int = 8) -> CloudBody:
    axis = np.linspace(0.0, 1.0, count)
    points = np.array([(x, y) for x in axis for y in axis])
    return CloudBody(points, 0.01 * points, points[:, 0], Delaunay(points).simplices.astype(np.int64))


def content(directory: Path, kind: str, suffix: str) -> bytes:
    """The content of a picture."""
    path = directory / f"plot_{kind}{suffix}"
    if kind == "cloud":
        detail = (0.0, 0.5, 0.0, 0.5)
        plot_bodies(path, BodyPicture([square(4)], "von Mises", "scene", 2.0, detail=detail))
    else:
        draw(path, CURVES if kind == "path" else STACKED)
    return path.read_bytes()


@pytest.fixture
def kept(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """Catches the figures instead of saving them."""
    caught: list[Figure] = []

    @contextmanager
    def keep(path: Path, width: float, height: float) -> Iterator[Figure]:
        figure = Figure(figsize=(width, height))
        yield figure
        caught.append(figure)

    monkeypatch.setattr(plotted, "picture", keep)
    monkeypatch.setattr(cloud, "picture", keep)
    return caught


@pytest.mark.parametrize(("kind", "suffix"), [("path", ".png"), ("stacked", ".svg"), ("cloud", ".pdf")])
def test_files_are_valid_marked_as_ours_and_equal_for_equal_data(
    tmp_path: Path, kind: str, suffix: str
) -> None:
    picture = content(tmp_path, kind, suffix)
    assert SIGNATURE in picture
    if suffix == ".png":
        assert picture.startswith(b"\x89PNG\r\n")
    elif suffix == ".pdf":
        assert picture.startswith(b"%PDF-")
    else:
        assert ET.fromstring(picture).tag == "{http://www.w3.org/2000/svg}svg"
    assert content(tmp_path, kind, suffix) == picture
    assert {path.suffix for path in tmp_path.iterdir()} == {suffix}


def test_pictures_need_no_display_and_no_pyplot(tmp_path: Path) -> None:
    code = """import sys, numpy as np
from pathlib import Path
from mlsanm_cli.io.plots.curves import Curve, Panel, Picture, draw
draw(Path(sys.argv[1]), Picture([Panel([Curve(np.arange(3.0), np.arange(3.0), "a")], "x", "y")]))
print("matplotlib.pyplot" in sys.modules)
"""
    assert printed("-c", code, str(tmp_path / "a.png"), DISPLAY="", MPLBACKEND="") == "False\n"
    assert (tmp_path / "a.png").stat().st_size > 1000


@pytest.mark.parametrize(
    ("arc", "pressure", "expected"),
    [
        (ARC, np.zeros((1, 101)), (-5.0, 5.0)),
        (np.array([2.0]), np.array([[5.0]]), (1.5, 2.5)),
        (np.empty(0), np.empty((1, 0)), (0.0, 1.0)),
        (ARC, np.maximum(1.0 - ARC**2, 0.0)[None, :], (-1.35, 1.35)),
    ],
)
def test_the_loaded_part_of_a_contact_is_shown(arc: Any, pressure: Any, expected: Any) -> None:
    assert visible_range(arc, pressure) == pytest.approx(expected)


def test_singular_values_do_not_take_the_colours_from_the_rest(kept: list[Figure]) -> None:
    smooth = np.linspace(-3.0, 5.0, 300)
    points = np.random.default_rng(0).random((300, 2))
    for extreme, limits, words in (
        ([], (-3.0, 5.0), ""),
        ([9.0], (-3.0, 9.0), ""),
        ([7e4], (-3.0, 4.95), "up to 7e+04"),
        ([7e4, -40.0], (-2.9, 4.95), "down to -40\nup to 7e+04"),
    ):
        values = smooth.copy()
        values[: len(extreme)] = extreme
        body = CloudBody(points, np.zeros((300, 2)), values, Delaunay(points).simplices.astype(np.int64))
        plot_bodies(Path("a.png"), BodyPicture([body], "von Mises", "s"))
        bar = kept[-1].axes[-1]
        assert bar.get_title() == words
        meshes = [item for item in kept[-1].axes[0].collections if type(item).__name__ == "TriMesh"]
        assert meshes[0].get_clim() == pytest.approx(limits, abs=0.05)


def test_wrong_names_and_places_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="formats are"), figures.picture(tmp_path / "a.bmp", 1.0, 1.0):
        pass
    with pytest.raises(RunError, match="cannot write"):
        draw(tmp_path / "none" / "a.png", CURVES)
    assert list(tmp_path.iterdir()) == []


def test_singular_ends_leave_room_for_the_rest() -> None:
    """A flat punch has no largest pressure; Hertz' is shown whole, however fine its ends are."""
    far = np.concatenate([[0.0], np.geomspace(1e-5, 1.0, 60)])
    for power, weakly in ((-0.02, True), (0.5, False), (1.0, False)):
        end = np.sign(-power) * np.maximum(far, 1e-6) ** power + 2.0 * (power > 0.0)
        assert is_singular(far, end) == is_singular(-far[::-1], end[::-1]) == weakly
    x = 1.0 - np.concatenate([np.geomspace(1e-9, 0.5, 60), np.linspace(0.52, 1.0, 40)])
    place = np.concatenate([-x, x[-2::-1]])
    # A bounded peak at an end is none, a weakly singular one is.
    assert not is_singular(place, 1.0 + place)
    assert is_singular(place[1:], (1.0 + 1e-9 - place[1:]) ** -0.1)
    for singular, pressure in ((True, 1.0 / np.sqrt(1.0 - place**2)), (False, np.sqrt(1.0 - place**2))):
        highest = regular_peak(place, pressure)
        assert is_singular(place, pressure) == singular
        high, words = cut_off_above(float(pressure.max()), highest)
        if singular:
            # At 0.98 of the width.
            assert highest == pytest.approx(1.0 / np.sqrt(1.0 - 0.98**2), rel=0.2)
            assert high == pytest.approx(1.5 * highest)
            assert words == f"singular ends up to {pressure.max():.4g} are cut off"
        else:
            assert high == pytest.approx(1.0)
            assert words == ""
