"""The Python interface: ``import mlsanm_cli as mlsanm``, with the functions of the command line.

>>> import mlsanm_cli as mlsanm
>>> mlsanm.overrides({"solver.order": 15, "contact.*.regularization.law": "exact"})
('solver.order=15', 'contact.*.regularization.law="exact"')
"""

from __future__ import annotations

import os
import sys
import tempfile
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from mlsanm_cli.errors import Interrupted, NumericalError, RunError
from mlsanm_cli.inputs import results_of
from mlsanm_cli.results import Run
from mlsanm_cli.system import THREAD_VARIABLES
from mlsanm_cli.toml import toml_value

Place = str | os.PathLike[str]
Changes = Mapping[str, Any]
CaseSource = Place | Mapping[str, Any]
"""A case file, or a case as nested dicts."""
ENDED_EARLY = {"failed": NumericalError, "stopped": Interrupted}


class MlsanmWarning(UserWarning):
    """A warning of a run or a check."""


def run(
    case: CaseSource,
    changes: Changes | None = None,
    *,
    out: Place | None = None,
    force: bool = False,
    skip_done: bool = False,
    threads: int = 1,
    max_wall: float | None = None,
    progress: bool = False,
) -> Run:
    """Solve the case in a file, or of nested dicts, with ``changes`` of its keys, and write a run directory.

    ``changes`` are those of ``--set``: ``{"solver.order": 15, "contact.*.friction": 0.2}``. ``out`` is the
    run directory, by default ``results/<name of the case>``; ``force`` overwrites a run in it, ``skip_done``
    opens a completed run of the same case. ``max_wall`` stops after this number of seconds, ``progress``
    prints the messages of the command on stderr. Warnings are issued as `MlsanmWarning`.

    Raises CaseError for an invalid case, RunError for invalid usage, NumericalError if the run failed, and
    Interrupted if it was stopped; in the last two cases ``error.run`` is the run, with its completed steps.
    """
    options: dict[str, Any] = {"force": force, "skip_done": skip_done, "max_wall": max_wall}
    options |= {"overrides": overrides(changes), "argv": ("python", *sys.argv)}
    with _file_of(case) as path:
        options["out"] = _path(out) or results_of(path)
        summary = _call("run.run", threads, path, threads=threads, progress=progress, **options)
    return _opened(summary)


def resume(rundir: Place, *, threads: int = 1, max_wall: float | None = None, progress: bool = False) -> Run:
    """Continue a stopped or killed run, to the same result within the solver's tolerance; see `run`."""
    return _opened(_call("run.resume", threads, _named(rundir), max_wall=max_wall, progress=progress))


def check(
    case: CaseSource,
    changes: Changes | None = None,
    *,
    write: Place | None = None,
    picture: Place | None = None,
) -> dict[str, Any]:
    """Check a case without solving it: sizes, cloud quality, contact pairs, cost, ``warnings``, ``notes``.

    The model is written to the VTU file ``write`` and drawn in ``picture``, if given. Raises CaseError and
    RunError as `run` does.
    """
    files: dict[str, Any] = {"write": _path(write), "picture": _path(picture)}
    with _file_of(case) as path:
        return dict(_call("check.check", 1, path, overrides=overrides(changes), **files))


def open_run(rundir: Place) -> Run:
    """Open the directory of a run that is done, failed, stopped or still running. Raises RunError otherwise.

    Exported by the package as ``open``.
    """
    return Run(_named(rundir))


def sweep(
    case: CaseSource,
    varied: Mapping[str, Sequence[Any]],
    changes: Changes | None = None,
    *,
    out: Place | None = None,
    jobs: int = 1,
    force: bool = False,
    progress: bool = False,
) -> list[Run]:
    """Solve all combinations of values of the ``varied`` keys that are not done yet; returns all runs, sorted
    by geometry.

    ``jobs`` is the number of processes; scripts with more than one need ``if __name__ == "__main__":``.
    Failed runs are returned as well, with their ``status``. Raises CaseError or RunError before the first
    run if any point is invalid.
    """
    texts = [f"{key}={','.join(toml_value(value) for value in values)}" for key, values in varied.items()]
    options: dict[str, Any] = {"jobs": jobs, "force": force, "argv": ("python", *sys.argv)}
    options |= {"out": _path(out), "overrides": overrides(changes)}
    with _file_of(case) as path:
        result = _call("sweep.sweep", 1, path, texts, progress=progress, **options)
    if result["stopped"]:
        raise Interrupted("the sweep was stopped", "repeat the call to continue with the remaining points")
    return [Run(Path(place)) for place in result["directories"]]


