"""Exact contact against every possible set, and what keeps the search from going round."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.active_set import solve_exact
from mlsanm_cli.contact.response.coercivity import contact_stability
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.linear_map import Columns, LinearMap
from mlsanm_cli.errors import NumericalError
from tests.contact.scenes import synthetic

FULL = np.ones(1)


def random_compliance(m: int, rng: np.random.Generator, skew: float = 0.0) -> FloatArray:
    """A matrix with a positive definite symmetric part, ``skew`` of it unsymmetric."""
    root = rng.normal(size=(m, m))
    lean = rng.normal(size=(m, m))
    return np.asarray(root @ root.T / m + 0.05 * np.eye(m) + skew * (lean - lean.T))


def of_pressures(columns: Columns, rows: FloatArray) -> LinearMap:
    """A map (r, m) of the pressures alone."""
    return replace(columns.zeros(len(rows)), pressure=rows)


def platen(compliance: FloatArray, gap: FloatArray, force: float) -> Condensed:
    """The same surface on a platen that a force presses: gap + q, sum of pressures = force."""
    m = len(gap)
    columns = Columns(1, 1, m)
    push = columns.of_loads(np.array([[-force]]))
    sums = of_pressures(columns, np.ones((1, m)))
    return synthetic(compliance, gap, np.zeros((m, 1)), push + sums, np.ones((m, 1)))


def every_set(condensed: Condensed) -> list[tuple[FloatArray, FloatArray]]:
    """All contact states (pressures and gaps), found by trying every set of closed nodes."""
    gap: LinearMap = condensed.gap
    free = gap.constant + gap.load @ FULL
    m, k = len(free), len(condensed.balance.constant)
    imbalance = condensed.balance.constant + condensed.balance.load @ FULL
    found = []
    for choice in product([False, True], repeat=m):
        closed = np.flatnonzero(choice)
        a = len(closed)
        matrix = np.zeros((a + k, a + k))
        matrix[:a, :a] = gap.pressure[np.ix_(closed, closed)]
        matrix[:a, a:] = gap.motion[closed]
        matrix[a:, :a] = condensed.balance.pressure[:, closed]
        matrix[a:, a:] = condensed.balance.motion
        if a + k and np.linalg.matrix_rank(matrix) < a + k:
            continue
        solution = np.linalg.solve(matrix, np.concatenate([-free[closed], -imbalance]))
        pressure = np.zeros(m)
        pressure[closed] = solution[:a]
        opened = free + gap.motion @ solution[a:] + gap.pressure @ pressure
        if pressure.min() >= -1e-10 and opened.min() >= -1e-10:
            found.append((pressure, opened))
    return found


@given(m=st.integers(1, 7), seed=st.integers(0, 100_000), skew=st.sampled_from([0.0, 0.2]))
def test_state_is_the_only_one_there_is(m: int, seed: int, skew: float) -> None:
    rng = np.random.default_rng(seed)
    condensed = synthetic(random_compliance(m, rng, skew), rng.normal(size=m), rng.normal(size=(m, 1)))
    assert contact_stability(condensed, np.ones(len(condensed.weight), dtype=bool)) > 0.0
    state = solve_exact(condensed, FULL)
    for pressure, gap in every_set(condensed):
        assert np.abs(state.pressure - pressure).max() <= 1e-8 * max(1.0, np.abs(pressure).max())
        assert np.abs(state.gap - gap).max() <= 1e-8 * max(1.0, np.abs(gap).max())
    assert every_set(condensed)
    assert state.residual <= 1e-10
    assert not (state.active & (state.gap != 0.0)).any()
    assert not (~state.active & (state.pressure != 0.0)).any()


@given(m=st.integers(1, 7), seed=st.integers(0, 100_000), force=st.floats(1e-3, 100.0))
def test_platen_finds_its_place(m: int, seed: int, force: float) -> None:
    rng = np.random.default_rng(seed)
    condensed = platen(random_compliance(m, rng), rng.normal(size=m), force)
    state = solve_exact(condensed, FULL)
    assert state.pressure.sum() == pytest.approx(force, rel=1e-9)
    (pressure, gap), *_ = every_set(condensed)
    assert np.abs(state.pressure - pressure).max() <= 1e-8 * force
    assert np.abs(state.gap - gap).max() <= 1e-7 * max(1.0, np.abs(gap).max(), force)


def plain_iteration_cycles(condensed: Condensed) -> bool:
    """Whether exchanging all wrong nodes at once, from the overlapping ones on, meets a set again."""
    compliance, free = condensed.gap.pressure, condensed.gap.constant
    active = free < 0.0
    seen = set()
    while active.tobytes() not in seen:
        seen.add(active.tobytes())
        pressure = np.zeros(len(free))
        closed = np.flatnonzero(active)
        pressure[closed] = np.linalg.solve(compliance[np.ix_(closed, closed)], -free[closed])
        gap = free + compliance @ pressure
        wrong = (active & (pressure < 0.0)) | (~active & (gap < -1e-12))
        if not wrong.any():
            return False
        active = active ^ wrong
    return True


def cycling_problem() -> Condensed:
    """A problem with a positive compliance on which the plain iteration goes round for ever."""
    for seed in range(20_000):
        rng = np.random.default_rng(seed)
        condensed = synthetic(random_compliance(4, rng, 0.7), rng.normal(size=4))
        if plain_iteration_cycles(condensed):
            return condensed
    raise AssertionError("no cycling problem among those tried")


def test_safeguard_ends_a_cycle() -> None:
    condensed = cycling_problem()
    assert contact_stability(condensed, np.ones(len(condensed.weight), dtype=bool)) > 0.0
    state = solve_exact(condensed, FULL)
    ((pressure, _),) = every_set(condensed)
    assert np.abs(state.pressure - pressure).max() <= 1e-9
    assert state.residual <= 1e-12


@given(seed=st.integers(0, 1000))
def test_every_start_gives_the_same_state(seed: int) -> None:
    rng = np.random.default_rng(seed)
    condensed = synthetic(random_compliance(9, rng), rng.normal(size=9))
    one = solve_exact(condensed, FULL)
    other = solve_exact(condensed, FULL, rng.uniform(size=9) < 0.5)
    assert np.abs(one.pressure - other.pressure).max() <= 1e-9
    again = solve_exact(condensed, FULL, one.active)
    assert again.solves == 1 or not one.active.any()


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e9])
def test_units_change_nothing(scale: float) -> None:
    rng = np.random.default_rng(3)
    compliance, gap = random_compliance(12, rng), rng.normal(size=12)
    one = solve_exact(synthetic(compliance, gap), FULL)
    other = solve_exact(synthetic(compliance * scale, gap * 1e-3), FULL)
    assert np.array_equal(one.active, other.active)
    assert other.pressure * scale * 1e3 == pytest.approx(one.pressure, rel=1e-10, abs=1e-12)


def test_open_surfaces_stay_as_they_are() -> None:
    state = solve_exact(synthetic(np.eye(3), np.array([0.1, 0.0, 2.0])), FULL)
    assert (state.pressure == 0.0).all()
    assert state.gap == pytest.approx([0.1, 0.0, 2.0])
    assert state.residual == 0.0


def test_a_platen_pulled_off_is_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(NumericalError):
        solve_exact(platen(random_compliance(5, rng), rng.normal(size=5), -1.0), FULL)


def test_a_direction_that_nothing_resists_is_refused() -> None:
    columns = Columns(1, 1, 2)
    push = columns.of_loads(np.array([[1.0]]))
    condensed = synthetic(np.eye(2), np.array([-1.0, -1.0]), np.zeros((2, 1)), push, np.zeros((2, 1)))
    with pytest.raises(NumericalError, match="no contact pressure balances the loads"):
        solve_exact(condensed, FULL)


@pytest.mark.parametrize("seed", range(4))
def test_a_body_that_rests_on_its_ends_unloaded_is_found(seed: int) -> None:
    x = np.linspace(-1.0, 1.0, 19)
    columns, motion = Columns(1, 2, 19), np.stack([np.ones(19), x], axis=1)
    balance = columns.of_loads(np.zeros((2, 1))) + of_pressures(columns, motion.T)
    compliance = random_compliance(19, np.random.default_rng(seed))
    condensed = synthetic(compliance, 0.3 + 0.1 * (1.0 - x**2), np.zeros((19, 1)), balance, motion)
    state = solve_exact(condensed, FULL)
    assert state.gap.min() >= -1e-12
    assert np.abs(state.pressure).max() <= 1e-12


@pytest.mark.parametrize("walls", [(0,), (0, 2)], ids=["one", "two"])
@pytest.mark.parametrize("seed", range(4))
def test_an_unloaded_body_that_overlaps_as_drawn_is_moved(seed: int, walls: tuple[int, ...]) -> None:
    """In a round hole, with walls that it overlaps: nothing presses where it comes to rest."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(0.0, 2.0 * np.pi, 9, endpoint=False)
    motion, columns = np.stack([np.cos(angle), np.sin(angle)], axis=1), Columns(1, 2, 9)
    balance = columns.of_loads(np.zeros((2, 1))) + of_pressures(columns, motion.T)
    gap = rng.uniform(1e-7, 4e-7, 9)
    gap[list(walls)] = [-4e-9, -3.1e-9][: len(walls)]
    condensed = synthetic(random_compliance(9, rng), gap, np.zeros((9, 1)), balance, motion)
    state = solve_exact(condensed, FULL, gap < 0.0)
    assert state.gap.min() >= -1e-20
    assert not state.pressure.any()
    assert state.residual <= 1e-8


def test_a_body_between_soft_supports_moves_out_of_an_overlap_without_pressure() -> None:
    """The supports give way under a common pressure by far more than under one of its nodes."""
    side = np.repeat([1.0, -1.0], 25)
    motion, columns = side[:, None], Columns(1, 1, 50)
    balance = columns.of_loads(np.zeros((1, 1))) + of_pressures(columns, motion.T)
    compliance = 1e-5 * np.eye(50) + 1e-3 * (side[:, None] == side)
    gap = np.where(side > 0.0, 1e-3, -1e-4)
    state = solve_exact(synthetic(compliance, gap, np.zeros((50, 1)), balance, motion), FULL)
    assert not state.pressure.any()
    assert state.gap.min() >= -1e-15
    assert state.residual <= 1e-8
