"""Slits: found where they are and nowhere else; the kernel against a slow twin."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mlsanm_cli.app.checks.quality import measure
from mlsanm_cli.cloud.cells import measure as cell_measures
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Outline, annulus, disk, half_disk, rectangle, sector
from mlsanm_cli.cloud.drawing import polygon
from mlsanm_cli.cloud.sight import VisibilityCriterion, visibility_criterion
from mlsanm_cli.cloud.spacing import Spacing, Zone, build_cloud
from tests.cloud.shapes import polygon as chain


def notched(width: float, tip: float = 0.0, between: float | None = None) -> Outline:
    """A square of side 2 with a notch from the top down to its middle; ``tip`` is its width there.

    ``between`` puts one more corner on the right face, so that its nodes do not stand opposite the left ones.
    """
    half = 0.5 * width
    extra = [] if between is None else [(0.5 * tip + between * 0.5 * (width - tip), between)]
    bottom = [(0.0, 0.0)] if tip == 0.0 else [(0.5 * tip, 0.0), (-0.5 * tip, 0.0)]
    return chain(
        (-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (half, 1.0), *extra, *bottom, (-half, 1.0), (-1.0, 1.0)
    )


def sight_of(cloud: Cloud) -> VisibilityCriterion:
    assert cloud.sight is not None
    return cloud.sight


@pytest.mark.parametrize(
    "outline",
    [
        rectangle((0.0, 2.0), (0.0, 1.0)),
        disk((0.0, 0.0), 1.0),
        half_disk((0.0, 0.0), 1.0, "upper"),
        annulus((0.0, 0.0), (0.2, 1.0)),
        annulus((0.0, 0.0), (0.9, 1.0)),
        sector((0.0, 0.0), (0.5, 1.0), (0.0, 3.0)),
        chain((0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)),
        notched(1.0),
        notched(1.2, 1.2),
    ],
)
def test_bodies_without_slits(outline: Outline) -> None:
    assert build_cloud(outline, Spacing(0.1), 0).sight is None


def test_a_hole_behind_a_wall_is_no_slit() -> None:
    """The sides of an eye's shank and of its bore look at each other through the wall, far to one side."""
    angle = math.asin(1.0 / 3.0)
    arc = 18.0 * np.exp(1j * np.linspace(angle, 2.0 * math.pi - angle, 65))
    shank = np.linspace(arc[-1], arc[-1] + 30.0, 21)[1:]
    end = np.linspace(shank[-1], np.conj(shank[-1]), 9)[1:]
    outer = np.concatenate([arc, shank, end, np.conj(shank[::-1])[1:]])
    bore = 10.0 * np.exp(-2j * math.pi * np.arange(42) / 42)
    places = np.concatenate([outer, bore])
    number = [np.arange(len(outer)), len(outer) + np.arange(len(bore))]
    edges = np.concatenate([np.stack([one, np.roll(one, -1)], axis=1) for one in number])
    assert visibility_criterion(np.stack([places.real, places.imag], axis=1), edges) is None


@pytest.mark.parametrize("width", [1e-6, 0.01, 0.05, 0.3])
@pytest.mark.parametrize("between", [None, 0.37])
def test_neighbours_across_a_notch_do_not_see_each_other(width: float, between: float | None) -> None:
    cloud = build_cloud(notched(width, between=between), Spacing(0.1), 0)
    x, y = cloud.points.T
    sight = sight_of(cloud)
    # The faces of the notch belong to their own sides.
    names = list(cloud.surfaces)
    right, left = cloud.surfaces["side3"].index, cloud.surfaces[names[-3]].index
    side = np.sign(x)
    side[right], side[left] = 1.0, -1.0
    one, other = (k.ravel() for k in np.meshgrid(np.flatnonzero(y > 0.2), np.flatnonzero(y > 0.2)))
    near = (np.hypot(x[one] - x[other], y[one] - y[other]) < 0.6) & (one != other)
    one, other = one[near], other[near]
    above = y[one] + y[other] > 1.9  # lines along the top
    opposite = side[one] * side[other] < 0.0
    assert sight.apart(one, other)[opposite].all()
    assert not sight.apart(one, other)[~opposite & ~above].any()
    # Around the bottom of the notch, far from its faces, everything is seen.
    low = np.flatnonzero((y < -0.05) & (np.abs(x) < 0.5))
    a, b = (k.ravel() for k in np.meshgrid(low, low))
    assert not sight.apart(a[a != b], b[a != b]).any()


