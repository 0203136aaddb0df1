"""Errors of single bodies against closed forms, and whether they come out as well on every cloud.

    python benchmarks/closed_forms.py [--seeds 10] [--degree 2 4]

Lamé's ring of radii 20 and 32 with 7 and 13 nodes across under pressure from inside, a square plate with a
hole of 31, 63 and 126 nodes around it under the tractions of Kirsch's solution (Young's modulus 1, Poisson's
ratio 0.3, plane stress), and a smooth solution with body forces on squares of 33 and 65 nodes a side, held on
the left. ``displacement`` is the root of the mean square error over the body, relative to that of the
displacement; rings and plates are free, and compared without their rigid motion. ``peak`` is the error of the
largest stress at the hole. Writes closed_forms.json (``--out``), of which medians and worst are printed.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy.sparse as sparse

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.formulas.kirsch import KirschHole  # noqa: E402
from benchmarks.formulas.lame import LameRing  # noqa: E402
from mlsanm_cli.arrays import FloatArray  # noqa: E402
from mlsanm_cli.cloud.cloud import Cloud, build_cloud  # noqa: E402
from mlsanm_cli.cloud.curves import Arc, Outline, annulus, rectangle  # noqa: E402
from mlsanm_cli.cloud.spacing import Spacing, Zone  # noqa: E402
from mlsanm_cli.mechanics.energy import rigid_part  # noqa: E402
from mlsanm_cli.mechanics.material import isotropic  # noqa: E402
from tests.mechanics.bodies import (  # noqa: E402
    boundary_values,
    build,
    with_body_force,
)

RESULTS = Path(__file__).parent / "results"
SOFT = isotropic(1.0, 0.3, "stress")
INNER, OUTER, EDGE = 20.0, 32.0, 5.0


def error(cloud: Cloud, found: FloatArray, exact: FloatArray) -> float:
    """Mean square distance of two displacements (n, 2), relative to the second."""
    mean = np.sqrt(cloud.areas @ ((found - exact) ** 2).sum(axis=1))
    return float(mean / np.sqrt(cloud.areas @ (exact**2).sum(axis=1)))


def free(cloud: Cloud, found: FloatArray, exact: FloatArray) -> float:
    """The same without the rigid motions of both."""
    return error(cloud, found - rigid_part(cloud, found, []), exact - rigid_part(cloud, exact, []))


def manufactured(side: int, degree: int, seed: int) -> dict[str, float]:
    """A smooth solution with body forces on a square, with a spacing of 1 / (side - 1)."""
    cloud = build_cloud(rectangle((0.0, 1.0), (0.0, 1.0)), Spacing(1.0 / (side - 1)), seed)
    c = SOFT.stiffness

    def moved(at: FloatArray) -> FloatArray:
        x, y = 2.0 * at.T
        return np.stack([np.sin(x) * np.cosh(0.5 * y), np.exp(0.5 * x) * np.sin(1.5 * y)], axis=1)

    def stress(at: FloatArray) -> FloatArray:
        (x, y), v = 2.0 * at.T, moved(at)[:, 1]
        shear = np.sin(x) * np.sinh(0.5 * y) + v
        strain = [2.0 * np.cos(x) * np.cosh(0.5 * y), 3.0 * np.exp(0.5 * x) * np.cos(1.5 * y), shear]
        return np.asarray(np.stack(strain, axis=1) @ c)

    def force(at: FloatArray) -> FloatArray:
        (x, y), (u, v) = 2.0 * at.T, moved(at).T
        u_xy, v_xy = 2.0 * np.cos(x) * np.sinh(0.5 * y), 3.0 * np.exp(0.5 * x) * np.cos(1.5 * y)
        along = -4.0 * c[0, 0] * u + c[0, 1] * v_xy + c[2, 2] * (u + v_xy)
        across = c[0, 1] * u_xy - 9.0 * c[1, 1] * v + c[2, 2] * (u_xy + v)
        return -np.stack([along, across], axis=1)

    body = build(cloud, {"left": (True, True)}, degree, SOFT)
    source = with_body_force(body, boundary_values(body, moved, stress), force)
    found = body.system.solve(sparse.csc_array(source[:, None])).reshape(-1, 2)
    return {"displacement": error(cloud, found, moved(cloud.points))}


def lame(across: int, degree: int, seed: int) -> dict[str, float]:
    """A ring under pressure."""
    ring = LameRing(INNER, OUTER, 1.0, 1.0, 0.3)
    cloud = build_cloud(annulus((0.0, 0.0), (INNER, OUTER)), Spacing((OUTER - INNER) / (across - 1)), seed)

    def stress(at: FloatArray) -> FloatArray:
        r = np.hypot(*at.T)
        c, s = at.T / r
        radial, hoop = ring.stress(r)
        both = [radial * c**2 + hoop * s**2, radial * s**2 + hoop * c**2, (radial - hoop) * c * s]
        return np.stack(both, axis=1)

    def moved(at: FloatArray) -> FloatArray:
        r = np.hypot(*at.T)
        return np.asarray(at * (ring.displacement(r) / r)[:, None])

    body = build(cloud, {}, degree, SOFT)
    source = boundary_values(body, moved, stress)
    found = body.system.solve(sparse.csc_array(source[:, None])).reshape(-1, 2)
    return {"displacement": free(cloud, found, moved(cloud.points))}


def kirsch(around: int, degree: int, seed: int) -> dict[str, float]:
    """A plate with a hole of radius 1 under the tractions of an endless one."""
    plate, hole = rectangle((-EDGE, EDGE), (-EDGE, EDGE)), Arc((0.0, 0.0), 1.0, 0.5 * np.pi, -2.0 * np.pi)
    outline = Outline((*plate.names, "hole"), (*plate.curves, hole), (0, 4))
    zone = Zone(hole, 2.0 * np.pi / around, 0.0, 0.25)
    cloud, exact = build_cloud(outline, Spacing(0.25, (zone,)), seed), KirschHole(1.0, 1.0)
    body = build(cloud, {}, degree, SOFT)
    source = boundary_values(body, lambda at: 0.0 * at, exact.stress)
    found = body.system.solve(sparse.csc_array(source[:, None])).reshape(-1, 2)
    stress = body.model.stress(found)[cloud.surfaces["hole"].index, 0]
    return {
        "displacement": free(cloud, found, exact.displacement(cloud.points, 1.0, 0.3)),
        "peak": float(stress.max() / 3.0 - 1.0),
    }


SERIES: list[tuple[Callable[[int, int, int], dict[str, float]], tuple[int, ...]]] = [
    (manufactured, (33, 65)),
    (lame, (7, 13)),
    (kirsch, (31, 63, 126)),
]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--degree", type=int, nargs="+", default=[2, 4])
    parser.add_argument("--out", type=Path, default=RESULTS / "closed_forms.json")
    given = parser.parse_args()
    lines = []
    for solve, sizes in SERIES:
        for degree in given.degree:
            for size in sizes:
                each = [solve(size, degree, seed) for seed in range(given.seeds)]
                errors = {key: [one[key] for one in each] for key in each[0]}
                lines.append({"solution": solve.__name__, "degree": degree, "nodes": size} | errors)
                told = [
                    f"{key} {np.median(values):.2g}, worst {max(values, key=abs):.2g}"
                    for key, values in errors.items()
                ]
                print(f"{solve.__name__:13s} degree {degree}, {size:3d} nodes: {'; '.join(told)}", flush=True)
    given.out.write_text(json.dumps(lines, indent=1) + "\n")


if __name__ == "__main__":
    main()
