"""Polygons: their boundaries, and everything that can be wrong with them, told with its key."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mlsanm_cli.app.scene.surfaces import drawn
from mlsanm_cli.case import Annulus, Polygon
from mlsanm_cli.case.model.chains import Round, Side, pieces, signed_area
from tests.case.scenes import only, parse, problems

PLATE = """format = 1
[model]
plane = "stress"
[material.m]
E = 1.0
nu = 0.3
[[body]]
name = "plate"
material = "m"
spacing = 0.2
[body.shape]
kind = "polygon"
points = [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 2.0], [2.0, 4.0], [0.0, 4.0]]
names = ["bottom", "tip", "arm", "shank", "top", "left"]
rounding = [0.0, 0.0, 0.3, 0.5, 0.0, 0.0]
[[body.shape.holes]]
name = "bolt"
center = [1.0, 1.0]
radius = 0.4
[[support]]
boundary = "plate.left"
ux = 0.0
uy = 0.0
[[load]]
name = "pull"
boundary = "plate.tip"
kind = "traction"
traction = [1.0, 0.0]
"""
CORNERS = ((0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (2.0, 2.0), (2.0, 4.0), (0.0, 4.0))


def shape() -> Polygon:
    found = parse(PLATE).case.body[0].shape
    assert isinstance(found, Polygon)
    return found


def test_boundaries_of_an_angle_with_a_hole() -> None:
    plate = shape()
    assert plate.boundaries == ("bottom", "tip", "corner3", "arm", "corner4", "shank", "top", "left", "bolt")
    assert (plate.centre, plate.size) == ((2.0, 2.0), 4.0)
    assert plate.samples("tip")[1] == pytest.approx((4.0, 1.7))
    assert plate.normal("arm") == pytest.approx((0.0, 1.0))
    assert plate.normal("corner3") is None
    assert plate.curvature("corner3") == pytest.approx(1.0 / 0.3)
    assert plate.curvature("corner4") == pytest.approx(-1.0 / 0.5)
    assert plate.curvature("bolt") == pytest.approx(-1.0 / 0.4)
    assert plate.curvature("arm") == 0.0
    assert len(plate.samples("bolt")) == 4
    ends = plate.samples("corner4")
    assert ends[0] == pytest.approx((2.5, 2.0))
    assert ends[-1] == pytest.approx((2.0, 2.5))
    assert ends[1] == pytest.approx((2.5 - 0.5 * math.sqrt(0.5), 2.5 - 0.5 * math.sqrt(0.5)))


@pytest.mark.parametrize("backwards", [False, True])
def test_sides_and_arcs_join_smoothly_in_either_direction(backwards: bool) -> None:
    points = CORNERS[::-1] if backwards else CORNERS
    rounding = (0.3, 0.2, 0.0, 0.4, 0.3, 0.5)
    chain = pieces(points, (), rounding)
    assert signed_area([p.start for p in chain if isinstance(p, Side)]) > 0.0
    outline = drawn(Polygon(kind="polygon", points=points, rounding=rounding))
    assert outline.names == tuple(piece.name for piece in chain)

    ends = [
        (c.points(np.array([0.0, c.length])), c.normals(np.array([0.0, c.length]))) for c in outline.curves
    ]
    smooth = 0
    for (this, normal), (following, other) in zip(ends, ends[1:] + ends[:1], strict=True):
        assert np.abs(this[1] - following[0]).max() <= 1e-14 * 10.0
        smooth += bool(np.abs(normal[1] - other[0]).max() <= 1e-12)
    # Every arc meets both its neighbours without a kink; one corner stays sharp.
    assert smooth == 2 * 5
    # Side k goes from point k to the next one of the file, whichever way round that is.
    sides = {piece.name: piece for piece in chain if isinstance(piece, Side)}
    for k in range(6):
        side, a, b = sides[f"side{k + 1}"], points[k], points[(k + 1) % 6]
        along = (b[0] - a[0], b[1] - a[1])
        for x, y in (side.start, side.end):
            assert along[0] * (y - a[1]) - along[1] * (x - a[0]) == pytest.approx(0.0, abs=1e-12)


def test_arcs_may_use_up_a_side() -> None:
    chain = pieces(((0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (0.0, 1.0)), (), (0.5, 0.5, 0.5, 0.5))
    assert [piece.name for piece in chain] == [
        "corner1", "side1", "corner2", "corner3", "side3", "corner4",
    ]  # fmt: skip
    assert all(piece.sweep == pytest.approx(0.5 * math.pi) for piece in chain if isinstance(piece, Round))


def test_default_names() -> None:
    plain = Polygon(kind="polygon", points=CORNERS, holes=({"center": (1.0, 1.0), "radius": 0.4},))  # type: ignore[arg-type]
    assert plain.boundaries == (*(f"side{k}" for k in range(1, 7)), "hole1")


def test_ring() -> None:
    ring = Annulus(kind="annulus", center=(1.0, 0.0), radii=(1.0, 2.0))
    assert ring.boundaries == ("outer", "inner")
    assert (ring.curvature("outer"), ring.curvature("inner")) == (0.5, -1.0)
    text = PLATE[: PLATE.index("kind")] + 'kind = "annulus"\ncenter = [0.0, 0.0]\nradii = [2.0, 1.0]\n'
    text += PLATE[PLATE.index("[[support]]") :].replace("plate.left", "plate.inner").replace("tip", "outer")
    assert only(text).key == "body.plate.shape.radii"
    shape = parse(text.replace("[2.0, 1.0]", "[1.0, 2.0]")).case.body[0].shape
    assert isinstance(shape, Annulus)
    assert shape.size == 4.0


@pytest.mark.parametrize(
    ("setting", "key", "words"),
    [
        ("points=[[0.0, 0.0], [1.0, 0.0]]", "points", "at least 3"),
        ("names=['a', 'b']", "names", "2 items for 6 points"),
        ("rounding=[0.1]", "rounding", "1 items for 6 points"),
        ("rounding=[0.0, 0.0, -1.0, 0.0, 0.0, 0.0]", "rounding.2", "at least 0"),
        ("rounding=[0.0, 0.0, 0.0, 2.5, 0.0, 0.0]", "rounding.3", "at most 2"),
        ("rounding=[0.0, 0.0, 1.2, 1.0, 0.0, 0.0]", "rounding.2", "has 1 left"),
        ("names=['bolt', 'tip', 'a', 'b', 'c', 'bolt']", "names.0", "two boundaries"),
        ("corners=['', '']", "corners", "2 items for 6 points"),
        ("names=['x', 'tip', 'corner3', 'b', 'c', 'left']", "names.2", "two boundaries"),
        ("holes.bolt.name='left'", "names.5", "two boundaries"),
        ("holes.bolt.radius=1.1", "holes.bolt.radius", "cuts the boundary"),
        ("holes.bolt.center=[3.0, 3.0]", "holes.bolt.center", "outside"),
        ("holes.bolt.center=[2.0, 2.0]", "holes.bolt.radius", '"corner4"'),
        ("holes.bolt.radiu=1.0", "holes.bolt.radiu", 'did you mean "radius"'),
    ],
)
def test_what_can_be_wrong(setting: str, key: str, words: str) -> None:
    found = problems(PLATE, [f"body.plate.shape.{setting}"])
    told = {problem.key: str(problem) for problem in found}
    assert words in told[f"body.plate.shape.{key}"]


@pytest.mark.parametrize(
    ("points", "key", "words"),
    [
        # A bow tie, a repeated point, a spike, a side that touches another, points on a line.
        ("[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 3.0]", "points", "cross or touch"),
        ("[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 0.0]", "points.3", "point 1 again"),
        (
            "[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 2.0], [3.0, 2.0], [0.0, 3.0]",
            "points",
            "cross or touch",
        ),
        ("[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 0.0], [0.0, 2.0]", "points", "cross or touch"),
        ("[0.0, 0.0], [1.0, 1.0], [3.0, 3.0]", "points", "on a line"),
    ],
)
def test_outlines_that_meet_themselves(points: str, key: str, words: str) -> None:
    start, end = PLATE.index("points"), PLATE.index("[[support]]")
    text = (
        PLATE[:start]
        + f"points = [{points}]\n"
        + PLATE[end:].replace("left", "side1").replace("tip", "side2")
    )
    found = problems(text)
    assert {problem.key for problem in found} == {f"body.plate.shape.{key}"}
    assert all(words in problem.message for problem in found)


def test_an_arc_must_not_cut_another_part_of_the_outline() -> None:
    # A slit whose end lies in the corner that the rounding cuts off.
    points = "[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 4.0], [0.3, 0.21], [1.9, 4.0], [0.0, 4.0]"
    start, end = PLATE.index("points"), PLATE.index("[[support]]")
    text = PLATE[:start] + f"points = [{points}]\n{{}}" + PLATE[end:].replace("left", "side7")
    text = text.replace("tip", "side2")
    parse(text.format(""))
    found = problems(text.format("rounding = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]\n"))
    assert [problem.key for problem in found] == ["body.plate.shape.points"] * 2
    assert all('"corner1"' in problem.message for problem in found)


def test_holes_lie_apart() -> None:
    other = "[[body.shape.holes]]\ncenter = [{}, 1.0]\nradius = 0.3\n"
    at = PLATE.index("[[support]]")
    parse(PLATE[:at] + other.format(1.8) + PLATE[at:])
    problem = only(PLATE[:at] + other.format(1.6) + PLATE[at:])
    assert problem.key == "body.plate.shape.holes.1.center"


def test_thin_slits_are_legal() -> None:
    points = "[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0001, 4.0], [2.0, 1.0], [1.9999, 4.0], [0.0, 4.0]"
    start, end = PLATE.index("points"), PLATE.index("[[support]]")
    text = PLATE[:start] + f"points = [{points}]\n" + PLATE[end:].replace("left", "side7")
    parse(text.replace("tip", "side2"))
