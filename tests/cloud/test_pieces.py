"""Division of clouds into pieces: connected, of about the size wanted, symmetric where the cloud is."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sparse

from mlsanm_cli.arrays import IntArray
from mlsanm_cli.cloud.cloud import Cloud, SymmetryLine
from mlsanm_cli.cloud.curves import Outline, annulus, disk, rectangle, sector
from mlsanm_cli.cloud.pieces import CLEARANCE, MAX_NODES, MERGE_FRACTION, _divided, divide, pair_up
from mlsanm_cli.cloud.spacing import Spacing, Zone, build_cloud

BLOCK = rectangle((-1.0, 1.0), (0.0, 1.0))
GRADED = Spacing(0.1, (Zone.around((0.0, 1.0), 0.01, 0.03, 0.15),))
BODIES: dict[str, tuple[Outline, Spacing]] = {
    "block": (BLOCK, GRADED),
    "beam": (rectangle((0.0, 20.0), (-0.5, 0.5)), Spacing(0.25)),
    "disk": (disk((0.0, 0.0), 1.0), Spacing(0.05)),
    "ring": (annulus((0.0, 0.0), (9.5, 10.5)), Spacing(0.25)),
    "slit": (sector((0.0, 0.0), (0.5, 1.5), (0.0, np.radians(359.5))), Spacing(0.06)),
    "a few nodes": (BLOCK, Spacing(0.9)),
}


def parts_of(cloud: Cloud, labels: IntArray) -> int:
    """Into how many parts the triangles' sides connect nodes with the same label."""
    a, b = np.concatenate([cloud.triangles[:, [i, j]] for i, j in ((0, 1), (1, 2), (2, 0))]).T
    same = labels[a] == labels[b]
    shape = (len(labels), len(labels))
    graph = sparse.csr_array((np.ones(same.sum()), (a[same], b[same])), shape=shape)
    return int(sparse.csgraph.connected_components(graph, directed=False)[0])


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("size", [8, 16, 40])
def test_pieces_are_connected_and_cover_every_node_once(name: str, size: int) -> None:
    cloud = build_cloud(*BODIES[name], 0)
    labels = divide(cloud, size)
    assert labels.shape == (len(cloud.points),)
    count = np.bincount(labels)
    assert (count > 0).all()
    assert parts_of(cloud, labels) == len(count)
    # Beside hollows they are smaller than asked for.
    assert len(count) == 1 or count.min() >= MERGE_FRACTION * min(size, 16)
    assert count.max() <= 1.5 * MAX_NODES


def test_thin_bodies_are_cut_across() -> None:
    cloud = build_cloud(*BODIES["beam"], 0)
    labels = divide(cloud, 16)
    # Five nodes across: three to four of these columns a piece, no piece longer than two thicknesses.
    for piece in range(labels.max() + 1):
        x, y = cloud.points[labels == piece].T
        assert np.ptp(x) <= 2.0
        assert np.ptp(y) >= 0.9


UPRIGHT, LEVEL = SymmetryLine(0, 0.0), SymmetryLine(1, 0.0)


@pytest.mark.parametrize(
    ("name", "line"),
    [("block", UPRIGHT), ("block", LEVEL), ("disk", UPRIGHT), ("disk", LEVEL), ("ring", UPRIGHT)],
)
def test_pieces_of_mirrored_clouds_are_their_own_images_or_each_others(name: str, line: SymmetryLine) -> None:
    outline, spacing = BODIES[name]
    if name == "block":
        outline = rectangle((-1.0, 1.0), (-1.0, 1.0))
        spacing = Spacing(0.1)
    cloud = build_cloud(outline, spacing, 0, line=line)
    mirror = cloud.mirror
    assert mirror is not None
    labels = divide(cloud, 16)
    count = int(labels.max()) + 1
    assert np.array_equal(np.unique(labels), np.arange(count))
    image = np.full(count, -1)
    image[labels] = labels[mirror.image]
    assert np.array_equal(image[labels], labels[mirror.image])
    assert np.array_equal(image[image], np.arange(count))
    # One that reaches the mirror is its own image.
    assert (image[labels[mirror.side == 0]] == labels[mirror.side == 0]).all()
    assert (image != np.arange(count)).any()
    assert parts_of(cloud, labels) == count


@pytest.mark.parametrize("line", [None, SymmetryLine(0, 0.0)], ids=["plain", "mirrored"])
def test_pairs_are_neighbours_along_surfaces_away_from_corners(line: SymmetryLine | None) -> None:
    cloud = build_cloud(BLOCK, Spacing(0.05), 0, line=line)
    labels = pair_up(cloud, ["top"], ["bottom"])
    paired = np.flatnonzero(labels >= 0)
    top = cloud.surfaces["top"].index
    assert len(paired) >= 0.6 * len(top)
    assert set(paired) <= set(top)
    assert (np.bincount(labels[paired]) == 2).all()
    place = np.full(len(cloud.points), -1)
    place[top] = np.arange(len(top))
    order = np.argsort(labels[paired], kind="stable")
    first, second = place[paired[order]].reshape(-1, 2).T
    assert (np.abs(first - second) == 1).all()
    corners = np.array([[-1.0, 1.0], [1.0, 1.0]])
    away = np.hypot(*(cloud.points[paired][:, None] - corners).transpose(2, 0, 1)).min(axis=1)
    assert (away > CLEARANCE * cloud.spacing[paired]).all()
    if cloud.mirror is not None:
        beyond = labels[cloud.mirror.image]
        pairs = {tuple(np.flatnonzero(labels == k)) for k in range(labels.max() + 1)}
        assert {tuple(np.flatnonzero(beyond == k)) for k in range(labels.max() + 1)} == pairs


def test_a_closed_surface_is_paired_all_around() -> None:
    cloud = build_cloud(disk((0.0, 0.0), 1.0), Spacing(0.1), 0)
    (name,) = cloud.surfaces
    labels = pair_up(cloud, [name], [])
    index = cloud.surfaces[name].index
    assert (labels >= 0).sum() == 2 * (len(index) // 2)
    assert (pair_up(cloud, [], []) == -1).all()
    assert (pair_up(cloud, [name], [name]) == -1).all()


@pytest.mark.parametrize("unit", [25.4, 1.0 / 3.0])
def test_units_do_not_cut_regular_meshes_otherwise(unit: float) -> None:
    # Round-off chose along which axis squares were cut, and among nodes that are equally far: a frame from a
    # mesh swayed by 1 to 2 % more or less.
    points = np.stack(np.meshgrid(*2 * [np.linspace(0.0, 3.1, 32)]), axis=2).reshape(-1, 2)
    wanted = np.full(len(points), 16.0)
    number = np.arange(len(points)).reshape(32, 32)
    beside = [(number[:-1], number[1:]), (number[:, :-1], number[:, 1:])]
    pairs = np.concatenate([np.stack([first.ravel(), last.ravel()], axis=1) for first, last in beside])
    places = points, unit * (points + np.array([0.7, 0.3]))
    one, other = (_divided(where, pairs, wanted) for where in places)
    np.testing.assert_array_equal(one, other)
    assert len(np.unique(one)) == 64
