"""The certificate of bodies without contact: high for sound equations, low for those that amplify errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sparse

from mlsanm_cli.cloud.cloud import build_cloud
from mlsanm_cli.cloud.curves import disk
from mlsanm_cli.cloud.spacing import Spacing, Zone
from mlsanm_cli.mechanics.body import BodyEquations
from mlsanm_cli.mechanics.material import isotropic
from mlsanm_cli.mechanics.stability import bulk_stability
from mlsanm_cli.operators import least_squares
from mlsanm_cli.operators.least_squares import LeastSquares
from tests.mechanics.bodies import build, jittered_square

CLAMPED = {"bottom": (True, True)}


@pytest.mark.parametrize("degree", [2, 4])
@pytest.mark.parametrize("poisson", [0.0, 0.499])
def test_least_squares_is_certified(degree: int, poisson: float) -> None:
    body = build(jittered_square(17), CLAMPED, degree, isotropic(1.0, poisson, "strain"))
    # Rows of pieces count in what is left of rough displacements, not in the loads that are compared with:
    # no rough residual brings a larger response than smooth loads do.
    assert 1.0 <= bulk_stability(body) <= 20.0


def test_it_does_not_fall_with_refinement_and_depends_on_no_units() -> None:
    # It rises by a fifth with every halving: pieces are of as many nodes, and smaller in a finer cloud.
    coarse, fine = (bulk_stability(build(jittered_square(side), CLAMPED)) for side in (13, 25))
    assert coarse <= fine <= 2.0 * coarse
    stiff = build(jittered_square(13), CLAMPED, material=isotropic(210e9, 0.3, "strain"))
    assert bulk_stability(stiff) == pytest.approx(coarse, rel=1e-6)
    shrunk = jittered_square(13, size=1e-3)
    assert bulk_stability(build(shrunk, CLAMPED)) == pytest.approx(coarse, rel=1e-6)


def test_graded_clouds_and_single_held_nodes_pass() -> None:
    spacing = Spacing(0.1, (Zone.around((0.0, 1.0), 0.002, 0.01, 0.15),))
    cloud = build_cloud(disk((0.0, 0.0), 1.0), spacing, 0)
    left, right = (int(np.argmin(np.hypot(cloud.points[:, 0] - x, cloud.points[:, 1]))) for x in (-1, 1))
    body = build(cloud, {}, held_nodes=((left, 0), (left, 1), (right, 1)))
    assert bulk_stability(body) >= 0.2


def test_equations_that_hardly_know_a_mode_are_found_out() -> None:
    # Least squares without the equilibrium of every second node leaves rough modes nearly free.
    body = build(jittered_square(17), CLAMPED)
    system = body.system
    assert isinstance(system, LeastSquares)
    weight = system.weight.copy()
    nodes = len(body.model.cloud.points)
    dropped = np.random.default_rng(0).permutation(nodes)[: int(0.6 * nodes)]
    weight[np.concatenate([dropped, nodes + dropped])] *= 1e-3
    rows = sparse.csr_array(system.rows.multiply((weight / system.weight)[:, None]))
    weak = least_squares.factorise(rows, weight, body.model.cloud.points, "auto", system.strong)
    spoilt = replace(body, equations=BodyEquations("weak", lambda: weak))
    assert bulk_stability(spoilt) <= 0.5 * bulk_stability(body)
