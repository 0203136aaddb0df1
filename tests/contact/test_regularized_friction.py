"""The regularised law with friction: its equations, and what its sets mean."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.complementarity.problem import ContactStatus
from mlsanm_cli.contact.laws.coupling import DenseCoupling
from mlsanm_cli.contact.laws.friction_tangents import FrictionTangent
from mlsanm_cli.contact.laws.regularized_friction import RegularizedFriction
from mlsanm_cli.contact.laws.scales import Regularization
from mlsanm_cli.contact.response.dense import SingularSystemError
from mlsanm_cli.contact.response.linear_map import Columns
from tests.contact.derivatives import error_of_orders
from tests.contact.friction import in_units
from tests.contact.scenes import synthetic


def random_problem(m: int, k: int, seed: int, smooth: int = 1) -> RegularizedFriction:
    """A made-up problem; the first ``smooth`` nodes have no friction, of the others some stick, slip or are
    open."""
    rng = np.random.default_rng(seed)
    n = max(m - smooth, 0)
    root = rng.normal(size=(m + n, m + n))
    whole = root @ root.T + np.eye(m + n)
    columns = Columns(2, k, m, n)
    rows = columns.split(rng.normal(size=(m + n + k, columns.total)), rng.normal(size=m + n + k))
    gap, slip, balance = rows.take(slice(0, m)), rows.take(slice(m, m + n)), rows.take(slice(m + n, None))
    base = synthetic(whole[:m, :m], rng.normal(size=m))
    condensed = replace(
        base,
        friction_nodes=np.arange(m - n, m),
        friction=rng.uniform(0.1, 1.0, n),
        gap=replace(gap, pressure=whole[:m, :m], traction=whole[:m, m:]),
        slip=replace(slip, pressure=whole[m:, :m], traction=whole[m:, m:]),
        balance=balance,
    )
    law = Regularization(
        eta=rng.uniform(0.05, 0.2, m),
        delta=rng.uniform(0.5, 2.0, m),
        pressure=3.0,
        gap=0.2,
        force=rng.uniform(0.5, 2.0, k),
        motion=np.ones(k),
        slip=0.7,
        stick_compliance=rng.uniform(0.1, 0.3, n),
        threshold=rng.uniform(0.0, 0.1, n),
    )
    kind = rng.integers(0, 4, n)
    closed = np.zeros(m, dtype=bool)
    closed[m - n :] = kind > 0
    sets = ContactStatus(closed, kind == 1, np.select([kind == 2, kind == 3], [1.0, -1.0], 0.0))
    start, end, stick_reference = rng.normal(size=2), rng.normal(size=2), rng.normal(size=n)
    return RegularizedFriction(
        DenseCoupling.of(condensed, law).with_stick_compliance(), start, end, sets, stick_reference
    )


def state(problem: RegularizedFriction, seed: int) -> FloatArray:
    """An admissible state."""
    rng = np.random.default_rng(seed + 1)
    m = problem.m
    return np.concatenate([rng.uniform(0.1, 3.0, 2 * m), rng.normal(size=problem.k + problem.n)])


sizes = {
    "m": st.integers(2, 7),
    "k": st.integers(0, 3),
    "seed": st.integers(0, 10_000),
    "smooth": st.sampled_from([1, 1, 7]),
}


@given(**sizes)
def test_high_orders_at_once_are_those_one_by_one(m: int, k: int, seed: int, smooth: int) -> None:
    problem = random_problem(m, k, seed, smooth)
    x = state(problem, seed)
    tangent = problem.tangent(x, 0.3)
    assert isinstance(tangent, FrictionTangent)
    assert error_of_orders(problem, tangent, x, seed) <= 1e-8


def test_residual_is_the_laws_the_gap_and_the_balance() -> None:
    problem = random_problem(7, 2, 1)
    x = state(problem, 5)
    p, h, q, t = problem.split(x)
    law, c, f = problem.law, problem.condensed, problem.factors(0.25)
    one, two, three, four = problem.split(problem.residual(x, 0.25))
    assert one * law.pressure * law.gap == pytest.approx((p + law.eta) * h - law.eta * law.delta)
    assert two * law.gap == pytest.approx(h - c.gap(f, q, p, t))
    assert three * law.force == pytest.approx(c.balance(f, q, p, t))
    sticking, slipping = problem.sets.stuck, problem.sets.slip_sign != 0.0
    assert sticking.any()
    assert slipping.any()
    held = c.slip(f, q, p, t) + law.stick_compliance * t - problem.stick_reference
    assert (four * law.slip)[sticking] == pytest.approx(held[sticking])
    pulled = t - problem.sets.slip_sign * c.friction * (p[1:] - law.threshold)
    assert (four * problem.limit)[~sticking] == pytest.approx(np.where(slipping, pulled, t)[~sticking])
    assert problem.stick_coordinate(x, 0.25) == pytest.approx(held + problem.stick_reference)


def test_rates_are_the_slope_of_the_path() -> None:
    problem = random_problem(6, 1, 4)
    x = state(problem, 4)
    slope = -problem.tangent(x, 0.0).solve(problem.load_derivative(x, 0.0))
    rates, own = problem.rates(problem.softened(x), problem.sets)[1], problem.slope(x, 0.0)
    for name in ("pressure", "traction", "motion", "gap", "slip"):
        assert getattr(own, name) == pytest.approx(getattr(rates, name))
    p, _, _, t = problem.split(slope)
    assert rates.pressure == pytest.approx(np.where(problem.sets.closed, p, 0.0))
    assert rates.traction == pytest.approx(t)
    # A node that is open closes if its pressure grows.
    assert (np.sign(rates.gap) == np.where(problem.sets.closed, 0.0, -np.sign(p))).all()
    ahead = problem.stick_coordinate(x + 1e-3 * slope, 1e-3) - problem.stick_coordinate(x, 0.0)
    assert rates.slip == pytest.approx(1e3 * ahead, abs=1e-9)


def test_nothing_resists_is_told() -> None:
    problem = random_problem(4, 1, 8)
    c = problem.softened(state(problem, 8))
    parts = {name: getattr(c, name) for name in ("gap", "slip", "balance")}
    free = replace(c, **{name: replace(one, motion=np.zeros_like(one.motion)) for name, one in parts.items()})
    with pytest.raises(SingularSystemError):
        problem.rates(free, problem.sets)


def test_faces_have_a_limit_without_pressure_until_they_are_pressed() -> None:
    """Kept later, it let tractions leave Coulomb's cone."""
    problem = random_problem(6, 1, 3)
    nodes, eta = problem.condensed.friction_nodes, problem.law.eta
    floating = problem.changed(coupling=problem.coupling.with_thresholds(np.full(problem.n, -0.05)))
    x = state(floating, 3)
    x[: problem.m] = 0.0
    assert floating.by_pressure_alone(x) is floating
    x[nodes[:2]] = 2.0 * eta[nodes[:2]]
    after = floating.by_pressure_alone(x)
    assert after.law.threshold == pytest.approx([0.0, 0.0, -0.05, -0.05, -0.05])
    assert after.pressed(x[: problem.m])[:2] == pytest.approx(2.0 * eta[nodes[:2]])


