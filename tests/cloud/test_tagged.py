"""Loops from tagged nodes, and tagged nodes that are no boundary."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.membership import first_crossing, signed_area
from mlsanm_cli.cloud.tagged import TaggedNodes, check_normals, tagged_loops
from mlsanm_cli.errors import GeometryError


def nodes(*stretches: tuple[str, FloatArray]) -> TaggedNodes:
    points = np.concatenate([points for _, points in stretches])
    tags = tuple(tag for tag, points in stretches for _ in points)
    places = tuple(f"line {k + 2}" for k in range(len(points)))
    return TaggedNodes(points, tags, np.full(points.shape, np.nan), places)


def line(x: tuple[float, float], y: tuple[float, float], count: int) -> FloatArray:
    return np.stack([np.linspace(*x, count), np.linspace(*y, count)], axis=1)


def ring(count: int, radius: float, turn: float = 1.0, x: float = 0.0) -> FloatArray:
    angle = turn * 2.0 * np.pi * np.arange(count) / count
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1) + [x, 0.0]


INSIDE = ("", np.array([[0.5, 0.5], [0.3, 0.6]]))
BOTTOM = ("bottom", line((0.0, 1.0), (0.0, 0.0), 6))
RIGHT = ("right", line((1.0, 1.0), (1.0, 0.2), 5))
TOP = ("top", line((0.2, 0.8), (1.0, 1.0), 4))
LEFT = ("left", line((0.0, 0.0), (1.0, 0.2), 5))


def test_sides_in_any_order_and_direction_become_one_loop_with_shared_corners() -> None:
    given = nodes(LEFT, INSIDE, TOP, BOTTOM, RIGHT)
    (loop,) = tagged_loops(given)
    points = given.points[loop.nodes]
    assert signed_area(points) == pytest.approx(1.0)
    assert len(loop.nodes) == 20
    # The edge near a corner belongs to the side it lies on, whichever tag the corner has.
    after = np.roll(points, -1, axis=0)
    for a, b, name in zip(points, after, loop.names, strict=True):
        side = {"bottom": a[1] == b[1] == 0, "top": a[1] == b[1] == 1}.get(name)
        side = {"left": a[0] == b[0] == 0, "right": a[0] == b[0] == 1}.get(name, side)
        assert side, (a, b, name)


def test_a_hole_runs_the_other_way_round() -> None:
    given = nodes(("hole", ring(20, 0.3)), ("rim", ring(40, 1.0, -1.0)))
    hole, rim = tagged_loops(given)
    assert signed_area(given.points[rim.nodes]) > 0.0 > signed_area(given.points[hole.nodes])


def jumbled() -> FloatArray:
    return BOTTOM[1][[0, 3, 1, 4, 2, 5]]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (nodes(INSIDE), "no node has a tag"),
        (nodes(BOTTOM, RIGHT, TOP, LEFT, ("", BOTTOM[1][2:3])), r"line 22: .* repeats that of line 4"),
        (
            nodes(("bottom", jumbled()), RIGHT, TOP, LEFT),
            '"bottom" do not form a curve: it turns back from line 3',
        ),
        (
            nodes(("rim", np.concatenate([ring(20, 1.0), ring(20, 1.0, x=9.0)]))),
            "jumps from line 21 to line 22",
        ),
        (nodes(BOTTOM, RIGHT, LEFT), 'open between "(left|right)"'),
        (nodes(BOTTOM, RIGHT, TOP, LEFT, ("dot", np.array([[0.5, 0.4]]))), 'line 22: "dot" has one node'),
        (nodes(("a", ring(20, 1.0)), ("b", ring(20, 0.9, x=5.0))), 'loop of "b" .line 22. is not a hole'),
        (nodes(BOTTOM, RIGHT, TOP, LEFT, ("", np.array([[2.0, 0.5]]))), "line 22: the node .* outside"),
    ],
)
def test_what_is_no_boundary_is_refused_with_its_place(given: TaggedNodes, words: str) -> None:
    with pytest.raises(GeometryError, match=words):
        tagged_loops(given)


def test_normals_that_do_not_point_outward_are_refused() -> None:
    given = nodes(("rim", ring(24, 1.0)), ("", np.zeros((1, 2))))
    loops = tagged_loops(given)
    given = replace(given, normals=np.concatenate([ring(24, 1.0), [[np.nan, np.nan]]]))
    check_normals(given, loops)
    for factor, words in ((-1.0, "line 9: the normal at .* points inward"), (0.0, "points sideways")):
        wrong = given.normals.copy()
        wrong[7] = factor * wrong[7] + (1.0 - abs(factor)) * np.array([-wrong[7, 1], wrong[7, 0]])
        with pytest.raises(GeometryError, match=words):
            check_normals(replace(given, normals=wrong), loops)
    given.normals[24] = (1.0, 0.0)
    with pytest.raises(GeometryError, match="line 26: a normal at a node without a tag"):
        check_normals(given, loops)


def test_crossings_of_an_outline_are_found() -> None:
    eight = np.array([[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0]])
    chords = np.hstack([eight, np.roll(eight, -1, axis=0)])
    assert first_crossing(chords) == pytest.approx([1.0, 1.0])
    square = eight[[0, 2, 1, 3]]
    assert first_crossing(np.hstack([square, np.roll(square, -1, axis=0)])) is None
