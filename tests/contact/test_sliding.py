"""What holds a platen along its contacts, whatever the axes and whatever other contacts do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.complementarity.problem import ContactStatus
from mlsanm_cli.contact.complementarity.solution import Search
from mlsanm_cli.contact.laws.contact_state import ContactState, SlidingError
from mlsanm_cli.contact.laws.coulomb import event_driven_path, slides_freely, start
from mlsanm_cli.contact.response.condensed import Condensed
from tests.contact.friction import half_planes, side_by_side

ONE = half_planes(20).condensed
TWO = side_by_side(ONE, ONE)
NONE = np.zeros(20)
SIDE = np.arange(20) - 9.5
"""Places of nodes from the middle of the contact."""


def moved(condensed: Condensed, gap: FloatArray, slip: FloatArray) -> Condensed:
    """A contact whose gaps and slips follow the platen's motions by other columns."""
    gaps, slips = replace(condensed.gap, motion=gap), replace(condensed.slip, motion=slip)
    return replace(condensed, gap=gaps, slip=slips)


def turned(angle: float) -> Condensed:
    """The contact with its platen's motions counted along axes that are turned by degrees."""
    cos, sin = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    axes = np.array([[cos, -sin], [sin, cos]])
    return moved(ONE, ONE.gap.motion @ axes, ONE.slip.motion @ axes)


def rising(slope: FloatArray) -> Condensed:
    """The contact on a surface of these slopes at its nodes, which sliding closes or opens."""
    return moved(ONE, ONE.gap.motion + np.outer(slope, [0.0, 1.0]), ONE.slip.motion)


def curved(curvature: float, swapped: bool = False) -> Condensed:
    """The contact in a hollow, or on a ridge if positive; with slave and master swapped places are counted
    the other way."""
    found = rising(curvature * ONE.slip.motion[:, 1].mean() * SIDE)
    return moved(found, found.gap.motion[::-1], -found.slip.motion) if swapped else found


def wedge(degrees: float) -> Condensed:
    """Both flanks of one body, whose motions are along its axis and across it."""
    up, along = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    motions = np.array([[up, along], [along, -up], [up, -along], [along, up]])
    found = moved(TWO, TWO.gap.motion @ motions, TWO.slip.motion @ motions)
    return replace(found, balance=replace(TWO.balance, motion=np.zeros((2, 2))))


def all_slip(condensed: Condensed, but: tuple[int, ...] = ()) -> ContactStatus:
    slip_sign = np.ones(len(condensed.friction_nodes))
    slip_sign[list(but)] = 0.0
    return ContactStatus(np.ones(len(condensed.weight), dtype=bool), slip_sign == 0.0, slip_sign)


def moving(status: ContactStatus, motion: FloatArray) -> ContactState:
    """Rates that only move the platen."""
    none = np.zeros(len(status.stuck))
    return ContactState(none, none, motion, none, none, status)


HELD = replace(ONE, balance=replace(ONE.balance, motion=np.eye(2)))
STATES = {
    **{f"axes turned by {angle}": (turned(angle), (), True) for angle in (0, 37, 90, 180, 233)},
    **{f"a stuck node, axes turned by {angle}": (turned(angle), (3,), False) for angle in (0, 37, 233)},
    "a surface that rises a little": (rising(0.1 * np.sign(SIDE)), (), True),
    "a surface that closes half of the nodes": (rising(-np.sign(SIDE)), (), False),
    "parallel flanks": (wedge(0.0), (), True),
    "a slender wedge": (wedge(2.0), (), False),
    "a wedge": (wedge(8.0), (), False),
    "a prescribed displacement": (HELD, (), False),
    "another contact that sticks": (TWO, tuple(range(20)), True),
    "stuck nodes in both contacts": (TWO, (3, 33), False),
}


@pytest.mark.parametrize(("contact", "stuck", "slides"), STATES.values(), ids=STATES)
def test_what_slips_everywhere_slides(contact: Condensed, stuck: tuple[int, ...], slides: bool) -> None:
    status = all_slip(contact, stuck)
    # The motion that closes least.
    way = np.linalg.svd(np.vstack([contact.gap.motion, contact.slip.motion[status.stuck]]))[2][-1]
    assert slides_freely(contact, moving(status, way)) == slides


def test_open_contacts_do_not_slide() -> None:
    assert not slides_freely(ONE, moving(ContactStatus(NONE > 0.0, NONE > 0.0, NONE), np.ones(2)))


RATES = {
    "driven down": (ONE, [1.0, 0.5], False),
    "driven along": (ONE, [0.0, 1.0], True),
    "driven along far more": (ONE, [1.0, 1e3], True),
    # As a pin in a hook that bends.
    **{f"hollow, {way}": (curved(-0.005), [1.0, way], False) for way in (1.0, -1.0)},
    **{f"ridge, {way}": (curved(0.005), [1.0, way], True) for way in (1.0, -1.0)},
    **{f"hardly hollow and fast, {way}": (curved(-1e-4), [1.0, way], True) for way in (1e3, -1e3)},
    "hollow, swapped": (curved(-0.005, True), [1.0, 1.0], False),
    "ridge, swapped": (curved(0.005, True), [1.0, 1.0], True),
    "hardly hollow and fast, swapped": (curved(-1e-4, True), [1.0, 1e3], True),
}


@pytest.mark.parametrize(("contact", "rates", "slides"), RATES.values(), ids=RATES)
def test_what_is_driven_along_slides(contact: Condensed, rates: list[float], slides: bool) -> None:
    assert slides_freely(contact, moving(all_slip(contact), np.array(rates))) == slides


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
    assert not slides_freely(c, moving(sets, np.array([0.0, 1.0])))
