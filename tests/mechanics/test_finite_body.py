"""Bodies at finite strain: homogeneous states, derivatives, series, manufactured solutions, turned bodies."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.body_series import BodySeries, Forces
from mlsanm_cli.mechanics.finite.loads import Loads
from mlsanm_cli.mechanics.finite.tangent import tangent_rows
from mlsanm_cli.mechanics.laws.law import Law
from tests.mechanics.bodies import build, jittered_square, with_body_force
from tests.mechanics.finite_bodies import (
    KINDS,
    NU,
    boundary_loads,
    finite_body,
    law_of,
    left_of,
    newton,
    problem_of,
)
from tests.mechanics.test_laws import LAWS

BOTTOM = {"bottom": (True, True)}
STATES = {"stretch": [[0.3, 0.0], [0.0, -0.15]], "shear": [[0.0, 0.5], [0.0, 0.0]]}


Exact = Callable[[FloatArray], tuple[FloatArray, FloatArray]]


def homogeneous(gradient: list[list[float]]) -> Exact:
    """Displacement and gradient at places (n, 2)."""
    one = np.array(gradient)
    return lambda points: (points @ one.T, np.tile(one.reshape(4, 1), len(points)))


@pytest.mark.parametrize("plane", ["strain", "stress"])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("state", "degree"), [("stretch", 4), ("shear", 2)])
def test_homogeneous_states_are_exact(state: str, kind: str, plane: str, degree: int) -> None:
    law, exact, cloud = law_of(kind, plane), homogeneous(STATES[state]), jittered_square(9)
    body = finite_body(
        cloud, kind, BOTTOM, lambda elastic: boundary_loads(elastic, law, exact), degree, plane
    )
    problem, x = problem_of(body), np.zeros(body.unknowns)
    for lam in (0.5, 1.0):
        x = newton(problem, x, lam)
    np.testing.assert_allclose(x.reshape(-1, 2), exact(cloud.points)[0], atol=1e-10)


@pytest.mark.parametrize("degree", [2, 4])
def test_nearly_incompressible_homogeneous_states_are_exact(degree: int) -> None:
    """Sheared and stretched at constant volume, in steps that Newton's method takes only with the mean stress
    that the last iteration predicts."""
    law, exact = law_of("neo-hookean", "strain", 0.4999), homogeneous([[0.25, 0.1], [0.0, -0.2]])
    cloud = jittered_square(9)
    body = finite_body(
        cloud,
        "neo-hookean",
        BOTTOM,
        lambda elastic: boundary_loads(elastic, law, exact),
        degree,
        poisson=0.4999,
    )
    problem, x = problem_of(body), np.zeros(body.unknowns)
    projector = problem.projector
    for lam in (0.25, 0.5, 0.75, 1.0):
        for _ in range(9):
            residual = problem.residual(x, lam)
            tangent = projector.factorised(x, problem.factors(lam), iterating=True)
            x = x - tangent.solve(projector.image(residual))
    np.testing.assert_allclose(x.reshape(-1, 2), exact(cloud.points)[0], atol=1e-9)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: f"{law.name} {law.plane}")
def test_series_of_a_path_meet_newtons_method(law: Law) -> None:
    """A sheared block, from 0.4 to 0.45 of its loads."""
    exact = homogeneous([[0.15, 0.2], [0.0, -0.1]])
    elastic = build(jittered_square(7), BOTTOM, 2, law.linear)
    problem = problem_of(FiniteBody(elastic, law, boundary_loads(elastic, law, exact)))
    start, step = newton(problem, np.zeros(problem.size), 0.4), 0.05
    tangent = problem.tangent(start, 0.4)
    slope = -tangent.solve(problem.load_derivative(start, 0.4))
    x, lam = np.zeros((11, problem.size)), np.zeros(11)
    x[:2], lam[:2] = [start, slope], [0.4, 1.0]
    for order in range(2, len(x)):
        x[order] = tangent.solve(problem.series_rhs(x[:order], lam[:order]))
    end = step ** np.arange(11) @ x
    np.testing.assert_allclose(end, newton(problem, end, 0.4 + step), atol=1e-8)


def mixed(elastic: ElasticBody) -> Loads:
    """Two loads: a traction with a body force, a pressure that follows with another."""
    cloud = elastic.model.cloud
    arc = Halves.of(cloud.surfaces["top"], FINE).arc
    tractions = np.zeros((len(arc), 2, 2))
    tractions[:, 0, 0] = 0.3
    sources, force = np.zeros((elastic.rows, 2)), np.zeros((len(cloud.points), 2, 2))
    force[:, 1, 1], force[:, 0, 0] = 0.2, cloud.points[:, 0]
    sources[: force[:, :, 0].size] -= force.transpose(1, 0, 2).reshape(-1, 2)
    sources[elastic.condition_rows("top", 0), 0] = 0.3
    nodal, between = (
        np.tile([0.0, 0.2], (count, 1)) for count in (len(cloud.surfaces["right"].index), len(arc))
    )
    return Loads(2, sources, {"top": tractions}, force, {"right": (nodal, between)})


@pytest.mark.parametrize(("kind", "poisson"), [*((kind, NU) for kind in KINDS), ("neo-hookean", 0.499)])
def test_derivatives_and_series_are_those_of_the_rows(kind: str, poisson: float) -> None:
    body = finite_body(jittered_square(9), kind, BOTTOM, mixed, poisson=poisson)
    rng = np.random.default_rng(0)
    bent = body.elastic.model.cloud.points @ np.array([[0.1, -0.2], [0.3, 0.2]])
    u, factors = bent.ravel() + 0.002 * rng.normal(size=body.unknowns), np.array([0.7, 0.6])
    step, h = rng.normal(size=body.unknowns), 1e-6
    difference = (left_of(body, u + h * step, factors) - left_of(body, u - h * step, factors)) / (2.0 * h)
    split = body.elastic.rows - 3 * body.count
    own, strong = tangent_rows(body, u, factors)
    nodes = own @ step
    np.testing.assert_allclose(nodes, difference[:split], atol=1e-7 * np.abs(nodes).max())
    pieces = strong @ step
    np.testing.assert_allclose(pieces, difference[split:], atol=1e-7 * np.abs(pieces).max())
    orders = 5
    path = 0.01 * rng.normal(size=(orders + 1, body.unknowns))
    loads = 0.1 * rng.normal(size=(orders + 1, 2))
    path[0], loads[0] = u, factors
    series = BodySeries(body, orders)
    for order in range(orders + 1):
        # What is not known yet is put as nothing first: that must leave no trace.
        series.put(order, None, np.zeros(2))
        series.put(order, path[order], loads[order])
    powers = 0.01 ** np.arange(orders + 1)
    found = sum(power * series.rows(order) for order, power in enumerate(powers))
    exact = left_of(body, powers @ path, powers @ loads)
    np.testing.assert_allclose(found, exact, atol=1e-9 * np.abs(exact).max())


def test_a_turned_body_without_loads_is_a_solution() -> None:
    body = finite_body(
        jittered_square(9), "neo-hookean", BOTTOM, lambda elastic: Loads(1, np.zeros((elastic.rows, 1)))
    )
    turn = np.array([[-1.0, -1.0], [1.0, -1.0]])  # by 90 degrees, less the identity
    left = left_of(body, (body.elastic.model.cloud.points @ turn.T).ravel(), np.zeros(1))
    held = np.concatenate([body.elastic.condition_rows("bottom", k) for k in (0, 1)])
    assert np.abs(np.delete(left, held)).max() <= 1e-11


def test_loads_and_reactions_balance_in_force_and_moment() -> None:
    body = finite_body(jittered_square(9), "neo-hookean", BOTTOM, mixed)
    problem, x = problem_of(body), np.zeros(body.unknowns)
    for lam in (0.5, 1.0):
        x = newton(problem, x, lam)
    assert np.abs(x).max() > 0.1
    forces = Forces(body, x, np.ones(2))
    assert forces.rest <= 1e-5 * forces.size
    series = BodySeries(body, 0)
    series.put(0, x, np.ones(2))
    # Moments of all pieces about their own deformed middles, moved to one point, are those on the body.
    lack = series.rows(0)[-3 * body.count :].reshape(3, -1)
    middle = series.middle[0]
    size = body.elastic.pieces.size
    moment = (size * lack[2] + middle[0] * lack[1] - middle[1] * lack[0]).sum()
    assert abs(moment) <= 1e-5


@pytest.mark.parametrize(("kind", "amplitude"), [("neo-hookean", 0.15), ("saint-venant-kirchhoff", 0.05)])
@pytest.mark.parametrize(("degree", "bar"), [(2, 4e-3), (4, 1.5e-4)])
def test_manufactured_solution(kind: str, amplitude: float, degree: int, bar: float) -> None:
    """u = A (sin, sin), two sides held: at 17 x 17 nodes; 65 x 65 are in docs/results.md."""
    cloud = jittered_square(17, 0.2)
    waves, phase = np.array([[2.0, 1.5], [1.5, -2.0]]), np.array([0.3, 1.1])

    def exact(points: FloatArray) -> tuple[FloatArray, FloatArray]:
        angle = points @ waves.T + phase
        slope = amplitude * np.cos(angle)
        gradient = np.stack([slope[:, c] * waves[c, axis] for c in (0, 1) for axis in (0, 1)])
        return amplitude * np.sin(angle), gradient

    law, h = law_of(kind, "strain"), 1e-5

    def force(points: FloatArray) -> FloatArray:
        """Minus Div P, by central differences of fourth order."""
        total = np.zeros((len(points), 2))
        for axis in (0, 1):
            for shift, factor in ((1.0, 8.0), (-1.0, -8.0), (2.0, -1.0), (-2.0, 1.0)):
                moved = points.copy()
                moved[:, axis] += shift * 20.0 * h
                p = law.stress(exact(moved)[1])
                total -= factor * np.stack([p[axis], p[2 + axis]], axis=1) / (12.0 * 20.0 * h)
        return total

    def loads(elastic: ElasticBody) -> Loads:
        found = boundary_loads(elastic, law, exact)
        pull = force(cloud.points)
        sources = found.sources
        sources[: pull.size, 0] -= pull.T.ravel()
        return Loads(1, sources, found.tractions, pull[:, :, None])

    held = {"bottom": (True, True), "left": (True, True)}
    body = finite_body(cloud, kind, held, loads, degree)
    # The exact force on the pieces, not that of nodal values.
    exactly = with_body_force(body.elastic, np.zeros(body.elastic.rows), force)[-3 * body.count :]
    vars(body)["of_force"] = exactly[:, None]
    truth = exact(cloud.points)[0]
    # The path to it: any state near it does, for Newton's method.
    x = newton(problem_of(body), truth.ravel(), 1.0)
    error = np.linalg.norm(x.reshape(-1, 2) - truth) / np.linalg.norm(truth)
    assert error <= bar
