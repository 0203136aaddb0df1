"""Published cases by the paper's route: friction as a smooth law with history, against closed formulas."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.cases.test_friction import cattaneo, contact_of, even, off, row
from tests.cases.test_published import solve

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
    short = ("stage=[{press=1.0}, {shear=1.0}]", "output.at=[2.0]")
    run = solve("paper_partial_slip", tmp_path / "run", *short)
    contact, x = contact_of(run), np.linspace(-0.11, 0.11, 401)
    found, expected = even(contact, contact.traction[-1], x), -cattaneo(x, 0.1, 5769.3, 0.5)
    # Sixteen nodes carry pressure; the middle, away from where slip begins, is nearer.
    assert off(found, expected, expected) <= 0.12
    middle = np.abs(x) <= 0.05
    assert off(found[middle], expected[middle], expected[middle]) <= 0.03
    stick = contact.points[contact.status[-1] == 1, 0]
    assert abs(0.5 * np.ptp(stick) - 0.1 * np.sqrt(0.5)) <= 0.0125
