"""Plane stiffness against the three-dimensional law."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mlsanm_cli.mechanics.elasticity import von_mises
from mlsanm_cli.mechanics.material import LOCKING_RATIO, anisotropic, isotropic, orthotropic


@given(xx=st.floats(-10, 10), yy=st.floats(-10, 10), xy=st.floats(-10, 10), ratio=st.floats(0.0, 0.5))
def test_von_mises_from_the_deviator(xx: float, yy: float, xy: float, ratio: float) -> None:
    tensor = np.array([[xx, xy, 0.0], [xy, yy, 0.0], [0.0, 0.0, ratio * (xx + yy)]])
    deviator = tensor - np.trace(tensor) / 3.0 * np.eye(3)
    expected = np.sqrt(1.5 * (deviator**2).sum())
    assert von_mises(np.array([[xx, yy, xy]]), np.array([ratio * (xx + yy)]))[0] == pytest.approx(
        expected, abs=1e-12
    )


@given(
    modulus=st.floats(1e-3, 1e12),
    poisson=st.floats(-0.5, 0.49),
    angle=st.floats(-4.0, 4.0),
    plane=st.sampled_from(["stress", "strain"]),
)
def test_an_orthotropic_material_may_be_isotropic(
    modulus: float, poisson: float, angle: float, plane: str
) -> None:
    one = isotropic(modulus, poisson, plane, 2e-3)
    shear = 0.5 * modulus / (1.0 + poisson)
    other = orthotropic((modulus,) * 3, (poisson,) * 3, shear, angle, plane, (2e-3,) * 3)
    assert other.stiffness / modulus == pytest.approx(one.stiffness / modulus, rel=1e-9, abs=1e-10)
    assert other.across == pytest.approx(one.across, abs=1e-9)
    assert other.expansion == pytest.approx(one.expansion, abs=1e-12)
    assert other.across_heat == pytest.approx(one.across_heat, rel=1e-12)
    assert other.modulus == pytest.approx(one.stiffness[0, 0], rel=1e-9)


@pytest.mark.parametrize("plane", ["stress", "strain"])
def test_a_turned_orthotropic_material_obeys_hookes_law(plane: str) -> None:
    e, nu, shear, alpha = (12.0, 3.0, 2.0), (0.3, 0.25, 0.4), 1.1, np.array([0.1, 0.3, 0.7])
    angle = 0.6
    wood = orthotropic(e, nu, shear, angle, plane, tuple(alpha))
    strain = np.array([[0.3, 0.05], [0.05, -0.2]])
    found = wood.stiffness @ (np.array([0.3, -0.2, 0.1]) - wood.expansion)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    tensor = np.array([[found[0], found[2]], [found[2], found[1]]])
    own, bent = turn @ tensor @ turn.T, turn @ strain @ turn.T
    zz = float(wood.out_of_plane_stress(found[None], 1.0)[0])
    assert bent[0, 0] == pytest.approx(own[0, 0] / 12 - 0.3 / 12 * own[1, 1] - 0.25 / 12 * zz + 0.1)
    assert bent[1, 1] == pytest.approx(-0.3 / 12 * own[0, 0] + own[1, 1] / 3 - 0.4 / 3 * zz + 0.3)
    assert bent[0, 1] == pytest.approx(0.5 * own[0, 1] / shear)
    third = -0.25 / 12 * own[0, 0] - 0.4 / 3 * own[1, 1] + zz / 2 + 0.7
    assert (zz if plane == "stress" else third) == pytest.approx(0.0, abs=1e-12)


@given(poisson=st.floats(0.0, 0.499))
def test_locking_is_judged_by_lames_constants(poisson: float) -> None:
    rubber = isotropic(1.0, poisson, "strain")
    first, shear = rubber.stiffness[0, 1], rubber.stiffness[2, 2]
    assert rubber.bulk_part[0, 1] == pytest.approx(first, abs=1e-9)
    assert rubber.nearly_incompressible == (first > LOCKING_RATIO * shear)


def test_stiff_fibres_and_soft_shear_do_not_lock() -> None:
    for shear in (0.01, 0.3, 5.0):
        fibres = orthotropic((100.0, 1.0, 1.0), (0.3, 0.3, 0.3), shear, 0.4, "stress")
        assert not fibres.nearly_incompressible
    # Compliances whose columns sum to nothing leave the volume alone; a little less does nearly.
    for part, locks in ((0.999, True), (0.8, False)):
        poisson = tuple(part * value for value in (5.0 / 12.0, 7.0 / 12.0, 0.375))
        rubber = orthotropic((1.0, 1.5, 1.2), poisson, 0.4, 0.4, "strain")
        assert rubber.nearly_incompressible == locks


def test_a_plane_stiffness_does_not_tell_the_stress_across() -> None:
    stress = np.array([[1.0, 2.0, 3.0]])
    assert np.isnan(anisotropic(np.eye(3), "strain").out_of_plane_stress(stress)).all()
    assert (anisotropic(np.eye(3), "stress").out_of_plane_stress(stress) == 0.0).all()
