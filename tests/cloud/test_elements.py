"""The boundary of elements, and elements that are no body."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.elements import boundary_loops
from mlsanm_cli.cloud.membership import signed_area
from mlsanm_cli.errors import GeometryError

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
