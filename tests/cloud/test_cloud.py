"""Clouds: surfaces, corners, units, size, quality."""

from __future__ import annotations

import signal
import time
from dataclasses import replace

import numpy as np
import pytest

from mlsanm_cli.app.checks.quality import measure
from mlsanm_cli.app.scene.build import COUNT_LIMIT, estimate_nodes
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Outline, annulus, disk, half_disk, rectangle, sector
from mlsanm_cli.cloud.spacing import Spacing, Zone, build_cloud
from tests.cloud.shapes import polygon

BLOCK = rectangle((-2.0, 2.0), (-2.0, 0.0))
FINE = Spacing(0.15, (Zone.around((0.0, 0.0), 0.01, 0.1, 0.12),))
SCENES: list[tuple[Outline, Spacing]] = [
    (BLOCK, Spacing(0.1)),
    (BLOCK, FINE),
    (half_disk((0.0, 1.0), 1.0, "lower"), FINE),
    (disk((0.0, 1.0), 1.0), FINE),
    (sector((0.0, 0.0), (1.0, 2.0), (0.0, 1.5)), Spacing(0.1)),
    (BLOCK, Spacing(0.2, (Zone(BLOCK.curves[2], 0.03, 0.05, 0.2),))),
]


@pytest.mark.parametrize(("outline", "spacing"), SCENES)
def test_surfaces_lie_on_their_curves_with_outward_normals(outline: Outline, spacing: Spacing) -> None:
    cloud = build_cloud(outline, spacing, 0)
    inside = cloud.points[len(cloud.boundary_nodes) :]
    assert tuple(cloud.surfaces) == outline.names
    for curve, surface in zip(outline.curves, cloud.surfaces.values(), strict=True):
        points = cloud.points[surface.index]
        assert np.abs(points - curve.points(surface.arc_length)).max() <= 1e-14 * 4.0
        assert np.hypot(*surface.normal.T) == pytest.approx(1.0)
        assert (np.diff(surface.arc_length) > 0.0).all()
        # Every interior node near a boundary node lies behind it.
        apart = inside[None] - points[:, None]
        behind = np.einsum("bid,bd->bi", apart, surface.normal)
        near = np.hypot(*apart.transpose(2, 0, 1)) < 3.0 * cloud.spacing[surface.index][:, None]
        assert near.any()
        assert behind[near].max() < 0.0


@pytest.mark.parametrize(("outline", "spacing"), SCENES)
def test_weights_add_up_to_the_length(outline: Outline, spacing: Spacing) -> None:
    for curve, surface in zip(
        outline.curves, build_cloud(outline, spacing, 0).surfaces.values(), strict=True
    ):
        assert surface.weight.sum() == pytest.approx(curve.length, rel=1e-13)
        assert (surface.weight > 0.0).all()
        # The trapezoid rule: exact for a linear function of the arc length, where nothing is joined.
        if not curve.closed:
            moment = float(surface.weight @ surface.arc_length)
            assert moment == pytest.approx(0.5 * curve.length**2, rel=1e-12)


def test_corner_nodes_belong_to_both_surfaces_each_with_its_own_normal() -> None:
    cloud = build_cloud(BLOCK, Spacing(0.3), 0)
    names = list(cloud.surfaces)
    for one, other in zip(names, names[1:] + names[:1], strict=True):
        shared = np.intersect1d(cloud.surfaces[one].index, cloud.surfaces[other].index)
        assert len(shared) == 1
        assert cloud.surfaces[one].index[-1] == cloud.surfaces[other].index[0] == shared[0]
        assert float(cloud.surfaces[one].normal[-1] @ cloud.surfaces[other].normal[0]) == pytest.approx(0.0)
    assert len(cloud.boundary_nodes) == sum(len(s.index) for s in cloud.surfaces.values()) - 4


@pytest.mark.parametrize("unit", [1e-3, 25.4])
@pytest.mark.parametrize("round_", [False, True])
def test_other_units_give_the_same_cloud(unit: float, round_: bool) -> None:
    def cloud(unit: float) -> Cloud:
        zone = Zone.around((0.0, 0.0), 0.02 * unit, 0.1 * unit, 0.12)
        outline = (
            half_disk((0.0, unit), unit, "lower")
            if round_
            else rectangle((-2.0 * unit, 2.0 * unit), (-2.0 * unit, 0.0))
        )
        return build_cloud(outline, Spacing(0.15 * unit, (zone,)), 3)

    one, other = cloud(1.0), cloud(unit)
    assert one.points.shape == other.points.shape
    assert np.abs(other.points / unit - one.points).max() <= 1e-12
    assert np.abs(other.spacing / unit / one.spacing - 1.0).max() <= 1e-12


