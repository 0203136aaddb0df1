"""Error of the Hertz pressure against CPU time, over clouds, degrees and refinement of cases/hertz.toml.

    python benchmarks/error_vs_time.py [--repeat 5] [--out benchmarks/results]

Every point is a whole process, interpreter start and file writing included, on one thread with compiled
kernels; its time is the median CPU time (user and system) of the repeats. The error is the L2 norm of the
pressure's difference to the half-plane formula over the formula's norm; the finite bodies differ from that
formula by about 0.05 % themselves. Writes error_vs_time.json and error_vs_time.png. Compare ratios within one
run, not times of different runs.
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
EXACT = 'contact.interface.regularization.law="exact"'
BODIES = ("cylinder", "block")


def cloud(scale: float) -> list[str]:
    """Overrides that multiply every spacing under the contact by ``scale``; growth changes with it."""
    settings = []
    for body in BODIES:
        for number, spacing in enumerate((0.004, 0.0005, 0.0005)):
            settings.append(f"body.{body}.refine.{number}.spacing={spacing * scale!r}")
            settings.append(f"body.{body}.refine.{number}.growth={min(0.25, 0.12 * scale**0.5)!r}")
    return settings


def coarse(spacing: float) -> list[str]:
    """Overrides for one even zone of ``spacing``, with nothing at the edges of the contact."""
    zone = f"[{{at=[0.0, 0.0], spacing={spacing!r}, radius=0.1}}]"
    return [f"body.{body}.refine={zone}" for body in BODIES]


SERIES: dict[str, list[list[str]]] = {
    "degree 2": [[*cloud(scale), EXACT] for scale in (2.0, 1.4, 1.0, 0.7, 0.5)],
    "degree 4": [[*cloud(scale), EXACT, "mls.degree=4"] for scale in (2.0, 1.4, 1.0, 0.7)],
    "degree 2, even zone": [[*coarse(spacing), EXACT] for spacing in (0.01, 0.005, 0.0025)],
    "degree 2, found and refined": [[*coarse(0.01), EXACT, f"adapt.passes={n}"] for n in (1, 2)],
    "hyperbolic law, whole path": [cloud(scale) for scale in (2.0, 1.0)],
}


def measure(settings: list[str], repeat: int) -> dict[str, Any]:
    """One point: figures of summary.json and the median CPU time."""
    seconds = []
    with tempfile.TemporaryDirectory() as directory:
        out = Path(directory) / "run"
        command = [
            sys.executable,
            "-m",
            "mlsanm_cli.cli",
            "run",
            str(ROOT / "cases" / "hertz.toml"),
            "--quiet",
        ]
        command += ["--force", "--out", str(out), *(part for text in settings for part in ("--set", text))]
        for _ in range(repeat):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run(command, cwd=ROOT, check=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            seconds.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        summary = json.loads((out / "summary.json").read_text())
    contact = summary["contacts"]["interface"]
    reference = contact["reference"]
    return {
        "settings": settings,
        "nodes": summary["nodes"],
        "cpu_seconds": statistics.median(seconds),
        "pressure_error_l2": reference["pressure_error_l2"],
        "peak_error": contact["peak_pressure"] / reference["peak_pressure"] - 1.0,
        "half_width_error": contact["half_width"] / reference["half_width"] - 1.0,
        "split": summary["seconds"],
    }


def draw(path: Path, results: dict[str, list[dict[str, Any]]]) -> None:
    """Error against time, both logarithmic."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    for (name, points), marker in zip(results.items(), "osd^v", strict=True):
        x = [point["cpu_seconds"] for point in points]
        y = [100.0 * point["pressure_error_l2"] for point in points]
        axes.loglog(x, y, marker=marker, label=name)
    axes.set_xlabel("CPU seconds of the whole process, one thread")
    axes.set_ylabel("pressure error, L2 [%]")
    axes.set_title("Hertz contact, a/R = 0.05")
    axes.grid(which="both", alpha=0.3)
    axes.legend()
    figure.savefig(path, dpi=120)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks" / "results")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    measure(SERIES["degree 2"][0], 1)  # kernels compiled and files in memory before anything counts
    results: dict[str, list[dict[str, Any]]] = {}
    for name, runs in SERIES.items():
        results[name] = []
        for settings in runs:
            point = measure(settings, arguments.repeat)
            results[name].append(point)
            print(
                f"{name:30} {point['nodes']:6d} nodes  {point['cpu_seconds']:6.2f} s  "
                f"L2 {100 * point['pressure_error_l2']:.3f} %  peak {100 * point['peak_error']:+.3f} %",
                flush=True,
            )
    (arguments.out / "error_vs_time.json").write_text(json.dumps(results, indent=1) + "\n")
    draw(arguments.out / "error_vs_time.png", results)


if __name__ == "__main__":
    main()
