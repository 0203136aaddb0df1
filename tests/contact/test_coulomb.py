"""Coulomb's law in one increment: against every choice of sets, and what the residual sees."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mlsanm_cli.contact.complementarity.basis import Basis, SingularError
from mlsanm_cli.contact.complementarity.problem import ContactStatus
from mlsanm_cli.contact.laws.coulomb import CoulombState, increment, residual, unloaded
from mlsanm_cli.contact.laws.linearised import ContactSolution
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.linear_map import Columns, LinearMap
from tests.contact.friction import half_planes
from tests.contact.scenes import synthetic

FULL = np.ones(1)


def random_problem(m: int, seed: int, friction: float) -> Condensed:
    """``m`` nodes with a positive compliance over pressures and tractions, without platens."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(2 * m, 2 * m))
    whole = root @ root.T / (2 * m) + 0.3 * np.eye(2 * m)
    gap, load = rng.normal(size=m), rng.normal(size=(m, 1))
    motion = np.zeros((m, 0))
    columns = Columns(1, 0, m, m)
    return replace(
        synthetic(whole[:m, :m], gap, load),
        tangential={"contact": slice(0, m)},
        friction_nodes=np.arange(m),
        friction=np.full(m, friction),
        gap=LinearMap(gap, load, motion, whole[:m, :m], whole[:m, m:]),
        slip=LinearMap(np.zeros(m), rng.normal(size=(m, 1)), motion, whole[m:, :m], whole[m:, m:]),
        watched=columns.zeros(0),
        balance=columns.zeros(0),
    )


def solution(c: Condensed, basis: Basis, before: np.ndarray) -> ContactSolution:
    """The values at full load of the equations of a status, with nodes sticking at slips ``before`` (n,)."""
    p = c.problem
    aim = p.aim(p.rows[p.m : p.contacts] * before)
    return ContactSolution.unscaled(p, *basis.solve(c.free_rows(FULL), aim))


def every_state(c: Condensed, before: np.ndarray) -> list[ContactSolution]:
    """All states that obey the law, found by trying open, sticking and slipping both ways at every node."""
    found = []
    for choice in product(range(4), repeat=len(c.weight)):
        kind = np.array(choice)
        sets = ContactStatus(kind > 0, kind == 1, np.select([kind == 2, kind == 3], [1.0, -1.0], 0.0))
        try:
            v = solution(c, Basis(c.problem, sets), before)
        except SingularError:
            continue
        slipped = v.slip - before
        good = (v.pressure >= -1e-10).all() and (v.gap >= -1e-10).all()
        good &= bool((np.abs(v.traction) <= c.friction * v.pressure + 1e-10).all())
        if good and (sets.slip_sign * slipped <= 1e-10).all():
            found.append(v)
    return found


@given(m=st.integers(1, 4), seed=st.integers(0, 10_000), friction=st.sampled_from([0.1, 0.3]))
def test_state_is_the_only_one_there_is(m: int, seed: int, friction: float) -> None:
    c = random_problem(m, seed, friction)
    state, _ = increment(c, unloaded(c, np.zeros(1)), FULL)
    assert residual(c, state) <= 1e-9
    states = every_state(c, np.zeros(m))
    assert states
    for v in states:
        assert np.abs(v.pressure - state.values.pressure).max() <= 1e-8 * max(1.0, np.abs(v.pressure).max())
        assert np.abs(v.traction - state.values.traction).max() <= 1e-8 * max(1.0, np.abs(v.traction).max())


@pytest.mark.parametrize("seed", [24, 35, 82, 88, 97, 177])
def test_a_node_that_neither_opens_nor_slips_as_it_asks_rests_or_slips_back(seed: int) -> None:
    """With so much friction the search had exchanged one node for ever."""
    c = random_problem(3, seed, 2.5)
    state, _ = increment(c, unloaded(c, np.zeros(1)), FULL)
    (only,) = every_state(c, np.zeros(3))
    assert state.values.pressure == pytest.approx(only.pressure, abs=1e-9)


