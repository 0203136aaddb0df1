"""Functionals of many solutions, corrected where the factor loses digits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import scipy.sparse as sparse
from hypothesis import given, settings
from hypothesis import strategies as st

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.operators import factors
from mlsanm_cli.operators.factors import nested_dissection
from mlsanm_cli.operators.normal import bordered, normal_equations
from mlsanm_cli.operators.system import CHECK_COLUMNS, RANK, corrected
from mlsanm_cli.roundoff import ROUND_OFF


@dataclass
class Matrix:
    """A matrix (g, c) with the number of columns and rows asked for."""

    values: FloatArray
    asked: int = 0

    def of_columns(self, chosen: FloatArray) -> FloatArray:
        self.asked += chosen.shape[1]
        return np.asarray(self.values @ chosen)

    def of_rows(self, chosen: FloatArray) -> FloatArray:
        self.asked += chosen.shape[1]
        return np.asarray(chosen.T @ self.values)

    def start(self, rank: int, size: float) -> FloatArray:
        """The matrix with an error of that rank and relative size."""
        rng = np.random.default_rng(rank)
        error = rng.normal(size=(len(self.values), rank)) @ rng.normal(size=(rank, self.values.shape[1]))
        size *= float(np.linalg.norm(self.values))
        return np.asarray(self.values + size * error / max(float(np.linalg.norm(error)), 1e-300))


def example(seed: int, shape: tuple[int, int] = (120, 90)) -> Matrix:
    return Matrix(np.random.default_rng(seed).normal(size=shape))


def error_of(matrix: Matrix, found: FloatArray) -> float:
    return float(np.linalg.norm(found - matrix.values) / np.linalg.norm(matrix.values))


@given(seed=st.integers(0, 500), rank=st.integers(0, RANK), size=st.sampled_from([1e-6, 1e-2, 10.0]))
def test_errors_of_low_rank_go_with_few_solutions(seed: int, rank: int, size: float) -> None:
    matrix = example(seed)
    assert error_of(matrix, corrected(matrix.start(rank, size), matrix.of_columns, matrix.of_rows)) <= 1e-9
    assert matrix.asked == 2 * RANK + CHECK_COLUMNS


@pytest.mark.parametrize(("rank", "most"), [(RANK + 3, 80), (80, 400)])
def test_errors_of_higher_rank_take_more_solutions(rank: int, most: int) -> None:
    matrix = example(1)
    found = corrected(matrix.start(rank, 1e-3), matrix.of_columns, matrix.of_rows)
    assert error_of(matrix, found) <= 2.0 * ROUND_OFF
    assert 2 * RANK + CHECK_COLUMNS < matrix.asked <= most


def test_small_columns_are_corrected_beside_large_ones() -> None:
    # What the factor gets wrong of the small ones is nowhere in the large ones: unless all count alike it is
    # lost in the noise of these.
    rng = np.random.default_rng(0)
    exact = rng.normal(size=(120, 90))
    size = np.where(np.arange(90) < 45, 1.0, 1e-9)
    shapes = rng.normal(size=(120, 8))
    error = np.hstack([shapes[:, :4] @ rng.normal(size=(4, 45)), shapes[:, 4:] @ rng.normal(size=(4, 45))])

    def of_columns(chosen: FloatArray) -> FloatArray:
        answer = (exact * size) @ chosen
        return np.asarray(answer + 1e-10 * np.abs(answer).max(axis=0) * rng.normal(size=answer.shape))

    def of_rows(chosen: FloatArray) -> FloatArray:
        answer = chosen.T @ exact
        return np.asarray((answer + 1e-10 * np.abs(answer).max() * rng.normal(size=answer.shape)) * size)

    found = corrected((exact + 1e-3 * error) * size, of_columns, of_rows)
    assert np.abs(found / size - exact).max() <= 1e-6


@pytest.mark.parametrize("shape", [(5, 90), (120, 3), (0, 90), (120, 0), (6, 5)])
def test_few_rows_or_columns_are_taken_as_they_come(shape: tuple[int, int]) -> None:
    matrix = example(4, shape)
    found = corrected(np.zeros(shape), matrix.of_columns, matrix.of_rows)
    assert found.shape == shape
    assert np.array_equal(found, matrix.values @ np.eye(shape[1])) or error_of(matrix, found) <= 1e-15


@settings(max_examples=40)
@given(rows=st.integers(1, 40), nodes=st.integers(1, 15), seed=st.integers(0, 1000))
def test_blocks_are_those_of_the_product(rows: int, nodes: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    # Some rows act on one unknown of a node only, some nodes have no row.
    matrix = sparse.csr_array(sparse.random_array((rows, 2 * nodes), density=0.3, rng=rng))
    found = normal_equations(matrix)
    assert found.blocksize == (2, 2)
    expected = (matrix.T @ matrix).toarray()
    assert np.abs(found.toarray() - expected).max() <= 1e-14 * max(1.0, np.abs(expected).max())
    # One block for each pair of nodes, even if the entries come in any order.
    mixed = sparse.csr_array(matrix)
    for row in range(rows):
        own = slice(mixed.indptr[row], mixed.indptr[row + 1])
        order = rng.permutation(own.stop - own.start)
        mixed.indices[own], mixed.data[own] = mixed.indices[own][order], mixed.data[own][order]
    again = normal_equations(mixed)
    assert len(again.indices) == len(found.indices)
    assert np.abs(again.toarray() - expected).max() <= 1e-14 * max(1.0, np.abs(expected).max())


@pytest.mark.parametrize("most", [39, 40, 399, 400])
def test_more_entries_than_can_be_counted_are_refused(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two rows on all of 20 nodes: 40 entries, and a block for each of 400 pairs."""
    matrix = sparse.csr_array(np.ones((2, 40)))
    whole = normal_equations(matrix)
    monkeypatch.setattr(factors, "MAX_ENTRIES", most)
    if most < 400:
        with pytest.raises(NumericalError, match=f"have {40 if most < 40 else 400} entries"):
            normal_equations(matrix)
        with pytest.raises(NumericalError, match="have 400 entries"):
            nested_dissection(np.random.default_rng(0).uniform(size=(20, 2)), whole)
    else:
        assert np.array_equal(normal_equations(matrix).toarray(), whole.toarray())


@settings(max_examples=40)
@given(places=st.integers(1, 6), nodes=st.integers(1, 15), seed=st.integers(0, 1000))
def test_bordered_equations_against_dense_ones(places: int, nodes: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    plain = sparse.csr_array(sparse.random_array((30, 2 * nodes), density=0.3, rng=rng))
    # Up to four rows to a place, in any order, some of them empty.
    owner = rng.permutation(np.repeat(np.arange(places), rng.integers(1, 5, places)))
    rows = sparse.csr_array(sparse.random_array((len(owner), 2 * nodes), density=0.3, rng=rng))
    found = bordered(plain, rows, owner, 2 * places)
    assert found.blocksize == (2, 2)
    # Four multipliers to a place, those behind its own rows belong to none.
    line = [4 * place + int((owner[:row] == place).sum()) for row, place in enumerate(owner)]
    border = np.zeros((4 * places, 2 * nodes))
    border[line] = rows.toarray()
    expected = np.block([[normal_equations(plain).toarray(), border.T], [border, -np.eye(4 * places)]])
    np.testing.assert_array_equal(found.toarray(), expected)
    # One block for each pair of neighbours.
    line_of = np.repeat(np.arange(found.shape[0] // 2), np.diff(found.indptr))
    assert len(np.unique(line_of * found.shape[0] + found.indices)) == len(found.indices)
