"""Digests: equal for equal content only."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sparse

from mlsanm_cli.memo import digest

ONE = np.array([1.0, 2.0, 3.0, 4.0])
ROWS = sparse.csr_array(np.array([[1.0, 0.0], [2.0, 3.0]]))


def test_equal_content_has_equal_digests() -> None:
    assert digest(ONE, "a", {"b": [1, 2.5, None]}) == digest(ONE.copy(), "a", {"b": (1, 2.5, None)})
    assert digest(np.asfortranarray(np.eye(3)[:, :2])) == digest(np.eye(3)[:, :2].copy())


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ([ONE], [np.nextafter(ONE, 9.0)]),
        ([ONE], [ONE.reshape(2, 2)]),
        ([ONE], [ONE.view(np.int64)]),
        ([ONE[:2], ONE[2:]], [ONE]),
        (["ab", "c"], ["a", "bc"]),
        ([["a"], "b"], [["a", "b"]]),
        ([1], [1.0]),
        ([True], [1]),
        ([None], ["None"]),
        ([{"a": 1}], [{"a": 2}]),
        ([{"a": 1}], [["a", 1]]),
        ([ROWS], [2.0 * ROWS]),
        ([ROWS], [sparse.csr_array(ROWS.T)]),
        ([ROWS], [sparse.csc_array(ROWS)]),
    ],
)
def test_unlike_content_has_unlike_digests(one: list[object], other: list[object]) -> None:
    assert digest(*one) != digest(*other)


def test_what_has_no_digest_is_refused() -> None:
    with pytest.raises(TypeError, match="no digest of a object"):
        digest(object())
