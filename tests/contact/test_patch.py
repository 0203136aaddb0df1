"""Contact patch test: stacked blocks under uniform pressure, whatever their nodes."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.app.checks.references import HertzLine
from mlsanm_cli.contact.geometry.profile import half_width
from mlsanm_cli.contact.laws.contact_state import ContactState
from mlsanm_cli.contact.response.coercivity import contact_stability
from tests.case_text import scene
from tests.contact.scenes import Small, blocks, blocks_text, build, cylinder

RATIOS = [0.5, 0.73, 1.37, 2.0]


def stress_error(small: Small, state: ContactState) -> float:
    """Largest |sigma_yy + p|/p, |sigma_xx|/p, |sigma_xy|/p in both bodies."""
    worst = 0.0
    for name, body in small.scene.bodies.items():
        stress = body.model.stress(small.displacement(name, state)) + np.array([0.0, 100.0, 0.0])
        worst = max(worst, float(np.abs(stress).max()) / 100.0)
    return worst


@pytest.mark.parametrize("nu", [0.0, 0.3])
@pytest.mark.parametrize("ratio", RATIOS)
def test_pressure_and_stress_are_uniform(ratio: float, nu: float) -> None:
    small = blocks(ratio, nu)
    state = small.exact()
    arguments, c = (state.factors, state.motion, state.pressure), small.condensed
    assert state.closed.all()
    assert np.abs(state.pressure / 100.0 - 1.0).max() <= 1e-11
    assert stress_error(small, state) <= 1e-9
    inner = np.ones(len(state.closed), dtype=bool)
    inner[[0, -1]] = False
    assert contact_stability(c, inner) >= 0.5
    # Two columns in plane strain, with the stiffness E/(1 - nu^2).
    assert state.motion[0] == pytest.approx(-100.0 * 2.0 * (1.0 - nu**2) / 210e3, rel=1e-10)
    assert c.quantities["contact"]["interface"](*arguments) == pytest.approx([0.0, 200.0], abs=1e-9)
    assert c.quantities["force"]["lower.bottom"](*arguments)[1] == pytest.approx(200.0, rel=1e-10)
    assert max(np.abs(one(*arguments)).max() for one in c.quantities["imbalance"].values()) <= 1e-8


def test_seeds_and_slaves_make_no_difference() -> None:
    for overrides in (
        ("body.upper.seed=5", "body.lower.seed=11"),
        ('contact.interface.slave="lower.top"', 'contact.interface.master="upper.bottom"'),
        ('model.plane="stress"',),
    ):
        small = blocks(1.37, 0.3, *overrides)
        state = small.exact()
        assert np.abs(state.pressure / 100.0 - 1.0).max() <= 1e-11
        assert stress_error(small, state) <= 1e-9


def test_a_platen_free_to_turn_stays_level_above_the_middle() -> None:
    # Without Poisson's ratio the platen may hold the whole top, and nothing else need hold the upper block.
    text = blocks_text(0.0, 0.1, 0.137)
    text = text.replace('[[support]]\nboundary = "upper.left"\nux = 0.0\n', "")
    small = build(text.replace("fy = -200.0", 'ux = 0.0\nfy = -200.0\nrotation = "free"'))
    state = small.exact()
    down, turn = state.motion
    assert down == pytest.approx(-200.0 / 210e3, rel=1e-10)
    assert abs(turn) <= 1e-10 * abs(down)
    assert np.abs(state.pressure / 100.0 - 1.0).max() <= 1e-10


def test_a_crack_beside_glued_faces_closes_as_in_one_block() -> None:
    """The contact ends where the bond begins; unequal spacings."""
    text = scene("strain", "soft", E=1000.0)
    for name, y, spacing in (("low", 0.0, 0.7), ("high", 5.0, 1.0)):
        text = text.body(name, "soft", spacing, box=([0.0, 10.0], [y, y + 5.0]))
    text = text.support("low.bottom", uy=0.0).pin("low", [0.0, 0.0], ux=0.0)
    for name, ends, friction in (("glue", (4.0, 10.0), "bonded"), ("crack", (0.0, 4.0), 0.0)):
        first, last = ([x, 5.0] for x in ends)
        text = text.contact(name, "high.bottom", "low.top", friction=friction, from_=first, to=last)
    text = text.load("press", "high.top", "pressure", pressure=10.0)
    small = build(text)
    state = small.exact()
    assert np.abs(state.pressure / 10.0 - 1.0).max() <= 1e-6
    assert small.displacement("high", state)[:, 1].min() == pytest.approx(-0.091, rel=1e-6)


HERTZ = HertzLine(226.566, 1.0, 0.5 * 210e3 / 0.91)


def test_pressure_profile() -> None:
    """Of Hertz, at spacings of a/6 and a/12, pressures joined linearly."""
    x, errors = np.linspace(-0.08, 0.08, 4001), []
    expected = HERTZ.pressure(x)
    for spacing in (0.008, 0.004):
        small = cylinder(spacing)
        pressure, place = small.exact().pressure, small.coordinate
        off = np.interp(x, place, pressure) - expected
        errors.append(float(np.linalg.norm(off) / np.linalg.norm(expected)))
    assert errors[1] <= min(0.035, 0.9 * errors[0])
    assert pressure.max() == pytest.approx(HERTZ.peak_pressure, rel=0.005)
    assert half_width(place, pressure) == pytest.approx(HERTZ.half_width, abs=0.004)
