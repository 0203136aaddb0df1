"""Derivatives and series of the laws with friction, with memory and without, and the law without."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.coupling import DenseCoupling
from mlsanm_cli.contact.laws.holonomic import HolonomicContact
from tests.contact.derivatives import highest_terms, tangent_times
from tests.contact.test_regularized_friction import random_problem as random_friction
from tests.contact.test_regularized_friction import state as friction_state


def random_problem(m: int, k: int, seed: int) -> HolonomicContact:
    """A made-up problem whose first node has no friction."""
    one = random_friction(m, k, seed)
    return HolonomicContact(DenseCoupling.of(one.condensed, one.law), one.start, one.start + one.change)


def state(problem: HolonomicContact, seed: int) -> FloatArray:
    """An admissible state."""
    rng = np.random.default_rng(seed + 1)
    m, n = problem.m, problem.n
    bound, free = rng.uniform(0.1, 3.0, 2 * m), rng.normal(size=problem.k + n)
    return np.concatenate([bound, free, rng.uniform(0.5, 2.0, n)])


LAWS = [(random_problem, state), (random_friction, friction_state)]
laws = pytest.mark.parametrize(("make", "at"), LAWS, ids=["holonomic", "with memory"])
sizes = {"m": st.integers(2, 7), "k": st.integers(0, 3), "seed": st.integers(0, 10_000)}


@laws
@given(**sizes)
def test_tangent_undoes_the_residuals_derivative(make: Any, at: Any, m: int, k: int, seed: int) -> None:
    problem = make(m, k, seed)
    x, v = at(problem, seed), np.random.default_rng(seed + 2).normal(size=problem.size)
    found = problem.tangent(x, 0.3).solve(tangent_times(problem, x, 0.3, v))
    assert np.abs(tangent_times(problem, x, 0.3, found - v)).max() <= 1e-6 * np.abs(v).max()


@laws
@given(**sizes)
def test_load_derivative(make: Any, at: Any, m: int, k: int, seed: int) -> None:
    problem = make(m, k, seed)
    x, step = at(problem, seed), 1e-3
    ahead, behind = (problem.residual(x, 0.3 + d) for d in (step, -step))
    found = problem.load_derivative(x, 0.3)
    assert found == pytest.approx((ahead - behind) / (2.0 * step), rel=1e-6, abs=1e-6 * np.abs(found).max())


@laws
@given(order=st.integers(1, 6), **sizes)
def test_series_terms_are_those_of_the_residual(
    make: Any, at: Any, order: int, m: int, k: int, seed: int
) -> None:
    problem = make(m, k, seed)
    rng = np.random.default_rng(seed + 3)
    x = np.concatenate([at(problem, seed)[None], rng.normal(size=(order, problem.size))])
    found, expected, largest = highest_terms(problem, x, rng.normal(size=order + 1))
    assert np.abs(found - expected).max() <= 1e-7 * max(1.0, largest)


def test_traction_is_the_laws() -> None:
    problem = random_problem(6, 1, 2)
    x = state(problem, 2)
    p, h, q, t, _ = problem.split(x)
    law, c, s = problem.law, problem.condensed, problem.slip(x, 0.4)
    t[:] = -c.friction * (p + law.eta)[c.friction_nodes] * s / np.hypot(s, problem.small)
    bare = np.concatenate([p, h, q, t])
    assert bare == pytest.approx(x[: len(bare)])
    # The traction changes the slip in turn: only the auxiliary unknown must go with it.
    whole = problem.with_auxiliary(bare, 0.4)
    s = problem.slip(whole, 0.4)
    *_, four, five = problem.split(problem.residual(whole, 0.4))
    assert five == pytest.approx(np.zeros(problem.n), abs=1e-12)
    expected = t * np.hypot(s, problem.small) + c.friction * (p + law.eta)[c.friction_nodes] * s
    assert four * problem.work == pytest.approx(expected)
    assert problem.admissible(whole, 0.4)
    whole[-1] = -whole[-1]
    assert not problem.admissible(whole, 0.4)
