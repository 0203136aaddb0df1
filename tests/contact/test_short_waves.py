"""Slips of short waves: what is added to the discretisation, and what is left alone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.coulomb import increment, unloaded
from mlsanm_cli.contact.response.coercivity import contact_stability
from tests.case_text import annulus, body, contact, head, item, load, material, support, table
from tests.contact.scenes import build, cylinder


def fit(traction: list[float]) -> str:
    """A bush in a hub, pushed."""
    return (
        head("stress")
        + material("steel", E=210e3, nu=0.3)
        + body("hub", "steel", 0.05, annulus([0.0, 0.0], [1.0, 1.6]))
        + body("bush", "steel", 0.05, annulus([0.0, 0.0], [0.6, 1.0]))
        + support("hub.outer", ux=0.0, uy=0.0)
        + load("push", "bush.inner", "traction", traction=traction)
        + contact("fit", "bush.outer", "hub.inner", interference=0.001, friction=0.3)
        + item("stage", fit=1.0, push=1.0)
        + table("mls", degree=4)
    )


def test_alternating_tractions_meet_the_half_plane() -> None:
    # E* = 0.5 E / (1 - nu^2) and k = pi/h: the amplitude is 2/(E* k), but for ten nodes at both ends.
    one = cylinder(0.006, "contact.interface.friction=0.3", control="force = [1.0, -226.566]")
    slip, pairing = one.condensed.slip.traction, one.pairing
    spacing = float(np.median(pairing.spacing[pairing.candidate]))
    expected = 2.0 * spacing / (np.pi * 0.5 * 210e3 / 0.91)
    t: FloatArray = np.where(np.arange(len(slip)) % 2 == 0, 1.0, -1.0)
    assert np.mean((t * (slip @ t))[10:-10]) == pytest.approx(1.8 * expected, rel=0.4)


def test_degree_4_resists_where_spacings_grow_along_the_contact() -> None:
    settings = ["mls.degree=4", "mls.neighbors=37", "contact.interface.friction=0.3"]
    for name, depth in (("cylinder", 1.0), ("block", 0.0)):
        zones = ["{at=[0.0,0.0],spacing=0.005,radius=0.06,growth=0.2}"]
        for x in (-0.05, -0.0353553, 0.0353553, 0.05):
            y = depth * (1.0 - math.sqrt(1.0 - x**2))
            zones.append(f"{{at=[{x},{y}],spacing=0.0005,radius=0.002,growth=0.2}}")
        settings.append(f"body.{name}.refine=[{','.join(zones)}]")
    one = cylinder(0.006, *settings)
    bearing = np.abs(one.coordinate) <= 0.05
    assert 0.2 <= contact_stability(one.condensed, bearing) <= 2.0


def test_materials_answer_along_their_own_directions() -> None:
    wood = "{E1=20.0, E2=1.0, E3=1.0, G12=0.7, nu12=0.3, nu13=0.3, nu23=0.3}"
    one = cylinder(0.02, f"material.steel={wood}", "contact.interface.friction=0.3")
    pairing, material = one.pairing, one.scene.bodies["block"].model.material
    # Both bodies are of the same wood, whose grain runs along the surface.
    expected = 2.0 * material.contact_compliance(pairing.normal[pairing.candidate])
    np.testing.assert_allclose(one.condensed.half_plane[:, 0, 0], expected, rtol=1e-12)
    assert material.contact_compliance(np.eye(2))[1] > 3.0 * material.contact_compliance(np.eye(2))[0]


def test_a_fit_sticks_independently_of_the_direction_of_the_load() -> None:
    # Towards 90 degrees lies the seam of the bush's arc.
    angles, tractions = np.linspace(-np.pi, np.pi, 73), []
    for push, turn in (([30.0, 0.0], 0.0), ([0.0, 30.0], 0.5 * np.pi)):
        one = build(fit(push))
        zero = np.zeros_like(one.factors)
        state = increment(one.condensed, unloaded(one.condensed, zero), one.factors)
        assert state is not None
        assert state.status.stuck.all()
        bush = one.scene.bodies["bush"].model.cloud.points[one.pairing.node]
        angle = np.arctan2(bush[:, 1], bush[:, 0]) - turn
        tractions.append(np.interp(angles, angle[order := np.argsort(angle)], state.traction[order]))
    middle_, turned = (t[18:55] for t in tractions)
    assert np.abs(turned - middle_).max() <= 0.02 * np.abs(tractions[0]).max()
