"""Commands of mlsanm in children of this process, which has everything imported and compiled already.

A child may crash, hang or leave by any door: its parent sees the exit code or the signal, what it printed,
and what it used. Limits are hard: memory by RLIMIT_AS, time by SIGKILL. A child works on one command after
the other, for forking costs more than most refusals; a command that ends it leaves the rest to another child.
"""

from __future__ import annotations

import faulthandler
import io
import os
import resource
import select
import signal
import struct
import sys
import tempfile
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

PATIENCE = 20.0
REPORT = struct.Struct("iddd")
"""What a child tells of a command: exit code, CPU and wall seconds, peak memory so far in MB."""
MB = 2**20


@dataclass(frozen=True)
class Outcome:
    """How a command ended: ``code``, negative for the signal that ended it; ``hung`` where that was ours.

    ``grown_mb`` is by how much its child's peak of memory rose above what the child began with.
    """

    code: int
    hung: bool
    out: str
    err: str
    cpu: float
    wall: float
    peak_mb: float
    grown_mb: float

    @property
    def traceback(self) -> bool:
        """Whether a traceback was shown."""
        return "Traceback (most recent call last)" in self.out + self.err

    @property
    def sound(self) -> bool:
        """Whether it ended with 0, 2 or 3 and without a traceback."""
        return self.code in (0, 2, 3) and not self.traceback


def preload() -> None:
    """Import and compile what commands need, so that children begin with it."""
    # Fonts are looked for once, here.
    os.environ.setdefault("MPLCONFIGDIR", tempfile.mkdtemp(prefix="mlsanm-fonts-"))
    import h5py  # noqa: F401
    import scipy.optimize  # noqa: F401

    import mlsanm_cli.app.check
    import mlsanm_cli.app.comparison.compare
    import mlsanm_cli.app.results.info
    import mlsanm_cli.app.results.plot
    import mlsanm_cli.app.results.probe
    import mlsanm_cli.app.run
    import mlsanm_cli.app.sweep  # noqa: F401
    from mlsanm_cli.kernels.aot.jit import load

    load()


@dataclass(frozen=True)
class Job:
    """``mlsanm ARGUMENTS`` in a folder."""

    arguments: Sequence[str]
    folder: Path


def mlsanm(
    arguments: Sequence[str], folder: Path, *, seconds: float = 60.0, memory_mb: float = 4096.0
) -> Outcome:
    """Run one command in a child of its own."""
    return run_all([Job(arguments, folder)], seconds=seconds, memory_mb=memory_mb)[0]


def run_all(jobs: Sequence[Job], *, seconds: float = 60.0, memory_mb: float = 4096.0) -> list[Outcome]:
    """Run commands one after the other, each ended after ``seconds`` of CPU time or PATIENCE times that.

    Memory beyond ``memory_mb`` of addresses, on top of what this process has, is refused to them.
    """
    streams = [(os.memfd_create("out"), os.memfd_create("err")) for _ in jobs]
    outcomes: list[Outcome] = []
    try:
        while len(outcomes) < len(jobs):
            first = len(outcomes)
            outcomes += _child(jobs[first:], streams[first:], seconds, memory_mb)
    finally:
        for pair in streams:
            for number in pair:
                os.close(number)
    return outcomes


def _child(
    jobs: Sequence[Job], streams: Sequence[tuple[int, int]], seconds: float, memory_mb: float
) -> list[Outcome]:
    """What one child made of the jobs, up to the one that ended it."""
    read, write = os.pipe()
    sys.stdout.flush()
    sys.stderr.flush()
    with warnings.catch_warnings():
        # Of threads that a fork does not take along: libraries keep some that do nothing.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        _live(jobs, streams, write, memory_mb)
    os.close(write)
    outcomes: list[Outcome] = []
    began, size = time.monotonic(), _pages()[1] / MB
    hung = False
    for pair in streams:
        hung = not _ready(read, child, seconds)
        report = b"" if hung else os.read(read, REPORT.size)
        if not report:
            break
        code, cpu, wall, peak = REPORT.unpack(report)
        outcomes.append(Outcome(code, False, _text(pair[0]), _text(pair[1]), cpu, wall, peak, peak - size))
        began = time.monotonic()
    os.close(read)
    if hung:
        os.kill(child, signal.SIGKILL)
    _, status, used = os.wait4(child, 0)
    if len(outcomes) < len(jobs):
        wall, cpu = time.monotonic() - began, used.ru_utime + used.ru_stime
        code = os.waitstatus_to_exitcode(status)
        out, err = streams[len(outcomes)]
        peak = used.ru_maxrss / 1024
        outcomes.append(Outcome(code, hung, _text(out), _text(err), cpu, wall, peak, peak - size))
    return outcomes


def _ready(read: int, child: int, seconds: float) -> bool:
    """Wait until the child has something to tell; not so once it has used up its time."""
    began, before = time.monotonic(), _cpu(child)
    while not select.select([read], [], [], 0.5)[0]:
        if _cpu(child) - before > seconds or time.monotonic() - began > PATIENCE * seconds:
            return False
    return True


def _cpu(process: int) -> float:
    """CPU seconds of a process so far."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11:13])) / os.sysconf("SC_CLK_TCK")


def _text(number: int) -> str:
    size = os.fstat(number).st_size
    return os.pread(number, size, 0).decode(errors="replace")


def _live(jobs: Sequence[Job], streams: Sequence[tuple[int, int]], report: int, memory_mb: float) -> NoReturn:
    """The child's life."""
    from mlsanm_cli.cli import main

    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    limit = int(memory_mb * MB) + _pages()[0]
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for job, (out, err) in zip(jobs, streams, strict=True):
        began, before = time.monotonic(), time.process_time()
        try:
            os.dup2(out, 1)
            os.dup2(err, 2)
            # A stream over the number of each: what this process has may be no file at all.
            sys.stdout, sys.stderr = (io.TextIOWrapper(io.FileIO(number, "w", False)) for number in (1, 2))
            faulthandler.enable(sys.stderr)
            os.chdir(job.folder)
            sys.argv = ["mlsanm", *job.arguments]
            code = main(list(job.arguments))
            sys.stdout.flush()
            sys.stderr.flush()
        except BaseException as error:
            os.write(2, f"Traceback (most recent call last): escaped {error!r}".encode())
            code = 99
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        os.write(report, REPORT.pack(code, time.process_time() - before, time.monotonic() - began, peak))
    os._exit(0)


def _pages() -> tuple[int, int]:
    """Bytes of addresses and of memory that this process has."""
    addresses, memory = Path("/proc/self/statm").read_text().split()[:2]
    return int(addresses) * resource.getpagesize(), int(memory) * resource.getpagesize()
