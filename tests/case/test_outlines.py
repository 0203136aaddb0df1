"""Polygons and outlines: their boundaries, and faults that only their geometry shows."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.scene.outlines import drawn, geometry_of
from mlsanm_cli.case import case_hash, load_case, parse_case, resolved_mapping, rounded
from mlsanm_cli.cloud.curves import Arc, Outline
from mlsanm_cli.cloud.membership import signed_area
from mlsanm_cli.errors import CaseError
from mlsanm_cli.io.files import toml_text
from tests.case.scenes import PLATE, WAVY, only, parse, problems

CORNERS = ((0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (2.0, 2.0), (2.0, 4.0), (0.0, 4.0))


def plate(**changes: Any) -> Outline:
    """The outline of the plate with other keys."""
    return drawn(parse(PLATE).case.body[0].shape.model_copy(update=changes))


def test_boundaries_of_an_angle_with_a_hole() -> None:
    outline = plate()
    names = ("bottom", "tip", "corner3", "arm", "corner4", "shank", "top", "left", "bolt")
    assert outline.names == names
    assert outline.starts == (0, 8)
    curves = dict(zip(names, outline.curves, strict=True))
    for name, curvature in (("corner3", 1.0 / 0.3), ("corner4", -2.0), ("bolt", -2.5), ("arm", 0.0)):
        assert curves[name].curvature(np.zeros(1))[0] == pytest.approx(curvature)
    tip, fillet = curves["tip"], curves["corner4"]
    assert tip.points(np.array([tip.length]))[0] == pytest.approx((4.0, 1.7))
    middle = 2.5 - 0.5 * math.sqrt(0.5)
    at = fillet.points(np.array([0.0, 0.5, 1.0]) * fillet.length)
    assert at == pytest.approx(np.array([[2.5, 2.0], [middle, middle], [2.0, 2.5]]))
    geometry = geometry_of(parse(PLATE).case.body[0].shape)
    assert (geometry.centre, geometry.size) == ((2.0, 2.0), 4.0)
    assert {"arm", "corner3"} <= {*geometry.boundaries}


@pytest.mark.parametrize("backwards", [False, True])
def test_sides_and_arcs_join_smoothly_in_either_direction(backwards: bool) -> None:
    points = CORNERS[::-1] if backwards else CORNERS
    outline = plate(points=points, names=(), rounding=(0.3, 0.2, 0.0, 0.4, 0.3, 0.5), holes=())
    ends = [
        (c.points(np.array([0.0, c.length])), c.normals(np.array([0.0, c.length]))) for c in outline.curves
    ]
    assert signed_area(np.array([end[0][0] for end in ends])) > 0.0
    smooth = 0
    for (this, normal), (following, other) in zip(ends, ends[1:] + ends[:1], strict=True):
        assert np.abs(this[1] - following[0]).max() <= 1e-14 * 10.0
        smooth += bool(np.abs(normal[1] - other[0]).max() <= 1e-12)
    # Every arc meets both its neighbours without a kink; one corner stays sharp.
    assert smooth == 2 * 5
    # Side k goes from point k to the next one of the file, whichever way round that is.
    sides = dict(zip(outline.names, ends, strict=True))
    for k in range(6):
        a, b = np.array(points[k]), np.array(points[(k + 1) % 6])
        for x, y in sides[f"side{k + 1}"][0] - a:
            assert (b - a)[0] * y - (b - a)[1] * x == pytest.approx(0.0, abs=1e-12)


def test_arcs_may_use_up_a_side() -> None:
    points = ((0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (0.0, 1.0))
    outline = plate(points=points, names=(), rounding=(0.5, 0.5, 0.5, 0.5), holes=())
    assert outline.names == ("corner1", "side1", "corner2", "corner3", "side3", "corner4")
    arcs = [curve for curve in outline.curves if isinstance(curve, Arc)]
    assert [arc.sweep for arc in arcs] == pytest.approx([0.5 * math.pi] * 4)


def shaped(shape: str, support: str, load: str) -> list[str]:
    """Settings of another shape of the plate, with the boundaries that are held and loaded."""
    return [
        f"body.0.shape={shape}",
        f"support.0.boundary='plate.{support}'",
        f"load.0.boundary='plate.{load}'",
    ]


def test_one_radius_is_that_of_all_corners() -> None:
    alike = parse(PLATE, ["body.0.shape.rounding=0.25"]).case
    assert alike == parse(PLATE, [f"body.0.shape.rounding={6 * [0.25]}"]).case
    assert only(PLATE, ["body.0.shape.rounding=-0.25"]).key == "body.plate.shape.rounding.0"


def test_default_names() -> None:
    holes = "holes=[{center=[1.0, 1.0], radius=0.4}]"
    settings = shaped(
        f"{{kind='polygon', points={[list(point) for point in CORNERS]}, {holes}}}", "side6", "side2"
    )
    named = drawn(parse(PLATE, settings).case.body[0].shape).names
    assert named == (*(f"side{k}" for k in range(1, 7)), "hole1")


def test_ring() -> None:
    ring = shaped("{kind='annulus', center=[0.0, 0.0], radii=[1.0, 2.0]}", "inner", "outer")
    geometry = geometry_of(parse(PLATE, ring).case.body[0].shape)
    assert (geometry.size, geometry.boundaries) == (4.0, ("outer", "inner"))


def test_hints_on_corners_name_keys_that_the_shape_has() -> None:
    assert "shape.rounding" in rounded(parse(PLATE).case, "plate")
    box = parse(PLATE, shaped("{kind='rectangle', x=[0.0, 1.0], y=[0.0, 1.0]}", "top", "left")).case
    assert "rounding" not in rounded(box, "plate")


# Of a slit, whose end lies in the corner that a rounding cuts off.
SLIT = "[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 4.0], [0.3, 0.21], [1.9, 4.0], [0.0, 4.0]"
THIN = "[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0001, 4.0], [2.0, 1.0], [1.9999, 4.0], [0.0, 4.0]"


@pytest.mark.parametrize(
    ("points", "rounding", "key", "words"),
    [
        # A bow tie, a repeated point, a spike, a side that touches another, points on a line.
        ("[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 3.0]", 0.0, "points", "cross or touch"),
        ("[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 0.0]", 0.0, "points.3", "point 1"),
        ("[0, 0], [2, 0], [2, 2], [1, 2], [3, 2], [0, 3]", 0.0, "points", "cross or touch"),
        ("[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 0.0], [0.0, 2.0]", 0.0, "points", "cross or touch"),
        ("[0.0, 0.0], [1.0, 1.0], [3.0, 3.0]", 0.0, "points", "on a line"),
        ("[0.0, 0.0], [2.0, 0.0], [0.0, 1.0], [2.0, 1.0]", 0.0, "points", "sides cross near (1, 0.5)"),
        (SLIT, 0.0, "", ""),
        (SLIT, 1.0, "points", '"corner1"'),
        (THIN, 0.0, "", ""),
    ],
)
def test_outlines_do_not_meet_themselves(points: str, rounding: float, key: str, words: str) -> None:
    radii = [rounding, *(points.count("[") - 1) * [0.0]]
    shape = f"{{kind='polygon', points=[{points}], rounding={radii}}}"
    settings = shaped(shape, "side1", "side2")
    if not key:
        parse(PLATE, settings)
        return
    found = problems(PLATE, settings)
    assert {problem.key for problem in found} == {f"body.plate.shape.{key}"}
    assert all(words in problem.message for problem in found)


def test_sides_in_either_direction_are_the_same_outline() -> None:
    shape = parse(WAVY).case.body[0].shape
    geometry = geometry_of(shape)
    assert set(geometry.boundaries) == {"top", "right", "bottom", "left"}
    assert geometry.size == 4.0
    outline = drawn(shape)
    assert outline.names == ("left", "bottom", "right", "top")
    ends = [curve.points(np.array([0.0, curve.length])) for curve in outline.curves]
    for one, other in zip(ends, [*ends[1:], ends[0]], strict=True):
        assert np.abs(one[1] - other[0]).max() < 1e-12
    backwards = {
        "top.points": "[[4.0, 0.0], [3.0, 0.1], [2.0, 0.0], [1.0, 0.1], [0.0, 0.0]]",
        "right.to": "[0.0, -1.0]",
        "bottom.to": "[4.0, -1.0]",
    }
    settings = [f"body.0.shape.sides.{key}={value}" for key, value in backwards.items()]
    turned = drawn(parse(WAVY, settings).case.body[0].shape)
    s = np.linspace(0.0, outline.curves[3].length, 11)
    top = turned.curves[turned.names.index("top")]
    assert np.abs(top.points(s) - outline.curves[3].points(s)).max() < 1e-12


def test_points_of_a_file_stand_in_the_resolved_case(tmp_path: Path) -> None:
    inline = parse(WAVY).case
    points = "points = [[0.0, 0.0], [1.0, 0.1], [2.0, 0.0], [3.0, 0.1], [4.0, 0.0]]"
    text = WAVY.replace(points, 'file = "profile.csv"')
    (tmp_path / "profile.csv").write_text("x,y\n0,0\n1,0.1\n2,0\n3,0.1\n4,0\n")
    (tmp_path / "case.toml").write_text(text)
    loaded = load_case(tmp_path / "case.toml")
    assert case_hash(loaded.case) == case_hash(inline)
    again = parse_case(toml_text(resolved_mapping(loaded.case)), Path("elsewhere.toml"))
    assert again.case == loaded.case
    (tmp_path / "profile.csv").write_text("a,b\n0,0\n")
    with pytest.raises(CaseError, match="must begin with the line x,y"):
        load_case(tmp_path / "case.toml")
    (tmp_path / "profile.csv").unlink()
    with pytest.raises(CaseError) as caught:
        load_case(tmp_path / "case.toml")
    assert [problem.key for problem in caught.value.problems] == ["body.block.shape.sides.top.file"]


def test_sides_and_arcs_of_one_name_are_one_boundary() -> None:
    points = "[[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]]"
    names = "names=['foot', 'foot', 'top', 'left'], corners=['foot', '', '', '']"
    shape = f"{{kind='polygon', points={points}, {names}, rounding=[0.2, 0.3, 0.4, 0.0]}}"
    settings = shaped(shape, "foot", "top")
    outline = drawn(parse(PLATE, settings).case.body[0].shape)
    assert outline.names == ("foot/1", "foot/2", "foot/3", "foot/4", "corner3", "top", "left")
    twice = "body.0.shape.names=['foot', 'corner3', 'top', 'left']"
    assert only(PLATE, [*settings, twice]).key.endswith("names.1")
