"""Execution of the points of a sweep: in this process, in several local ones, or on a Dask cluster. Other
processes are spawned: a fork would copy the state of threads that numba and BLAS have started."""

from __future__ import annotations

import multiprocessing
import signal
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from mlsanm_cli.app.sweep.point import SweepPoint, outcome, solve_point
from mlsanm_cli.closing import Closing
from mlsanm_cli.errors import RunError

MAX_ATTEMPTS = 3
"""Number of times that the process of a point may die: the point may be the cause."""

Row = Mapping[str, Any]


class Engine(Closing, ABC):
    """Solves points; a context manager."""

    @abstractmethod
    def submit(self, point: SweepPoint) -> None:
        """Queue a point; points are solved in the order of submission as far as possible."""

    @abstractmethod
    def results(self) -> Iterator[Row]:
        """Rows of all submitted points in the order of their completion; points may be submitted
        meanwhile."""


def local_engine(jobs: int) -> Engine:
    """This process for one job, or else a pool of processes."""
    return SerialEngine() if jobs == 1 else PoolEngine(jobs)


class SerialEngine(Engine):
    """Solves points one after the other in this process."""

    def __init__(self) -> None:
        self._waiting: deque[SweepPoint] = deque()

    def submit(self, point: SweepPoint) -> None:
        """Queue a point after those of its geometry, before those of others."""
        self._waiting.append(point)

    def results(self) -> Iterator[Row]:
        """Solve the queued points; those submitted meanwhile first, as their operators are in memory."""
        while self._waiting:
            before = len(self._waiting) - 1
            row = solve_point(self._waiting.popleft())
            yield row
            self._waiting.rotate(len(self._waiting) - before)
            if row["status"] == "stopped":
                return

    def close(self) -> None:
        """Discard the queued points."""
        self._waiting.clear()


class PoolEngine(Engine):
    """Pool of spawned processes. If one dies, the pool is restarted and unfinished points are repeated."""

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        self._pool: ProcessPoolExecutor | None = None
        self._running: dict[Future[Row], SweepPoint] = {}
        self._attempts: dict[str, int] = {}

    def submit(self, point: SweepPoint) -> None:
        """Submit a point to the pool."""
        if self._pool is None:
            context = multiprocessing.get_context("spawn")
            self._pool = ProcessPoolExecutor(self._jobs, mp_context=context, initializer=_leave_signals)
        try:
            self._running[self._pool.submit(solve_point, point)] = point
        except BrokenProcessPool:
            # The broken pool is handled by its other points; this one only needs a new pool.
            self._pool = None
            self.submit(point)

    def results(self) -> Iterator[Row]:
        """Rows in the order of completion."""
        while self._running:
            finished, _ = wait(self._running, return_when=FIRST_COMPLETED)
            if any(isinstance(future.exception(), BrokenProcessPool) for future in finished):
                # No other point of the pool will complete.
                finished, _ = wait(self._running)
                self._pool = None
            ended = [
                (future, self._running.pop(future)) for future in list(self._running) if future in finished
            ]
            lost = []
            for future, point in ended:
                if isinstance(future.exception(), BrokenProcessPool):
                    lost.append(point)
                else:
                    yield future.result()
            yield from self._again(lost)

    def _again(self, lost: list[SweepPoint]) -> Iterator[Row]:
        """Repeat points lost with a process on a new pool; returns rows of those that have failed too
        often."""
        for number, point in enumerate(lost):
            # Only the first points, which had begun, may be the cause.
            count = self._attempts.get(point.name, 0) + (number < self._jobs)
            self._attempts[point.name] = count
            if count >= MAX_ATTEMPTS:
                yield outcome(point, "failed", f"its process died {count} times")
            else:
                self.submit(point)

    def close(self) -> None:
        """Discard the unfinished points."""
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)


def _leave_signals() -> None:
    """Ctrl-C reaches all processes: runs handle it, and idle processes ignore it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


class DaskEngine(Engine):
    """Existing Dask cluster with a shared file system; it repeats points that die with a worker."""

    def __init__(self, client: Any, as_completed: Any) -> None:
        self._client = client
        self._completed = as_completed([])
        self._points: dict[str, SweepPoint] = {}

    def submit(self, point: SweepPoint) -> None:
        """Submit a point to the scheduler, with decreasing priority."""
        future = self._client.submit(solve_point, point, pure=False, priority=-len(self._points))
        self._points[future.key] = point
        self._completed.add(future)

    def results(self) -> Iterator[Row]:
        """Rows in the order of completion."""
        for future in self._completed:
            point = self._points[future.key]
            try:
                row: Row = future.result()
            except CancelledError as error:
                raise RunError(
                    "the Dask scheduler is no longer available", "start it, and the sweep again"
                ) from error
            except Exception as error:
                # Errors on a worker concern this point only.
                row = outcome(point, "failed", f"{type(error).__name__}: {error}")
            yield row

    def close(self) -> None:
        """Discard the unfinished points."""
        self._client.close()


def dask_engine(scheduler: str) -> Engine:
    """Cluster of the scheduler at an address. RunError if dask is not installed or no scheduler answers."""
    try:
        from distributed import Client, as_completed
    except ImportError as error:
        raise RunError("--scheduler needs dask", "pip install 'mlsanm[dask]'") from error
    try:
        client: Any = Client(scheduler, timeout=10)  # type: ignore[no-untyped-call, unused-ignore]
    except (OSError, ValueError) as error:
        raise RunError(
            f"no Dask scheduler answers at {scheduler}: {error}", "as in --scheduler tcp://host:8786"
        ) from error
    return DaskEngine(client, as_completed)