@pytest.mark.parametrize(("outline", "spacing"), SCENES)
def test_estimate_of_the_number_of_nodes(outline: Outline, spacing: Spacing) -> None:
    nodes = len(build_cloud(outline, spacing, 0).points)
    assert estimate_nodes(outline, spacing) == pytest.approx(nodes, rel=0.1)


def test_estimate_stops_at_its_limit() -> None:
    assert estimate_nodes(BLOCK, Spacing(1e-9)) == COUNT_LIMIT


@pytest.mark.parametrize(("outline", "spacing"), SCENES)
@pytest.mark.parametrize("seed", [0, 1])
def test_quality_of_a_good_cloud(outline: Outline, spacing: Spacing, seed: int) -> None:
    cloud = build_cloud(outline, spacing, seed)
    quality = measure(cloud)
    assert (quality["nodes"], quality["boundary_nodes"]) == (len(cloud.points), len(cloud.boundary_nodes))
    steepest = max((zone.growth for zone in spacing.zones), default=0.0)
    # A node keeps its parent's h away, which may be finer than its own, and its neighbour's coarser still;
    # evening out gives a few per cent of that for smaller holes.
    assert 0.92 / (1.0 + 2.0 * steepest) <= quality["closest"] <= 1.05
    assert 0.7 <= quality["hole"] <= 1.12
    assert quality["growth"] <= steepest * (1.0 + 1e-9) + 1e-15
    assert quality["growth"] >= 0.5 * steepest


def test_quality_shows_nodes_too_close_a_hole_and_a_jump_of_the_spacing() -> None:
    cloud = build_cloud(BLOCK, Spacing(0.1), 0)
    spoilt = cloud.points.copy()
    spoilt[-1] = spoilt[-2] + np.array([1e-3, 0.0])
    assert measure(replace(cloud, points=spoilt))["closest"] == pytest.approx(0.01)
    # Removing interior nodes alone leaves the boundary nodes' numbers as they are.
    kept = np.hypot(cloud.points[:, 0] - 0.5, cloud.points[:, 1] + 1.0) > 0.4
    hollow = replace(cloud, points=cloud.points[kept], spacing=cloud.spacing[kept])
    assert 4.0 <= measure(hollow)["hole"] <= 5.0
    jump = np.where(cloud.points[:, 0] > 0.0, 0.2, 0.1)
    assert measure(replace(cloud, spacing=jump))["growth"] >= 0.8


def test_a_signal_is_heard_while_nodes_are_placed() -> None:
    """Four million of them, which would take half a minute."""

    def stop(number: int, frame: object) -> None:
        begun.append(time.process_time())
        raise KeyboardInterrupt

    begun: list[float] = []
    build_cloud(BLOCK, Spacing(0.1), 0)
    before = signal.signal(signal.SIGALRM, stop)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.3)
        with pytest.raises(KeyboardInterrupt):
            build_cloud(BLOCK, Spacing(0.0014), 0)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert time.process_time() - begun[0] < 0.5
    assert begun[0] > 0.0


@pytest.mark.parametrize("across", [2, 3, 5])
@pytest.mark.parametrize(
    ("outline", "width"),
    [
        (rectangle((0.0, 10.0), (0.0, 1.0)), 1.0),
        (annulus((0.0, 0.0), (9.5, 10.5)), 1.0),
        # A block on a leg.
        (polygon((0, 0), (2, 0), (2, 5), (12, 5), (12, 15), (0, 15)), 2.0),
    ],
)
def test_the_thinnest_part_has_so_many_spacings_across(outline: Outline, width: float, across: int) -> None:
    cloud = build_cloud(outline, Spacing(width / across), 0)
    assert cloud.spacings_across == pytest.approx(across, rel=0.03)
    assert cloud.widths.min() == pytest.approx(width, rel=0.03)


def test_wide_bodies_slits_and_sharp_tips_are_not_thin() -> None:
    outlines = [
        disk((0.0, 0.0), 1.0),
        half_disk((0.0, 0.0), 1.0, "lower"),
        polygon((0, 0), (2, 0), (2, 1)),
        # Two arms with nothing but a narrow void in between.
        polygon((0, 0), (4, 0), (4, 1), (1, 1), (1, 1.01), (4, 1.01), (4, 2), (0, 2)),
    ]
    for outline in outlines:
        assert build_cloud(outline, Spacing(0.05), 0).spacings_across > 8.0
