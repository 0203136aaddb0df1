"""A sweep of friction coefficients on one geometry, against one run of it.

    python benchmarks/sweep.py [--points 100] [--repeat 3] [--only NAME ...] [--cache DIR]
        [--out benchmarks/results]

cases/cattaneo_mindlin.toml on default clouds, its loads applied together in one stage. CPU seconds of whole
processes, children included, one thread, kernels compiled before. ``run`` is the median of runs, ``sweep``
one `mlsanm sweep`, ``ratio`` what one takes of the other, ``further`` what each point after the first adds.
The scenes:

- ``exact``: the exact law, everything written that the case writes by default;
- ``bare``: the same without fields;
- ``sliding``: pressed first, then sheared, so that slip spreads from the edges and friction matters;
- ``history``: the case as it is, pressed, sheared, unloaded and sheared the other way;
- ``smooth``: the smooth law, a tenth of the points.

Writes sweep.json.
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

ROOT = Path(__file__).resolve().parents[1]
CASE = ROOT / "cases" / "cattaneo_mindlin.toml"
TOGETHER = ("stage=[{press=1.0, shear=1.0}]", "output.at=[1.0]")
SCENES: dict[str, tuple[str, ...]] = {
    "exact": TOGETHER,
    "bare": (*TOGETHER, "output.fields=[]"),
    "sliding": ("stage=[{press=1.0}, {shear=1.0}]", "output.at=[2.0]"),
    "history": (),
    "smooth": (*TOGETHER, 'contact.interface.regularization.law="hyperbolic"'),
}


def settings(name: str) -> list[str]:
    """The scene's changes to the case, as options."""
    return [word for change in SCENES[name] for word in ("--set", change)]


def cpu_of(arguments: list[str], cache: Path) -> float:
    """CPU seconds of a command and its children."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "MLSANM_CACHE_DIR": str(cache)}
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        environment[name] = "1"
    # Bytecode, as where the program is installed: without it every start takes 0.4 s more.
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-m", "mlsanm_cli", *arguments],
        check=True,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def measure(name: str, points: int, repeat: int, work: Path, cache: Path) -> dict[str, Any]:
    """One line of the table."""
    run = ["run", str(CASE), *settings(name), "--force", "--quiet", "--out", str(work / "run")]
    alone = statistics.median(cpu_of(run, cache) for _ in range(repeat))
    vary = ["--vary", f"contact.interface.friction=0.2:0.9:{points}"]
    whole = cpu_of(["sweep", str(CASE), *settings(name), *vary, "--out", str(work / f"sweep-{name}")], cache)
    summary = json.loads((work / "run" / "summary.json").read_text())
    return {
        "scene": name,
        "points": points,
        **{key: summary[key] for key in ("nodes", "contact_unknowns", "steps")},
        "run": alone,
        "sweep": whole,
        "ratio": whole / alone,
        "further": (whole - alone) / (points - 1),
    }


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=100)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--only", nargs="+", choices=SCENES, default=list(SCENES))
    parser.add_argument("--cache", type=Path, help="where kernels may be compiled already")
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks" / "results")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    lines = []
    with tempfile.TemporaryDirectory() as directory:
        work = Path(directory)
        cache = (options.cache or work / "cache").absolute()
        cpu_of(["warmup"], cache)
        for name in options.only:
            points = max(2, options.points // 10) if name == "smooth" else options.points
            told = measure(name, points, options.repeat, work, cache)
            print(
                f"{name:8s} run {told['run']:.2f} s, {points} points {told['sweep']:.1f} s = "
                f"{told['ratio']:.1f} runs, each further point {told['further']:.3f} s",
                flush=True,
            )
            lines.append(told)
            (options.out / "sweep.json").write_text(json.dumps(lines, indent=1) + "\n")


if __name__ == "__main__":
    main()
