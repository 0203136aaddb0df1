"""Error against CPU time: Hertz pressure and a manufactured solution, over degrees and clouds.

    python benchmarks/error_vs_time.py [--repeat 5] [--out benchmarks/results]

Hertz: every point is a whole process, interpreter start and file writing included, on one thread with
compiled kernels; its time is the median CPU time (user and system) of the repeats. The error is the L2 norm
of the pressure's difference to the half-plane formula over the formula's norm; the finite bodies differ from
that formula by about 0.3 % themselves, so degree 4 ends there.

Manufactured: jittered clouds of 17^2 to 129^2 nodes on the unit square, traction on three sides; the median
over three clouds of the displacement's relative root mean square error and of the CPU time of stencils, of
rows and factorisation, and of one solution.

Writes error_vs_time.json and two pictures. Compare ratios within one run, not times of different runs.
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sparse

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from mlsanm_cli.mechanics.assembly import assemble  # noqa: E402
from mlsanm_cli.mechanics.body import BodyModel  # noqa: E402
from mlsanm_cli.operators.settings import MlsSettings  # noqa: E402
from tests.mechanics.bodies import (  # noqa: E402
    STEEL,
    boundary_values,
    jittered_square,
    with_body_force,
)
from tests.mechanics.waves import Wave  # noqa: E402

EXACT = 'contact.interface.regularization.law="exact"'
SMOOTH = 'contact.interface.regularization.law="hyperbolic"'
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
    "hyperbolic law, whole path": [[*cloud(scale), SMOOTH] for scale in (2.0, 1.0)],
}


def measure(settings: list[str], repeat: int) -> dict[str, Any]:
    """One point: figures of summary.json and the median CPU time."""
    seconds = []
    with tempfile.TemporaryDirectory() as directory:
        out = Path(directory) / "run"
        command = [
            sys.executable,
            "-m",
            "mlsanm_cli",
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


SIDES = (17, 33, 65, 129)
DEGREES = (2, 4, 6)


def manufactured_point(side: int, degree: int, seed: int) -> dict[str, float]:
    """Error and CPU seconds of one cloud."""
    cloud, held = jittered_square(side, 0.25, seed), {"bottom": (True, True)}
    wave = Wave(STEEL.stiffness)
    start = time.process_time()
    model = BodyModel.build("square", cloud, STEEL, MlsSettings(degree))
    built = time.process_time()
    body = assemble(model, held, (), "auto")
    factorised = time.process_time()
    source = boundary_values(body, wave.displacement, wave.stress)
    source = with_body_force(body, source, wave.force)
    ready = time.process_time()
    u = body.system.solve(sparse.csc_array(source[:, None])).reshape(-1, 2)[: len(cloud.points)]
    solved = time.process_time()
    exact = wave.displacement(cloud.points)
    return {
        "error": float(np.linalg.norm(u - exact) / np.linalg.norm(exact)),
        "stencils": built - start,
        "factorization": factorised - built,
        "solution": solved - ready,
    }


def manufactured() -> dict[str, list[dict[str, Any]]]:
    """Medians over three clouds, and the fitted order of every series."""
    manufactured_point(9, 2, 0)
    results: dict[str, list[dict[str, Any]]] = {}
    for degree in DEGREES:
        points = []
        for side in SIDES:
            runs = [manufactured_point(side, degree, seed) for seed in range(3)]
            errors = [one["error"] for one in runs]
            median = {key: statistics.median(one[key] for one in runs) for key in runs[0]}
            points.append({"nodes": side**2, **median, "worst_error": max(errors)})
        slope = np.polyfit(np.log(np.array(SIDES) - 1.0), np.log([p["error"] for p in points]), 1)[0]
        results[f"degree {degree}"] = points
        figures = "  ".join(f"{p['error']:.1e}" for p in points)
        print(f"degree {degree}  {figures}  order {-slope:.1f}", flush=True)
    return results


def draw_manufactured(path: Path, results: dict[str, list[dict[str, Any]]]) -> None:
    """Error against CPU time, and against the node spacing."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.5, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2, sharey=True)
    for number, (name, points) in enumerate(results.items()):
        error = [point["error"] for point in points]
        seconds = [point["stencils"] + point["factorization"] + point["solution"] for point in points]
        spacing = [1.0 / (point["nodes"] ** 0.5 - 1.0) for point in points]
        style: dict[str, Any] = {"color": f"C{number}", "ms": 4, "lw": 1.2}
        left.loglog(seconds, error, "-o", label=name, **style)
        right.loglog(spacing, error, "-o", **style)
    left.set(xlabel="CPU seconds, one thread", ylabel="displacement error, relative")
    left.legend(fontsize=7)
    right.set(xlabel="node spacing")
    for axes in (left, right):
        axes.grid(which="both", alpha=0.25)
    figure.suptitle("Manufactured solution, jittered clouds, traction on three sides")
    figure.savefig(path, dpi=110)


def draw_hertz(path: Path, results: dict[str, list[dict[str, Any]]]) -> None:
    """Error against time, both logarithmic."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    for (name, points), marker in zip(results.items(), "osdP^v", strict=True):
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
    smooth = manufactured()
    whole = {"hertz": results, "manufactured": smooth}
    (arguments.out / "error_vs_time.json").write_text(json.dumps(whole, indent=1) + "\n")
    draw_hertz(arguments.out / "error_vs_time.png", results)
    draw_manufactured(arguments.out / "error_vs_time_manufactured.png", smooth)


if __name__ == "__main__":
    main()
