"""Faults put into the numerics on purpose: a run fails, or misses the bar of its published case."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.run import run
from mlsanm_cli.contact.response import basis as sources
from mlsanm_cli.mechanics.pieces import Pieces
from mlsanm_cli.mechanics.remainder import remainder_sources
from tests.app.scenes import EXACT_LAW, Quiet

CASES = Path(__file__).parents[2] / "cases"
COARSE = "contact.interface.accuracy=1e-2"


def outcome(name: str, directory: Path, *overrides: str) -> Mapping[str, Any]:
    """Summary of a run of a published case without fields."""
    quiet = ("output.fields=[]", "output.vtu=false", *overrides)
    return run(CASES / f"{name}.toml", overrides=quiet, out=directory, console=Quiet())


@pytest.mark.parametrize("case", ["lame", "self_weight"])
def test_pieces_that_know_of_no_load(case: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in ("per_column", "gathered"):
        proper = getattr(Pieces, name)
        monkeypatch.setattr(Pieces, name, lambda *some, proper=proper: 0.0 * proper(*some))
    monkeypatch.setattr(Pieces, "of_force", lambda pieces, force: np.zeros(3 * pieces.count))
    summary = outcome(case, tmp_path / "run")
    assert summary["status"] == "failed"


def test_remainders_of_half_the_forces(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    proper = remainder_sources
    monkeypatch.setattr(sources, "remainder_sources", lambda *rest: 0.5 * proper(*rest))
    (warning,) = outcome("hertz", tmp_path / "run", EXACT_LAW)["warnings"]
    assert warning.startswith("force imbalance on body cylinder: 9")
