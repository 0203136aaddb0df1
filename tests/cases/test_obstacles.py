"""Cases of rigid obstacles, of bodies held by contact alone and of fits, with the bars users may rely on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.formulas import FlatPunch, LameRing, plates_approach, press_fit
from tests.app.scenes import EXACT_LAW
from tests.cases.test_friction import cattaneo, contact_of, even, off, row
from tests.cases.test_published import STEEL, solve


def test_disk_between_plates(tmp_path: Path) -> None:
    _, data = solve("disk_between_plates", tmp_path / "run")
    exact = plates_approach(500.0, 1.0, STEEL)
    # Over eight seeds 0.3 to 0.7 % on symmetric clouds, 0.3 to 0.6 % on others.
    assert -data.path.displacements["press"][-1, 1] == pytest.approx(exact, rel=0.009)


def test_stack(tmp_path: Path) -> None:
    contacts = ("floor", "joint1", "joint2", "joint3")
    sizes = (f"body.block{k}.spacing={0.4 if k % 2 else 0.5}" for k in (1, 2, 3, 4))
    summary, data = solve("stack", tmp_path / "stack", EXACT_LAW, *sizes)
    for name in contacts:
        assert np.abs(data.contacts[name].pressure[-1] - 100.0).max() <= 1e-6 * 100.0
    assert len(summary["force_balance_bodies"]) == 4


def test_press_fit(tmp_path: Path) -> None:
    _, data = solve("press_fit", tmp_path / "fit", "output.at=[0.5, 1.0]")
    hub, bush = LameRing(1.0, 1.6, 1.0, 210e3, 0.3), LameRing(0.6, 1.0, 1.0, 100e3, 0.34)
    pressure, path = data.contacts["fit"].pressure, data.path
    expected = press_fit(bush, hub, 0.001)
    assert np.abs(pressure[-1] - expected).max() <= 0.004 * expected
    # The interference grows in proportion to its load factor.
    assert path.factors["fit"][-1] == 1.0
    later = path.factors["fit"] > 0.1
    ratio = pressure[later] / (path.factors["fit"][later, None] * expected)
    assert np.abs(ratio - 1.0).max() <= 0.004


@pytest.mark.parametrize("cut", [True, False], ids=["up to where the side is cut", "whole side"])
def test_rigid_punch(cut: bool, tmp_path: Path) -> None:
    """Up to the ends of a part of a straight side nodal pressures had zigzagged."""
    whole = [] if cut else ['contact.under.slave=["block.beside", "block.under", "block.beyond"]']
    summary, data = solve("rigid_punch", tmp_path / "run", *whole)
    assert not (cut and summary["warnings"])
    assert summary["nodes"] <= 600
    assert summary["contacts"]["under"]["singular_ends"]
    contact, punch = data.contacts["under"], FlatPunch(100.0, 0.2)
    inside = np.abs(contact.points[:, 0]) < 0.98 * punch.half_width
    expected = punch.pressure(contact.points[inside, 0])
    assert contact.pressure[-1][inside] == pytest.approx(expected, rel=4e-3)


SHEAR_MODULUS = 210e3 / 2.6


def test_a_patch_slides_to_and_fro(tmp_path: Path) -> None:
    """The same pressure p and traction mu p at every node, and the work mu P along the way."""
    run = solve("paper_sliding_patch", tmp_path / "run")
    summary, data = run
    contact = contact_of(run)
    assert not summary["warnings"]
    way = 0.002 - 30.0 / SHEAR_MODULUS * 2.0
    for position, sign, ways in ((2.0, -1.0, 1.0), (3.0, 1.0, 3.0)):
        at = row(run, position)
        assert np.abs(contact.pressure[at] / 100.0 - 1.0).max() <= 1e-4
        # Smooth laws let tractions be eta beyond the cone.
        assert np.abs(contact.traction[at] / (sign * 30.0) - 1.0).max() <= 1.2e-3
        assert (contact.status[at] == 2).all()
        assert abs(contact.dissipated_work[at] / (60.0 * way * ways) - 1.0) <= 4e-3
    assert data.path.residual.max() <= 1e-8


def test_partial_slip_by_power_series(tmp_path: Path) -> None:
    # Half of its nodes, and no way back.
    short = ("stage=[{press=1.0}, {shear=1.0}]", "output.at=[2.0]")
    few = ("body.*.refine.0.growth=0.5", "body.*.refine.0.radius=0.105")
    run = solve("paper_partial_slip", tmp_path / "run", *short, *few)
    contact, x = contact_of(run), np.linspace(-0.11, 0.11, 401)
    found, expected = even(contact, contact.traction[-1], x), -cattaneo(x, 0.1, 5769.3, 0.5)
    # Sixteen nodes carry pressure; the middle, away from where slip begins, is nearer.
    assert off(found, expected, expected) <= 0.12
    middle = np.abs(x) <= 0.05
    assert off(found[middle], expected[middle], expected[middle]) <= 0.03
    stick = contact.points[contact.status[-1] == 1, 0]
    assert abs(0.5 * np.ptp(stick) - 0.1 * np.sqrt(0.5)) <= 0.0125
