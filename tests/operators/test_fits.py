"""Fits without weights against the stencils that have them."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import build_cloud
from mlsanm_cli.cloud.curves import rectangle, sector
from mlsanm_cli.cloud.spacing import Spacing, Zone
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.operators import fits
from mlsanm_cli.operators.fits import fitted_derivatives
from mlsanm_cli.operators.neighbors import nearest_nodes
from mlsanm_cli.operators.settings import MlsSettings
from mlsanm_cli.operators.stencils import build_stencils
from mlsanm_cli.startup import cKDTree

FINE = Spacing(0.1, (Zone.around((0.5, 1.0), 0.005, 0.05, 0.12),))


def field_at(points: FloatArray) -> FloatArray:
    x, y = points.T
    return np.stack([np.sin(3.0 * x + y), 5.0 + np.exp(x - 2.0 * y), x * y**2], axis=1)


@pytest.mark.parametrize("degree", [2, 3, 4, 5])
def test_they_are_the_derivatives_of_the_stencils(degree: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fits, "BATCH_SIZE", 300)
    points = build_cloud(rectangle((0.0, 1.0), (0.0, 1.0)), FINE, 0).points
    assert len(points) > 600
    tree, settings = cKDTree(points), MlsSettings(degree)
    expected = build_stencils(points, tree, points, 2, settings).derivatives(field_at(points))
    found = fitted_derivatives(points, tree, points, settings, field_at(points))
    known = nearest_nodes(tree, points, settings.stencil_size)
    again = fitted_derivatives(points, tree, points, settings, field_at(points), known=known)
    np.testing.assert_array_equal(again, found)
    for kind in range(6):
        # A derivative loses the digits that it divides by the fit's radius.
        scale = np.abs(expected[:, kind]).max() + 10.0 ** (2 * (kind > 2) + 2 * (kind > 0))
        np.testing.assert_allclose(found[:, kind], expected[:, kind], atol=1e-12 * scale)


def test_slits_stay_between_the_nodes_and_poor_fits_take_more_of_them() -> None:
    cloud = build_cloud(sector((0.0, 0.0), (0.3, 1.0), (0.0, 6.27)), Spacing(0.1), 0)
    thin = build_cloud(rectangle((0.0, 3.0), (0.0, 0.1)), Spacing(0.03), 0)
    assert cloud.sight is not None
    for one, settings in ((cloud, MlsSettings(2)), (thin, MlsSettings(3, 11))):
        points, tree = one.points, cKDTree(one.points)
        stencils = build_stencils(points, tree, points, 2, settings, one.sight)
        assert stencils.enlarged or one is cloud
        found = fitted_derivatives(points, tree, points, settings, field_at(points), one.sight)
        expected = stencils.derivatives(field_at(points))
        np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


def test_too_few_nodes_are_refused() -> None:
    points = np.random.default_rng(0).uniform(size=(9, 2))
    with pytest.raises(NumericalError, match="degree 3"):
        fitted_derivatives(points, cKDTree(points), points, MlsSettings(3), points)
