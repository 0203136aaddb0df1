"""Our own Cholesky factorisation, against dense algebra and SuperLU, on easy and on hard matrices."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sparse
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.operators.factors import (
    Fronts,
    MultifrontalFactor,
    SuperLUFactor,
    backward_error,
    factor_definite,
    factor_general,
    mirrored,
)
from tests.operators.test_normal import bordered


def normal_equations(points: FloatArray, seed: int = 0, apart: float = 1.0) -> sparse.csc_array:
    """Those (2n, 2n) of :func:`neighbours_rows`."""
    rows = neighbours_rows(points, seed, apart)
    return sparse.csc_array(rows.T @ rows)


def neighbours_rows(points: FloatArray, seed: int = 0, apart: float = 1.0) -> sparse.csr_array:
    """Random rows (3n, 2n) over the neighbours of every node.

    Both unknowns of a node differ by ``apart`` only in what they do: the smaller, the worse conditioned.
    """
    rng = np.random.default_rng(seed)
    count = len(points)
    near = np.asarray(cKDTree(points).query(points, k=min(9, count))[1]).reshape(count, -1)
    at = np.repeat(np.arange(3 * count), near.shape[1])
    columns = 2 * np.tile(near, (3, 1)).ravel()
    first = rng.normal(size=len(at))
    second = first + apart * rng.normal(size=len(at))
    entries = (np.concatenate([at, at]), np.concatenate([columns, columns + 1]))
    return sparse.csr_array((np.concatenate([first, second]), entries), shape=(3 * count, 2 * count))


def scattered(count: int, seed: int = 0) -> FloatArray:
    return np.random.default_rng(seed).uniform(0.0, 1.0, (count, 2))


def quasi_definite(count: int, apiece: int, seed: int = 0) -> tuple[sparse.bsr_array, FloatArray, int]:
    """Normal equations bordered by three rows for each of some pieces of about ``apiece`` of the nodes, as
    those of bodies are: the matrix, the places of all vertices, and how many are of multipliers.

    A row touches the nodes of its piece and those around it.
    """
    points, rng = scattered(count, seed), np.random.default_rng(seed)
    pieces = max(1, count // apiece)
    middles = points[rng.permutation(count)[:pieces]]
    near = np.asarray(cKDTree(points).query(middles, k=min(2 * apiece, count))[1]).reshape(pieces, -1)
    line = np.repeat(np.arange(3 * pieces), 2 * near.shape[1])
    column = np.tile(np.stack([2 * near, 2 * near + 1], axis=2).reshape(pieces, -1), (1, 3)).ravel()
    entries = 10.0 * rng.normal(size=len(line)), (line, column)
    rows = sparse.csr_array(entries, shape=(3 * pieces, 2 * count))
    matrix = bordered(neighbours_rows(points, seed), rows, np.repeat(np.arange(pieces), 3), 2 * pieces)
    return matrix, np.concatenate([points, np.repeat(middles, 2, axis=0)]), 2 * pieces


def in_pieces(count: int, apiece: int, seed: int) -> tuple[sparse.csc_array, FloatArray, int]:
    """Several definite matrices of nodes far apart: parts without a separator."""
    matrices = [normal_equations(scattered(count, seed + piece), seed + piece) for piece in range(apiece)]
    points = np.concatenate([scattered(count, seed + piece) + 10.0 * piece for piece in range(apiece)])
    return sparse.csc_array(sparse.block_diag(matrices)), points, 0


@settings(max_examples=30)
@given(
    count=st.integers(1, 120), apiece=st.integers(1, 30), definite=st.booleans(), seed=st.integers(0, 1000)
)
def test_solutions_against_dense_ones(count: int, apiece: int, definite: bool, seed: int) -> None:
    scene = in_pieces(count, 1 + apiece % 3, seed) if definite else quasi_definite(count, apiece, seed)
    matrix, points, negative = scene
    factor = factor_definite(matrix, points, negative)
    assert isinstance(factor, MultifrontalFactor)
    dense = matrix.toarray()
    for shape in ((len(dense),), (len(dense), 5)):
        rhs = np.random.default_rng(seed).normal(size=shape)
        expected = np.linalg.solve(dense, rhs)
        size = np.linalg.cond(dense) * np.abs(expected).max()
        assert np.abs(factor.solve(rhs) - expected).max() <= (1e-13 if negative else 1e-14) * size


@settings(max_examples=30)
@given(count=st.integers(1, 120), apiece=st.integers(1, 30), seed=st.integers(0, 1000))
def test_unsymmetric_solutions_against_dense_ones(count: int, apiece: int, seed: int) -> None:
    graph, points, negative = quasi_definite(count, apiece, seed)
    rng = np.random.default_rng(seed)
    blocks = graph.data + 0.3 * np.abs(graph.data).mean() * rng.normal(size=graph.data.shape)
    matrix = sparse.bsr_array((blocks, graph.indices, graph.indptr), shape=graph.shape)
    factor = factor_general(matrix, Fronts(points, graph, negative), mirrored(graph))
    dense = matrix.toarray()
    for shape in ((len(dense),), (len(dense), 5)):
        rhs = rng.normal(size=shape)
        expected = np.linalg.solve(dense, rhs)
        size = np.linalg.cond(dense) * np.abs(expected).max()
        assert np.abs(factor.solve(rhs) - expected).max() <= 1e-12 * size
    with pytest.raises(NumericalError, match="singular"):
        factor_general(0.0 * matrix, Fronts(points, graph, negative), mirrored(graph))


@settings(max_examples=20)
@given(seed=st.integers(0, 1000), density=st.sampled_from([0.0, 0.01, 0.5]), definite=st.booleans())
def test_products_against_solutions(seed: int, density: float, definite: bool) -> None:
    points = scattered(150, seed)
    scene = (normal_equations(points, seed), points, 0) if definite else quasi_definite(150, 16, seed)
    matrix, places, negative = scene
    rng, size = np.random.default_rng(seed), matrix.shape[0]
    left = sparse.csr_array(sparse.random_array((7, size), density=density, rng=rng))
    right = sparse.csc_array(sparse.random_array((size, 90), density=density, rng=rng))
    expected = left @ np.linalg.solve(matrix.toarray(), right.toarray())
    for solver in ("auto", "superlu") if definite else ("auto",):
        found = factor_definite(matrix, places, negative, solver=solver).products(left, right)
        assert found.shape == (7, 90)
        assert np.abs(found - expected).max() <= 1e-9 * max(1.0, np.abs(expected).max())


@pytest.mark.parametrize("apart", [1.0, 1e-3, 1e-6])
@pytest.mark.parametrize("scales", [0.0, 4.0, 8.0])
def test_hard_matrices_are_solved_as_well_as_by_superlu(apart: float, scales: float) -> None:
    points = scattered(400)
    scale = sparse.diags_array(10.0 ** np.random.default_rng(1).uniform(-scales, scales, 800))
    matrix = sparse.csc_array(scale @ normal_equations(points, apart=apart) @ scale)
    factor = factor_definite(matrix, points)
    assert isinstance(factor, MultifrontalFactor)
    other = factor_definite(matrix, points, solver="superlu")
    assert backward_error(matrix, factor) <= max(1e-16, 3.0 * backward_error(matrix, other))


def test_other_sizes_are_refused_and_nothing_is_asked_of_blas(capfd: pytest.CaptureFixture[str]) -> None:
    points = scattered(60)
    factor = factor_definite(normal_equations(points), points)
    assert factor.solve(np.zeros((120, 0))).shape == (120, 0)
    assert capfd.readouterr().err == ""
    for size in (0, 118, 122):
        with pytest.raises(ValueError, match=f"{size} rows for 120 unknowns"):
            factor.solve(np.ones(size))
    for count in (59, 61):
        with pytest.raises(ValueError, match=f"a graph of 60 vertices for {count} points"):
            factor_definite(normal_equations(points), scattered(count))


def full(count: int) -> sparse.csc_array:
    root = np.random.default_rng(count).normal(size=(2 * count, 2 * count))
    return sparse.csc_array(root @ root.T + np.eye(2 * count))


def star(count: int) -> sparse.csc_array:
    """One node that all others touch."""
    matrix = 2.0 * count * np.eye(2 * count)
    matrix[0], matrix[:, 0] = 1.0, 1.0
    matrix[0, 0] = 2.0 * count
    return sparse.csc_array(matrix)


@pytest.mark.parametrize("place", [scattered, lambda count: np.zeros((count, 2))], ids=["apart", "one place"])
@pytest.mark.parametrize(
    "matrix",
    [full(1), full(90), star(150), sparse.block_diag([full(7) for _ in range(20)], format="csc")],
    ids=["one node", "full", "star", "in pieces"],
)
def test_graphs_unlike_those_of_bodies(matrix: sparse.csc_array, place: Callable[[int], FloatArray]) -> None:
    factor = factor_definite(matrix, place(matrix.shape[0] // 2))
    assert isinstance(factor, MultifrontalFactor)
    assert backward_error(matrix, factor) <= 1e-14


def test_matrices_of_other_signs_than_told_are_left_to_superlu_and_noted() -> None:
    points = scattered(200)
    matrix = normal_equations(points)
    # A pivot of the other sign than told is no pivot.
    twice, places = sparse.block_diag([matrix, np.eye(4)]), np.concatenate([points, points[:2]])
    quasi, quasi_places, _ = quasi_definite(100, 16)
    for other, at, negative in ((sparse.csc_array(twice), places, 2), (quasi, quasi_places, 0)):
        assert isinstance(factor_definite(other, at, negative), SuperLUFactor)
    matrix = matrix - 5.0 * sparse.eye_array(400)
    assert np.linalg.eigvalsh(matrix.toarray())[0] < -0.1
    factor = factor_definite(sparse.csc_array(matrix), points)
    assert isinstance(factor, SuperLUFactor)
    assert "not positive definite" in factor.note
    rhs = np.random.default_rng(0).normal(size=400)
    assert np.abs(factor.solve(rhs) - np.linalg.solve(matrix.toarray(), rhs)).max() <= 1e-9


@pytest.mark.parametrize(
    ("value", "block"),
    [(0.0, 0.0), (np.nan, np.nan), (0.0, [[1e-20, 1.0], [1.0, 1e-20]])],
    ids=["zero", "not a number", "useless pivots"],
)
def test_a_matrix_that_nothing_can_factorise_is_refused(value: float, block: Any) -> None:
    points = scattered(50)
    matrix = normal_equations(points).tolil()
    matrix[6:8, :] = matrix[:, 6:8] = value
    matrix[6:8, 6:8] = block
    with pytest.raises(NumericalError, match=r"could not be factorised|singular to working"):
        factor_definite(sparse.csc_array(matrix), points)
