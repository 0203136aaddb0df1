"""What holds a platen along its contacts, whatever the axes and whatever other contacts do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mlsanm_cli.contact.complementarity.problem import Changes, ContactStatus
from mlsanm_cli.contact.complementarity.solution import Search
from mlsanm_cli.contact.laws.coulomb import event_driven_path, start
from mlsanm_cli.contact.laws.failures import SlidingError
from mlsanm_cli.contact.laws.limit_load import slides_freely
from mlsanm_cli.contact.laws.linearised import ContactSolution
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.linear_map import LinearMap
from tests.contact.friction import half_planes, side_by_side


def turned(condensed: Condensed, angle: float) -> Condensed:
    """The same contact with its platen's motions counted along axes that are turned by an angle."""
    axes = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    def of(one: LinearMap) -> LinearMap:
        return replace(one, motion=one.motion @ axes)

    return replace(condensed, gap=of(condensed.gap), slip=of(condensed.slip))


def all_slip(condensed: Condensed, but: tuple[int, ...] = ()) -> ContactStatus:
    slip_sign = np.ones(len(condensed.friction_nodes))
    slip_sign[list(but)] = 0.0
    return ContactStatus(np.ones(len(condensed.weight), dtype=bool), slip_sign == 0.0, slip_sign)


def moving(motion: list[float]) -> ContactSolution:
    """Rates of motions while all forces are constant."""
    none = np.zeros(20)
    return ContactSolution(none, none, np.array(motion), none, none)


@pytest.mark.parametrize("angle", np.radians([0.0, 37.0, 90.0, 180.0, 233.0]).tolist())
def test_axes_mean_nothing(angle: float) -> None:
    c = turned(half_planes(20).condensed, angle)
    assert slides_freely(c, all_slip(c))
    assert not slides_freely(c, all_slip(c, (3,)))
    nothing = np.zeros(20)
    assert not slides_freely(c, ContactStatus(nothing > 0.0, nothing > 0.0, nothing))


@pytest.mark.parametrize(("rates", "slides"), [([1.0, 0.5], False), ([0.0, 1.0], True), ([1.0, 1e3], True)])
def test_what_slips_everywhere_and_is_not_driven_along_does_not_slide(
    rates: list[float], slides: bool
) -> None:
    c = half_planes(20).condensed
    assert slides_freely(c, all_slip(c), moving(rates)) == slides


def test_a_surface_that_rises_holds() -> None:
    c = half_planes(20).condensed
    for slope, slides in ((0.1, True), (-1.0, False)):
        # Half of the nodes face one way, half the other: sliding either way closes some of them.
        motion = c.gap.motion + np.outer(slope * np.sign(np.arange(20) - 9.5), [0.0, 1.0])
        assert slides_freely(replace(c, gap=replace(c.gap, motion=motion)), all_slip(c)) == slides


@pytest.mark.parametrize(
    ("curvature", "fast", "slides"), [(-0.005, 1.0, False), (0.005, 1.0, True), (-1e-4, 1e3, True)]
)
def test_a_hollow_holds_what_slides_along_it(curvature: float, fast: float, slides: bool) -> None:
    """A pin in a hook slipped everywhere as the hook bent, and the run ended as if it slid as a whole."""
    c = half_planes(20).condensed
    along = c.slip.motion[:, 1].mean()
    motion = c.gap.motion + np.outer(curvature * along * (np.arange(20) - 9.5), [0.0, 1.0])
    c = replace(c, gap=replace(c.gap, motion=motion))
    for way in (1.0, -1.0):
        assert slides_freely(c, all_slip(c), moving([1.0, way * fast])) == slides
    # With slave and master swapped places are counted the other way.
    c = replace(c, gap=replace(c.gap, motion=motion[::-1]), slip=replace(c.slip, motion=-c.slip.motion))
    assert slides_freely(c, all_slip(c), moving([1.0, fast])) == slides


@pytest.mark.parametrize(("degrees", "slides"), [(0.0, True), (2.0, False), (8.0, False)])
def test_a_slender_wedge_does_not_slide_through(degrees: float, slides: bool) -> None:
    one = half_planes(20)
    c = side_by_side(one.condensed, one.condensed)
    up, along = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    # Both flanks of one body, whose motions are along its axis and across it.
    motions = np.array([[up, along], [along, -up], [up, -along], [along, up]])
    c = replace(
        c,
        gap=replace(c.gap, motion=c.gap.motion @ motions),
        slip=replace(c.slip, motion=c.slip.motion @ motions),
        balance=replace(c.balance, motion=np.zeros((2, 2))),
    )
    assert slides_freely(c, all_slip(c)) == slides


def test_a_prescribed_displacement_holds() -> None:
    c = half_planes(20).condensed
    stiff = replace(c.balance, motion=np.eye(2))
    assert not slides_freely(replace(c, balance=stiff), all_slip(c))


def test_other_contacts_have_no_say() -> None:
    one = half_planes(20)
    c = side_by_side(one.condensed, one.condensed)
    assert slides_freely(c, all_slip(c, tuple(range(20))))
    assert not slides_freely(c, all_slip(c, (3, 33)))


def test_one_of_two_contacts_that_slides_is_named() -> None:
    one = half_planes(20)
    c = side_by_side(one.condensed, one.condensed)
    state = start(c, np.zeros(4)).state
    for event in event_driven_path(c, state, np.array([1.0, 0.0, 1.0, 0.0]), [1.0]):
        state = event.state
    with pytest.raises(SlidingError) as caught:
        list(event_driven_path(c, state, np.array([1.0, 0.4, 1.0, 1.25]), [1.0]))
    assert caught.value.fraction == pytest.approx(0.8, abs=1e-9)


def test_a_body_that_slips_both_ways_rests_somewhere() -> None:
    # A clamped strip spreads both ways; when its last sticking node gives way another one comes to rest.
    c = half_planes(20, beta=0.5).condensed
    slip_sign, never = np.where(np.arange(20) < 9, 1.0, -1.0), np.zeros(20, dtype=bool)
    allowed = Changes(never, never, slip_sign > 0.0, slip_sign < 0.0)
    load = c.free_rows(np.array([1.0, 0.0]), rates=True)
    sets = (
        Search(c.problem, load, np.zeros(20), allowed).solved(ContactStatus(~never, never, slip_sign)).status
    )
    assert sets.stuck.any()
    assert not slides_freely(c, sets)
