"""Error of a manufactured solution against CPU time, over degrees and clouds.

    python benchmarks/error_vs_time.py [--out benchmarks/results]

Jittered clouds of 17^2 to 129^2 nodes on the unit square, traction on three sides; the median over three
clouds of the displacement's relative root mean square error and of the CPU time of stencils, of rows and
factorisation, and of one solution. Writes error_vs_time.json and a picture. Compare ratios within one run.
Whole processes with contact are timed by peers/run.py.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sparse

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from mlsanm_cli.io.plots.curves import Curve, Panel, Picture, draw  # noqa: E402
from mlsanm_cli.mechanics.assembly import assemble  # noqa: E402
from mlsanm_cli.mechanics.body_model import BodyModel  # noqa: E402
from mlsanm_cli.operators.neighbors import MlsSettings  # noqa: E402
from tests.mechanics.bodies import STEEL, boundary_values, jittered_square, with_body_force  # noqa: E402
from tests.mechanics.waves import Wave  # noqa: E402

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
    by_time, by_spacing = [], []
    for name, points in results.items():
        error = np.array([point["error"] for point in points])
        seconds = [point["stencils"] + point["factorization"] + point["solution"] for point in points]
        spacing = [1.0 / (point["nodes"] ** 0.5 - 1.0) for point in points]
        by_time.append(Curve(np.array(seconds), error, name))
        by_spacing.append(Curve(np.array(spacing), error))
    left = Panel(by_time, "CPU seconds, one thread", "displacement error, relative", scale="log")
    right = Panel(by_spacing, "node spacing", "", scale="log")
    title = "Manufactured solution, jittered clouds, traction on three sides"
    draw(path, Picture([left, right], title, "best", (10.5, 4.6), beside=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks" / "results")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    results = manufactured()
    (out / "error_vs_time.json").write_text(json.dumps({"manufactured": results}, indent=1) + "\n")
    draw_manufactured(out / "error_vs_time_manufactured.png", results)


if __name__ == "__main__":
    main()
