"""Results kept in a process, and digests: equal for equal content only."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import scipy.sparse as sparse

from mlsanm_cli.memo import NO_CACHE, Memo, digest

ONE = np.array([1.0, 2.0, 3.0, 4.0])
ROWS = sparse.csr_array(np.array([[1.0, 0.0], [2.0, 3.0]]))


@dataclass(frozen=True)
class Pair:
    one: object
    two: object = 0


class Other(Pair):
    pass


class Told(Pair):
    """Only what it tells of itself counts."""

    @property
    def content(self) -> str:
        return str(self.one)


def test_equal_content_has_equal_digests() -> None:
    assert digest(ONE, "a", {"b": [1, 2.5, None]}) == digest(ONE.copy(), "a", {"b": (1, 2.5, None)})
    assert digest(Pair(ONE, Pair("a"))) == digest(Pair(ONE.copy(), Pair("a")))
    assert digest(Told("a", 1)) == digest(Told("a", object()))
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
        ([np.bool_(True)], [np.int64(1)]),
        ([Pair(ONE)], [Pair(2.0 * ONE)]),
        ([Pair(1, 2)], [Pair(2, 1)]),
        ([Pair(1)], [Other(1)]),
        ([Pair([Pair(1)])], [Pair([Pair(2)])]),
        ([Told("a")], [Told("b")]),
        ([Told("a")], ["a"]),
    ],
)
def test_unlike_content_has_unlike_digests(one: list[object], other: list[object]) -> None:
    assert digest(*one) != digest(*other)


def test_what_has_no_digest_is_refused() -> None:
    with pytest.raises(TypeError, match="no digest of a object"):
        digest(object())


def test_the_latest_results_are_kept() -> None:
    memo = Memo(2)
    made: list[str] = []

    def value(key: str) -> str:
        def make() -> str:
            made.append(key)
            return key

        return memo.value("kind", key, make)

    assert [value(key) for key in "abacab"] == list("abacab")
    # c took the place of b, which a's use had made the oldest, and b that of c.
    assert made == list("abcb")
    assert memo.figures == {"found": 2, "made": 4}
    assert (NO_CACHE.value("kind", "a", lambda: 1), NO_CACHE.value("kind", "a", lambda: 2)) == (1, 2)
    assert NO_CACHE.figures == {}
