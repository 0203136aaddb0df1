"""Contacts with many unknowns: compressed compliances, and what closed places ask for."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.geometry.clusters import hierarchical
from mlsanm_cli.contact.geometry.grid import Hats
from mlsanm_cli.contact.geometry.hat_pairs import HatPairs
from mlsanm_cli.contact.laws.contact_state import residual
from mlsanm_cli.contact.laws.frictionless import solve_exact
from mlsanm_cli.contact.response.compressed import Compressed, LinearMap, as_array
from mlsanm_cli.contact.response.condensed import Condensed
from tests.contact.scenes import synthetic

LOG, TURN = -0.3 * np.eye(2), np.array([[0.0, 0.2], [-0.2, 0.0]])


def uneven(count: int) -> Hats:
    """Intervals between -1 and 1 whose lengths differ by a factor of 11, with half a hat at one end."""
    steps = np.exp(1.2 * np.sin(np.linspace(0.0, 20.0 * np.pi, count)))
    nodes = np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()
    return Hats.on(2.0 * nodes - 1.0, (True, False))


def normals(hats: Hats, curvature: float) -> FloatArray:
    """Directions that turn along the contact."""
    angle = curvature * hats.points
    return np.stack([np.sin(angle), -np.cos(angle)], axis=1)


def matrix(hats: Hats, curvature: float = 0.0) -> Compressed:
    """The compliance of a half-plane's kernel, with a smooth part."""
    count = len(hats.place)
    smooth = Compressed.product(np.ones((count, 1)), 0.5 * hats.weight[None], hats.weight)
    near, far = hierarchical(HatPairs(hats), LOG, TURN, normals(hats, curvature))
    assert near.nnz < 0.3 * count**2
    return smooth.plus(near, far, (), 0, hats.place)


def dense(hats: Hats, curvature: float = 0.0) -> FloatArray:
    """The same by pairs."""
    along = normals(hats, curvature)
    pairs = HatPairs(hats).integrals(LOG, TURN, along, along)
    return pairs / hats.weight[:, None] + 0.5 * hats.weight


def apart(one: FloatArray, other: FloatArray) -> float:
    """What arrays differ by over the largest number of the second."""
    return float(np.abs(one - other).max() / np.abs(other).max())


def pressed(hats: Hats, compliance: FloatArray, gap: FloatArray, force: float) -> Condensed:
    """A rigid obstacle with a ``gap`` (m,), pressed on a half-plane by a ``force``."""
    count = len(hats.place)
    balance = LinearMap.of_rows(np.concatenate([[-force, 0.0], hats.weight])[None], (1, 1, count, 0))
    return synthetic(compliance, gap, balance=balance, motion=-np.ones((count, 1)))


@pytest.mark.parametrize("curvature", [0.0, 0.5])
def test_clusters_are_as_exact_as_pairs(curvature: float) -> None:
    hats = uneven(700)
    found, expected = matrix(hats, curvature), dense(hats, curvature)
    assert apart(np.asarray(found), expected) <= 1e-10
    values = np.random.default_rng(0).standard_normal(len(hats.place))
    assert apart(found @ values, expected @ values) <= 1e-10
    assert apart(found.diagonal(), expected.diagonal()) <= 1e-10


def test_many_places_carry_what_hertz_says() -> None:
    # Gap x^2 / 2 and -0.3 ln|s - s'|, which is 2 / (pi E*): a^2 = 0.6 P, peak 2 P / (pi a).
    hats = Hats(np.linspace(-1.0, 1.0, 3002))
    scene = pressed(hats, as_array(matrix(hats)), 0.5 * hats.at_places(hats.points[:, None] ** 2)[:, 0], 0.3)
    state = solve_exact(scene, np.ones(1))
    half = np.sqrt(0.6 * 0.3)
    shape = 2.0 * 0.3 / (np.pi * half) * np.sqrt(np.maximum(1.0 - (hats.place / half) ** 2, 0.0))
    assert np.abs(state.pressure - shape).max() <= 0.02 * shape.max()
    assert state.pressure.max() == pytest.approx(shape.max(), rel=1e-5)
    assert hats.weight @ state.pressure == pytest.approx(0.3, rel=1e-11)
    assert residual(scene, state) <= 1e-10


def test_many_patches_are_those_of_the_dense_search() -> None:
    hats = uneven(900)
    wave = 0.01 * np.cos(40.0 * hats.place) + 0.004 * np.cos(97.0 * hats.place + 1.0)
    states = [
        solve_exact(pressed(hats, compliance, wave, 0.05), np.ones(1))
        for compliance in (as_array(matrix(hats)), dense(hats))
    ]
    assert np.flatnonzero(np.diff(states[0].closed.astype(int)) == 1).size >= 8
    assert (states[0].closed == states[1].closed).all()
    assert apart(states[0].pressure, states[1].pressure) <= 1e-8
