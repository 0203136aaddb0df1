"""Loops from tagged nodes, and tagged nodes that are no boundary."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.elements import boundary_loops
from mlsanm_cli.cloud.loops import TaggedNodes, tagged_loops
from mlsanm_cli.cloud.membership import first_crossing, signed_area
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
    given = replace(given, normals=np.concatenate([ring(24, 1.0), [[np.nan, np.nan]]]))
    tagged_loops(given)
    for factor, words in ((-1.0, "line 9: the normal at .* points inward"), (0.0, "points sideways")):
        wrong = given.normals.copy()
        wrong[7] = factor * wrong[7] + (1.0 - abs(factor)) * np.array([-wrong[7, 1], wrong[7, 0]])
        with pytest.raises(GeometryError, match=words):
            tagged_loops(replace(given, normals=wrong))
    given.normals[24] = (1.0, 0.0)
    with pytest.raises(GeometryError, match="line 26: a normal at a node without a tag"):
        tagged_loops(given)


def test_crossings_of_an_outline_are_found() -> None:
    eight = np.array([[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0]])
    chords = np.hstack([eight, np.roll(eight, -1, axis=0)])
    assert first_crossing(chords) == pytest.approx([1.0, 1.0])
    square = eight[[0, 2, 1, 3]]
    assert first_crossing(np.hstack([square, np.roll(square, -1, axis=0)])) is None


NO_LINES: IntArray = np.zeros((0, 2), dtype=np.int64)


def grid(nx: int, ny: int) -> tuple[FloatArray, IntArray]:
    """Unit cells: nodes row by row, and counter-clockwise quads."""
    points = np.stack(np.meshgrid(np.arange(nx + 1.0), np.arange(ny + 1.0)), axis=-1).reshape(-1, 2)
    first = (np.arange(nx) + (nx + 1) * np.arange(ny)[:, None]).ravel()
    return points, np.stack([first, first + 1, first + nx + 2, first + nx + 1], axis=1)


def test_the_boundary_runs_around_the_material_whatever_the_elements_orientation() -> None:
    points, quads = grid(3, 3)
    mixed = quads.copy()
    mixed[::2] = mixed[::2, ::-1]
    for rings in ((quads,), (mixed,), (mixed[:, ::-1],), (quads[:4], mixed[4:, :3], mixed[4:, [2, 3, 0]])):
        (loop,) = boundary_loops(points, rings, NO_LINES, (), {})
        assert signed_area(points[loop.nodes]) == pytest.approx(9.0)
    outer, hole = boundary_loops(points, (np.delete(mixed, 4, axis=0),), NO_LINES, (), {})
    assert {signed_area(points[x.nodes]) for x in (outer, hole)} == {9.0, -1.0}


def test_lines_and_node_sets_name_edges() -> None:
    points, quads = grid(3, 2)
    lines, names = np.array([[0, 1], [2, 1], [5, 1]]), ("floor", "floor", "inside")
    sets = {"left": np.array([0, 4, 8]), "all": np.arange(12), "point": np.array([3])}
    (loop,) = boundary_loops(points, (quads,), lines, names, sets)
    named = {
        (int(a), int(b)): name
        for a, b, name in zip(loop.nodes, np.roll(loop.nodes, -1), loop.names, strict=True)
    }
    assert {edge for edge, name in named.items() if name == "floor"} == {(0, 1), (1, 2)}
    assert {edge for edge, name in named.items() if name == "left"} == {(8, 4), (4, 0)}
    assert set(loop.names) == {"floor", "left", ""}


def apart() -> tuple[FloatArray, tuple[IntArray, ...]]:
    points, quads = grid(1, 1)
    return np.concatenate([points, points + 3.0]), (np.concatenate([quads, quads + 4]),)


def twice() -> tuple[FloatArray, tuple[IntArray, ...]]:
    points, quads = grid(2, 1)
    return np.concatenate([points, points[:1] + 1e-12]), (quads,)


def wrong(change: str) -> tuple[FloatArray, tuple[IntArray, ...]]:
    points, quads = grid(2, 2)
    rings: tuple[IntArray, ...] = (quads,)
    if change == "fan":
        points = np.concatenate([points, [[0.3, 0.4]]])
        rings = (quads, np.array([[1, 4, 9]]))
    elif change == "folded":
        points[4] = (2.5, 2.5)
    elif change == "flat":
        rings = (quads, np.array([[0, 1, 2]]))
    elif change == "again":
        rings = (quads, quads[:1, :3])
    elif change == "corner":
        rings = (quads[[0, 3]],)
        points = points.copy()
        keep = np.unique(rings[0])
        number = np.full(9, -1)
        number[keep] = np.arange(len(keep))
        points, rings = points[keep], (number[rings[0]],)
    return points, rings


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (apart(), r"2 separate parts, around \(0.5, 0.5\), \(3.5, 3.5\)"),
        (twice(), r"1 pairs of nodes coincide, the first at \("),
        (wrong("fan"), r"more than two of them, near \(1, 0.5\)"),
        (wrong("folded"), "flat or folded"),
        (wrong("flat"), r"1 elements are flat or folded, the first near \(1, 0\)"),
        (wrong("again"), "elements overlap"),
        (wrong("corner"), r"touches itself in the node at \(1, 1\)"),
    ],
)
def test_elements_that_are_no_body_are_refused(
    body: tuple[FloatArray, tuple[IntArray, ...]], words: str
) -> None:
    with pytest.raises(GeometryError, match=words):
        boundary_loops(*body, NO_LINES, (), {})


def test_marks_that_do_not_fit_are_refused() -> None:
    points, quads = grid(2, 1)
    with pytest.raises(GeometryError, match=r"line element near \(0.5, 0.5\) is not an edge"):
        boundary_loops(points, (quads,), np.array([[0, 4]]), ("a",), {})
    with pytest.raises(GeometryError, match=r'groups "a" and "b" share the edge near \(0.5, 0\)'):
        boundary_loops(points, (quads,), np.array([[0, 1], [1, 0]]), ("a", "b"), {})
