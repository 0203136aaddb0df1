"""CPU seconds and memory of whole processes: the tables of docs/performance.md.

    python benchmarks/cost.py [--only cases scale levels sweep rough] [--repeat 3] [--out benchmarks/results]

- ``cases``: published cases, phase by phase, and what importing numpy and scipy.sparse.linalg takes;
- ``scale``: ``cases/hertz.toml`` with all spacings uniform and ever smaller; ``per_node`` in KB;
- ``levels``: ``cases/cattaneo_mindlin.toml`` with 60 saved levels and with one;
- ``sweep``: 30 friction coefficients in one stage, against one of them;
- ``rough``: self-affine rigid profiles (Hurst exponent 0.8, rms slope 0.02) on a block, exact law.

One thread, kernels compiled before, bytecode as after installation, medians of ``--repeat`` turns. Writes
cost.json, in which each part replaces itself only. Compare figures of one run, not of different ones.
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
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.scenes.scene import CASES, Array, case_of

ROOT = Path(__file__).resolve().parents[1]
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
NAMES = (
    "lame hertz two_cylinders rigid_cylinder disk_between_plates pin_in_hole press_fit rigid_punch "
    "cattaneo_mindlin block_slide wedge stack kirsch bent_cantilever snap_through deep_cylinder "
    "squeezed_ring rubber_half_disk"
)
SPACINGS = {"cylinder": 0.1, "block": 0.2}
SCALES = (1.0, 0.36, 0.147, 0.095)
PROFILES = ((0.4, 401, 40.0), (0.1, 2001, 400.0), (0.02, 12001, 400.0))
"""Shortest waves, points of the profile, and mean pressures."""
Line = dict[str, Any]


def cpu_of(command: Sequence[str]) -> float:
    """CPU seconds of a command and its children."""
    environment = {**os.environ, **dict.fromkeys(THREADS, "1"), "PYTHONPATH": str(ROOT)}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, env=environment, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def mlsanm(*arguments: str) -> list[str]:
    """A command of the program."""
    return [sys.executable, "-m", "mlsanm_cli", *arguments]


def measured(case: Path, settings: Sequence[str], folder: Path, repeat: int) -> Line:
    """A run: median CPU seconds, and its own figures."""
    options = [word for setting in settings for word in ("--set", setting)]
    command = mlsanm("run", str(case), *options, "--quiet", "--force", "--out", str(folder / "run"))
    cpu = statistics.median(cpu_of(command) for _ in range(repeat))
    summary = json.loads((folder / "run" / "summary.json").read_text())
    kept = {key: summary[key] for key in ("nodes", "contact_unknowns", "seconds", "peak_memory_mb")}
    return {"case": case.stem, "cpu": cpu, **kept}


def published(name: str) -> Path:
    """A published case."""
    return ROOT / "cases" / f"{name}.toml"


def cases(folder: Path, repeat: int) -> list[Line]:
    """Published cases."""
    imports = [sys.executable, "-c", "import numpy, scipy.sparse.linalg"]
    first = {"case": "imports", "cpu": statistics.median(cpu_of(imports) for _ in range(repeat))}
    return [first, *(measured(published(name), (), folder, repeat) for name in NAMES.split())]


def scale(folder: Path, _: int) -> list[Line]:
    """Ever finer clouds."""
    lines = []
    for factor in SCALES:
        settings = [f"body.{name}.spacing={size * factor}" for name, size in SPACINGS.items()]
        line = measured(published("hertz"), settings, folder, 1)
        lines.append({**line, "per_node": 1024.0 * line["peak_memory_mb"] / line["nodes"]})
    return lines


def levels(folder: Path, repeat: int) -> list[Line]:
    """One saved level, and sixty."""
    texts = ("4.0", ",".join(f"{k / 15.0:.6g}" for k in range(1, 61)))
    return [measured(published("cattaneo_mindlin"), [f"output.at=[{at}]"], folder, repeat) for at in texts]


def sweep(folder: Path, repeat: int) -> list[Line]:
    """A run, and thirty of them in one process."""
    together = ("stage=[{press=1.0, shear=1.0}]", "output.at=[1.0]")
    case, points = published("cattaneo_mindlin"), 30
    alone = measured(case, together, folder, repeat)
    options = [word for change in together for word in ("--set", change)]
    vary = ["--vary", f"contact.interface.friction=0.2:0.9:{points}"]
    whole = cpu_of(mlsanm("sweep", str(case), *options, *vary, "--force", "--out", str(folder / "sweep")))
    return [alone, {"case": f"{points} points", "cpu": whole, "runs": whole / alone["cpu"]}]


def self_affine(points: int, shortest: float, wide: float = 10.0) -> Array:
    """A profile (n, 2), even about both ends, lowest point at 0."""
    random = np.random.default_rng(1)
    number = np.unique(np.round(2.0 * wide / np.geomspace(2.0, shortest, 160)).astype(int))
    k = np.pi * number / wide
    height = k**-1.3 * np.sqrt(np.gradient(k)) * random.choice([-1, 1], len(k))
    height *= random.uniform(0.5, 1.5, len(k))
    height *= 0.02 / np.sqrt(0.5 * ((height * k) ** 2).sum())
    x = np.linspace(0.0, wide, points)
    y = (height[:, None] * np.cos(k[:, None] * x)).sum(axis=0)
    return np.column_stack([x, y - y.min()])


def rough(folder: Path, _: int) -> list[Line]:
    """Rough profiles with ever more waves."""
    lines = []
    for shortest, points, mean in PROFILES:
        case, profile = case_of(CASES / "rough_light.toml"), self_affine(points, shortest)
        case["body"][0]["shape"]["y"], case["load"][0]["fy"] = [-5.0, 0.0], -10.0 * mean
        case["contact"][0]["obstacle"]["points"] = profile.tolist()
        case["contact"][0]["regularization"] = {"law": "exact"}
        path = folder / f"rough-{points}.toml"
        path.write_text(tomli_w.dumps(case))
        lines.append(measured(path, (), folder, 1))
    return lines


PARTS: dict[str, Callable[[Path, int], list[Line]]] = {
    part.__name__: part for part in (cases, scale, levels, sweep, rough)
}


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks" / "results")
    given = parser.parse_args()
    path = given.out / "cost.json"
    found = json.loads(path.read_text()) if path.exists() else {}
    given.out.mkdir(parents=True, exist_ok=True)
    cpu_of(mlsanm("warmup"))
    for name in given.only:
        with tempfile.TemporaryDirectory() as folder:
            found[name] = PARTS[name](Path(folder), given.repeat)
        path.write_text(json.dumps(found, indent=1) + "\n")
        for line in found[name]:
            figures = {key: value for key, value in line.items() if key not in ("case", "seconds")}
            shown = ", ".join(f"{key} {value:.4g}" for key, value in figures.items())
            print(f"{name}: {line['case']}: {shown}", flush=True)


if __name__ == "__main__":
    main()
