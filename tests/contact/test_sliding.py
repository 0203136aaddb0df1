"""What holds a platen along its contacts, whatever the axes and whatever other contacts do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mlsanm_cli.contact.complementarity.problem import ContactStatus
from mlsanm_cli.contact.complementarity.solution import Search
from mlsanm_cli.contact.laws.contact_state import SlidingError
from mlsanm_cli.contact.laws.coulomb import event_driven_path, start
from tests.contact.friction import half_planes, side_by_side

ONE = half_planes(20).condensed
TWO = side_by_side(ONE, ONE)
NONE = np.zeros(20)
SIDE = np.arange(20) - 9.5
"""Places of nodes from the middle of the contact."""


@pytest.mark.parametrize("curvature", [0.0, 1e-4, -1e-4, 1e-3, -1e-3])
def test_a_sheared_contact_slides_at_the_limit_of_friction(curvature: float) -> None:
    """On a flat surface, on a ridge and in a hollow, whose slopes add to the limit."""
    slopes = curvature * ONE.slip.motion[:, 1].mean() * SIDE
    gap = replace(ONE.gap, motion=ONE.gap.motion + np.outer(slopes, [0.0, 1.0]))
    condensed = replace(ONE, gap=gap)
    *_, state = event_driven_path(condensed, start(condensed, np.zeros(2)), np.array([1.0, 0.0]), [1.0])
    with pytest.raises(SlidingError) as caught:
        list(event_driven_path(condensed, state, np.array([1.0, 1.25]), [1.0]))
    assert caught.value.fraction == pytest.approx(0.8, abs=1e-9)


def test_one_of_two_contacts_that_slides_is_named() -> None:
    state = start(TWO, np.zeros(4))
    *_, state = event_driven_path(TWO, state, np.array([1.0, 0.0, 1.0, 0.0]), [1.0])
    with pytest.raises(SlidingError) as caught:
        list(event_driven_path(TWO, state, np.array([1.0, 0.4, 1.0, 1.25]), [1.0]))
    assert caught.value.fraction == pytest.approx(0.8, abs=1e-9)


def test_a_body_that_slips_both_ways_rests_somewhere() -> None:
    # A clamped strip spreads both ways; when its last sticking node gives way another one comes to rest.
    c = half_planes(20, beta=0.5).condensed
    slip_sign, never = np.where(SIDE < -0.5, 1.0, -1.0), NONE > 0.0
    allowed = np.stack([never, never, slip_sign > 0.0, slip_sign < 0.0, ~never])
    search = Search(c.problem, c.free_rows(np.array([1.0, 0.0]), rates=True), NONE, allowed)
    sets = search.solved(ContactStatus(~never, never, slip_sign)).status
    assert sets.stuck.any()
