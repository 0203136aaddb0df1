"""What the shell completes, and the reference of all keys."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from click.shell_completion import BashComplete

from mlsanm_cli.case.explain import value_keys
from mlsanm_cli.case.schema import json_schema
from mlsanm_cli.case.starters import kinds, starter
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


Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_new_writes_a_starter_once(capsys: Capture) -> None:
    assert main(["new", "punch"]) == 0
    # Editors find the keys by the first line.
    first = "#:schema ./mlsanm.schema.json\n"
    assert Path("punch.toml").read_text() == first + starter("hertz")
    assert "mlsanm run punch.toml" in capsys.readouterr().out
    assert main(["new", "punch.toml", "--kind", "patch"]) == 2
    assert "--force" in capsys.readouterr().err
    assert Path("punch.toml").read_text() == first + starter("hertz")
    assert main(["new", "punch", "--kind", "patch", "--force", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"file": "punch.toml", "kind": "patch"}
    # Commands are shown as a shell takes them.
    assert main(["new", "my punch"]) == 0
    assert "mlsanm run 'my punch.toml'\n" in capsys.readouterr().out
    assert Path("punch.toml").read_text() == first + starter("patch")


def test_new_names_what_there_is(capsys: Capture) -> None:
    assert main(["new", "--list"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == list(kinds())
    assert main(["new", "a", "--kind", "herz"]) == 2
    assert 'did you mean "hertz"?' in capsys.readouterr().err
    assert main(["new"]) == 2
    assert "no name given" in capsys.readouterr().err
    assert main(["new", "nowhere/a"]) == 2
    assert "No such file" in capsys.readouterr().err
    assert not list(Path().iterdir())


def test_schema_is_json(capsys: Capture) -> None:
    assert main(["schema"]) == 0
    assert json.loads(capsys.readouterr().out) == json_schema()


def test_explain(capsys: Capture) -> None:
    assert main(["explain", "solver.order", "--color", "never"]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["default", "20"] in lines
    assert ["allowed", "at", "least", "2,", "at", "most", "40"] in lines
    assert main(["explain", "solver.order", "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)["explanations"]
    assert (found["key"], found["default"]) == ("solver.order", "20")
    assert main(["explain", "body.shape"]) == 0
    assert "(0: sharp corner)" in capsys.readouterr().out
    assert main(["explain"]) == 0
    assert "solver" in capsys.readouterr().out
    assert main(["explain", "order"]) == 2
    assert "solver.order" in capsys.readouterr().err


def install(monkeypatch: pytest.MonkeyPatch, **functions: Any) -> None:
    import sys

    import mlsanm_cli.app.results

    module = ModuleType("mlsanm_cli.app.results.probe")
    for name, function in functions.items():
        setattr(module, name, function)
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setattr(mlsanm_cli.app.results, "probe", module, raising=False)


def test_probe_of_a_force(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    seen: list[Any] = []

    def probe(*arguments: Any) -> Any:
        seen.append(arguments)
        return [
            {"position": at, "how": how, "fx": 0.0, "fy": -at}
            for at, how in ((0.5, "series"), (1.0, "stored"))
        ]

    install(monkeypatch, probe_force=probe)
    common = ["probe", "there", "--at", "0.5", "--at", "1", "--force", "press"]
    assert main(common) == 0
    assert seen == [(Path("there"), (0.5, 1.0), "press")]
    title, _, first, second = capsys.readouterr().out.splitlines()
    assert title == "force of press"
    assert first.split()[:3] == ["0.5", "0", "-0.5"]
    assert "series" in first
    assert second.split() == ["1", "0", "-1"]
    assert main([*common, "--csv"]) == 0
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    assert [float(row["fy"]) for row in rows] == [-0.5, -1.0]
    assert main([*common, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["levels"][0]["how"] == "series"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--force", "a", "--contact", "b"], "more than one"),
        (["--body", "a"], "needed together"),
        (["--point", "1,2"], "needed together"),
        (["--body", "a", "--point", "1"], "not a point"),
        (["--body", "a", "--point", "1,nan"], "nan"),
        (["--force", "a", "--quantity", "gap"], "--contact"),
        (["--contact", "a", "--field", "stress"], "--point"),
        (["--field", "stress"], "--point"),
        (["--force", "a", "--csv", "--json"], "--json"),
        (["--force", "a"], "is not a run"),
    ],
)
def test_probe_refuses(options: list[str], words: str, capsys: Capture) -> None:
    assert main(["probe", "there", *options]) == 2
    out, err = capsys.readouterr()
    # Errors are a result where JSON is asked for.
    assert ("problems" in out) == ("--json" in options)
    assert words in err
