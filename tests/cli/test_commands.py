"""Commands, options and exit codes, with stand-ins for what they call."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from mlsanm_cli import __version__
from mlsanm_cli.cli import main
from mlsanm_cli.cli.text import run_text
from mlsanm_cli.errors import CaseError, CaseProblem, Interrupted, MlsanmError, NumericalError, RunError
from mlsanm_cli.system import THREAD_VARIABLES

SUMMARY: dict[str, Any] = {
    "status": "done",
    "stop_reason": "target reached",
    "position": 1.0,
    "steps": 243,
    "factorizations": 250,
    "solves": 5000,
    "nodes": 5210,
    "unknowns": 10420,
    "contact_unknowns": 118,
    "seconds": {"total": 2.31, "jit": 0.0, "cloud": 0.25, "operators": 0.5},
    "contacts": {"interface": {"peak_pressure": 1234.5678, "force": [0.0, -350.0], "min_gap": 1.5e-7}},
    "residual": 3.2e-10,
    "force_balance": 1.1e-12,
    "stability": 0.02,
    "peak_memory_mb": 150.0,
    "warnings": [],
    "directory": "results/hertz",
}


MODULES = {"info": "results.info", "plot": "results.plot", "collect": "results.info", "resume": "run"}
"""Modules in ``app`` that are not named like their command."""


def install(monkeypatch: pytest.MonkeyPatch, name: str, function: Callable[..., Any]) -> None:
    """Makes the given function what the command ``name`` calls."""
    module = ModuleType(f"mlsanm_cli.app.{MODULES.get(name, name)}")
    setattr(module, name, function)
    monkeypatch.setitem(sys.modules, module.__name__, module)


Patch = pytest.MonkeyPatch
Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def _same_environment(monkeypatch: Patch) -> Iterator[None]:
    for variable in (*THREAD_VARIABLES, "NO_COLOR"):
        monkeypatch.delenv(variable, raising=False)
    before = dict(os.environ)
    yield
    for variable in THREAD_VARIABLES:
        os.environ.pop(variable, None)
    os.environ.update(before)


def raising(error: BaseException) -> Any:
    def function(*arguments: Any, **options: Any) -> Any:
        raise error

    return function


def test_run_passes_everything_on(monkeypatch: Patch, capsys: Capture) -> None:
    calls: list[tuple[Any, dict[str, Any]]] = []
    threads: list[str | None] = []

    def run(case: Path, **options: Any) -> dict[str, Any]:
        calls.append((case, options))
        threads.extend(os.environ.get(variable) for variable in THREAD_VARIABLES)
        options["console"].phase("clouds")
        options["console"].warning("spacing ratio 2.1")
        return SUMMARY

    install(monkeypatch, "run", run)
    monkeypatch.setattr(sys, "argv", ["mlsanm", "run", "a.toml"])
    arguments = ["run", "a.toml", "--set", "solver.order=15", "--set", "mls.degree=4", "--out", "there"]
    assert main([*arguments, "--force", "--threads", "2", "--max-wall", "90"]) == 0
    ((case, options),) = calls
    assert case == Path("a.toml")
    assert options.pop("console") is not None
    assert options == {
        "overrides": ("solver.order=15", "mls.degree=4"),
        "out": Path("there"),
        "force": True,
        "threads": 2,
        "max_wall": 90.0,
        "argv": ("mlsanm", "run", "a.toml"),
        "skip_done": False,
    }
    assert threads == ["2"] * 4
    out, err = capsys.readouterr()
    for words in ("done: target reached", "1234.57", "243 steps", "118 contact unknowns", "results/hertz"):
        assert words in out
    assert err.splitlines() == ["clouds ...", "warning: spacing ratio 2.1"]
    assert "\x1b" not in out + err


def test_resume_uses_the_threads_of_the_run(monkeypatch: Patch, tmp_path: Path) -> None:
    calls: list[tuple[Any, Any, Any]] = []

    def resume(rundir: Path, *, max_wall: float | None, console: Any) -> dict[str, Any]:
        calls.append((rundir, max_wall, os.environ["OPENBLAS_NUM_THREADS"]))
        return {**SUMMARY, "status": "stopped"}

    install(monkeypatch, "resume", resume)
    assert main(["resume", str(tmp_path)]) == 75
    (tmp_path / "events.jsonl").write_text('{"event": "start", "threads": 2}\n')
    assert main(["resume", str(tmp_path), "--max-wall", "9"]) == 75
    assert main(["resume", str(tmp_path), "--threads", "3"]) == 75
    assert calls == [(tmp_path, None, "1"), (tmp_path, 9.0, "2"), (tmp_path, None, "3")]


def chatty(case: Path, **options: Any) -> dict[str, Any]:
    """A run that uses all that the console offers."""
    console = options["console"]
    console.phase("clouds")
    console.step(1, 0.5, 1e-9, "")
    console.note("working")
    console.warning("look here")
    console.error("no way on", "refine")
    return {**SUMMARY, "stability": float("nan"), "path": Path("x")}


def test_json_is_all_there_is_on_stdout_and_quiet_shows_warnings_only(
    monkeypatch: Patch, capsys: Capture
) -> None:
    install(monkeypatch, "run", chatty)
    assert main(["run", "a.toml", "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out) == {**SUMMARY, "stability": None, "path": "x"}
    assert "working" in err
    assert main(["run", "a.toml", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "warning: look here\nerror: no way on\nhint: refine\n")


def test_exit_code_follows_the_status(monkeypatch: Patch) -> None:
    for status, code in (("done", 0), ("failed", 3), ("stopped", 75)):
        install(monkeypatch, "run", lambda case, status=status, **options: {**SUMMARY, "status": status})
        assert main(["run", "a.toml", "--quiet"]) == code


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (CaseError((CaseProblem("a.b", "wrong", 3, "x.toml", "do this"),)), 2, "x.toml:3: a.b: wrong (do"),
        (RunError("there is a run already", "use --force"), 2, "hint: use --force"),
        (NumericalError("no way on", "set solver.order"), 3, "error: no way on"),
        (Interrupted("wall time is over"), 75, "error: wall time is over"),
        (KeyboardInterrupt(), 75, "stopped by a signal\nhint: nothing was saved: repeat the command"),
        (KeyboardInterrupt("the wall time of 2 s is over"), 75, "the wall time of 2 s is over"),
        (MemoryError(), 2, "memory"),
        (PermissionError(13, "Permission denied", "/x/y"), 2, "/x/y: Permission denied"),
        (MlsanmError("base"), 70, "base"),
        (ZeroDivisionError("oh"), 70, "bug in mlsanm: ZeroDivisionError: oh"),
    ],
)
def test_errors(monkeypatch: Patch, capsys: Capture, error: BaseException, code: int, words: str) -> None:
    install(monkeypatch, "run", raising(error))
    assert main(["run", "a.toml"]) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert words in err
    assert "Traceback" not in err
    assert main(["run", "a.toml", "--debug"]) == code
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGUSR1])
def test_a_termination_signal_ends_like_an_interrupt(
    number: signal.Signals, monkeypatch: Patch, capsys: Capture
) -> None:
    before = signal.getsignal(number)
    install(monkeypatch, "run", lambda case, **options: signal.raise_signal(number))
    assert main(["run", "a.toml"]) == 75
    assert signal.getsignal(number) is before
    assert "stopped" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["rnu", "a.toml"], 'Did you mean "run"?'),
        (["a.toml"], '"mlsanm run a.toml"'),
        (["run"], "Missing argument 'CASE'"),
        (["run", "a.toml", "--thread", "2"], "--threads"),
        (["sweep", "-", "--vary", "a=1,2"], "write it to a file"),
        (["run", "a.toml", "--threads", "0"], "x>=1"),
        (["run", "a.toml", "--color", "blue"], "auto"),
        (["plot", "dir", "--format", "gif"], "png"),
        (["info"], "RUNDIR"),
        (["run", "a.toml", "--max-wall", "nan"], "nan is not"),
        (["run", "a.toml", "--max-wall", "inf"], "x<=1000000000"),
        (["resume", "a", "--max-wall", "1e300"], "x<=1000000000"),
        (["run", "a\udcff.toml"], "is not UTF-8 text"),
        (["run", "a.toml", "--out", "o\udcff"], "is not UTF-8 text"),
    ],
)
def test_bad_usage(arguments: list[str], words: str, capsys: Capture) -> None:
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert words in err


def test_help_and_version(capsys: Capture) -> None:
    assert main(["--version"]) == 0
    assert __version__ in capsys.readouterr().out
    assert main(["--help"]) == 0
    assert "sweep" in capsys.readouterr().out
    for command in ("run", "check", "info", "plot", "warmup"):
        assert main([command, "--help"]) == 0
        text = capsys.readouterr().out
        for option in ("--quiet", "--json", "--color", "--debug"):
            assert option in text


@pytest.mark.parametrize(
    ("option", "no_color", "colored"),
    [("auto", "", False), ("always", "", True), ("always", "1", True), ("never", "", False)],
)
def test_color(monkeypatch: Patch, capsys: Capture, option: str, no_color: str, colored: bool) -> None:
    monkeypatch.setenv("NO_COLOR", no_color)
    install(monkeypatch, "run", lambda case, **options: options["console"].warning("w") or SUMMARY)
    assert main(["run", "a.toml", "--color", option]) == 0
    out, err = capsys.readouterr()
    assert ("\x1b[" in out, "\x1b[" in err) == (colored, colored)


def test_the_closing_table_tells_how_far_to_trust_it() -> None:
    reference = {"solution": "hertz-line", "peak_pressure": 1230.0, "pressure_error_l2": 0.0021}
    summary = {
        **SUMMARY,
        "contacts": {"interface": {**SUMMARY["contacts"]["interface"], "reference": reference}},
        "error_estimate": {"displacement": 0.37, "pressure": {"interface": 0.0123}},
        "limits": {"residual": 1e-8, "stability": 0.15},
        "seconds": {"total": 2.0, **{f"phase {k}": 1.0 for k in range(10)}},
    }
    text = run_text(summary, color=False, width=75)
    for words in ("1.2 %", "0.21 %", "37 %", "above 1e-08", "below 0.15"):
        assert words in text
    assert max(map(len, text.splitlines())) <= 75


def told_as_json(capsys: Capture, *arguments: str) -> tuple[int, list[dict[str, Any]]]:
    code = main([*arguments, "--json"])
    return code, json.loads(capsys.readouterr().out)["problems"]


def test_errors_as_json(monkeypatch: Patch, capsys: Capture) -> None:
    problems = (CaseProblem("a.b", "is wrong", 3, "x.toml", "do this"), CaseProblem("c", "too", 0, "--set"))
    install(monkeypatch, "run", raising(CaseError(problems)))
    listed = [
        {"file": "x.toml", "line": 3, "key": "a.b", "message": "is wrong", "hint": "do this"},
        {"file": "--set", "line": None, "key": "c", "message": "too", "hint": None},
    ]
    assert told_as_json(capsys, "run", "x.toml") == (2, listed)
    install(monkeypatch, "run", raising(RunError("there is a run", "use --force")))
    code, (problem,) = told_as_json(capsys, "run", "x.toml")
    told = (code, problem["message"], problem["hint"], problem["key"])
    assert told == (2, "there is a run", "use --force", None)
    code, (problem,) = told_as_json(capsys, "run", "--thread")
    assert (code, "--threads" in problem["message"]) == (2, True)
    install(monkeypatch, "run", raising(ZeroDivisionError("oh")))
    assert told_as_json(capsys, "run", "x.toml")[0] == 70
