"""CPU time and memory of whole runs as their clouds get finer.

    python benchmarks/scale.py [--case hertz] [--set KEY=VALUE ...] [--scale 1.0 0.36 0.147 0.104]

A case of ``cases/`` with all spacings multiplied by each scale and other keys as ``--set`` has them, as
``'solver.order=15'``; every run a process of its own with one thread, compiled kernels and no cache of
operators. Tells CPU seconds (user and system, of the process), those of the phases, peak memory, and the
exponents of CPU time in the number of nodes, from line to line and over all. Writes scale.json (``--out``)
after every line; lines of other cases and settings stay.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def finer(case: Path, scale: float) -> list[str]:
    """Options that multiply all spacings of a case; automatic ones become uniform."""
    options = []
    check = [sys.executable, "-m", "mlsanm_cli", "check", str(case), "--json"]
    found = json.loads(subprocess.run(check, check=True, capture_output=True, cwd=ROOT).stdout)
    for body in tomllib.loads(case.read_text())["body"]:
        key = f"body.{body['name']}"
        spacing = body.get("spacing", found["bodies"][body["name"]]["finest"])
        options.append(f"{key}.spacing={spacing * scale}")
        for number, zone in enumerate(body.get("refine", [])):
            options.append(f"{key}.refine.{number}.spacing={zone['spacing'] * scale}")
    return given(options)


def given(settings: list[str]) -> list[str]:
    """Options of ``mlsanm run`` for overrides of the case."""
    return [part for setting in settings for part in ("--set", setting)]


def measure(case: Path, settings: list[str], scale: float) -> dict[str, Any]:
    """One run."""
    environment = {**os.environ, **dict.fromkeys(THREADS, "1")}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as directory:
        out = Path(directory) / "run"
        command = [sys.executable, "-m", "mlsanm_cli", "run", str(case), "--quiet"]
        command += ["--out", str(out), *finer(case, scale), *given(settings)]
        subprocess.run(command, check=True, env=environment, cwd=ROOT)
        summary = json.loads((out / "summary.json").read_text())
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return {
        "case": case.stem,
        "set": settings,
        "scale": scale,
        "nodes": summary["nodes"],
        "contact_unknowns": summary["contact_unknowns"],
        "cpu": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
        "seconds": summary["seconds"],
        "peak_memory_mb": summary["peak_memory_mb"],
    }


def exponent(one: dict[str, Any], other: dict[str, Any]) -> float:
    """Of CPU time in the number of nodes between two lines."""
    return math.log(other["cpu"] / one["cpu"]) / math.log(other["nodes"] / one["nodes"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--case", default="hertz")
    parser.add_argument("--set", dest="settings", action="append", default=[])
    parser.add_argument("--scale", type=float, nargs="+", default=[1.0, 0.36, 0.147, 0.104])
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks" / "results")
    wishes = parser.parse_args()
    subprocess.run([sys.executable, "-m", "mlsanm_cli", "warmup"], check=True, cwd=ROOT)
    path = wishes.out / "scale.json"
    kept = json.loads(path.read_text()) if path.exists() else []
    here = (wishes.case, wishes.settings)
    others = [line for line in kept if (line["case"], line.get("set", [])) != here]
    wishes.out.mkdir(parents=True, exist_ok=True)
    lines: list[dict[str, Any]] = []
    for scale in sorted(wishes.scale, reverse=True):
        line = measure(ROOT / "cases" / f"{wishes.case}.toml", wishes.settings, scale)
        step = f", exponent {exponent(lines[-1], line):.2f}" if lines else ""
        lines.append(line)
        path.write_text(json.dumps([*others, *lines], indent=1) + "\n")
        print(
            f"{line['nodes']:7} nodes: {line['cpu']:.2f} s{step}, {line['peak_memory_mb']:.0f} MB, "
            f"{line['peak_memory_mb'] * 1024 / line['nodes']:.1f} KB a node",
            flush=True,
        )
    if len(lines) > 1:
        print(f"exponent over all: {exponent(lines[0], lines[-1]):.2f}")


if __name__ == "__main__":
    main()
