"""The surface of an anisotropic half-plane against the roots of its characteristic equation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.material import orthotropic, surface_compliance

PLANES = st.sampled_from(["stress", "strain"])


def by_roots(stiffness: FloatArray) -> FloatArray:
    """The surface compliance in x and y from Lekhnitskii's two roots in the upper half-plane.

    With S the plane compliance, S_xx mu^4 - 2 S_xs mu^3 + (2 S_xy + S_ss) mu^2 - 2 S_ys mu + S_yy = 0.
    """
    s = np.linalg.inv(stiffness)
    roots = np.roots([s[0, 0], -2 * s[0, 2], 2 * s[0, 1] + s[2, 2], -2 * s[1, 2], s[1, 1]])
    one, two = roots[roots.imag > 0.0]
    total, product = one + two, one * two
    off, last = product.imag, total.real * product.imag - total.imag * product.real
    result: FloatArray = s[0, 0] * np.array([[total.imag, off], [off, last]])
    return result


@given(entries=st.lists(st.floats(-1.0, 1.0), min_size=9, max_size=9))
def test_any_material_against_its_roots(entries: list[float]) -> None:
    matrix = np.array(entries).reshape(3, 3)
    stiffness = matrix @ matrix.T + 0.1 * np.eye(3)
    expected = by_roots(stiffness)
    assert surface_compliance(stiffness) == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("ratio", [1.5, 20.0, 1000.0])
def test_orthotropic_half_plane(ratio: float) -> None:
    # Normal to axis 1: M = 2 sqrt(S_22) sqrt(2 sqrt(S_11 S_22) + 2 S_12 + S_66) with half of it 1/E'.
    wood = orthotropic((ratio, 1.0, 1.0), (0.3, 0.3, 0.2), 0.4, 0.0, "stress")
    s = np.linalg.inv(wood.stiffness)
    expected = np.sqrt(s[1, 1]) * np.sqrt(2.0 * np.sqrt(s[0, 0] * s[1, 1]) + 2.0 * s[0, 1] + s[2, 2])
    assert surface_compliance(wood.stiffness)[1, 1] == pytest.approx(expected, rel=1e-11)
    assert wood.contact_compliance(np.array([[0.0, 1.0]]))[0] == pytest.approx(0.5 * expected, rel=1e-11)


@given(angle=st.floats(-3.0, 3.0))
def test_a_turned_material_has_a_turned_compliance(angle: float) -> None:
    def wood(turned: float) -> FloatArray:
        return orthotropic((12.0, 1.0, 1.0), (0.3, 0.3, 0.2), 0.4, turned, "strain").stiffness

    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    expected = turn @ surface_compliance(wood(0.0)) @ turn.T
    assert surface_compliance(wood(angle)) == pytest.approx(expected, abs=1e-12)
