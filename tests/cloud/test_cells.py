"""Cells around nodes: they close, fill the body up to its true outline, and share their faces."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mlsanm_cli.cloud.cells import FINE, GAUSS, Halves, cell_quadrature, measure
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Outline, annulus, disk, half_disk, rectangle
from mlsanm_cli.cloud.spacing import Spacing, Zone, build_cloud

GRADED = Spacing(0.1, (Zone.around((1.0, 0.5), 0.02, 0.05, 0.15),))
BODIES: dict[str, tuple[Outline, Spacing, float, tuple[float, float]]] = {
    "rectangle": (rectangle((0.0, 2.0), (0.0, 1.0)), GRADED, 2.0, (1.0, 0.5)),
    "disk": (disk((0.3, -0.2), 1.0), Spacing(0.1), math.pi, (0.3, -0.2)),
    "ring": (annulus((0.0, 0.0), (0.5, 1.0)), Spacing(0.1), 0.75 * math.pi, (0.0, 0.0)),
    "half disk": (half_disk((0.0, 0.0), 1.0, "lower"), GRADED, 0.5 * math.pi, (0.0, -4.0 / 3.0 / math.pi)),
}


def cloud_of(name: str) -> Cloud:
    outline, spacing, _, _ = BODIES[name]
    return build_cloud(outline, spacing, 0)


@pytest.mark.parametrize("name", BODIES)
def test_cells_close_and_fill_the_body(name: str) -> None:
    _, _, area, middle = BODIES[name]
    cloud = cloud_of(name)
    areas, middles, closed = measure(cloud.points, cloud.faces, cloud.surfaces, np.arange(len(cloud.points)))
    assert closed.all()
    assert (areas > 0.0).all()
    # Up to the true outline, not to its chords, which lose a part of 1e-3 or so of a disk.
    assert areas.sum() == pytest.approx(area, rel=1e-6)
    assert areas @ middles / areas.sum() == pytest.approx(middle, abs=1e-5)
    assert (np.hypot(*(middles - cloud.points).T) <= cloud.spacing).all()


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("rule", [GAUSS[2], FINE], ids=["two points", "four"])
def test_halves_of_surfaces_are_their_length(name: str, rule: tuple[tuple[float, float], ...]) -> None:
    for surface in cloud_of(name).surfaces.values():
        halves, curve = Halves.of(surface, rule), surface.curve
        assert halves.length.sum() == pytest.approx(curve.length)
        assert ((halves.share > 0.5) & (halves.share < 1.0)).all()
        # Each lies nearer to its own node than to the other one, between them.
        at, one, other = (
            curve.points(s) for s in (halves.arc, *surface.arc_length[[halves.own, halves.other]])
        )
        near, far = np.hypot(*(at - one).T), np.hypot(*(at - other).T)
        assert (near < far).all()
        # A function that is linear along an open surface is integrated exactly.
        if not curve.closed:
            s = surface.arc_length
            value = halves.share * s[halves.own] + (1.0 - halves.share) * s[halves.other]
            assert value == pytest.approx(halves.arc)
            assert halves.length @ halves.arc**3 == pytest.approx(0.25 * curve.length**4)


def test_quadrature_over_cells_is_exact_up_to_quadratics() -> None:
    cloud = cloud_of("rectangle")
    node, points, area, shares = cell_quadrature(cloud.points, cloud.triangles)
    assert np.abs(shares.sum(axis=1) - 1.0).max() <= 1e-14
    assert (shares[:, 0] >= shares[:, 1:].max(axis=1) - 1e-14).all()
    np.testing.assert_allclose((shares[:, :, None] * cloud.points[node]).sum(axis=1), points, atol=1e-14)
    x, y = points.T
    assert area.sum() == pytest.approx(2.0)
    for values, expected in ((x, 2.0), (y, 1.0), (x * x, 8.0 / 3.0), (x * y, 1.0), (y * y, 2.0 / 3.0)):
        assert area @ values == pytest.approx(expected)
    cells = measure(cloud.points, cloud.faces, cloud.surfaces, np.arange(len(cloud.points)))[0]
    np.testing.assert_allclose(np.bincount(node[:, 0], area), cells, rtol=1e-10)
