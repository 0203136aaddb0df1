"""What the shell completes, and the reference of all keys."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.shell_completion import BashComplete

from mlsanm_cli.case.explain import value_keys
from mlsanm_cli.cli import main
from mlsanm_cli.cli.commands import cli

ROOT = Path(__file__).parents[2]
CASE = ROOT / "cases" / "hertz.toml"


def completed(words: str, count: int) -> list[str]:
    """What stands behind the words, of which ``count`` come before the one that is completed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COMP_WORDS", words)
        patch.setenv("COMP_CWORD", str(count))
        told = BashComplete(cli, {}, "mlsanm", "_MLSANM_COMPLETE").complete()
    return [line.partition(",")[2] for line in told.splitlines() if line]


def test_keys_have_the_names_of_the_case_in_them() -> None:
    found = completed(f"mlsanm run {CASE} --set contact.interface.reg", 4)
    assert found[0] == "contact.interface.regularization.law="
    assert set(completed("mlsanm run nowhere.toml --set solver.pa", 4)) == {"solver.pade="}
    assert "body.*.spacing=" in completed("mlsanm check nowhere.toml --set body.", 4)
    assert "body.block.spacing=" in completed(f"mlsanm sweep {CASE} --vary body.block.", 4)
    assert set(completed("mlsanm explain solver.p", 2)) == {"solver.pade"}


def test_kinds_and_names_of_a_run_are_completed(tmp_path: Path) -> None:
    assert completed("mlsanm new punch --kind her", 4) == ["hertz"]
    # Names come from resolved.toml alone: nothing is opened that a run writes to.
    (tmp_path / "resolved.toml").write_text(CASE.read_text())
    assert completed(f"mlsanm probe {tmp_path} --contact ", 4) == ["interface"]
    assert completed(f"mlsanm plot {tmp_path} --contact in", 4) == ["interface"]
    assert completed(f"mlsanm probe {tmp_path} --force ", 4) == ["press", "block.bottom", "interface"]
    assert completed(f"mlsanm probe {tmp_path} --body ", 4) == ["cylinder", "block"]
    for content in ("= no toml", "body = 3", "body = [3]"):
        (tmp_path / "resolved.toml").write_text(content)
        assert completed(f"mlsanm probe {tmp_path} --body ", 4) == []


def test_the_reference_has_every_key_with_its_meaning(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "--all"]) == 0
    text = capsys.readouterr().out
    lines = [line for line in text.splitlines() if line.startswith("| `")]
    for key in value_keys():
        assert any(line.startswith(f"| `{key.rpartition('.')[2]}`") for line in lines), key
    assert all(len(line.replace("\\|", "").split("|")) == 6 for line in lines)
    assert "## `[[body]]`" in text
    assert text.index("## `[[contact]]`") < text.index("| `accuracy`")
    assert "| `law` | " in text
    assert main(["explain", "--all", "--json"]) == 0
    told: list[dict[str, Any]] = json.loads(capsys.readouterr().out)["explanations"]
    assert {one["key"] for one in told} >= set(value_keys())
    assert all(one["meaning"] for one in told)


def test_all_and_a_key_do_not_go_together(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "solver.order", "--all"]) == 2
    assert "--all explains every key" in capsys.readouterr().err
