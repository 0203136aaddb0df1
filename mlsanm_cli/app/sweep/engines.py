"""Execution of the points of a sweep: in this process, in several local ones, or on a Dask cluster. Other
processes are spawned: a fork would copy the state of threads that numba and BLAS have started.
"""

from __future__ import annotations

import multiprocessing
import signal
import threading
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from mlsanm_cli.app.run import run
from mlsanm_cli.errors import Interrupted, MlsanmError, RunError
from mlsanm_cli.memo import Memo

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
                memo=_memo(point.memory),
            )
        except (KeyboardInterrupt, Interrupted):
            return outcome(point, "stopped", "stopped by a signal")
        except MlsanmError as error:
            return outcome(point, "failed", error.message)
        warnings = len(summary["warnings"])
        return outcome(point, str(summary["status"]), str(summary["stop_reason"]), warnings)


def outcome(point: SweepPoint, status: str, reason: str, warnings: int = 0) -> Mapping[str, Any]:
    """Status of a point and the number of warnings in its summary."""
    return {
        "name": point.name,
        "directory": str(point.directory),
        "status": status,
        "stop_reason": reason,
        "warnings": warnings,
    }


@lru_cache(maxsize=1)
def _memo(memory: int) -> Memo:
    """Memo of the process."""
    return Memo(memory)


class Silent:
    """Console without output: warnings are counted and stored in summaries."""

    def phase(self, *given: Any, **named: Any) -> None:
        """No output."""

    step = note = warning = error = phase


MAX_ATTEMPTS = 3
"""Number of times that the process of a point may die: the point may be the cause."""

Row = Mapping[str, Any]


def solve_points(points: Sequence[SweepPoint], jobs: int, scheduler: str | None) -> Iterator[Row]:
    """Rows of the points in the order of their completion; points are begun in the order given, as far as
    possible. Raises RunError if the Dask cluster at the address of its ``scheduler`` is not available."""
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
    """The same by an existing Dask cluster with a shared file system, which repeats points that die with a
    worker."""
    try:
        import distributed
    except ImportError as error:
        raise RunError("--scheduler needs dask", "pip install 'mlsanm[dask]'") from error
    dask: Any = distributed
    try:
        client = dask.Client(scheduler, timeout=10)
    except (OSError, ValueError) as error:
        raise RunError(
            f"no Dask scheduler answers at {scheduler}: {error}", "as in --scheduler tcp://host:8786"
        ) from error
    with client:
        running = {
            client.submit(solve_point, point, pure=False, priority=-number): point
            for number, point in enumerate(points)
        }
        for future in dask.as_completed(list(running)):
            try:
                row: Row = future.result()
            except CancelledError as error:
                raise RunError(
                    "the Dask scheduler is no longer available", "start it, and the sweep again"
                ) from error
            except Exception as error:
                # Errors on a worker concern this point only.
                row = outcome(running[future], "failed", f"{type(error).__name__}: {error}")
            yield row
