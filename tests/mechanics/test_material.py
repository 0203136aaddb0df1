"""Plane stiffness against the three-dimensional law."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.elasticity import von_mises
from mlsanm_cli.mechanics.material import isotropic


def compliance(modulus: float, poisson: float) -> FloatArray:
    """Strains (xx, yy, zz, 2 xy) per stress (xx, yy, zz, xy): Hooke's law in space."""
    matrix = np.full((4, 4), -poisson)
    np.fill_diagonal(matrix, 1.0)
    matrix[3] = matrix[:, 3] = 0.0
    matrix[3, 3] = 2.0 * (1.0 + poisson)
    return matrix / modulus


@given(modulus=st.floats(1e-3, 1e12), poisson=st.floats(-0.5, 0.49))
def test_stiffness_is_hookes_law_with_its_plane_condition(modulus: float, poisson: float) -> None:
    space = compliance(modulus, poisson)
    plane = [0, 1, 3]
    stress = isotropic(modulus, poisson, "stress").stiffness
    assert stress @ space[np.ix_(plane, plane)] == pytest.approx(np.eye(3), abs=1e-12)
    strain = isotropic(modulus, poisson, "strain").stiffness
    whole = np.linalg.inv(space)
    assert strain / modulus == pytest.approx(whole[np.ix_(plane, plane)] / modulus, rel=1e-9, abs=1e-12)


@given(poisson=st.floats(-0.5, 0.49))
def test_stress_out_of_the_plane(poisson: float) -> None:
    strain = isotropic(2.0, poisson, "strain")
    whole = np.linalg.inv(compliance(2.0, poisson))
    e = np.array([0.3, -0.7, 0.0, 0.2])
    s = whole @ e
    assert strain.across_stress(s[None, [0, 1, 3]])[0] == pytest.approx(s[2], abs=1e-11)
    assert not isotropic(2.0, poisson, "stress").across.any()


def test_hand_values_of_steel() -> None:
    strain, stress = isotropic(210e3, 0.3, "strain"), isotropic(210e3, 0.3, "stress")
    assert strain.stiffness[0] == pytest.approx([282692.3, 121153.8, 0.0], rel=1e-6)
    assert stress.stiffness[0] == pytest.approx([230769.2, 69230.77, 0.0], rel=1e-6)
    assert strain.stiffness[2, 2] == stress.stiffness[2, 2] == pytest.approx(80769.23, rel=1e-6)
    oblique = np.array([[0.6, 0.8]])
    assert 1.0 / strain.softness(oblique)[0] == pytest.approx(230769.2, rel=1e-6)
    assert 1.0 / stress.softness(oblique)[0] == pytest.approx(210e3, rel=1e-12)


def test_another_plane_is_refused() -> None:
    with pytest.raises(ValueError, match="'axisymmetric'"):
        isotropic(1.0, 0.3, "axisymmetric")


@given(
    xx=st.floats(-10, 10),
    yy=st.floats(-10, 10),
    xy=st.floats(-10, 10),
    ratio=st.floats(0.0, 0.5),
)
def test_von_mises_from_the_deviator(xx: float, yy: float, xy: float, ratio: float) -> None:
    tensor = np.array([[xx, xy, 0.0], [xy, yy, 0.0], [0.0, 0.0, ratio * (xx + yy)]])
    deviator = tensor - np.trace(tensor) / 3.0 * np.eye(3)
    expected = np.sqrt(1.5 * (deviator**2).sum())
    assert von_mises(np.array([[xx, yy, xy]]), np.array([ratio * (xx + yy)]))[0] == pytest.approx(
        expected, abs=1e-12
    )
