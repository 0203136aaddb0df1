"""Execution of the points of a sweep: in this process, in several local ones, or on a Dask cluster. Other
processes are spawned: a fork would copy the state of threads that numba and BLAS have started."""

from __future__ import annotations

import multiprocessing
import signal
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from typing import Any

from mlsanm_cli.app.sweep.point import SweepPoint, outcome, solve_point
from mlsanm_cli.errors import RunError

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
