"""Starter cases: every one runs as it stands, without a warning."""

from __future__ import annotations

from pathlib import Path

import pytest

from mlsanm_cli.case.starters import kinds, starter
from tests.app.scenes import Quiet, solve


# "ironing" runs in test_finite_contact.py.
@pytest.mark.parametrize("kind", sorted(set(kinds()) - {"ironing"}))
def test_every_starter_runs(kind: str, tmp_path: Path) -> None:
    console = Quiet()
    summary = solve(starter(kind), tmp_path / kind, console=console)
    assert summary["status"] == "done"
    assert not summary["warnings"]
    assert summary["nodes"] <= 7000
    for contact in summary["contacts"].values():
        if "reference" in contact:
            assert contact["reference"]["pressure_error_l2"] <= 0.05
