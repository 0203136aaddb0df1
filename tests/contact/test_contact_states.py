"""States of contacts with and without friction: against enumeration, and what the residual sees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.random_complementarity import Example
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.contact_state import residual
from mlsanm_cli.contact.laws.coulomb import increment, unloaded
from mlsanm_cli.contact.laws.frictionless import solve_exact
from mlsanm_cli.contact.response.compressed import Counts, LinearMap
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.errors import NumericalError
from tests.contact.friction import half_planes
from tests.contact.scenes import synthetic

FULL = np.ones(1)


def random_compliance(m: int, rng: np.random.Generator, skew: float = 0.0) -> FloatArray:
    """A matrix with a positive definite symmetric part, ``skew`` of it unsymmetric."""
    root = rng.normal(size=(m, m))
    lean = rng.normal(size=(m, m))
    return np.asarray(root @ root.T / m + 0.05 * np.eye(m) + skew * (lean - lean.T))


def of_pressures(counts: Counts, rows: FloatArray) -> LinearMap:
    """A map (r, m) of the pressures alone."""
    return replace(LinearMap.zeros(len(rows), counts), pressure=rows)


def platen(compliance: FloatArray, gap: FloatArray, force: float) -> Condensed:
    """The same surface on a platen that a force presses: gap + q, sum of pressures = force."""
    m = len(gap)
    counts = (1, 1, m, 0)
    push = LinearMap.of_loads(np.array([[-force]]), counts)
    sums = of_pressures(counts, np.ones((1, m)))
    return synthetic(compliance, gap, np.zeros((m, 1)), push + sums, np.ones((m, 1)))


def enumerated(c: Condensed) -> list[FloatArray]:
    """Pressures and tractions of all states at full load."""
    rows = [[one.pressure, one.traction, one.motion] for one in (c.gap, c.slip, c.balance)]
    free = np.concatenate([one.constant + one.load @ FULL for one in (c.gap, c.slip, c.balance)])
    problem = Example(np.block(rows), free, c.friction_nodes, c.friction, len(c.weight))
    return [x[: problem.contacts] for x in problem.states()]


@given(
    m=st.integers(1, 7),
    seed=st.integers(0, 100_000),
    skew=st.sampled_from([0.0, 0.2]),
    force=st.none() | st.floats(1e-3, 100.0),
)
def test_the_state_without_friction_is_the_only_one(
    m: int, seed: int, skew: float, force: float | None
) -> None:
    """On a fixed body, and under a platen that a ``force`` presses; whatever the search starts from."""
    rng = np.random.default_rng(seed)
    compliance, gap = random_compliance(m, rng, skew), rng.normal(size=m)
    condensed = synthetic(compliance, gap) if force is None else platen(compliance, gap, force)
    state = solve_exact(condensed, FULL, rng.uniform(size=m) < 0.5)
    states = enumerated(condensed)
    assert states
    for pressure in states:
        assert state.pressure == pytest.approx(pressure, abs=1e-8 * max(1.0, np.abs(pressure).max()))
    assert residual(condensed, state) <= 1e-10
    assert not (state.closed & (state.gap != 0.0)).any()
    assert not (~state.closed & (state.pressure != 0.0)).any()


def test_loads_that_nothing_resists_are_refused() -> None:
    """A platen pulled off, and a motion that changes no gap."""
    rng, push = np.random.default_rng(0), LinearMap.of_loads(np.array([[1.0]]), (1, 1, 2, 0))
    idle = synthetic(np.eye(2), np.array([-1.0, -1.0]), np.zeros((2, 1)), push, np.zeros((2, 1)))
    for condensed in (platen(random_compliance(5, rng), rng.normal(size=5), -1.0), idle):
        with pytest.raises(NumericalError, match="no contact pressure balances the loads"):
            solve_exact(condensed, FULL)


@pytest.mark.parametrize("walls", [(0,), (0, 2)], ids=["one", "two"])
@pytest.mark.parametrize("seed", range(4))
def test_an_unloaded_body_that_overlaps_as_drawn_is_moved(seed: int, walls: tuple[int, ...]) -> None:
    """In a round hole, with walls that it overlaps: nothing presses where it comes to rest."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(0.0, 2.0 * np.pi, 9, endpoint=False)
    motion, counts = np.stack([np.cos(angle), np.sin(angle)], axis=1), (1, 2, 9, 0)
    balance = LinearMap.of_loads(np.zeros((2, 1)), counts) + of_pressures(counts, motion.T)
    gap = rng.uniform(1e-7, 4e-7, 9)
    gap[list(walls)] = [-4e-9, -3.1e-9][: len(walls)]
    condensed = synthetic(random_compliance(9, rng), gap, np.zeros((9, 1)), balance, motion)
    state = solve_exact(condensed, FULL, gap < 0.0)
    assert state.gap.min() >= -1e-20
    assert not state.pressure.any()
    assert residual(condensed, state) <= 1e-8


