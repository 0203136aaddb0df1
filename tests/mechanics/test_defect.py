"""What fits of the next degree find beyond the body's own."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sparse

from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.defect import CORRECTION_TOLERANCE, correct, defect_of
from mlsanm_cli.mechanics.material import isotropic
from mlsanm_cli.mechanics.pieces import rule_of
from mlsanm_cli.memo import Memo
from mlsanm_cli.operators.least_squares import LeastSquares
from tests.mechanics.bodies import STEEL, build, jittered_square
from tests.mechanics.waves import Wave

HELD = {"left": (True, True)}


@pytest.mark.parametrize("degree", [2, 3, 4])
def test_source_is_the_difference_of_both_degrees_rows(degree: int) -> None:
    cloud = jittered_square(14)
    body, better = (build(cloud, HELD, one, held_nodes=((9, 1),)) for one in (degree, degree + 1))
    u = np.random.default_rng(3).normal(size=(len(cloud.points), 2))
    defect = defect_of(body, u)
    assert isinstance(body.system, LeastSquares)
    assert isinstance(better.system, LeastSquares)
    old, new = (system.rows @ u.ravel() / system.weight for system in (body.system, better.system))
    np.testing.assert_allclose(defect.source[: len(old)], old - new, atol=1e-9 * np.abs(old).max())
    stress = better.model.stress(u) - body.model.stress(u)
    np.testing.assert_allclose(defect.stress, stress, atol=1e-9 * np.abs(stress).max())


@pytest.mark.parametrize("degree", [2, 3, 4])
def test_pieces_lack_what_both_degrees_fluxes_differ_by(degree: int) -> None:
    # Up to the third derivatives of the better fits, which the defect leaves out on a face.
    cloud = jittered_square(20)
    body, better = (build(cloud, HELD, one) for one in (degree, degree + 1))
    u = Wave(STEEL.stiffness).displacement(cloud.points)
    old, new = (
        body.pieces.fluxes(model.stress_around, body.restrained, rule_of(model)) @ u.ravel()
        for model in (body.model, better.model)
    )
    defect = defect_of(body, u)
    found = body.loads @ defect.source
    assert np.linalg.norm(found - (old - new)) <= 0.1 * np.linalg.norm(old - new)
    old, new = (one.reaction_rows("left") @ u.ravel() for one in (body, better))
    assert np.linalg.norm(defect.reactions["left"] - (new - old)) <= 0.1 * np.linalg.norm(new - old)


def loaded(body: ElasticBody) -> sparse.csc_array:
    """A right-hand side (r, 1) of tractions that no polynomial of a low degree balances."""
    source = np.zeros(body.rows)
    for name, surface in body.model.cloud.surfaces.items():
        values = np.sin(5.0 * body.model.cloud.points[surface.index, ::-1]) * surface.normal
        source += body.source(name, values, held=False)
    return sparse.csc_array(source[:, None])


@pytest.mark.parametrize("poisson", [0.3, 0.4999])
@pytest.mark.parametrize("held", [HELD, {}], ids=["held", "free"])
def test_corrections_are_those_of_refined_solutions(
    held: dict[str, tuple[bool, bool]], poisson: float
) -> None:
    body = build(jittered_square(14), held, material=isotropic(210.0, poisson, "strain"))
    source, moved = loaded(body), np.tile([0.1, -0.2], len(body.model.cloud.points))
    found = correct(body, source, moved)
    solution = body.system.solve(source)[:, 0] + moved
    np.testing.assert_allclose(found.displacement.ravel(), solution, atol=1e-6 * np.abs(solution).max())
    beyond = sparse.csc_array(defect_of(body, solution.reshape(-1, 2)).source[:, None])
    exact = body.system.solve(beyond)[:, 0]
    assert np.linalg.norm(found.change - exact) <= 10.0 * CORRECTION_TOLERANCE * np.linalg.norm(exact)
    # The same by fits that are kept, of another state too.
    memo = Memo(1)
    other = correct(body, -2.0 * source, moved, memo=memo).change
    np.testing.assert_allclose(
        correct(body, source, moved, memo=memo).change, found.change, atol=1e-4 * np.abs(found.change).max()
    )
    np.testing.assert_allclose(other, -2.0 * found.change, atol=1e-3 * np.abs(other).max())


@pytest.mark.parametrize("off", [1.0, 1.1])
def test_rough_solutions_are_refined_where_they_are_too_rough(
    off: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    body = build(jittered_square(12), HELD)
    assert isinstance(body.system, LeastSquares)
    source, moved = loaded(body), np.zeros(body.model.unknowns)
    right, expected = LeastSquares.correction, correct(body, source, moved)
    sources = sparse.csc_array(np.random.default_rng(1).normal(size=(body.rows, 2)))
    exact = body.system.solve(sources)
    monkeypatch.setattr(LeastSquares, "correction", lambda *of: off * right(*of))
    found = correct(body, source, moved)
    assert (found.rough > CORRECTION_TOLERANCE) == (off > 1.0)
    np.testing.assert_allclose(found.change, expected.change, atol=1e-2 * np.abs(expected.change).max())
    assert np.linalg.norm(found.response(body, sources) - exact) <= CORRECTION_TOLERANCE * np.linalg.norm(
        exact
    )


def test_other_degrees_are_refused() -> None:
    body = build(jittered_square(12), HELD, 5)
    with pytest.raises(NumericalError, match="degree 5"):
        defect_of(body, np.zeros((len(body.model.cloud.points), 2)))
