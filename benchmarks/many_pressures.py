"""Contacts with thousands of pressures: waves against Westergaard's formula, and rough profiles.

    python benchmarks/many_pressures.py [--only waves rough] [--out benchmarks/results]

A rigid profile on a block between smooth walls, without friction, exact law. ``waves``: forty waves from a
tenth of the load of complete contact on, with the L2 error of the pressure and that of its peak. ``rough``:
self-affine profiles (Hurst exponent 0.8, rms slope 0.02, wave lengths from 2 to the shortest) of length 10.
CPU seconds and memory of whole processes, one thread, kernels compiled before. Writes many_pressures.json.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import tomli_w

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.scenes.profiles import PLANE, polyline_case, wave
from benchmarks.scenes.scene import Array

RESULTS = Path(__file__).resolve().parent / "results"
WAVES, HEIGHT = 40, 0.002
LOADS = (0.1, 0.5, 0.9, 1.3)
"""Mean pressures over that of complete contact."""
PROFILES = ((0.4, 401, 40.0), (0.1, 2001, 400.0), (0.02, 12001, 400.0))
"""Shortest waves, points of the profile, and mean pressures."""


def solved(case: dict[str, Any], folder: Path) -> tuple[dict[str, Any], Array, Array]:
    """What a run took, and its pressures and their places."""
    case["contact"][0]["regularization"] = {"law": "exact"}
    (folder / "case.toml").write_text(tomli_w.dumps(case))
    command = [sys.executable, "-m", "mlsanm_cli", "run", str(folder / "case.toml"), "--json", "--force"]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    ran = subprocess.run(
        [*command, "--out", str(folder / "run")], env=environment, check=True, capture_output=True, text=True
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    told = json.loads(ran.stdout)
    figures = {
        "unknowns": told["contact_unknowns"],
        "cpu": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
        "start": told["seconds"]["start"],
        "megabytes": told["peak_memory_mb"],
        "estimate": told["error_estimate"]["pressure"]["face"],
    }
    with h5py.File(folder / "run" / "run.h5") as file:
        return figures, file["contacts/face/pressure"][-1], file["contacts/face/points"][:, 0]


def waves(folder: Path) -> list[dict[str, Any]]:
    """Westergaard's waves from partial to complete contact."""
    lines, full = [], 0.5 * np.pi * PLANE * HEIGHT
    for part in LOADS:
        mean = part * full
        case = polyline_case(wave(WAVES, HEIGHT, 80), float(WAVES), 0.5 * WAVES, mean * WAVES)
        told, pressure, x = solved(case, folder)
        away = np.abs(x % 1.0 - 0.5)
        if part < 1.0:
            inside = np.maximum(part - np.sin(np.pi * away) ** 2, 0.0)
            exact = 2.0 * mean / part * np.cos(np.pi * away) * np.sqrt(inside)
        else:
            exact = mean + full * np.cos(2.0 * np.pi * away)
        length = np.gradient(x)
        l2 = np.sqrt((length * (pressure - exact) ** 2).sum() / (length * exact**2).sum())
        peak = abs(pressure.max() / exact.max() - 1.0)
        lines.append({"load": part, **told, "l2": float(l2), "peak": float(peak)})
        print(lines[-1], flush=True)
    return lines


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


def rough(folder: Path) -> list[dict[str, Any]]:
    """Rough profiles with ever more waves."""
    lines = []
    for shortest, points, mean in PROFILES:
        case = polyline_case(self_affine(points, shortest), 10.0, 5.0, 10.0 * mean)
        told, pressure, _ = solved(case, folder)
        patches = int(np.count_nonzero(np.diff((pressure > 0.0).astype(int)) == 1))
        lines.append({"shortest": shortest, "patches": patches, **told})
        print(lines[-1], flush=True)
    return lines


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=("waves", "rough"), default=["waves", "rough"])
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as directory:
        found = {name: {"waves": waves, "rough": rough}[name](Path(directory)) for name in options.only}
    (options.out / "many_pressures.json").write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