def test_a_body_between_soft_supports_moves_out_of_an_overlap_without_pressure() -> None:
    """The supports give way under a common pressure by far more than under one of its nodes."""
    side = np.repeat([1.0, -1.0], 25)
    motion, counts = side[:, None], (1, 1, 50, 0)
    balance = LinearMap.of_loads(np.zeros((1, 1)), counts) + of_pressures(counts, motion.T)
    compliance = 1e-5 * np.eye(50) + 1e-3 * (side[:, None] == side)
    gap = np.where(side > 0.0, 1e-3, -1e-4)
    condensed = synthetic(compliance, gap, np.zeros((50, 1)), balance, motion)
    state = solve_exact(condensed, FULL)
    assert not state.pressure.any()
    assert state.gap.min() >= -1e-15
    assert residual(condensed, state) <= 1e-8


def random_problem(m: int, seed: int, friction: float) -> Condensed:
    """``m`` nodes with a positive compliance over pressures and tractions, without platens."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(2 * m, 2 * m))
    whole = root @ root.T / (2 * m) + 0.3 * np.eye(2 * m)
    gap, load = rng.normal(size=m), rng.normal(size=(m, 1))
    motion = np.zeros((m, 0))
    counts = 1, 0, m, m
    return replace(
        synthetic(whole[:m, :m], gap, load),
        tangential={"contact": slice(0, m)},
        friction_nodes=np.arange(m),
        friction=np.full(m, friction),
        gap=LinearMap(gap, load, motion, whole[:m, :m], whole[:m, m:]),
        slip=LinearMap(np.zeros(m), rng.normal(size=(m, 1)), motion, whole[m:, :m], whole[m:, m:]),
        watched=LinearMap.zeros(0, counts),
        balance=LinearMap.zeros(0, counts),
    )


@given(seed=st.integers(0, 300), friction=st.floats(0.05, 1.5))
def test_increments_never_give_work_back(seed: int, friction: float) -> None:
    c = random_problem(8, seed, friction)
    state = unloaded(c, np.zeros(1))
    # There and back: nodes turn, and what presses them falls meanwhile.
    for load in (FULL, -0.5 * FULL, FULL):
        before = state.work
        found = increment(c, state, load)
        assert found is not None
        state = found
        assert residual(c, state) <= 1e-9
        assert (state.work >= before - 1e-9).all()


def test_residual_sees_every_law() -> None:
    planes = half_planes(40)
    state = planes.event_driven_path((1.0, 0.0), (1.0, 0.5))[-1]
    c = planes.condensed
    assert residual(c, state) <= 1e-12
    slipping = np.flatnonzero(state.status.slip_sign)[0]
    beyond = state.traction.copy()
    beyond[slipping] *= 1.01
    assert residual(c, replace(state, traction=beyond)) >= 1e-5
    assert residual(c, replace(state, motion=state.motion + np.array([1e-6, 0.0]))) >= 1e-5
    assert residual(c, replace(state, motion=state.motion + np.array([0.0, 1e-6]))) >= 1e-5
    assert residual(c, replace(state, pressure=-state.pressure)) >= 0.5
    assert residual(c, replace(state, reference=state.reference + 1e-6)) >= 1e-5
