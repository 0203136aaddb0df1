"""``solver.linear``: what each choice gives, needs and says."""

from __future__ import annotations

from pathlib import Path

import pytest

from mlsanm_cli.app.run import run
from mlsanm_cli.app.scene import size_estimate as estimate
from mlsanm_cli.case import load_case
from mlsanm_cli.errors import CaseError
from tests.app.scenes import BAR, NODAL, Quiet


def test_results_do_not_depend_on_who_factorises(tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(NODAL)
    found = run(
        tmp_path / "case.toml", overrides=('solver.linear="superlu"',), out=tmp_path / "out", console=Quiet()
    )
    expected = run(tmp_path / "case.toml", out=tmp_path / "usual", console=Quiet())
    assert found["status"] == "done"
    assert found["warnings"] == expected["warnings"]
    for key in ("peak_pressure", "half_width"):
        there = expected["contacts"]["interface"][key]
        assert found["contacts"]["interface"][key] == pytest.approx(there, rel=1e-6)
    assert found["linear_residual"] <= 1e-7


def test_memory_is_that_of_the_solver(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "case.toml").write_text(BAR)
    cases = [
        load_case(tmp_path / "case.toml", (f'solver.linear="{kind}"', "body.bar.spacing=0.001")).case
        for kind in ("auto", "superlu")
    ]
    ours, other = (estimate.estimate(case).memory_mb for case in cases)
    assert ours < other
    monkeypatch.setattr(estimate, "physical_memory_mb", lambda: 0.5 * (ours + other))
    estimate.refuse_too_large(cases[0])
    with pytest.raises(CaseError, match="GB of memory") as caught:
        estimate.refuse_too_large(cases[1])
    assert caught.value.problems[0].key == "body.bar.spacing"
