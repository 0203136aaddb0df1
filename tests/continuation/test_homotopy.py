"""A parameter lowered at a fixed load."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.continuation import Family, FloatArray, NewtonOptions, follow, solve_at
from mlsanm_cli.errors import NumericalError

from .contact_problems import Contact, hertz, open_start
from .problems import Scalar


def carried(x: FloatArray, before: float, eta: float) -> FloatArray:
    """Closed nodes keep their pressure, open ones their gap."""
    problem, peak, _ = hertz(60, eta)
    m = problem.m
    p, h = x[:m] / peak, x[m : 2 * m]
    closed = p > h / problem.h_ref
    pressure = np.where(closed, p, eta * (problem.delta / h - 1.0))
    gap = np.where(closed, eta * problem.delta / (np.maximum(p, 0.0) + eta), h)
    return np.concatenate([pressure * peak, gap, x[2 * m :]])


def problem(eta: float) -> Contact:
    return hertz(60, eta)[0]


@pytest.mark.parametrize("values", [(1.0, 1e-1, 1e-2, 1e-3, 1e-4), (1.0, 1e-4)])
def test_same_state_as_along_the_path(values: tuple[float, ...]) -> None:
    start = open_start(problem(1.0))
    found = list(solve_at(Family(problem, carried), values, start, 1.0))
    assert len(found) == len(values)
    assert max(one.residual for one in found) <= 1e-8
    path = follow(problem(1e-4), open_start(problem(1e-4)), 0.0, 1.0)
    list(path.steps())
    assert np.abs((found[-1].x - path.outcome.x) / problem(1.0).scale).max() <= 1e-7
    assert sum(one.factorizations for one in found) < path.outcome.factorizations


def test_values_in_between_are_found_where_needed() -> None:
    """x^3 + v x = 1 with fewer updates allowed than the whole way takes."""

    class Counting:
        def __init__(self) -> None:
            self.values: list[float] = []

        def __call__(self, value: float) -> Scalar:
            self.values.append(value)
            return Scalar(0.0, value, 0.0, 1.0)

    family = Counting()
    found = list(
        solve_at(
            Family(family, lambda x, before, value: x),
            (1e3, 1.0),
            np.ones(1),
            1.0,
            NewtonOptions(max_corrections=4),
        )
    )
    assert found[-1].x[0] ** 3 + found[-1].x[0] == pytest.approx(1.0, abs=1e-8)
    assert set(family.values) > {1e3, 1.0}
    assert found[-1].factorizations > 12  # the trial that failed counts


def test_no_solution_is_an_error() -> None:
    with pytest.raises(NumericalError, match="for the parameter 1") as caught:
        list(solve_at(Family(lambda v: Scalar(v, 0.0, 1.0), lambda x, a, b: x), (1.0,), np.ones(1), 0.0))
    assert caught.value.hint
