"""The smooth law's scales: every contact has its own."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.contact.laws.active_set import ExactState
from mlsanm_cli.contact.laws.scales import FRICTION_THRESHOLD, MIN_SHARE, regularize
from tests.contact.friction import half_planes, side_by_side


def test_every_contact_is_regularised_by_itself() -> None:
    one, other = half_planes(20, 0.3), half_planes(30, 0.5)
    c = side_by_side(one.condensed, other.condensed)
    pressed, m = np.concatenate([np.full(20, 100.0), np.full(30, 4.0)]), 50
    closed, free = np.ones(m, dtype=bool), np.zeros(m)
    state = ExactState(np.zeros(4), pressed, free, np.zeros(4), free, closed, ~closed, 0, 0.0)
    eta = np.where(np.arange(m) < 20, 1e-3, 1e-5)
    law = regularize(c, [state], eta, 1e-3)
    assert law.pressure == 100.0
    assert law.eta == pytest.approx(np.where(np.arange(m) < 20, 0.1, 4e-5))
    assert law.threshold == pytest.approx(FRICTION_THRESHOLD * law.eta)
    # An asperity at its limit gives by the same part of what friction does in its own contact.
    limit = law.stick_compliance * c.friction * pressed
    slips = np.abs(c.slip.traction @ (c.friction * pressed))
    assert limit[:20] == pytest.approx(1e-3 * slips[:20].max())
    assert limit[20:] == pytest.approx(1e-3 * slips[20:].max())


def test_a_contact_without_pressure_takes_its_scales_from_the_scene() -> None:
    one = half_planes(20)
    c = side_by_side(one.condensed, one.condensed)
    pressed, closed = np.repeat([100.0, 0.0], 20), np.repeat([True, False], 20)
    nothing = np.zeros(40)
    state = ExactState(np.zeros(4), pressed, nothing, np.zeros(4), nothing, closed, ~closed, 0, 0.0)
    law = regularize(c, [state], 1e-3, 1e-3)
    assert law.eta == pytest.approx(np.repeat([0.1, MIN_SHARE * 0.1], 20))
    assert (law.stick_compliance > 0.0).all()
