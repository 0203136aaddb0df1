"""Where knots touch within an increment."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.contact.finite.exact import touching


def test_ends_of_contact_move_evenly() -> None:
    """Knots 2 and 3 were closed; 4 to 6 and 1 have entered, from knots 7 and 0 outside."""
    before, now = np.zeros(10, dtype=bool), np.zeros(10, dtype=bool)
    before[2:4] = now[1:7] = True
    part, beside = touching(np.ones(10), before, now, around=False)
    np.testing.assert_allclose(part, [0, 0.5, 0, 0, 1 / 6, 1 / 2, 5 / 6, 0, 0, 0])
    np.testing.assert_array_equal(beside, [0, 0, 2, 3, 7, 7, 7, 7, 8, 9])


def test_a_contact_passes_the_start_of_a_closed_side() -> None:
    before, now = np.zeros(8, dtype=bool), np.zeros(8, dtype=bool)
    before[[6, 7]] = now[[7, 0, 1]] = True
    part, beside = touching(np.ones(8), before, now, around=True)
    np.testing.assert_allclose(part, [1 / 4, 3 / 4, 0, 0, 0, 0, 0, 0])
    np.testing.assert_array_equal(beside, [2, 2, 2, 3, 4, 5, 6, 7])


def test_new_patches_and_corners_count_from_the_start() -> None:
    """A patch without an earlier knot; one that reaches the end of its side, beyond which nothing moves."""
    before, now = np.zeros(8, dtype=bool), np.zeros(8, dtype=bool)
    before[6], now[[1, 2, 6, 7]] = True, True
    part, beside = touching(np.ones(8), before, now, around=False)
    assert not part.any()
    np.testing.assert_array_equal(beside, np.arange(8))
