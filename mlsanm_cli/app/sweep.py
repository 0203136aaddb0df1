"""``mlsanm sweep``: a case solved for all combinations of given values, each in its own run directory, by
this process, several local ones, or a Dask cluster. Points of one geometry are consecutive and share
operators. Other processes are spawned: a fork would copy the state of threads of numba and BLAS."""

from __future__ import annotations

import hashlib
import multiprocessing
import signal
import threading
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from mlsanm_cli.app.checks.references import read_case
from mlsanm_cli.app.context import Console, Silent
from mlsanm_cli.app.results.info import collect, write_rows
from mlsanm_cli.app.run import run
from mlsanm_cli.case import Case, resolved_mapping
from mlsanm_cli.case.reading.overrides import parse_vary, points
from mlsanm_cli.errors import CaseError, CaseProblem, Interrupted, MlsanmError, RunError
from mlsanm_cli.inputs import results_of
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.run_reader import held_run
from mlsanm_cli.memo import Memo, digest

TABLE_FILE = "sweep.csv"
MAX_NAME_LENGTH = 120
"""Longest name of a run directory, made of the values; longer ones end with a digest."""
_ONE_AT_A_TIME = threading.Lock()
"""Workers of a cluster may have several threads; CPU times and signals belong to the process."""


class SweepPoint(NamedTuple):
    """A run to be made: the case, its changes, directory and options; ``memory`` is the number of results
    of each kind that its process keeps, and ``done`` points are skipped."""

    case: Path
    overrides: tuple[str, ...]
    directory: Path
    name: str
    threads: int
    memory: int
    argv: tuple[str, ...]
    done: bool


def solve_point(point: SweepPoint) -> Mapping[str, Any]:
    """Run one point; returns its name, status and stop reason, also if it fails."""
    with _ONE_AT_A_TIME:
        try:
            summary = run(
                point.case,
                overrides=point.overrides,
                out=point.directory,
                # The directory holds an unsuccessful run of the same case.
                force=True,
                threads=point.threads,
                console=Silent(),
                argv=point.argv,
                memo=process_memo(point.memory),
            )
        except (KeyboardInterrupt, Interrupted):
            return outcome(point, "stopped", "stopped by a signal")
        except MlsanmError as error:
            return outcome(point, "failed", error.message)
        warnings = len(summary["warnings"])
        return outcome(point, str(summary["status"]), str(summary["stop_reason"]), warnings)


def outcome(point: SweepPoint, status: str, reason: str, warnings: int = 0) -> Mapping[str, Any]:
    return {
        "name": point.name,
        "directory": str(point.directory),
        "status": status,
        "stop_reason": reason,
        "warnings": warnings,
    }


process_memo = lru_cache(maxsize=1)(Memo)
"""The memo of a process; all points of a sweep have the same size of it."""
MAX_ATTEMPTS = 3
"""Number of times that the process of a point may die: the point may be the cause."""

Row = Mapping[str, Any]


def solve_points(points: Sequence[SweepPoint], jobs: int, scheduler: str | None) -> Iterator[Row]:
    """Rows of the points in the order of their completion. Raises RunError without the Dask cluster."""
    if scheduler is not None:
        yield from _on_cluster(points, scheduler)
    elif jobs > 1:
        yield from in_pool(points, jobs)
    else:
        for point in points:
            row = solve_point(point)
            yield row
            if row["status"] == "stopped":
                break


def in_pool(points: Sequence[SweepPoint], jobs: int) -> Iterator[Row]:
    """The same by a pool of processes. If one of them dies, a new pool repeats the unfinished points."""
    attempts = Counter[str]()
    # Ctrl-C reaches all processes: runs handle it, and idle processes ignore it.
    idle: Any = {"initializer": signal.signal, "initargs": (signal.SIGINT, signal.SIG_IGN)}
    while points:
        running: dict[Future[Row], SweepPoint] = {}
        done = set()
        pool = ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), **idle)
        try:
            with suppress(BrokenProcessPool):
                for point in points:
                    running[pool.submit(solve_point, point)] = point
            for future in as_completed(running):
                # If a process dies, no other point of its pool completes.
                if not isinstance(future.exception(), BrokenProcessPool):
                    done.add(running[future].name)
                    yield future.result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
        lost = [point for point in points if point.name not in done]
        # Only the first points, which had begun, may be the cause.
        attempts.update(point.name for point in lost[:jobs])
        points = [point for point in lost if attempts[point.name] < MAX_ATTEMPTS]
        for point in lost:
            if attempts[point.name] >= MAX_ATTEMPTS:
                yield outcome(point, "failed", f"its process died {attempts[point.name]} times")


def _on_cluster(points: Sequence[SweepPoint], scheduler: str) -> Iterator[Row]:
    """The same by an existing Dask cluster with a shared file system, which repeats lost points."""
    try:
        import distributed
    except ImportError as error:
        raise RunError("--scheduler needs dask", "pip install 'mlsanm[dask]'") from error
    dask: Any = distributed
    try:
        client = dask.Client(scheduler, timeout=10)
    except (OSError, ValueError) as error:
        message = f"no Dask scheduler answers at {scheduler}: {error}"
        raise RunError(message, "as in --scheduler tcp://host:8786") from error
    with client:
        running = {
            client.submit(solve_point, point, pure=False, priority=-number): point
            for number, point in enumerate(points)
        }
        for future in dask.as_completed(list(running)):
            try:
                row: Row = future.result()
            except CancelledError as error:
                message = "the Dask scheduler is no longer available"
                raise RunError(message, "start it, and the sweep again") from error
            except Exception as error:
                # Errors on a worker concern this point only.
                row = outcome(running[future], "failed", f"{type(error).__name__}: {error}")
            yield row


