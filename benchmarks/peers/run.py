"""mlsanm and finite element programs on the same three problems: error against CPU time of whole processes.

    python benchmarks/peers/run.py [--repeat 5] [--only [hertz levels ...]] [--out DIRECTORY]

Needs what benchmarks/peers/README.md lists; a program that is not installed is left out with a message. Every
process has one thread. The programs take turns, so that a busy machine slows all of them; compare
figures of one run only. Peers run twice, with a mesh given in a file and making it themselves; mlsanm always
makes its clouds. Each part is written to peers.json as soon as it is done, and replaces only itself there;
picture and tables follow it: the tables stand in docs/peers.md, or next to peers.json with --out.
``--only`` without a part measures nothing and writes them again.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from entries import Entry, Job, missing, parts
from report import END, GEOMETRY, START, draw, insert, tables
from scenes import PATCH_PRESSURE, REFERENCE, Profile, difference, read_profile

PARTS = parts()
RESULTS = Path(__file__).resolve().parents[1] / "results"
PAGE = Path(__file__).resolve().parents[2] / "docs" / "peers.md"
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
LONG, BUDGET = 3.0, 15.0
"""What takes longer than LONG seconds is run for about BUDGET seconds only, at least once."""


@dataclass(frozen=True)
class Run:
    """One way to run an entry, and the times of its turns."""

    entry: Entry
    job: Job
    way: str
    seconds: list[float] = field(default_factory=list)

    def wanted(self, repeat: int) -> int:
        """Number of turns; of a short entry's the first is not counted, its caches are cold."""
        first = self.seconds[0] if self.seconds else 0.0
        if first > LONG:
            return min(repeat, max(1, int(BUDGET / first)))
        return repeat + (repeat > 1)

    def measured(self, repeat: int) -> dict[str, Any]:
        """Median, extremes and number of the turns that count."""
        counted = self.seconds[-repeat:]
        return {
            "cpu_seconds": statistics.median(counted),
            "spread": [min(counted), max(counted)],
            "turns": len(counted),
        }


def cpu_seconds(command: list[str]) -> float:
    """User and system time of a process and its children; its output is shown only when it fails."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = {**os.environ, **dict.fromkeys(THREADS, "1")}
    # All programs have bytecode, as where they are installed; without it mlsanm takes 0.4 s more.
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} failed:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def error(part: str, path: Path) -> float:
    """Relative L2 error of the pressure, or of the even part of the traction."""
    if part == "patch":
        profile = read_profile(path, "pressure")
        exact = Profile(profile.x[[0, -1]], np.full(2, PATCH_PRESSURE))
        return difference(profile, exact)
    if part in ("hertz", "levels"):
        return difference(read_profile(path, "pressure"), read_profile(REFERENCE / "hertz.csv", "pressure"))
    reference = read_profile(REFERENCE / f"{part}.csv", "traction")
    return difference(read_profile(path, "traction").even(), reference.even())


def measure(part: str, entries: list[Entry], repeat: int) -> list[dict[str, Any]]:
    """All entries of a part in turn, each in all its ways."""
    with tempfile.TemporaryDirectory() as directory:
        jobs = [(entry, entry.prepare(Path(directory) / str(number))) for number, entry in enumerate(entries)]
        runs = [Run(entry, job, way) for entry, job in jobs for way in job.commands]
        for turn in range(repeat + (repeat > 1)):
            for run in runs:
                if len(run.seconds) < turn or turn >= run.wanted(repeat):
                    continue  # failed before, or has had its turns
                try:
                    run.seconds.append(cpu_seconds(run.job.commands[run.way]))
                except RuntimeError as problem:
                    print(f"{run.entry.program}, {run.entry.label}: {problem}", file=sys.stderr, flush=True)
        points: list[dict[str, Any]] = []
        for entry, job in jobs:
            point: dict[str, Any] = {"program": entry.program, "label": entry.label}
            ways = [run for run in runs if run.job is job]
            points.append(point)
            if not all(run.seconds for run in ways):
                point["failed"] = True
                continue
            point |= {"nodes": job.nodes(), "error": error(part, job.result)}
            point |= {run.way: run.measured(repeat) for run in ways}
            print(
                f"{part:8} {entry.program:24} {entry.label:16} {point['nodes']:6d} nodes "
                f"{point[GEOMETRY]['cpu_seconds']:7.2f} s  {100 * point['error']:.3g} %",
                flush=True,
            )
    return points


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--only", nargs="*", choices=list(PARTS), default=list(PARTS))
    parser.add_argument("--out", type=Path, default=RESULTS)
    arguments = parser.parse_args()
    absent = missing()
    for program, reason in absent.items():
        print(f"{program} is left out: {reason}", file=sys.stderr)
    arguments.out.mkdir(parents=True, exist_ok=True)
    store = arguments.out / "peers.json"
    page = PAGE if arguments.out.resolve() == RESULTS else arguments.out / "peers.md"
    results = json.loads(store.read_text()) if store.exists() else {}
    if arguments.only:  # kernels are compiled once, which is no part of a run
        subprocess.run([sys.executable, "-m", "mlsanm_cli", "warmup"], check=True)
    for part in arguments.only:
        entries = [entry for entry in PARTS[part] if entry.needs not in absent]
        results[part] = measure(part, entries, arguments.repeat)
        store.write_text(json.dumps(results, indent=1) + "\n")
    if set(results) - {"patch"}:
        draw(arguments.out / "peers.png", results)
    page.write_text(insert(page.read_text() if page.exists() else f"{START}\n{END}\n", tables(results)))


if __name__ == "__main__":
    main()
