"""Plastic flow at a point: stresses on the yield surface, tangents, hardening curves, cycles."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.laws.von_mises import HISTORY, Hardening, VonMises, plastic_stress
from mlsanm_cli.mechanics.material import isotropic

E, NU, Y = 1.0, 0.3, 1e-2
START = np.array([[0.0, Y]])
LAWS = {
    "perfect": Hardening(START),
    "linear": Hardening(START, slope=0.1),
    "table": Hardening(np.array([[0.0, Y], [1e-3, 1.2e-2], [1e-2, 1.5e-2]])),
    "ludwik": Hardening(START, strength=0.5, exponent=0.4),
    "kinematic": Hardening(START, kinematic=0.05),
    "combined": Hardening(START, slope=0.1, kinematic=0.05),
}


def law(hardening: Hardening, plane: str) -> VonMises:
    return VonMises(isotropic(E, NU, plane), plane, hardening)


@pytest.mark.parametrize("plane", ["strain", "stress"])
@pytest.mark.parametrize("name", LAWS)
def test_the_state_after_an_increment(name: str, plane: str) -> None:
    material, rng = law(LAWS[name], plane), np.random.default_rng(0)
    free = np.array([1.0, 1.0, 0.0, 1.0])
    _, _, before = material.update(rng.normal(size=(60, 4)) * 1e-2 * free, np.zeros((60, HISTORY)))
    strain = rng.normal(size=(60, 4)) * 2e-2 * free
    stress, tangent, after = material.update(strain, before)
    flow = material.hardening.flow(after[:, 4])[0]
    excess = material.equivalent(stress, after) - flow
    flowed = after[:, 4] > before[:, 4]
    assert flowed.sum() > 20
    assert (~flowed).any()
    assert np.abs(excess[flowed]).max() < 1e-12
    assert excess[~flowed].max() < 1e-12
    assert np.abs(after[:, :3].sum(axis=1)).max() < 1e-15, "plastic strains change the volume"
    assert np.abs(stress[:, 2]).max() < 1e-12 or plane == "strain"
    whole = strain[:, [0, 1, 3]] @ material.linear.stiffness
    assert stress[:, [0, 1, 3]] == pytest.approx(whole - plastic_stress(material.linear, after), abs=1e-14)
    for part in (0, 1, 3):
        step = np.zeros(4)
        step[part] = 1e-7
        ahead, back = (material.update(strain + sign * step, before)[0] for sign in (1.0, -1.0))
        assert tangent[:, :, part] == pytest.approx((ahead - back) / 2e-7, abs=1e-6)


def pulled(material: VonMises, stretches: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Stresses and histories of a bar in tension along x in plane stress, whose lateral strain is found by
    Newton's method."""
    history, across, found = np.zeros((1, HISTORY)), 0.0, []
    for stretch in stretches:
        for _ in range(50):
            strain = np.array([[stretch, across, 0.0, 0.0]])
            stress, tangent, after = material.update(strain, history)
            if abs(stress[0, 1]) < 1e-15:
                break
            across -= stress[0, 1] / tangent[0, 1, 1]
        history = after
        found.append(stress[0, 0])
    return np.array(found), history


@pytest.mark.parametrize("name", LAWS)
def test_tension_follows_the_hardening_curve(name: str) -> None:
    hardening = LAWS[name]
    stress, history = pulled(law(hardening, "stress"), np.linspace(0.0, 0.03, 7))
    amount = history[0, 4]
    assert amount == pytest.approx(0.03 - stress[-1] / E, rel=1e-9)
    assert stress[-1] == pytest.approx(
        hardening.flow(history[:, 4])[0][0] + hardening.kinematic * amount, rel=1e-9
    )


def test_kinematic_hardening_keeps_the_elastic_range() -> None:
    """Bauschinger effect: after tension the bar yields in compression 2 Y below; isotropic hardening would
    raise both limits."""
    path = np.concatenate([np.linspace(0.0, 0.05, 11), np.linspace(0.05, 0.0, 401)])
    stress, _ = pulled(law(LAWS["kinematic"], "stress"), path)
    back, strain = stress[11:], path[11:]
    slope = np.diff(back) / np.diff(strain)
    yields = back[np.flatnonzero(slope < 0.5 * E)[0]]
    assert stress[10] - yields == pytest.approx(2.0 * Y, rel=0.02)


def test_a_closed_cycle_dissipates_the_area_of_its_loop() -> None:
    parts = np.linspace(0.0, 0.02, 41), np.linspace(0.02, -0.02, 81), np.linspace(-0.02, 0.02, 81)
    cycle = np.concatenate(parts)
    stress, _ = pulled(law(LAWS["perfect"], "stress"), cycle)
    loop = np.trapezoid(stress[40:], cycle[40:])
    assert loop == pytest.approx(2.0 * Y * (0.04 - 2.0 * Y / E), rel=1e-6)
