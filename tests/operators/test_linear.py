"""Least squares with weak and strong rows, and sums of strong ones that hold exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sparse
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.operators.least_squares import LeastSquares, Strong, factorise, independent_sums
from mlsanm_cli.operators.system import residual_of

NOTHING = Strong(
    sparse.csr_array((0, 120)),
    sparse.csr_array((0, 300)),
    np.zeros(0, dtype=np.int64),
    np.zeros((0, 2)),
    sparse.csr_array((0, 0)),
)
"""No strong rows."""


def least_squares(apart: float, seed: int = 0) -> tuple[LeastSquares, FloatArray, FloatArray]:
    """A system of 300 rows of 24 entries, its dense rows and weights.

    Both unknowns of a node differ by ``apart`` only in what they do: the smaller, the worse conditioned.
    """
    rng = np.random.default_rng(seed)
    points = rng.uniform(0.0, 1.0, (60, 2))
    near = np.asarray(cKDTree(points).query(points, k=12)[1])
    rows = np.zeros((300, 120))
    for row in range(300):
        columns = 2 * near[row % 60]
        rows[row, columns] = rng.normal(size=12)
        rows[row, columns + 1] = rows[row, columns] + apart * rng.normal(size=12)
    weight = rng.uniform(0.1, 10.0, 300)
    return factorise(sparse.csr_array(weight[:, None] * rows), weight, points, "auto", NOTHING), rows, weight


@given(seed=st.integers(0, 500))
def test_least_squares_against_numpy(seed: int) -> None:
    system, rows, weight = least_squares(1.0, seed)
    b = np.random.default_rng(seed + 1).normal(size=(300, 3))
    expected = np.linalg.lstsq(weight[:, None] * rows, weight[:, None] * b, rcond=None)[0]
    assert np.abs(system.solve(sparse.csc_array(b)) - expected).max() <= 1e-11 * np.abs(expected).max()


def test_refinement_goes_on_where_one_step_is_not_enough() -> None:
    # The worse the conditioning, the less a step brings; the end is the same.
    system, rows, _ = least_squares(1e-6)
    expected = np.random.default_rng(5).normal(size=120)
    b = sparse.csc_array((rows @ expected)[:, None])
    first = system.factor.solve(system.rows.T @ system.scaled(b))
    second = first + system.factor.solve(system.rows.T @ (system.scaled(b) - system.rows @ first))
    assert np.abs(second[:, 0] - expected).max() >= 1e-7
    assert residual_of(system, b, second) >= 1e-8
    assert np.abs(system.solve(b)[:, 0] - expected).max() <= 1e-8
    assert residual_of(system, b, system.solve(b)) <= 1e-8


def test_refinement_finds_what_the_factor_has_lost() -> None:
    """Where modes come out with any size and sign, so that the factor is not definite."""
    system, rows, _ = least_squares(1.0)
    shapes = np.linalg.eigh(system.inverse_normal(np.eye(120)))[1][:, -5:]
    proper = system.factor
    lost = shapes @ np.diag([-3.0, -0.4, -30.0, 7.0, -1.1]) @ shapes.T

    class Flawed:
        note = ""

        def solve(self, rhs: FloatArray) -> FloatArray:
            found = proper.solve(rhs)
            return np.asarray(found + lost @ found)

        def products(self, left: sparse.csr_array, right: sparse.csc_array) -> FloatArray:
            return np.asarray(left @ self.solve(right.toarray()))

    expected = np.random.default_rng(5).normal(size=(120, 2))
    found = replace(system, factor=Flawed()).solve(sparse.csc_array(rows @ expected))
    assert np.abs(found - expected).max() <= 1e-8


def test_residual_tells_the_size_of_a_step() -> None:
    system = least_squares(1.0)[0]
    b = sparse.csc_array(np.random.default_rng(7).normal(size=(300, 1)))
    best, unit = system.solve(b), np.eye(120)
    # One unknown alone, all together, and what the equations resist most and least.
    shapes = np.linalg.svd(np.linalg.inv(system.inverse_normal(unit)))[0]
    for shape in (unit[7], np.ones(120), shapes[:, 0], shapes[:, -1]):
        off = best + 1e-4 * np.linalg.norm(best) * shape[:, None] / np.linalg.norm(shape)
        assert residual_of(system, b, off) == pytest.approx(1e-4, rel=1e-3)
        # From there, one update leads back.
        found = off + system.correction(b, off)
        np.testing.assert_allclose(found, best, rtol=0.0, atol=1e-9 * np.abs(best).max())


def strong_ones(seed: int, sums: sparse.csr_array | None = None) -> Strong:
    """Three strong rows (9, 120) of each of three places among the nodes of :func:`least_squares`, what 300
    right-hand sides do there, and nine of their own; ``sums`` (s, 9) of them hold exactly."""
    rng = np.random.default_rng(seed)
    rows = 10.0 * sparse.random_array((9, 120), density=0.3, rng=rng)
    of_rows = sparse.random_array((9, 300), density=0.1, rng=rng)
    loads = 10.0 * sparse.hstack([of_rows, sparse.eye_array(9)])
    owner = rng.permutation(np.repeat(np.arange(3), 3))
    sums = sparse.csr_array((0, 9)) if sums is None else sums
    places = rng.uniform(0.0, 1.0, (3, 2))
    return Strong(sparse.csr_array(rows), sparse.csr_array(loads), owner, places, sums)


def strengthened(
    apart: float, seed: int = 0, sums: sparse.csr_array | None = None
) -> tuple[LeastSquares, LeastSquares, FloatArray, FloatArray]:
    """A system of :func:`least_squares` alone and with strong rows, all rows densely as they are scaled, and
    what makes their right-hand sides."""
    plain, rows, weight = least_squares(apart, seed)
    points = np.random.default_rng(seed).uniform(0.0, 1.0, (60, 2))
    strong = strong_ones(seed, sums)
    system = factorise(sparse.csr_array(weight[:, None] * rows), weight, points, "auto", strong)
    whole = np.concatenate([weight[:, None] * rows, strong.rows.toarray()])
    scale = np.concatenate([np.hstack([np.diag(weight), np.zeros((300, 9))]), strong.loads.toarray()])
    return plain, system, whole, scale


def some_sums(seed: int) -> sparse.csr_array:
    return sparse.csr_array(np.random.default_rng(seed).normal(size=(2, 9)))


def held(whole: FloatArray, wanted: FloatArray, sums: FloatArray) -> FloatArray:
    """Least squares (120, c) of ``whole`` rows (309, 120), of which sums of the last nine hold exactly."""
    rows, values = sums @ whole[300:], sums @ wanted[300:]
    some = np.linalg.pinv(rows) @ values
    free = np.linalg.svd(rows)[2][len(rows) :].T
    rest = np.linalg.lstsq(whole @ free, wanted - whole @ some, rcond=None)[0]
    return np.asarray(some + free @ rest)


@given(seed=st.integers(0, 500), exact=st.booleans())
@settings(max_examples=15)
def test_strong_rows_and_sums_that_hold_exactly(seed: int, exact: bool) -> None:
    sums, rng = some_sums(seed)[: 2 if exact else 0], np.random.default_rng(seed + 1)
    _, system, whole, scale = strengthened(1.0, seed, sums)
    b = sparse.csc_array(rng.normal(size=(309, 3)))
    expected = held(whole, scale @ b.toarray(), sums.toarray())
    size, column = np.abs(expected).max(), sparse.csc_array(b[:, [0]])
    off = expected[:, :1] + 1e-3 * rng.normal(size=(120, 1))
    found = {
        "solve": (system.solve(b), 1e-10),
        "roughly": (system.correction(b), 1e-6),
        "step": (off + system.correction(column, off), 1e-6),
    }
    for name, (solution, bar) in found.items():
        wanted = expected[:, : solution.shape[1]]
        assert np.abs(solution - wanted).max() <= bar * size, name
        lack = sums @ (whole[300:] @ (solution - wanted))
        size_of_sums = np.abs(sums @ (whole[300:] @ expected)).max(initial=0.0)
        assert np.abs(lack).max(initial=0.0) <= 1e-10 * size_of_sums, name
    observed = sparse.csr_array(np.concatenate([rng.normal(size=(5, 120)), sums @ whole[300:]]))
    mixture = rng.normal(size=(3, 4))
    for mixed, answers in ((None, expected), (mixture, expected @ mixture)):
        assert system.functionals(observed, b, mixed) == pytest.approx(observed @ answers, abs=1e-7 * size)
    # What held them but nearly is told.
    assert residual_of(system, b, expected).max() <= 1e-10
    if exact:
        nearly = strengthened(1.0, seed)[1].solve(b)
        moved = np.linalg.norm(nearly - expected, axis=0) / np.linalg.norm(nearly, axis=0)
        assert residual_of(system, b, nearly) == pytest.approx(moved, rel=1e-4)
        assert moved.min() >= 1e-5
    # Written out.
    matrix, sources = (one.toarray() for one in system.equations(b))
    assert np.abs(np.linalg.solve(matrix, sources) - expected).max() <= 1e-7 * size
    b0, u = b.toarray()[:, 0], rng.normal(size=120)
    assert system.residual_vector(b0, u) == pytest.approx(matrix @ u - sources[:, 0], rel=1e-8, abs=1e-4)


def test_sums_that_say_nothing_or_what_others_say_are_left_out() -> None:
    told = some_sums(0)
    rows = strong_ones(0).rows.toarray()
    _, system, _, _ = strengthened(1.0, 0, sparse.csr_array(sparse.vstack([told, told[[0]]])))
    assert system.conditions.rows.shape == (2, 120)
    assert system.strong.sums.shape == (2, 9)
    twice = strong_ones(0)
    twice = replace(twice, rows=sparse.csr_array(np.vstack([rows[0], rows[0], rows[2:]])))
    sums = sparse.csr_array(np.vstack([[1.0, -1.0, *np.zeros(7)], told.toarray()[0]]))
    kept, numbers = independent_sums(twice.rows, sums)
    assert (kept.shape, numbers.tolist()) == ((1, 120), [1])


@pytest.mark.parametrize("strong", [False, True])
@pytest.mark.parametrize("apart", [1.0, 1e-4])
def test_functionals_are_those_of_the_solutions(apart: float, strong: bool) -> None:
    plain, system, whole, scale = strengthened(apart)
    if not strong:
        system, whole, scale = plain, whole[:300], scale[:300, :300]
    rng = np.random.default_rng(8)
    observed = sparse.csr_array(sparse.random_array((80, 120), density=0.05, rng=rng))
    # Solutions that rows reproduce exactly, so that no reference's own error counts.
    exact = rng.normal(size=(120, 70))
    sources = np.linalg.solve(scale, whole @ exact)
    found = system.functionals(observed, sparse.csc_array(sources))
    assert np.abs(found - np.asarray(observed @ exact)).max() <= 1e-9
    mixture = rng.normal(size=(70, 30))
    found = system.functionals(observed, sparse.csc_array(sources), mixture)
    assert np.abs(found - np.asarray(observed @ exact) @ mixture).max() <= 1e-8
    contrary = sparse.csc_array(rng.normal(size=(len(sources), 70)))
    expected = np.asarray(observed @ system.solve(contrary))
    assert np.abs(system.functionals(observed, contrary) - expected).max() <= 1e-8 * np.abs(expected).max()