def collect(runs: Sequence[Place | Run]) -> list[dict[str, Any]]:
    """One row per run: directory, status, the keys that differ between the cases, and results."""
    with _numerics(1):
        from mlsanm_cli.app.results.info import collect as collect_runs
    return collect_runs([place.directory if isinstance(place, Run) else _named(place) for place in runs])


def overrides(changes: Changes | None) -> tuple[str, ...]:
    """Changes of a case as arguments of ``--set``. Raises TypeError for values that TOML cannot express."""
    return tuple(f"{key}={toml_value(value)}" for key, value in (changes or {}).items())


def _opened(summary: Mapping[str, Any]) -> Run:
    """The run of a summary, after issuing its warnings. Raises the error of a run that ended early."""
    for text in summary["warnings"]:
        # Only now that everything is written: a filter may turn warnings into errors.
        warnings.warn(text, MlsanmWarning, stacklevel=3)
    status, reason, hint = summary["status"], str(summary["stop_reason"]), str(summary.get("hint", ""))
    if status in ENDED_EARLY:
        error = ENDED_EARLY[status](f"{reason} (kept in {summary['directory']})", hint)
        error.run = Run(Path(summary["directory"]))
        raise error
    return Run(Path(summary["directory"]))


def _call(function: str, numerics: int, /, *given: Any, progress: bool = False, **options: Any) -> Any:
    """The result of a function of ``mlsanm_cli.app``, named by module and name, imported with this number of
    threads of the numerical libraries."""
    module, _, name = function.rpartition(".")
    with _numerics(numerics):
        called = getattr(import_module(f"mlsanm_cli.app.{module}"), name)
    with _console(progress) as console:
        return called(*given, console=console, **options)


@contextmanager
def _file_of(case: CaseSource) -> Iterator[Path]:
    """The file of a case; dicts are written to one within the block, and name files as seen from here."""
    if not isinstance(case, Mapping):
        yield _named(case)
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "case.toml"
        lines = [
            f"{toml_value(str(key))[1:-1]} = {toml_value(_placed(value))}" for key, value in case.items()
        ]
        path.write_text("\n".join(lines), encoding="utf-8")
        yield path


def _placed(value: Any) -> Any:
    """Nested dicts with the names of files made absolute."""
    if isinstance(value, Mapping):
        return {key: Path(one).absolute() if key == "file" else _placed(one) for key, one in value.items()}
    return [_placed(one) for one in value] if isinstance(value, list | tuple) else value


def _named(place: Place) -> Path:
    if not isinstance(place, str | os.PathLike):
        raise RunError(f"{place!r} is not the name of a file or a directory", "give a text or a path")
    return Path(place)


def _path(place: Place | None) -> Path | None:
    return None if place is None else _named(place)


@contextmanager
def _numerics(threads: int) -> Iterator[None]:
    """A block in which libraries are imported with this number of threads."""
    before = {name: os.environ.get(name) for name in THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, str(threads)))
    try:
        yield
    finally:
        for name in THREAD_VARIABLES:
            del os.environ[name]
        os.environ.update({name: value for name, value in before.items() if value is not None})


@contextmanager
def _console(progress: bool) -> Iterator[Any]:
    """The console of a run: the terminal, or none. Raises Interrupted at the wall-time limit."""
    from mlsanm_cli.app.context import Silent

    shown = None
    if progress:
        from mlsanm_cli.cli.console import Settings, TerminalConsole

        shown = TerminalConsole(sys.stderr, Settings())
    try:
        yield shown or Silent()
    except KeyboardInterrupt as stop:
        if not str(stop).startswith("the wall time"):
            raise
        raise Interrupted(f"{stop} before a run began", "increase max_wall") from None
    finally:
        if shown is not None:
            shown.close()
