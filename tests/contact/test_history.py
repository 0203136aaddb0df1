"""The exact history with friction, against Cattaneo and Mindlin, and what must hold at every event."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mlsanm_cli.contact.laws.contact_state import ContactState, residual
from mlsanm_cli.contact.laws.coulomb import event_driven_path, start
from mlsanm_cli.contact.laws.failures import SlidingError
from tests.contact.friction import HalfPlanes, half_planes

UP, BACK, TURNED = (1.0, 0.5), (1.0, 0.0), (1.0, -0.5)
PRESSED = (1.0, 0.0)


def difference(one: np.ndarray, other: np.ndarray, over: np.ndarray) -> float:
    return float(np.linalg.norm(one - other) / np.linalg.norm(over))


@pytest.fixture(scope="module")
def planes() -> HalfPlanes:
    return half_planes(160)


def test_shear_unload_reverse(planes: HalfPlanes) -> None:
    pressed, sheared, unloaded_, reversed_, again = planes.event_driven_path(PRESSED, UP, BACK, TURNED, BACK)
    assert np.abs(pressed.traction).max() <= 1e-9 * planes.peak
    first = planes.cattaneo(0.5)
    t = [-state.traction for state in (sheared, unloaded_, reversed_, again)]
    # The formulas' tractions act on the body below the platen's; sheared to +x, the cylinder is held to -x.
    assert difference(t[0], -first, first) <= 0.02
    residue = -first + 2.0 * planes.cattaneo(0.25)
    assert difference(t[1], residue, first) <= 0.02
    assert difference(t[2], first, first) <= 0.02
    assert difference(t[2], -t[0], first) <= 1e-9
    assert difference(t[3], -t[1], first) <= 1e-9
    stick = planes.x[sheared.status.stuck]
    assert 0.5 * np.ptp(stick) == pytest.approx(planes.half * np.sqrt(0.5), abs=0.05 * planes.half / 1.5)


@pytest.mark.parametrize(
    ("beta", "shift", "friction"), [(0.0, 0.0, 0.3), (0.2, 0.0003, 0.3), (0.3, 0.0001, 1.0)]
)
def test_laws_hold_at_every_event(beta: float, shift: float, friction: float) -> None:
    planes = half_planes(60, friction, beta, shift)
    c, state = planes.condensed, start(planes.condensed, np.zeros(2))
    for target in (PRESSED, UP, BACK, TURNED, (0.4, -0.1), (1.0, 0.6)):
        begin, before = state.factors, state
        path = event_driven_path(c, state, np.array(target), [0.5, 1.0])
        for state in path:
            assert not state.jumped
            assert residual(c, state) <= 1e-9
            limit = friction * state.pressure * (1.0 + 1e-9) + 1e-13 * planes.peak
            assert (np.abs(state.traction) <= limit).all()
            assert state.factors == pytest.approx(begin + state.fraction * (np.array(target) - begin))
            # Work per node never falls, and stays what it was where nothing slips.
            assert (state.work >= before.work - 1e-15 * planes.peak).all()
            resting = state.status.slip_sign == 0.0
            assert (state.work[resting] == before.work[resting]).all()
            # Friction acts against the slip of slipping nodes.
            slipped = state.slip - before.slip
            assert (state.status.slip_sign * slipped <= 1e-9 * np.abs(slipped).max(initial=1e-300)).all()
            before = state
        forces = planes.condensed.weight @ np.stack([state.pressure, state.traction], axis=1)
        assert forces == pytest.approx(
            [target[0] * planes.force, -target[1] * friction * planes.force], abs=1e-9 * planes.force
        )


def test_laws_hold_on_graded_grids() -> None:
    """Where the finest strips are a millionth of the widest, pressures solved for anew at every event were
    off by 1e-10; on grids graded towards corners by 1e-7, and runs ended for that."""
    planes = half_planes(60, shift=0.045, finest=1e-6)
    c, state = planes.condensed, start(planes.condensed, np.zeros(2))
    for target in (PRESSED, UP, BACK, TURNED):
        path = event_driven_path(c, state, np.array(target), [1.0])
        for state in path:
            assert residual(c, state) <= 2e-12


def test_an_event_takes_one_new_system(planes: HalfPlanes) -> None:
    c = planes.condensed
    events = list(event_driven_path(c, start(c, np.zeros(2)), np.array(PRESSED), [1.0]))
    assert len(events) > 40
    assert sum(event.solves for event in events) <= 1.2 * len(events)


def test_sliding_as_a_whole_is_named() -> None:
    planes = half_planes(60)
    state = planes.event_driven_path(PRESSED)[0]
    events: list[ContactState] = []
    with pytest.raises(SlidingError) as caught:
        events.extend(event_driven_path(planes.condensed, state, np.array([1.0, 1.25]), [1.0]))
    # The load factor of the shear force is relative to mu P.
    assert caught.value.fraction * 1.25 == pytest.approx(1.0, abs=1e-9)
    assert events[-1].fraction == caught.value.fraction


def test_a_guided_plate_backs_out_of_an_inclined_overlap_without_friction() -> None:
    # Without pressure there is no friction: at rest the node that comes free last had taken a traction beyond
    # its limit, and the run was refused.
    planes = half_planes(40)
    condensed = planes.condensed

    gap = replace(condensed.gap, constant=condensed.gap.constant - 1e-4, motion=np.full((40, 1), 0.8))
    guide = replace(
        condensed,
        gap=gap,
        slip=replace(condensed.slip, motion=np.full((40, 1), 0.6)),
        balance=replace(condensed.balance.take(slice(0, 1)), motion=np.zeros((1, 1))),
    )
    event = start(guide, np.zeros(2))
    assert residual(guide, event) == 0.0
    assert event.motion[0] == pytest.approx(1e-4 / 0.8, rel=0.02)
    assert not event.pressure.any()
    for one in event_driven_path(guide, event, np.array([1.0, 0.0]), [1.0]):
        assert residual(guide, one) <= 1e-8
    assert guide.weight @ one.pressure == pytest.approx(planes.force)
