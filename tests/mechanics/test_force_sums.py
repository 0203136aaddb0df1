"""Forces and moments on their way through a body: sums of rows in the least-squares system."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sparse

from mlsanm_cli.cloud.cloud import build_cloud
from mlsanm_cli.cloud.curves import rectangle
from mlsanm_cli.cloud.mirror import Line
from mlsanm_cli.cloud.spacing import Spacing
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.force_sums import CUTS, ForceSums
from mlsanm_cli.mechanics.material import isotropic
from mlsanm_cli.operators.least_squares import LeastSquares
from tests.mechanics.bodies import build, jittered_square

BEAM = isotropic(1000.0, 0.3, "stress")
LENGTH = 8.0
# Timoshenko's deflection of the tip under a unit force, height 1.
DEFLECTION = 4.0 * LENGTH**3 / 1000.0 + 1.2 * LENGTH / (1000.0 / 2.6)


def beam(spacing: float, degree: int, line: Line | None = None) -> ElasticBody:
    cloud = build_cloud(rectangle((0.0, LENGTH), (-0.5, 0.5)), Spacing(spacing), 0, line=line)
    return build(cloud, {"left": (True, True)}, degree, BEAM)


def tip(body: ElasticBody, system: LeastSquares) -> float:
    """Deflection over Timoshenko's."""
    cloud = body.model.cloud
    shear = np.tile([0.0, -1.0], (len(cloud.surfaces["right"].index), 1))
    u = system.solve(sparse.csc_array(body.source("right", shear, held=False)[:, None])).reshape(-1, 2)
    node = int(np.argmin(np.hypot(cloud.points[:, 0] - LENGTH, cloud.points[:, 1])))
    return float(-u[node, 1] / DEFLECTION)


@pytest.mark.parametrize(
    ("spacing", "degree", "error"), [(0.2, 2, 0.12), (0.1, 2, 0.03), (0.05, 2, 0.01), (0.1, 4, 0.03)]
)
def test_a_slender_clamped_beam_bends_as_it_should(spacing: float, degree: int, error: float) -> None:
    body = beam(spacing, degree)
    assert isinstance(body.system, LeastSquares)
    assert tip(body, body.system) == pytest.approx(1.0, abs=error)


@pytest.mark.parametrize("line", [Line(0, 0.5 * LENGTH), Line(1, 0.0)])
def test_so_it_does_on_a_cloud_that_is_its_own_mirror_image(line: Line) -> None:
    # Cuts that begin at the image of the clamped end as well had let a fifth of the deflection go.
    body = beam(0.1, 2, line)
    assert body.model.cloud.mirror is not None
    assert isinstance(body.system, LeastSquares)
    assert tip(body, body.system) == pytest.approx(1.0, abs=0.03)


def test_without_sums_it_does_not() -> None:
    body = beam(0.2, 2)
    assert isinstance(body.system, LeastSquares)
    assert tip(body, body.system.plain) <= 0.4


def test_sums_are_the_forces_beyond_the_cuts() -> None:
    # Unit residuals of equilibrium in x everywhere: the body force beyond every cut, less no traction.
    cloud = jittered_square(21)
    body = build(cloud, {"bottom": (True, True)})
    sums = ForceSums(cloud, body.held, (), body.first_row, body.rows).through_cuts()
    assert sums.shape == (3 * CUTS, body.rows)
    residual = np.zeros(body.rows)
    residual[: len(cloud.points)] = 1.0
    found = sums @ residual
    # Of the unit square, a ramp over (cut, cut + 1) / CUTS of the height leaves this area beyond.
    expected = 1.0 - (np.arange(CUTS) + 0.5) / CUTS
    scale = found[0] / expected[0]
    assert found[0::3] / scale == pytest.approx(expected, abs=0.03)
    assert np.abs(found[1::3]).max() == 0.0


def test_a_traction_balances_the_body_force_it_stands_for() -> None:
    # A uniform pull on the top and none of it anywhere else: the same force through every cut.
    cloud = jittered_square(21)
    body = build(cloud, {"bottom": (True, True)})
    sums = ForceSums(cloud, body.held, (), body.first_row, body.rows).through_cuts()
    pull = np.tile([0.0, 1.0], (21, 1))
    through = (sums @ body.source("top", pull, held=False))[1::3]
    # The last ramp reaches 1 at the farthest nodes only.
    assert through[:-1] == pytest.approx(np.full(CUTS - 1, through[0]))
    assert through[-1] < 0.8 * through[0] < 0.0


def test_held_surfaces_have_no_part_in_the_sums() -> None:
    cloud = jittered_square(13)
    body = build(cloud, {"bottom": (True, False)})
    sums = ForceSums(cloud, body.held, (), body.first_row, body.rows).through_cuts()
    for component in (0, 1):
        assert not sums[:, body.condition_rows("bottom", component)].any()
