"""Stencils of clouds that are their own mirror images."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.cloud.cloud import build_cloud
from mlsanm_cli.cloud.curves import rectangle
from mlsanm_cli.cloud.mirror import SymmetryLine
from mlsanm_cli.cloud.spacing import Spacing
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.operators.settings import MlsSettings
from tests.mechanics.bodies import STEEL


@pytest.mark.parametrize("degree", [1, 2, 4])
@pytest.mark.parametrize("line", [SymmetryLine(0, 0.0), SymmetryLine(1, 0.0)])
def test_stencils_are_their_own_images_and_reproduce_polynomials(line: SymmetryLine, degree: int) -> None:
    cloud = build_cloud(rectangle((-1.0, 1.0), (-0.5, 0.5)), Spacing(0.12), 0, line=line)
    model, mirror = BodyModel.build("body", cloud, STEEL, MlsSettings(degree)), cloud.mirror
    assert mirror is not None
    field = np.random.default_rng(0).normal(size=(len(cloud.points), 1))
    found = model.stencils.derivatives(field)
    reflected = model.stencils.derivatives(field[mirror.image])[mirror.image, :, 0]
    np.testing.assert_allclose(
        reflected * mirror.derivative_signs(found.shape[1]), found[:, :, 0], atol=1e-8 * np.abs(found).max()
    )
    x, y = cloud.points.T
    for p, q in [(p, total - p) for total in range(degree + 1) for p in range(total + 1)]:
        values = model.stencils.derivatives((x**p * y**q)[:, None])[:, :3, 0]
        dx, dy = p * x ** max(p - 1, 0) * y**q, q * x**p * y ** max(q - 1, 0)
        assert np.abs(values - np.stack([x**p * y**q, dx, dy], axis=1)).max() <= 1e-9