def sweep(
    case_path: Path,
    varied: Sequence[str],
    *,
    overrides: tuple[str, ...] = (),
    out: Path | None = None,
    jobs: int = 1,
    threads: int = 1,
    scheduler: str | None = None,
    force: bool = False,
    console: Console,
    argv: tuple[str, ...] = (),
) -> Mapping[str, Any]:
    """Solve every point that is not completed yet, and write ``sweep.csv`` with a row for each.

    ``varied`` are KEY=VALUES texts; points are solved by ``jobs`` local processes, or by the Dask cluster at
    ``scheduler``; ``force`` repeats completed points. Returns the numbers of points completed, skipped as
    completed before, failed, and stopped or not begun, and a row for each point that did not end well.
    Raises CaseError or RunError, before any run, if a point is invalid, or if a directory holds a run of
    another case and ``force`` is not set.
    """
    if not varied:
        raise RunError("nothing varies", "name a key and its values, as in --vary solver.order=10,20")
    place = results_of(case_path)
    directory = (out or place.with_name(f"{place.name}-sweep")).absolute()
    options = {"threads": threads, "argv": argv}
    planned = _plan(case_path.absolute(), varied, overrides, directory, force, options)
    todo, total = [point for point in planned if not point.done], len(planned)
    if len(todo) < total:
        console.note(f"{total - len(todo)} of {total} points are done already")
    rows: list[Mapping[str, Any]] = []
    try:
        for row in solve_points(todo, jobs, scheduler) if todo else ():
            rows.append(row)
            count = row["warnings"]
            warned = f", {count} warning{'s' if count > 1 else ''}" if count else ""
            reason = f": {row['stop_reason']}" if row["status"] != "done" else ""
            console.note(f"{len(rows)}/{len(todo)} {row['name']} {row['status']}{warned}{reason}")
    except KeyboardInterrupt:
        console.warning("stopped by a signal; repeat the command to continue with the remaining points")
    table = directory / TABLE_FILE
    write_rows(table, collect([point.directory for point in planned]))
    statuses = [row["status"] for row in rows]
    return {
        "directory": str(directory),
        "table": str(table),
        "directories": [str(point.directory) for point in planned],
        "points": total,
        "done": statuses.count("done"),
        "skipped": total - len(todo),
        "failed": statuses.count("failed"),
        "stopped": len(todo) - statuses.count("done") - statuses.count("failed"),
        "with_warnings": sum(row["warnings"] > 0 for row in rows),
        "trouble": [row for row in rows if row["status"] != "done"],
    }


def _plan(
    case_path: Path,
    varied: Sequence[str],
    overrides: tuple[str, ...],
    directory: Path,
    force: bool,
    options: Mapping[str, Any],
) -> list[SweepPoint]:
    """All points, checked; those of one geometry are consecutive."""
    found: list[tuple[str, SweepPoint]] = []
    problems: dict[str, Any] = {}
    for values in points([parse_vary(text) for text in varied]):
        try:
            loaded = read_case(case_path, (*overrides, *values))
        except CaseError as error:
            named = [_named(problem, values) for problem in error.problems]
            problems |= {str(problem): problem for problem in named}
            continue
        place = directory / point_name(values)
        held, summary = (None, None) if force else held_run(place)
        if held not in (None, loaded.case_hash):
            hint = "use --force to replace it, or another --out"
            raise RunError(f"{place} holds the run of another case", hint)
        if held is None and not force:
            run_dir.check(place, force=False)
        done = summary is not None
        # Clouds, operators and responses of two geometries.
        memory = 4 * len(loaded.case.body)
        changes = (*overrides, *values)
        point = SweepPoint(case_path, changes, place, place.name, memory=memory, done=done, **options)
        found.append((geometry(loaded.case), point))
    if problems:
        raise CaseError(tuple(problems.values()))
    order = list(dict.fromkeys(key for key, _ in found))
    return [point for _, point in sorted(found, key=lambda item: order.index(item[0]))]


def _named(problem: CaseProblem, values: Sequence[str]) -> CaseProblem:
    """A problem reported with the value that varies."""
    texts = dict(text.split("=", 1) for text in values)
    key = next((key for key in texts if f"{problem.key}.".startswith(f"{key}.")), None)
    if problem.source != "--set" or key is None:
        return problem
    value, hint = texts[key].strip(), problem.hint
    if value.startswith("[[" if key != problem.key else "["):
        hint = f"values are listed without brackets: --vary {key}={value[1:-1].replace(' ', '')}"
    return replace(problem, source="--vary", hint=hint)


def point_name(values: Sequence[str]) -> str:
    """Directory name of a point: its values, independent of the order of the keys."""
    name = ",".join(run_dir.file_part(value) for value in sorted(values)).replace("%3D", "=")
    if len(name) <= MAX_NAME_LENGTH:
        return name
    return f"{name[:MAX_NAME_LENGTH]}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"


def geometry(case: Case) -> str:
    """Key that is equal for cases with the same operators; it only determines the order of points."""
    content = resolved_mapping(case)
    contacts = [
        {key: value for key, value in contact.items() if key != "regularization"}
        | {"friction": contact["friction"] > 0.0}
        for contact in content.get("contact", [])
    ]
    return digest(*(content.get(key) for key in ("model", "material", "body", "support", "mls")), contacts)
