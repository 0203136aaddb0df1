"""The hyperbolic law and its way to the exact law; its derivatives are tested with those of friction."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.coupling import DenseCoupling
from mlsanm_cli.contact.laws.regularized_friction import RegularizedFriction
from mlsanm_cli.contact.laws.scales import regularize
from tests.contact.scenes import Small, cylinder
from tests.contact.test_regularized_friction import random_problem, state


def test_only_open_gaps_are_admissible() -> None:
    problem = random_problem(3, 1, 1, smooth=3)
    x = state(problem, 1)
    assert problem.admissible(x, 0.0)
    closed, torn = x.copy(), x.copy()
    closed[4] = -1e-12
    torn[1] = -problem.law.eta[1] - 1e-12
    assert not problem.admissible(closed, 0.0)
    assert not problem.admissible(torn, 0.0)


def newton(problem: RegularizedFriction) -> FloatArray:
    """State (2m + k,) at full load by Newton steps that keep every gap open and no node in full tension."""
    law = problem.law
    p = np.full(problem.m, law.pressure)
    x = np.concatenate([p, law.eta * law.delta / (p + law.eta), np.zeros(problem.k)])
    for _ in range(200):
        r = problem.residual(x, 1.0)
        if np.abs(r).max() <= 1e-11:
            return x
        step = -problem.tangent(x, 1.0).solve(r)
        bounded = np.concatenate([x[: problem.m] + law.eta, x[problem.m : 2 * problem.m]])
        shrinking = step[: 2 * problem.m] < 0.0
        room = (bounded / np.where(shrinking, -step[: 2 * problem.m], 1.0))[shrinking].min(initial=np.inf)
        x = x + min(1.0, 0.95 * room) * step
    raise AssertionError("Newton did not settle")


@pytest.fixture(scope="module")
def hertz() -> Small:
    """Half-disk on a block under its full force."""
    return cylinder(0.006)


def test_regularised_pressure_goes_to_the_exact_one(hertz: Small) -> None:
    exact = hertz.exact()
    etas = np.array([1e-2, 1e-3, 1e-4, 1e-5])
    errors = []
    for eta in etas:
        law = regularize(hertz.condensed, [exact], eta)
        problem = RegularizedFriction.frictionless(
            DenseCoupling.of(hertz.condensed, law), 0.0 * hertz.factors, hertz.factors
        )
        p, h, *_ = problem.split(newton(problem))
        assert (h > 0.0).all()
        assert (p > -law.eta).all()
        # Closed nodes leave a gap of about eta delta / p, open ones a tension below eta.
        assert (p + law.eta) * h == pytest.approx(law.eta * law.delta, rel=1e-6)
        errors.append(np.linalg.norm(p - exact.pressure) / np.linalg.norm(exact.pressure))
    # Between eta^0.5 of the continuous problem and eta^1 of a fixed set of nodes, none of them just touching.
    assert 0.4 <= np.polyfit(np.log(etas), np.log(errors), 1)[0] <= 1.1
    assert errors[2] <= 0.01
