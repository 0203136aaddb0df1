"""Whatever is wrong with a case or a call: one clear message, exit code 2, nothing written."""

from __future__ import annotations

from pathlib import Path

import pytest

from mlsanm_cli.cli import main
from tests.app.scenes import hertz
from tests.case_text import support

FLOOR = '[[support]]\nboundary = "block.bottom"\nuy = 0.0\n'

# What is replaced in the sound case by what, what the message must name, and how the line told begins. Other
# faults of keys and values are those of tests/case.
BAD = {
    "misspelt key": ("nu = 0.3", "nuu = 0.3", ("material.steel.nuu", "nu"), "nuu"),
    "negative spacing": ("spacing = 0.25", "spacing = -0.25", ("spacing", "above 0"), "spacing = -"),
    "unknown boundary": ('"block.top"', '"block.topp"', ("topp", "block.top"), 'master = "block.topp'),
    "overlapping support and load": (
        FLOOR, FLOOR + support("cylinder.flat", uy=0.0), ("cylinder.flat in y",), "[[load]]"
    ),
    "support on a contact surface": (
        FLOOR,
        FLOOR + support("block.top", ux=0.0),
        ("contact surface block.top",),
        'master = "block.top',
    ),
    "a body free to drift": (FLOOR, "", ("load.press", "nothing resists", "uy"), "[[load]]"),
    "surfaces that overlap": (
        "y = [-2.0, 0.0]", "y = [-2.0, 0.4]", ("contact.interface", "overlap by 0.4"), "[[contact]]"
    ),
    "a contact that faces nothing": (
        "center = [0.0, 1.0]", "center = [9.0, 1.0]", ("contact.interface", "faces block.top"), "[[contact]]"
    ),
    "a formula that does not fit": (
        '"hertz-line"', '"uniform-pressure"', ("reference.solution", "does not fit"), "solution ="
    ),
    "bad syntax": ("nu = 0.3", "nu = 0.3.1", ("(syntax)",), "nu ="),
}  # fmt: skip


@pytest.mark.parametrize("command", ["run", "check"])
@pytest.mark.parametrize("kind", BAD)
def test_bad_case(
    kind: str,
    command: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    old, new, told, place = BAD[kind]
    text = hertz().replace(old, new, 1)
    assert text != hertz()
    (tmp_path / "case.toml").write_text(text)
    monkeypatch.chdir(tmp_path)
    assert main([command, "case.toml", "--quiet"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert all(part in err for part in told), err
    line = text[: text.index(place)].count("\n") + 1
    assert f"case.toml:{line}: " in err, err
    assert "Traceback" not in err
    assert "nothing was run" in err
    assert [path.name for path in tmp_path.iterdir()] == ["case.toml"]


def test_a_scene_that_memory_cannot_hold(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "case.toml").write_text(hertz())
    monkeypatch.chdir(tmp_path)
    huge = ["--set", "body.block.spacing=0.0001", "--set", "body.block.refine=[]"]
    assert main(["run", "case.toml", *huge]) == 2
    err = capsys.readouterr().err
    assert "GB of memory" in err
    assert "block" in err
    assert "spacings" in err
    assert [path.name for path in tmp_path.iterdir()] == ["case.toml"]


def test_an_existing_run_is_kept(
    hertz_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {path.name: (path.stat().st_mtime_ns, path.stat().st_size) for path in hertz_run.iterdir()}
    (tmp_path / "case.toml").write_text(hertz())
    monkeypatch.chdir(tmp_path)
    assert main(["run", "case.toml", "--out", str(hertz_run)]) == 2
    err = capsys.readouterr().err
    assert "already holds a run" in err
    assert "--force" in err
    assert {p.name: (p.stat().st_mtime_ns, p.stat().st_size) for p in hertz_run.iterdir()} == before