@given(seed=st.integers(0, 10_000), changes=st.integers(1, 12))
def test_updated_factors_are_those_of_the_sets(seed: int, changes: int) -> None:
    """Also where the system next to it was itself an update, and back at the first sets."""
    c, rng = random_problem(30, seed, 0.3), np.random.default_rng(seed)
    kind, before = rng.integers(0, 4, 30), rng.normal(size=30)
    basis: Basis | None = None
    for _ in range(4):
        sets = ContactStatus(kind > 0, kind == 1, np.select([kind == 2, kind == 3], [1.0, -1.0], 0.0))
        basis = Basis(c.problem, sets) if basis is None else basis.to(sets)
        got, fresh = (solution(c, one, before) for one in (basis, Basis(c.problem, sets)))
        size = 1.0 + np.abs(fresh.pressure).max()
        for name in ("pressure", "traction", "gap", "slip"):
            assert np.abs(getattr(got, name) - getattr(fresh, name)).max() <= 1e-9 * size, name
        kind = kind.copy()
        kind[rng.integers(0, 30, changes)] = rng.integers(0, 4, changes)


@given(seed=st.integers(0, 300), friction=st.floats(0.05, 1.5))
def test_strong_friction_is_solved_too(seed: int, friction: float) -> None:
    c = random_problem(8, seed, friction)
    state, _ = increment(c, unloaded(c, np.zeros(1)), FULL)
    assert residual(c, state) <= 1e-9


@given(seed=st.integers(0, 300), friction=st.floats(0.05, 1.5))
def test_increments_never_give_work_back(seed: int, friction: float) -> None:
    c = random_problem(8, seed, friction)
    state = unloaded(c, np.zeros(1))
    # There and back: nodes turn, and what presses them falls meanwhile.
    for load in (FULL, -0.5 * FULL, FULL):
        before = state.work
        state, _ = increment(c, state, load)
        assert (state.work >= before - 1e-9).all()


def changed(state: CoulombState, **arrays: np.ndarray) -> CoulombState:
    return replace(state, values=replace(state.values, **arrays))


def test_residual_sees_every_law() -> None:
    planes = half_planes(40)
    state = planes.event_driven_path((1.0, 0.0), (1.0, 0.5))[-1]
    c, v = planes.condensed, state.values
    assert residual(c, state) <= 1e-12
    slipping = np.flatnonzero(state.sets.slip_sign)[0]
    beyond = v.traction.copy()
    beyond[slipping] *= 1.01
    assert residual(c, changed(state, traction=beyond)) >= 1e-5
    assert residual(c, changed(state, motion=v.motion + np.array([1e-6, 0.0]))) >= 1e-5
    assert residual(c, changed(state, motion=v.motion + np.array([0.0, 1e-6]))) >= 1e-5
    assert residual(c, changed(state, pressure=-v.pressure)) >= 0.5
    assert residual(c, replace(state, stick_reference=state.stick_reference + 1e-6)) >= 1e-5


def test_statuses() -> None:
    closed = np.array([True, True, False, True])
    sets = ContactStatus(closed, np.array([True, False]), np.array([0.0, -1.0]))
    # Nodes 1 and 3 have friction; node 0 is closed without it.
    assert sets.status(np.array([1, 3])).tolist() == [2, 1, 0, 2]


@pytest.mark.parametrize("scale", [1e-6, 1e9])
def test_units_change_nothing(scale: float) -> None:
    c = random_problem(8, 3, 0.4)
    one, _ = increment(c, unloaded(c, np.zeros(1)), FULL)
    gap, slip = (
        replace(one, pressure=one.pressure * scale, traction=one.traction * scale) for one in (c.gap, c.slip)
    )
    other, _ = increment(replace(c, gap=gap, slip=slip), unloaded(c, np.zeros(1)), FULL)
    assert other.values.traction * scale == pytest.approx(one.values.traction, rel=1e-8, abs=1e-12)
