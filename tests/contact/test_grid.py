"""Contact grids: integrals of the half-plane's kernels with hats, halving, and what errors are estimated."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial.legendre import leggauss

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.geometry.grid import MAX_RATIO, Hats, on_panels
from mlsanm_cli.contact.geometry.hat_pairs import HatPairs
from mlsanm_cli.contact.geometry.profile import THRESHOLD, half_width
from mlsanm_cli.solve.grid_fitting import spaced_apart

LOG, NONE = np.eye(2), np.zeros((2, 2))
GRADED = Hats(
    np.unique(
        np.concatenate(
            [np.linspace(0.0, 1.0, 9), 0.5 + np.linspace(-0.1, 0.1, 11), 0.5 + np.geomspace(1e-4, 0.1, 9)]
        ).round(12)
    )
)
"""Intervals from 1e-4 to 0.125."""


def hat(hats: Hats, which: int, s: FloatArray) -> FloatArray:
    """Values of one of the functions."""
    peak = np.eye(len(hats.nodes))[which + 1]
    return np.asarray(np.interp(s, hats.nodes, peak))


def by_quadrature(hats: Hats, one: int, other: int, sign: bool = False, turn: float = 0.0) -> float:
    """Integral of ln|s - s'| (sgn(s - s') with ``sign``) cos(turn (s - s')) with two hats.

    Gauss's points that cluster at every node for s, and at s on both of its sides for s'.
    """
    total = 0.0
    nodes = hats.nodes
    x, w = leggauss(40)
    u, v = leggauss(60)
    u, v = 0.5 * (1.0 + u), 0.5 * v
    x, w = 0.5 * (1.0 + x), 0.5 * w
    w, x = w * 6.0 * x * (1.0 - x), x * x * (3.0 - 2.0 * x)
    for a, b in zip(nodes[one : one + 2], nodes[one + 1 : one + 3], strict=True):
        for s, weight in zip(a + (b - a) * x, w * (b - a), strict=True):
            inner = 0.0
            ends = np.unique(np.append(nodes[other : other + 3], np.clip(s, nodes[other], nodes[other + 2])))
            for c, d in pairwise(ends):
                # From the end that is nearer to s, u^3 takes the logarithm away.
                near, far = (c, d) if abs(c - s) < abs(d - s) else (d, c)
                way = (far - near) * u**3
                apart, t = (s - near) - way, near + way
                kernel = (np.sign(apart) if sign else np.log(np.abs(apart))) * np.cos(turn * apart)
                inner += float((kernel * hat(hats, other, t) * 3.0 * u * u * v).sum()) * abs(d - c)
            total += weight * inner * float(hat(hats, one, np.array([s]))[0])
    return total


def constant(hats: Hats) -> FloatArray:
    """One direction at all points."""
    return np.tile([1.0, 0.0], (len(hats.points), 1))


@pytest.mark.parametrize("sign", [False, True], ids=["log", "sign"])
def test_pairs_against_quadrature(sign: bool) -> None:
    hats, one = GRADED, constant(GRADED)
    found = HatPairs(hats).integrals(*((NONE, LOG) if sign else (LOG, NONE)), one, one)
    count = len(hats.place)
    rng = np.random.default_rng(0)
    some = [(3, 3), (3, 4), (0, count - 1), *rng.integers(0, count, (30, 2)).tolist()]
    narrow = int(np.argmin(hats.weight))
    some += [(narrow, narrow), (narrow, narrow + 1), (narrow - 1, narrow)]
    for i, j in some:
        size = hats.weight[i] * hats.weight[j]
        expected = by_quadrature(hats, i, j, sign)
        assert found[i, j] / size == pytest.approx(expected / size, abs=2e-7)


def test_pairs_along_turning_directions() -> None:
    """The normals of a circle over hats that turn by 14 degrees."""
    hats = Hats(np.linspace(0.0, 3.0, 13))
    normal = np.stack([np.sin(hats.points), -np.cos(hats.points)], axis=1)
    found = HatPairs(hats).integrals(LOG, NONE, normal, normal)
    scale = np.outer(hats.weight, hats.weight)
    for i, j in ((0, 0), (4, 5), (7, 9), (2, 10)):
        expected = by_quadrature(hats, i, j, turn=1.0)
        assert found[i, j] / scale[i, j] == pytest.approx(expected / scale[i, j], abs=2e-4)


def test_pairs_are_symmetric() -> None:
    normal = np.stack([np.sin(GRADED.points), -np.cos(GRADED.points)], axis=1)
    for direction in (constant(GRADED), normal):
        found = HatPairs(GRADED).integrals(LOG, NONE, direction, direction)
        assert np.abs(found - found.T).max() <= 1e-14 * np.abs(found).max()
        turned = HatPairs(GRADED).integrals(NONE, LOG, direction, direction)
        assert np.abs(turned + turned.T).max() <= 1e-14 * np.abs(turned).max()
    # What tractions do to gaps is what pressures do to slips.
    tangent, pairs = np.stack([-normal[:, 1], normal[:, 0]], axis=1), HatPairs(GRADED)
    across, back = (
        pairs.integrals(LOG, np.array([[0.0, 0.5], [-0.5, 0.0]]), *directions)
        for directions in ((normal, tangent), (tangent, normal))
    )
    assert np.abs(across - back.T).max() <= 1e-12 * np.abs(across).max()


def test_pressures_of_no_net_force_do_work() -> None:
    # -ln|s - s'| is positive on them, whatever the grid: the reason for Galerkin's method.
    one = constant(GRADED)
    found = -HatPairs(GRADED).integrals(LOG, NONE, one, one)
    weight = GRADED.weight
    free = np.linalg.svd(weight[None])[2][1:].T
    assert np.linalg.eigvalsh(free.T @ found @ free).min() > 0.0


@given(
    seed=st.integers(0, 1000), count=st.integers(3, 30), rounds=st.integers(1, 4), part=st.floats(0.05, 0.9)
)
def test_halved_grids_stay_graded(seed: int, count: int, rounds: int, part: float) -> None:
    rng, hats = np.random.default_rng(seed), Hats(np.linspace(0.0, 1.0, count))
    for _ in range(rounds):
        chosen = rng.random(len(hats.steps)) < part
        finer = hats.halved(chosen)
        assert np.isin(hats.nodes, finer.nodes).all()
        halves = 0.5 * (hats.nodes[1:] + hats.nodes[:-1])[chosen]
        assert np.isin(halves, finer.nodes).all()
        ratio = finer.steps[1:] / finer.steps[:-1]
        assert ratio.max() <= MAX_RATIO * (1.0 + 1e-12)
        assert ratio.min() >= (1.0 - 1e-12) / MAX_RATIO
        hats = finer


def best_error(hats: Hats) -> tuple[FloatArray, float]:
    """Nodal values of sqrt(1 - x^2), and the L2 error of the lines between them."""
    places, weights = leggauss(400)
    total = 0.0
    for a, b in pairwise(hats.nodes):
        low, high = max(a, -1.0), min(b, 1.0)
        exact = np.sqrt(np.maximum(1.0 - hats.nodes**2, 0.0))
        if high > low:
            # x = sin(angle) takes the square root away.
            one, other = np.arcsin(low), np.arcsin(high)
            angle = 0.5 * (one + other) + 0.5 * (other - one) * places
            x = np.sin(angle)
            apart = np.cos(angle) - np.interp(x, hats.nodes, exact)
            total += float((0.5 * (other - one) * weights * np.cos(angle) * apart**2).sum())
    return exact[1:-1], float(np.sqrt(total))


@pytest.mark.parametrize("accuracy", [3e-2, 3e-3, 3e-4])
def test_estimated_errors_of_hertz_pressures(accuracy: float) -> None:
    # Halved where the estimate is large, as contacts are. The true error is within a factor of two of it.
    hats = Hats(np.linspace(-1.3, 1.3, 25))
    while True:
        values, true = best_error(hats)
        errors = hats.errors(values)
        if np.linalg.norm(errors) <= accuracy * hats.norm(values):
            break
        hats = hats.halved(errors > 0.5 * errors.max())
    assert len(hats.place) <= 400
    assert 0.5 <= float(np.linalg.norm(errors)) / true <= 2.0
    assert hats.norm(values) == pytest.approx(np.sqrt(4.0 / 3.0), rel=accuracy)


def test_panels_stand_for_places_towards_a_corner() -> None:
    x = np.geomspace(1e-9, 3.0, 2000)
    places, shares = on_panels(x)
    assert len(places) < 500
    # As what the corner of a right angle adds: poles half pi off the axis.
    by, exact = (1.0 / np.cosh(np.log(one[:, None] / one)) for one in (places, x))
    assert np.abs(shares @ by @ shares.T - exact).max() < 1e-8


PLACES = np.linspace(-0.5, 1.5, 21)
PROFILES = {
    "triangle": (PLACES, np.maximum(0.0, 1.0 - np.abs(PLACES - 0.5) / 0.5), 0.5 * (1.0 - THRESHOLD)),
    "crossings between nodes": ([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 0.0, 0.0], 0.99),
    # 100 falling to 0 over a distance of 4 on the right and 1 on the left.
    "uneven nodes": ([0.0, 1.0, 5.0, 6.0], [0.0, 100.0, 0.0, 0.0], 0.5 * 0.99 * 5.0),
    "outermost crossings": (np.arange(7.0), [0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], 2.0 + 0.99),
    "up to the last node": ([0.0, 0.5, 2.0], np.ones(3), 1.0),
    "unloaded": (np.arange(3.0), np.zeros(3), 0.0),
    "tension": (np.arange(3.0), -np.ones(3), 0.0),
    "no nodes": ([], [], 0.0),
}


@pytest.mark.parametrize(("arc", "pressure", "expected"), PROFILES.values(), ids=PROFILES)
def test_half_width(arc: list[float], pressure: list[float], expected: float) -> None:
    assert half_width(np.array(arc), np.array(pressure)) == pytest.approx(expected, rel=1e-12)


def test_no_interval_is_round_off() -> None:
    steps = np.arange(0.0, 0.9, 0.1)
    nodes = np.concatenate([[-1e-15], steps, [0.3 + 1e-12, 0.8 + 4e-16]])
    found = spaced_apart(nodes, 0.05)
    assert (found[0], found[-1]) == (nodes.min(), nodes.max())
    assert np.diff(found) == pytest.approx(np.full(8, 0.1))
    assert spaced_apart(np.array([0.0, 1e-9, 1.0]), 0.1).tolist() == [0.0, 1.0]
