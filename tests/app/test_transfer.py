"""What slave and master of a contact feel: the same, told per contact, and judged."""

from __future__ import annotations

from pathlib import Path

import pytest

from mlsanm_cli.app.assessment import checks as judge
from tests.app.scenes import NODAL, hertz, solve

LAW = 'contact.interface.regularization.law="exact"'


@pytest.mark.parametrize("text", [hertz(), NODAL])
def test_slave_and_master_feel_the_same(tmp_path: Path, text: str) -> None:
    summary = solve(text, tmp_path / "run", LAW)
    assert 0.0 <= summary["contacts"]["interface"]["force_mismatch"] <= 1e-6
    assert summary["limits"]["force_mismatch"] == 0.1


@pytest.mark.parametrize(
    ("lost", "status", "warned"), [(0.02, "done", 0), (0.04, "done", 1), (0.2, "failed", 0)]
)
def test_a_contact_that_loses_force_is_told(
    tmp_path: Path, afterwards: pytest.MonkeyPatch, lost: float, status: str, warned: int
) -> None:
    afterwards.setattr(judge, "force_mismatch", lambda built, state: {"interface": lost})
    summary = solve(hertz(), tmp_path / "run", LAW)
    told = [*summary["warnings"], summary["stop_reason"]]
    message = f"the forces on slave and master differ by {100.0 * lost:.2g} %"
    assert summary["status"] == status
    assert sum(message in text for text in summary["warnings"]) == warned
    assert any(message in text for text in told) == (lost > 0.03)
