"""Clouds that are their own mirror images, and those that cannot be."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mlsanm_cli.cloud.cloud import Cloud, Mirror, SymmetryLine
from mlsanm_cli.cloud.curves import Arc, Outline, Segment, annulus, disk, half_disk, rectangle, sector
from mlsanm_cli.cloud.spacing import Spacing, Zone, build_cloud
from mlsanm_cli.memo import Memo
from tests.cloud.shapes import polygon

UPRIGHT, LEVEL = SymmetryLine(0, 0.3), SymmetryLine(1, -0.2)


BLOCK = rectangle((-0.7, 1.3), (-0.7, 0.3))
FINE = Spacing(0.1, (Zone.around((0.3, 0.3), 0.01, 0.05, 0.12),))
BESIDE = Spacing(0.1, tuple(Zone.around((0.3 + x, 0.3), 0.01, 0.05, 0.2) for x in (-0.4, 0.4)))
SCENES: dict[str, tuple[Outline, Spacing, SymmetryLine]] = {
    "block": (BLOCK, Spacing(0.07), UPRIGHT),
    "level": (BLOCK, Spacing(0.07), LEVEL),
    "zone": (BLOCK, FINE, UPRIGHT),
    "two zones": (BLOCK, BESIDE, UPRIGHT),
    "zone along an edge": (BLOCK, Spacing(0.1, (Zone(BLOCK.curves[2], 0.03, 0.05, 0.2),)), UPRIGHT),
    "disk": (disk((0.3, 0.0), 0.5), Spacing(0.06), UPRIGHT),
    "half-disk": (half_disk((0.3, 0.5), 0.5, "lower"), Spacing(0.06), UPRIGHT),
    "ring": (annulus((0.3, 0.0), (0.5, 1.0)), Spacing(0.08), UPRIGHT),
    "sector": (sector((0.0, -0.2), (0.5, 1.0), (-0.6, 0.6)), Spacing(0.05), LEVEL),
    "roof": (polygon((-0.7, 0.0), (1.3, 0.0), (1.3, 0.5), (0.3, 1.0), (-0.7, 0.5)), Spacing(0.08), UPRIGHT),
}


def mirrored(name: str, seed: int = 0) -> tuple[Cloud, Mirror]:
    outline, spacing, line = SCENES[name]
    cloud = build_cloud(outline, spacing, seed, line=line)
    assert cloud.mirror is not None
    return cloud, cloud.mirror


@pytest.mark.parametrize("name", SCENES)
def test_nodes_and_surfaces_are_their_own_images(name: str) -> None:
    cloud, mirror = mirrored(name)
    image, side, line = mirror.image, mirror.side, mirror.line
    inner = np.arange(len(cloud.points)) >= len(cloud.boundary_nodes)
    assert np.array_equal(image[image], np.arange(len(image)))
    assert np.array_equal(side[image], -side)
    assert ((image == np.arange(len(image))) == (side == 0)).all()
    away = np.abs(line.reflect(cloud.points) - cloud.points[image])
    assert away[inner].max() <= 1e-15
    assert away.max() <= 1e-13
    adjacent = cloud.points[:, line.axis] - line.at
    assert (np.sign(adjacent[side != 0]) == side[side != 0]).all()
    assert not adjacent[(side == 0) & inner].any()
    assert np.abs(adjacent[side == 0]).max() <= 1e-13
    assert np.abs(cloud.areas - cloud.areas[image]).max() == 0.0


@pytest.mark.parametrize("spacing", [0.05, 0.06, 0.07, 0.08])
@pytest.mark.parametrize("name", SCENES)
def test_the_boundary_has_nodes_where_the_line_crosses_it(name: str, spacing: float) -> None:
    """A support `near` such a place finds one on the line, and leaves the scene symmetric."""
    outline, _, line = SCENES[name]
    cloud = build_cloud(outline, Spacing(spacing), 0, line=line)
    assert cloud.mirror is not None
    ends = cloud.mirror.side[cloud.edges]
    assert (ends.prod(axis=1) >= 0).all()
    crossings = 4 if name == "ring" else 2
    assert (cloud.mirror.side[cloud.boundary_nodes] == 0).sum() == crossings


@pytest.mark.parametrize(
    ("outline", "spacing", "line"),
    [
        (BLOCK, Spacing(0.07), SymmetryLine(0, 0.31)),
        (BLOCK, Spacing(0.07), SymmetryLine(0, 0.3 + 1e-6)),
        (polygon((-0.7, 0.0), (1.3, 0.0), (1.3, 0.5), (-0.7, 0.6)), Spacing(0.07), UPRIGHT),
        (BLOCK, Spacing(0.1, (Zone.around((0.31, 0.3), 0.01, 0.05, 0.12),)), UPRIGHT),
        # Too far from the boundary to show there.
        (BLOCK, Spacing(0.1, (Zone.around((0.5, -0.2), 0.03, 0.1, 1.0),)), UPRIGHT),
        (BLOCK, Spacing(0.1, (Zone(BLOCK.curves[1], 0.03, 0.05, 0.2),)), UPRIGHT),
        (half_disk((0.3, 0.5), 0.5, "lower"), Spacing(0.06), SymmetryLine(1, 0.5)),
        (rectangle((-0.7, 1.3), (-0.2, 0.3)), Spacing(0.06), LEVEL),
    ],
    ids=[
        "beside",
        "hardly beside",
        "outline",
        "zone",
        "inner zone",
        "zone of one edge",
        "along an edge",
        "along a side",
    ],
)
def test_others_are_as_without_a_line(outline: Outline, spacing: Spacing, line: SymmetryLine) -> None:
    ordinary, asked = build_cloud(outline, spacing, 3), build_cloud(outline, spacing, 3, line=line)
    assert asked.mirror is None
    assert np.array_equal(asked.points, ordinary.points)
    assert asked.content == ordinary.content


def test_clouds_of_a_memo_are_told_apart() -> None:
    memo = Memo(100)
    outline, spacing, line = SCENES["block"]
    clouds = [
        build_cloud(outline, spacing, 0, memo=memo, line=one) for one in (None, line, LEVEL, None, line)
    ]
    assert clouds[0] is clouds[3]
    assert clouds[1] is clouds[4]
    assert len({cloud.content for cloud in clouds}) == 3
    # Symmetry counts, also where the nodes are the same.
    known = clouds[1]
    assert Cloud(known.points, known.spacing, known.surfaces).content != known.content


@pytest.mark.parametrize(
    ("spacing", "symmetric"),
    [
        (Spacing(0.1), True),
        (Spacing(0.1, (Zone.around((0.3, 5.0), 0.01, 0.1, 0.1),)), True),
        (Spacing(0.1, (Zone.around((0.31, 0.0), 0.01, 0.1, 0.1),)), False),
        (BESIDE, True),
        (Spacing(0.1, BESIDE.zones[:1]), False),
        (Spacing(0.1, (BESIDE.zones[0], Zone.around((0.7, 0.3), 0.011, 0.05, 0.2))), False),
        (Spacing(0.1, (Zone(Segment((0.0, 0.0), (0.6, 0.0)), 0.01, 0.1, 0.1),)), True),
        (Spacing(0.1, (Zone(Segment((0.0, 0.0), (0.6, 0.1)), 0.01, 0.1, 0.1),)), False),
        (Spacing(0.1, (Zone(Arc((0.3, 1.0), 1.0, 1.25 * math.pi, 0.5 * math.pi), 0.01, 0.1, 0.1),)), True),
        (Spacing(0.1, (Zone(Arc((0.3, 1.0), 1.0, 1.25 * math.pi, 0.6 * math.pi), 0.01, 0.1, 0.1),)), False),
        (Spacing(0.1, (Zone(Arc((0.3, 1.0), 1.0, 0.4, 2.0 * math.pi), 0.01, 0.1, 0.1),)), True),
        (Spacing(0.1, (Zone(Arc((0.4, 1.0), 1.0, 0.4, 2.0 * math.pi), 0.01, 0.1, 0.1),)), False),
    ],
)
def test_symmetric_spacings(spacing: Spacing, symmetric: bool) -> None:
    assert spacing.symmetric(UPRIGHT) is symmetric
