"""Normal equations in blocks."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sparse
from hypothesis import given, settings
from hypothesis import strategies as st

from mlsanm_cli.arrays import IntArray
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.operators import factors
from mlsanm_cli.operators.factors import nested_dissection
from mlsanm_cli.operators.least_squares import NormalPattern


def bordered(
    rows: sparse.csr_array, strong: sparse.csr_array, owner: IntArray, vertices: int
) -> sparse.bsr_array:
    """The matrix [M^T M, B^T; B, -1] of ``rows`` M and ``strong`` rows B."""
    return NormalPattern(rows, strong, owner, vertices).matrix(rows, strong, rows, strong)


def normal_equations(rows: sparse.csr_array) -> sparse.bsr_array:
    return bordered(rows, sparse.csr_array((0, rows.shape[1])), np.zeros(0, dtype=np.int64), 0)


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
