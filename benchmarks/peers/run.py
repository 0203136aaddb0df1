"""mlsanm and finite element programs on the same three problems: error against CPU time of whole processes.

    python benchmarks/peers/run.py [--repeat 5] [--only hertz levels ...] [--out DIRECTORY]

Needs what benchmarks/peers/README.md lists; a program that is not installed is left out with a message. Every
process has one thread. The programs take turns, so that a busy machine slows all of them; compare
figures of one run only. Meshes are made by gmsh before the clock starts; mlsanm makes its clouds inside it.
Each part is written to peers.json as soon as it is done, and replaces only itself there.
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
from pathlib import Path
from typing import Any

import numpy as np
from catalogue import PARTS, Entry, missing
from scenes import PATCH_PRESSURE, REFERENCE, Profile, difference, read_profile

RESULTS = Path(__file__).resolve().parents[1] / "results"
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def cpu_seconds(command: list[str]) -> float:
    """User and system time of a process and its children; its output is shown only when it fails."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = {**os.environ, **dict.fromkeys(THREADS, "1")}
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
    """All entries of a part in turn, ``repeat`` times; of more than one a first turn is not counted."""
    with tempfile.TemporaryDirectory() as directory:
        jobs = [(entry, entry.prepare(Path(directory) / str(number))) for number, entry in enumerate(entries)]
        seconds: list[list[float]] = [[] for _ in jobs]
        for _ in range(repeat + (repeat > 1)):
            for place, (entry, job) in zip(seconds, jobs, strict=True):
                try:
                    place.append(cpu_seconds(job.command))
                except RuntimeError as problem:
                    print(f"{entry.program}, {entry.label}: {problem}", file=sys.stderr, flush=True)
        points: list[dict[str, Any]] = []
        for (entry, job), place in zip(jobs, seconds, strict=True):
            if not place:
                points.append({"program": entry.program, "label": entry.label, "failed": True})
                continue
            place = place[-repeat:]
            point = {
                "program": entry.program,
                "label": entry.label,
                "nodes": job.nodes(),
                "mesh_seconds": job.mesh_seconds,
                "error": error(part, job.result),
                "cpu_seconds": statistics.median(place),
                "spread": [min(place), max(place)],
            }
            points.append(point)
            print(
                f"{part:8} {entry.program:28} {entry.label:22} {point['nodes']:6d} nodes "
                f"{point['cpu_seconds']:7.2f} s  {100 * point['error']:.3g} %",
                flush=True,
            )
    return points


def draw(path: Path, results: dict[str, list[dict[str, Any]]]) -> None:
    """Error against time for every part that has errors worth drawing."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    titles = {
        "hertz": "pressure, one load level",
        "levels": "pressure, 50 load levels",
        "slip": "partial slip: traction's even part",
        "history": "traction after 60 levels",
    }
    shown = [part for part in titles if part in results]
    figure = Figure(figsize=(4.2 * len(shown), 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    programs = sorted({point["program"] for part in shown for point in results[part]})
    for axes, part in zip(figure.subplots(1, len(shown), squeeze=False)[0], shown, strict=True):
        for number, program in enumerate(programs):
            points = sorted(
                (point["cpu_seconds"], 100 * point["error"])
                for point in results[part]
                if point["program"] == program and "error" in point
            )
            if points:
                axes.loglog(
                    *zip(*points, strict=True), "osDP^vX"[number % 7], color=f"C{number}", label=program
                )
        axes.set(title=titles[part], xlabel="CPU seconds of the whole process", ylabel="error, L2 [%]")
        axes.grid(which="both", alpha=0.3)
        axes.legend(fontsize=7)
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--only", nargs="+", choices=list(PARTS), default=list(PARTS))
    parser.add_argument("--out", type=Path, default=RESULTS)
    arguments = parser.parse_args()
    absent = missing()
    for program, reason in absent.items():
        print(f"{program} is left out: {reason}", file=sys.stderr)
    arguments.out.mkdir(parents=True, exist_ok=True)
    store = arguments.out / "peers.json"
    results = json.loads(store.read_text()) if store.exists() else {}
    for part in arguments.only:
        entries = [entry for entry in PARTS[part] if entry.needs not in absent]
        results[part] = measure(part, entries, arguments.repeat)
        store.write_text(json.dumps(results, indent=1) + "\n")
    if set(results) - {"patch"}:
        draw(arguments.out / "peers.png", results)


if __name__ == "__main__":
    main()
