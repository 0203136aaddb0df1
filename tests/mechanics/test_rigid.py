"""Bodies that nothing holds: which motions are free, and what they answer to loads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.cloud.curves import disk
from mlsanm_cli.cloud.spacing import Spacing, Zone, build_cloud
from mlsanm_cli.mechanics.body import BodyEquations, ElasticBody, bulk_stability
from mlsanm_cli.mechanics.material import isotropic
from mlsanm_cli.mechanics.rigid import freedom, pins
from mlsanm_cli.operators import least_squares
from mlsanm_cli.operators.least_squares import LeastSquares
from mlsanm_cli.operators.system import residual_of
from tests.mechanics.bodies import build, jittered_square

POINTS = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])


def held(*pairs: tuple[int, int]) -> BoolArray:
    mask = np.zeros((4, 2), dtype=bool)
    for node, component in pairs:
        mask[node, component] = True
    return mask


@pytest.mark.parametrize(
    ("conditions", "components", "center"),
    [
        ([], (0, 1, 2), (1.0, 0.5)),
        ([(0, 0)], (1, 2), (1.0, 0.0)),
        ([(2, 1)], (0, 2), (2.0, 0.5)),
        ([(0, 0), (3, 0)], (1,), None),
        ([(0, 1), (1, 1)], (0,), None),
        ([(1, 0), (1, 1)], (2,), (2.0, 0.0)),
        ([(0, 0), (2, 1)], (2,), (2.0, 0.0)),
        ([(0, 0), (0, 1), (1, 1)], (), None),
    ],
)
def test_what_is_left_free(
    conditions: list[tuple[int, int]], components: tuple[int, ...], center: tuple[float, float] | None
) -> None:
    free = freedom(POINTS, np.ones(4), held(*conditions))
    assert free.components == components
    if center is not None:
        assert free.center == pytest.approx(center)
    # No free motion moves what is held, and the pins hold all of them.
    patterns = free.patterns(POINTS)
    assert np.abs(patterns[held(*conditions).ravel()]).max(initial=0.0) <= 1e-12
    pinned = [2 * node + component for node, component in pins(POINTS, free)]
    assert np.linalg.matrix_rank(patterns[pinned]) == len(components) if components else not pinned


def answer(body: ElasticBody, right: FloatArray, left: FloatArray) -> FloatArray:
    """Displacements under even tractions on two sides."""
    source = np.zeros(body.rows)
    for name, traction in (("right", right), ("left", left)):
        count = len(body.model.cloud.surfaces[name].index)
        source += body.source(name, np.tile(traction, (count, 1)), held=False)
    column = sparse.csc_array(source[:, None])
    solution = body.system.solve(column)
    assert residual_of(body.system, column, solution) <= 1e-10
    return solution.reshape(-1, 2)


def centred(body: ElasticBody, displacement: FloatArray) -> FloatArray:
    """The same displacements (n, 2) without mean motion."""
    patterns = body.free.patterns(body.model.cloud.points)
    weight = np.repeat(body.model.cloud.areas, 2)[:, None]
    flat = displacement.reshape(-1, 1)
    mean = np.linalg.solve(patterns.T @ (weight * patterns), patterns.T @ (weight * flat))
    return np.asarray((flat - patterns @ mean).reshape(-1, 2))


@pytest.mark.parametrize(
    ("rollers", "components", "left"), [({}, (0, 1, 2), -1.0), ({"left": (True, False)}, (1,), 0.0)]
)
def test_a_body_pulled_from_both_sides_or_off_rollers_stretches(
    rollers: dict[str, tuple[bool, bool]], components: tuple[int, ...], left: float
) -> None:
    body = build(jittered_square(9), rollers, material=isotropic(2.0, 0.3, "stress"))
    assert body.free.components == components
    u = answer(body, np.array([1.0, 0.0]), np.array([left, 0.0]))
    expected = body.model.cloud.points * np.array([0.5, -0.15])
    assert np.abs(u - centred(body, expected)).max() <= 1e-11


def test_a_push_is_balanced_by_inertia() -> None:
    modulus, poisson = 2.0, 0.3
    body = build(jittered_square(9), {}, material=isotropic(modulus, poisson, "stress"))
    u = answer(body, np.array([1.0, 0.0]), np.array([0.0, 0.0]))
    # An accelerating bar: the stress grows in proportion to the mass behind it.
    x, y = body.model.cloud.points.T
    expected = np.stack([x**2 + poisson * (y - 0.5) ** 2, -2.0 * poisson * x * (y - 0.5)], axis=1)
    assert np.abs(u - centred(body, expected / (2.0 * modulus))).max() <= 1e-10


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