def test_quality_and_triangles_do_not_reach_across() -> None:
    for gap in (1e-4, 0.02):
        for between in (None, 0.37):
            cloud = build_cloud(notched(gap, between=between), Spacing(0.1), 0)
            assert measure(cloud)["closest"] > 0.7
            assert measure(cloud)["hole"] < 1.3
            a, b, c = (cloud.points[cloud.triangles[:, k]] for k in range(3))
            area = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
            assert area.min() > 0.0
            assert area.sum() == pytest.approx(4.0 - 0.5 * gap, rel=1e-9)


def test_rounded_edges_of_a_slot_are_no_holes() -> None:
    # Triangles of the opened slot lie along its edges, whose circles with nodes inside counted: 5.3 spacings.
    corners = [(-6.0, -5.0), (6.0, -5.0), (6.0, 0.0), (1.0, 0.0), (1.0, -4.0), (-1.0, -4.0), (-1.0, 0.0)]
    names, curves = zip(
        *polygon([*corners, (-6.0, 0.0)], [], [0.0] * 3 + [0.8] + [0.0] * 2 + [0.8], []), strict=True
    )
    fine = Zone.around((1.8, -0.8), 0.15, 1.3, 0.15)
    cloud = build_cloud(Outline(names, curves), Spacing(0.8, (fine,)), 0)
    assert cloud.sight is not None
    assert measure(cloud)["hole"] < 1.2


def test_cells_close_where_a_slit_opens_with_rounded_lips() -> None:
    # Where a slit was opened, a triangle of three nodes of a lip lay over its neighbours.
    sides = [(-3.0, 1.5), (-3.0, -1.0), (3.0, -1.0), (3.0, 1.5), (0.3, 1.5), (0.3, 0.0), (-0.3, 0.0)]
    names, curves = zip(
        *polygon([*sides, (-0.3, 1.5)], [], [*[0.0] * 4, 0.8, 0.0, 0.0, 0.8], []), strict=True
    )
    cloud = build_cloud(Outline(names, curves), Spacing(0.1), 0)
    cells = np.arange(len(cloud.points))
    assert cell_measures(cloud.points, cloud.faces, cloud.surfaces, cells)[2].all()


def test_targets_on_a_face_belong_to_their_side() -> None:
    cloud = build_cloud(notched(0.002), Spacing(0.1, (Zone.around((0.0, 0.0), 0.02, 0.05, 0.2),)), 0)
    names = list(cloud.surfaces)
    faces = [cloud.surfaces["side3"], cloud.surfaces[names[-3]]]
    for face, sign in zip(faces, (1.0, -1.0), strict=True):
        s = np.linspace(0.25, 0.8, 37) * face.curve.length
        targets = face.curve.points(s)
        middle = np.flatnonzero(
            (np.abs(cloud.points[:, 0]) > 0.03) & (np.abs(cloud.points[:, 1] - 0.5) < 0.3)
        )
        numbers = np.tile(middle, (len(targets), 1))
        cut = sight_of(cloud).cut(targets, numbers)
        assert (cut == (sign * cloud.points[numbers][:, :, 0] < 0.0)).all()


def test_chords_over_a_hollow_are_no_reason() -> None:
    # A slit elsewhere in the body; around the small hole and the inner arc everything sees everything.
    slit = sector((0.0, 0.0), (0.3, 1.0), (0.0, math.radians(359.0)))
    cloud = build_cloud(slit, Spacing(0.05), 0)
    inner = cloud.surfaces["inner"].index[10:20]
    a, b = (k.ravel() for k in np.meshgrid(inner, inner))
    assert not sight_of(cloud).apart(a[a != b], b[a != b]).any()
    start, end = (cloud.surfaces[name].index[1:-1] for name in ("start", "end"))
    a, b = (k.ravel() for k in np.meshgrid(start, end))
    assert sight_of(cloud).apart(a, b).all()
    # Nor does the mouth of the slit in the inner arc let anything through.
    inner = cloud.surfaces["inner"].index
    assert sight_of(cloud).apart(inner[:4], inner[-4:]).all()
