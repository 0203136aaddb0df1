"""Random scenes against the stability certificate: is every bad result refused, and no good one?

    python benchmarks/stability.py [--bulk 300] [--hertz 100] [--out benchmarks/results]

Bodies without contact: groups of ten clouds of one scene (shape, grading 1 to 100, Poisson's ratio 0 to
0.499, plane strain or stress, one side clamped or three displacements held, jitter 0 to 0.4 spacings) that
differ in their random numbers only. The exact solution is smooth with bounded stress; the error is the root
mean square over four such solutions. A cloud's error is judged against the median of its group, for every
degree.

Hertz scenes: random seeds, facing spacings (ratio 0.5 to 2), offset, a/R 0.01 to 0.1, stiffness ratio 1 to
1000 either way, Poisson's ratios; always 15 slave nodes over the half-width, so that errors compare with each
other.

Writes stability.json and stability.png.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sparse
from scipy.spatial import cKDTree

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from mlsanm_cli.app.run import run  # noqa: E402
from mlsanm_cli.cloud.cloud import Cloud  # noqa: E402
from mlsanm_cli.cloud.curves import Outline, disk, half_disk, rectangle, sector  # noqa: E402
from mlsanm_cli.cloud.spacing import Spacing, Zone, build_cloud  # noqa: E402
from mlsanm_cli.contact.response import coercivity  # noqa: E402
from mlsanm_cli.contact.response.coercivity import CONTACT_LIMIT  # noqa: E402
from mlsanm_cli.errors import NumericalError  # noqa: E402
from mlsanm_cli.mechanics.assembly import assemble  # noqa: E402
from mlsanm_cli.mechanics.body import bulk_stability  # noqa: E402
from mlsanm_cli.mechanics.body_model import BodyModel  # noqa: E402
from mlsanm_cli.mechanics.material import isotropic  # noqa: E402
from mlsanm_cli.operators.neighbors import MlsSettings  # noqa: E402
from tests.app.scenes import Quiet  # noqa: E402
from tests.case_text import EXACT, box, head  # noqa: E402
from tests.mechanics.bodies import boundary_values, with_body_force  # noqa: E402
from tests.mechanics.waves import Wave  # noqa: E402

BULK_LIMIT = coercivity.BULK_LIMIT
PER_GROUP = 10
BLOCK = box([-2.0, 2.0], [-2.0, 0.0])
DEGREES = (2, 4)
FIELDS = 4


@dataclass(frozen=True)
class Scene:
    """One body without contact, up to the random numbers of its cloud."""

    outline: Outline
    center: tuple[float, float]
    length: float
    spacing: Spacing
    poisson: float
    plane: str
    clamped: str | None
    jitter: float
    waves: int


def random_scene(rng: np.random.Generator) -> Scene:
    """A scene of 300 to 2000 nodes."""
    kind = rng.choice(["rectangle", "disk", "half-disk", "sector"])
    center, length = (0.0, 0.0), 2.0
    if kind == "rectangle":
        width = 2.0 ** rng.uniform(-2.0, 2.0)
        outline, area = rectangle((0.0, width), (0.0, 1.0)), width
        center, length = (0.5 * width, 0.5), max(width, 1.0)
    elif kind == "disk":
        outline, area = disk((0.0, 0.0), 1.0), math.pi
    elif kind == "half-disk":
        outline, area = half_disk((0.0, 0.0), 1.0, "lower"), 0.5 * math.pi
    else:
        inner, angle = rng.uniform(0.2, 0.8), rng.uniform(0.5, 5.0)
        outline, area = sector((0.0, 0.0), (inner, 1.0), (0.0, angle)), 0.5 * angle * (1.0 - inner**2)
    h = math.sqrt(area / rng.uniform(300.0, 1500.0))
    grading = 10.0 ** rng.uniform(0.0, 2.0)
    curve = outline.curves[rng.integers(len(outline.curves))]
    x, y = curve.points(np.array([rng.uniform() * curve.length]))[0]
    zone = Zone.around((float(x), float(y)), h / grading, 3.0 * h / grading, rng.uniform(0.08, 0.25))
    side = bool(rng.integers(2)) and len(outline.curves) > 1
    return Scene(
        outline=outline,
        center=center,
        length=length,
        spacing=Spacing(h, (zone,)),
        poisson=float(rng.choice([rng.uniform(0.0, 0.45), 0.499])),
        plane=str(rng.choice(["strain", "stress"])),
        clamped=outline.names[rng.integers(len(outline.names))] if side else None,
        jitter=float(rng.uniform(0.0, 0.4)),
        waves=int(rng.integers(2**31)),
    )


def jittered(scene: Scene, seed: int) -> Cloud:
    """The scene's cloud, inner nodes moved by up to ``jitter`` spacings, half-way to the boundary at most."""
    cloud = build_cloud(scene.outline, scene.spacing, seed)
    rng = np.random.default_rng(seed + 1)
    points = cloud.points.copy()
    inner = np.setdiff1d(np.arange(len(points)), cloud.boundary_nodes)
    room = cKDTree(points[cloud.boundary_nodes]).query(points[inner])[0]
    reach = np.minimum(scene.jitter * cloud.spacing[inner], 0.5 * room) * np.sqrt(
        rng.uniform(size=len(inner))
    )
    angle = rng.uniform(0.0, 2.0 * math.pi, len(inner))
    points[inner] += reach[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return Cloud(points, cloud.spacing, cloud.surfaces)


def bulk_error(scene: Scene, cloud: Cloud, degree: int) -> tuple[float, float]:
    """Relative displacement error and certificate."""
    material = isotropic(1.0, scene.poisson, scene.plane)
    held, nodes = {scene.clamped: (True, True)} if scene.clamped else {}, []
    if not held:
        first = int(cloud.boundary_nodes[0])
        away = cloud.points - cloud.points[first]
        last = int(np.argmax((away**2).sum(axis=1)))
        across = int(abs(away[last, 0]) > abs(away[last, 1]))
        nodes = [(first, 0), (first, 1), (last, across)]
    model = BodyModel.build("body", cloud, material, MlsSettings(degree))
    body = assemble(model, held, nodes, "auto")
    rng = np.random.default_rng(scene.waves)
    measure = cloud.spacing[:, None]
    errors = []
    for _ in range(FIELDS):
        numbers = tuple((float(a), float(b)) for a, b in rng.uniform(-2.0, 2.0, (2, 2)))
        phases = tuple(float(a) for a in rng.uniform(0.0, 6.0, 2))
        wave = Wave(material.stiffness, numbers, phases, scene.center, scene.length)
        exact = wave.displacement(cloud.points)
        if nodes:
            exact = exact + rigid_motion(cloud.points, [(n, c, -exact[n, c]) for n, c in nodes])
        source = boundary_values(body, wave.displacement, wave.stress)
        source = with_body_force(body, source, wave.force)
        found = body.system.solve(sparse.csc_array(source[:, None])).reshape(-1, 2)[: len(cloud.points)]
        mean = (measure**2 * exact).sum(axis=0) / (measure**2).sum()
        errors.append(np.linalg.norm(measure * (found - exact)) / np.linalg.norm(measure * (exact - mean)))
    return float(np.sqrt(np.mean(np.square(errors)))), bulk_stability(body)


def rigid_motion(points: np.ndarray, wanted: list[tuple[int, int, float]]) -> np.ndarray:
    """The rigid motion (n, 2) with given displacements at three (node, component)s."""
    matrix = [[c == 0, c == 1, -points[n, 1] if c == 0 else points[n, 0]] for n, c, _ in wanted]
    x, y, turn = np.linalg.solve(np.array(matrix, dtype=float), [value for _, _, value in wanted])
    return np.asarray(np.array([x, y]) + turn * np.stack([-points[:, 1], points[:, 0]], axis=1))


def bulk(count: int) -> dict[str, list[dict[str, Any]]]:
    """Errors over the median of their group, and certificates, of every degree."""
    rng = np.random.default_rng(0)
    results: dict[str, list[dict[str, Any]]] = {f"degree {degree}": [] for degree in DEGREES}
    for group in range(count // PER_GROUP):
        scene = random_scene(rng)
        clouds = [jittered(scene, int(seed)) for seed in rng.integers(2**31, size=PER_GROUP)]
        for degree in DEGREES:
            points: list[dict[str, Any]] = []
            for cloud in clouds:
                try:
                    error, stability = bulk_error(scene, cloud, degree)
                except NumericalError as refusal:
                    points.append({"refused": refusal.message})
                    continue
                points.append({"error": error, "stability": stability})
            median = np.median([p["error"] for p in points if "error" in p] or [math.nan])
            for point in points:
                if "error" in point:
                    point["ratio"] = float(point["error"] / median)
                results[f"degree {degree}"].append(point)
        print(f"group {group}: {len(clouds[0].points)} nodes", flush=True)
    return results


def hertz(count: int) -> list[dict[str, Any]]:
    """Errors of the pressure profile, and certificates; the reason where a run failed.

    The certificate does not end a run here, so that its judgement can itself be judged.
    """
    setattr(coercivity, "CONTACT_LIMIT", -math.inf)  # noqa: B010
    rng = np.random.default_rng(1)
    results = []
    for seed in range(count):
        half_width = 10.0 ** rng.uniform(-2.0, -1.0)
        ratio = 2.0 ** rng.uniform(-1.0, 1.0)
        stiffness = 10.0 ** (rng.uniform(0.0, 3.0) * rng.choice([-1.0, 1.0]))
        offset = rng.uniform(-0.5, 0.5) * half_width / 15.0
        nu_slave, nu_master = rng.uniform(0.0, 0.45, 2)
        slave, master = 210e3, 210e3 / stiffness
        modulus = 1.0 / ((1.0 - nu_slave**2) / slave + (1.0 - nu_master**2) / master)
        h, reach = half_width / 15.0, 1.4 * half_width
        force = -0.25 * math.pi * modulus * half_width**2
        shape = {"kind": "half-disk", "center": [offset, 1.0], "radius": 1.0, "side": "lower"}
        zones = [
            [{"at": [x, 0.0], "spacing": spacing, "radius": reach}]
            for x, spacing in ((offset, h), (0.0, ratio * h))
        ]
        text = (
            head("strain")
            .material("slave", E=slave, nu=nu_slave)
            .material("master", E=master, nu=nu_master)
            .body("cylinder", "slave", 0.12, shape, seed=seed, refine=zones[0])
            .body("block", "master", 0.12, BLOCK, seed=seed, refine=zones[1], clamped="bottom")
            .load("press", "cylinder.flat", "platen", force=[0.0, force])
            .contact("interface", "cylinder.arc", "block.top", regularization=EXACT)
            .table("output", fields=[], vtu=False)
            .table("reference", solution="hertz-line")
        )
        with tempfile.TemporaryDirectory() as directory:
            case = Path(directory) / "hertz.toml"
            case.write_text(text)
            summary = run(case, out=Path(directory) / "run", console=Quiet())
        point = {"spacing_ratio": ratio, "slave_over_master": float(stiffness), "a_over_r": half_width}
        point |= {"status": summary["status"], "stability": summary["stability"]}
        if summary["status"] == "done":
            point["error"] = summary["contacts"]["interface"]["reference"]["pressure_error_l2"]
        else:
            point["reason"] = summary["stop_reason"]
        results.append(point)
        print(f"hertz {seed}: {point}", flush=True)
    return results


def figures(results: dict[str, Any]) -> dict[str, Any]:
    """The figures that count."""
    told = {}
    for name, points in results["bulk"].items():
        solved = [p for p in points if "ratio" in p]
        passed = [p["ratio"] for p in solved if p["stability"] >= BULK_LIMIT]
        told[name] = {
            "scenes": len(points),
            "refused": len(points) - len(passed),
            "worst_accepted_over_median": max(passed, default=None),
            "worst_of_all_over_median": max((p["ratio"] for p in solved), default=None),
            "smallest_stability": min((p["stability"] for p in solved), default=None),
        }
    solved = [p for p in results["hertz"] if "error" in p]
    accepted = [p["error"] for p in solved if p["stability"] >= CONTACT_LIMIT]
    median = float(np.median(accepted)) if accepted else math.nan
    told["hertz"] = {
        "scenes": len(results["hertz"]),
        "accepted": len(accepted),
        "median_error": median,
        "worst_accepted_over_median": max(accepted, default=math.nan) / median,
        "refused_over_median": sorted(p["error"] / median for p in solved if p["stability"] < CONTACT_LIMIT),
    }
    return told


def draw(path: Path, results: dict[str, Any]) -> None:
    """Error against coercivity."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.5, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    contacts = [p for p in results["hertz"] if "error" in p]
    stiff = [p for p in contacts if p["slave_over_master"] > 2.0]
    groups = {
        "slave softer or as stiff": [p for p in contacts if p["slave_over_master"] <= 2.0],
        "slave stiffer, master finer": [p for p in stiff if p["spacing_ratio"] < 0.9],
        "slave stiffer, master not finer": [p for p in stiff if p["spacing_ratio"] >= 0.9],
    }
    panels = (
        ("Bodies without contact", "error / median of its group", BULK_LIMIT, results["bulk"], "ratio"),
        ("Hertz contact, 15 slave nodes", "pressure error, L2", CONTACT_LIMIT, groups, "error"),
    )
    for axes, (title, label, limit, series, key) in zip(figure.subplots(1, 2), panels, strict=True):
        for (name, points), marker in zip(series.items(), "o^x", strict=False):
            shown = [(max(p["stability"], -0.1), p[key]) for p in points if key in p]
            if shown:
                axes.semilogy(*zip(*shown, strict=True), marker, ms=4, label=name)
        axes.axvline(limit, color="k", lw=0.8)
        axes.set(title=title, xlabel="stability (runs left of the line are refused)", ylabel=label)
        axes.legend(fontsize=8)
        axes.grid(which="both", alpha=0.3)
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--bulk", type=int, default=300)
    parser.add_argument("--hertz", type=int, default=100)
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks" / "results")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    results: dict[str, Any] = {"bulk": bulk(arguments.bulk), "hertz": hertz(arguments.hertz)}
    results = {"figures": figures(results), **results}
    (arguments.out / "stability.json").write_text(json.dumps(results, indent=1) + "\n")
    draw(arguments.out / "stability.png", results)
    print(json.dumps(results["figures"], indent=1))


if __name__ == "__main__":
    main()