@given(**sizes)
def test_units_change_no_digit(m: int, k: int, seed: int, smooth: int) -> None:
    problem = random_problem(m, k, seed, smooth)
    length, stress = 2.0**-20, 2.0**40
    base = DenseCoupling.of(*in_units(problem.condensed, problem.law, length, stress)).with_stick_compliance()
    end = problem.start + problem.change
    other = RegularizedFriction(base, problem.start, end, problem.sets, problem.stick_reference * length)
    x, rhs = state(problem, seed), np.random.default_rng(seed + 2).normal(size=problem.size)
    unit = other.scale / problem.scale
    assert (other.residual(x * unit, 0.3) == problem.residual(x, 0.3)).all()
    # Pivots chosen by their units would round elsewhere.
    assert (other.tangent(x * unit, 0.3).solve(rhs) == unit * problem.tangent(x, 0.3).solve(rhs)).all()


def test_tractions_are_brought_within_the_cone() -> None:
    problem = random_problem(7, 0, 1)
    x = state(problem, 1)
    inside = problem.within_cone(x)
    p, _, _, t = problem.split(inside)
    stuck = problem.sets.stuck
    assert (np.abs(t) <= problem.condensed.friction * np.maximum(problem.pressed(p), 0.0))[stuck].all()
    assert (t == problem.split(x)[3])[~stuck].all()
    assert (problem.within_cone(inside) == inside).all()


def test_nodes_beyond_their_limits_stay_there_while_others_are_updated() -> None:
    problem = random_problem(7, 0, 1)
    x = state(problem, 1)
    limited = problem.at_limits(x)
    beyond = problem.sets.stuck & ~limited.sets.stuck
    traction = problem.split(x)[3]
    assert beyond.any()
    assert (limited.sets.slip_sign[beyond] == np.sign(traction)[beyond]).all()
    p, _, _, t = limited.split(limited.on_limits(x))
    assert t[beyond] == pytest.approx((limited.friction_slope * limited.pressed(p))[beyond], abs=0.0)
    assert limited.at_limits(limited.on_limits(x)) is limited
