"""The Python interface: ``import mlsanm_cli as mlsanm``. What it does the commands do as well.

>>> import mlsanm_cli as mlsanm
>>> mlsanm.overrides({"solver.order": 15, "contact.*.regularization.law": "exact"})
('solver.order=15', 'contact.*.regularization.law="exact"')
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mlsanm_cli.errors import (
    CaseError,
    CaseProblem,
    Interrupted,
    MlsanmError,
    NumericalError,
    RunError,
)
from mlsanm_cli.results import Contact, ContactState, Run
from mlsanm_cli.toml import toml_value

__all__ = [
    "CaseError",
    "CaseProblem",
    "Contact",
    "ContactState",
    "Interrupted",
    "MlsanmError",
    "MlsanmWarning",
    "NumericalError",
    "Run",
    "RunError",
    "check",
    "collect",
    "open_run",
    "overrides",
    "resume",
    "run",
    "sweep",
]

Place = str | os.PathLike[str]
Changes = Mapping[str, Any]
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


class MlsanmWarning(UserWarning):
    """What a run or a check warns of."""


def run(
    case: Place,
    changes: Changes | None = None,
    *,
    out: Place | None = None,
    force: bool = False,
    skip_done: bool = False,
    threads: int = 1,
    max_wall: float | None = None,
    cache: bool = True,
    progress: bool = False,
) -> Run:
    """Solve the case in a file, with ``changes`` of its keys, and write a run directory.

    ``changes`` are as of ``--set``: ``{"solver.order": 15, "contact.*.friction": 0.2}``. ``out`` is the run
    directory, ``results/<name of the case>`` by default; ``force`` replaces a run in it, ``skip_done`` opens
    the run in it if it is done and of this very case. ``max_wall`` stops after so many seconds, ``progress``
    prints on stderr what the command prints; ``cache`` has no effect any more. Warnings come as
    `MlsanmWarning`.

    Raises CaseError for a case with faults (``problems`` has all of them), RunError for bad usage,
    NumericalError for a run that failed, and Interrupted for one that was stopped; what these two have done
    is kept, and can be opened.
    """
    with _numerics(threads):
        from mlsanm_cli.app.run import run as run_case
    with _console(progress) as console:
        summary = run_case(
            Path(case),
            overrides=overrides(changes),
            out=None if out is None else Path(out),
            force=force,
            skip_done=skip_done,
            threads=threads,
            max_wall=max_wall,
            console=console,
            argv=_argv(),
        )
    return _opened(summary)


def resume(
    rundir: Place,
    *,
    threads: int = 1,
    max_wall: float | None = None,
    cache: bool = True,
    progress: bool = False,
) -> Run:
    """Continue a run that was stopped or killed, to the same result; see `run`."""
    with _numerics(threads):
        from mlsanm_cli.app.resume import resume as resume_run
    with _console(progress) as console:
        summary = resume_run(Path(rundir), max_wall=max_wall, console=console)
    return _opened(summary)


def check(
    case: Place,
    changes: Changes | None = None,
    *,
    write: Place | None = None,
    picture: Place | None = None,
) -> dict[str, Any]:
    """Everything short of solving: sizes, quality of clouds, pairs, cost, ``warnings`` and ``notes``.

    ``write`` names a VTU file for a look at the model, ``picture`` a picture of it. Raises CaseError and
    RunError as `run` does.
    """
    with _numerics(1):
        from mlsanm_cli.app.check import check as check_case
        from mlsanm_cli.app.sweep.point import Silent
    result = check_case(
        Path(case),
        overrides=overrides(changes),
        write=None if write is None else Path(write),
        picture=None if picture is None else Path(picture),
        console=Silent(),
    )
    return dict(result)


def open_run(rundir: Place) -> Run:
    """A run directory, of a run that is done, failed, stopped or still running. RunError if it is none.

    The package has it as ``open``.
    """
    return Run(Path(rundir))


def sweep(
    case: Place,
    varied: Mapping[str, Sequence[Any]],
    changes: Changes | None = None,
    *,
    out: Place | None = None,
    jobs: int = 1,
    force: bool = False,
    cache: bool = True,
    progress: bool = False,
) -> list[Run]:
    """Solve every combination of the values of ``varied`` keys that is not done yet; all runs, geometry by
    geometry.

    ``jobs`` processes share the work; a script that asks for more than one begins with
    ``if __name__ == "__main__":``. Runs that failed are among those returned, with their ``status``. Raises
    CaseError or RunError, with nothing run, where a point cannot be run as written.
    """
    with _numerics(1):
        from mlsanm_cli.app.sweep.run_sweep import SweepOptions
        from mlsanm_cli.app.sweep.run_sweep import sweep as sweep_case
    texts = [f"{key}={','.join(toml_value(value) for value in values)}" for key, values in varied.items()]
    with _console(progress) as console:
        result = sweep_case(
            Path(case),
            texts,
            SweepOptions(jobs=jobs, force=force),
            overrides=overrides(changes),
            out=None if out is None else Path(out),
            console=console,
            argv=_argv(),
        )
    if result["stopped"]:
        raise Interrupted("the sweep was stopped", "repeat the call to continue with the remaining points")
    return [Run(Path(place)) for place in result["directories"]]


def collect(runs: Sequence[Place | Run]) -> list[dict[str, Any]]:
    """One row per run: directory, status, the keys in which the cases differ, and figures."""
    with _numerics(1):
        from mlsanm_cli.app.results.collect import collect as collect_runs
    return collect_runs([one.directory if isinstance(one, Run) else Path(one) for one in runs])


def overrides(changes: Changes | None) -> tuple[str, ...]:
    """Changes of a case as ``--set`` takes them. TypeError for values that no case can hold."""
    return tuple(f"{key}={toml_value(value)}" for key, value in (changes or {}).items())


def _opened(summary: Mapping[str, Any]) -> Run:
    """The run that a summary is of; its error if it has ended early. What it warned of comes first."""
    for text in summary["warnings"]:
        # When all is written: a filter may make errors of them.
        warnings.warn(text, MlsanmWarning, stacklevel=3)
    status, reason, hint = summary["status"], str(summary["stop_reason"]), str(summary.get("hint", ""))
    if status == "failed":
        raise NumericalError(f"{reason} (kept in {summary['directory']})", hint)
    if status == "stopped":
        raise Interrupted(f"{reason} (kept in {summary['directory']})", hint)
    return Run(Path(summary["directory"]))


@contextmanager
def _numerics(threads: int) -> Iterator[None]:
    """A block that imports what works on so many threads: libraries read the number when they are imported.

    One that the caller has imported before keeps its own; bit for bit the same results on any machine need
    the variables set before Python starts.
    """
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, str(threads)))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextmanager
def _console(progress: bool) -> Iterator[Any]:
    """What a run talks to, the terminal or nothing. A limit on the time that ends it is Interrupted."""
    from mlsanm_cli.app.sweep.point import Silent

    shown = None
    if progress:
        from mlsanm_cli.cli.console import TerminalConsole
        from mlsanm_cli.cli.settings import Settings

        shown = TerminalConsole(sys.stderr, Settings())
    try:
        yield shown or Silent()
    except KeyboardInterrupt as stop:
        if not str(stop).startswith("the wall time"):
            raise
        raise Interrupted(f"{stop}: no run had begun", "raise max_wall") from None
    finally:
        if shown is not None:
            shown.close()


def _argv() -> tuple[str, ...]:
    return ("python", *sys.argv)
