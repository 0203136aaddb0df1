"""Bending of thin bodies with few nodes across, and what the energy check says of right and wrong ones.

    python benchmarks/thin_bodies.py bending [--seeds 10] [--degree 0 2] [--across 3 5 8]
    python benchmarks/thin_bodies.py slender [--seeds 10]
    python benchmarks/thin_bodies.py energy [--bodies 300]

Rings under two opposite pushes, clamped cantilevers under a shear at the tip, and a portal frame with
fillets of half its thickness under a push at a corner and a load on its beam: Young's modulus 1, Poisson's
ratio 0.3, plane stress, thickness 1. The compliance is the work of the loads; references are those of
quadratic triangles on two meshes with 13 and 19 nodes across, which agree to 0.02 %. Degree 0 is what the
program takes where the degree is left to it. ``slender`` has eight nodes across bodies of 100 thicknesses.

``energy`` draws bodies of these kinds at the program's own degree, half of them with the rows of pieces all
but off, and compares the energy error of each with its true error, that of the compliance against 12 nodes
across at degree 4: whether errors beyond 10 % are told by a warning (3 %) or by a failure (10 %), and how
often there is either where errors are below 3 and below 10 %, and below 3 % with as many nodes across as are
asked for. Writes thin_bodies.json (``--out``).
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.app.checks.check import LIMITS, level
from mlsanm_cli.app.scene.assemble import HIGH_DEGREE, LOW_DEGREE, MIN_HIGH_SPACINGS
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.cloud.curves import Arc, Curve, Outline, Segment, annulus, rectangle
from mlsanm_cli.cloud.spacing import Spacing, build_cloud
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics import pieces
from mlsanm_cli.mechanics.assembly import assemble
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.energy import energy_between_nodes, twice_strain_energy
from mlsanm_cli.mechanics.material import isotropic
from mlsanm_cli.operators.neighbors import MlsSettings

ENERGY_WARNING, ENERGY_LIMIT = level("energy_error"), LIMITS["energy_error"].fails or 0.0

RESULTS = Path(__file__).parent / "results"
MATERIAL = isotropic(1.0, 0.3, "stress")
REFERENCES = {
    "ring 5": 216.73330,
    "ring 10": 1770.91930,
    "ring 20": 14252.57130,
    "ring 50": 223090.49070,
    "cantilever 5": 513.67510,
    "cantilever 10": 4023.91640,
    "cantilever 20": 32034.20900,
    "cantilever 50": 499983.49740,
    "portal": 579.49950,
    "ring 100": 1785184.0,
    "cantilever 100": 3999627.5,
}
"""Work of the loads by quadratic triangles, 19 nodes across, 13 for the ring of 50. Those of 100 continue the
others by the formulas of beams, 12 (pi / 4 - 2 / pi) R^3 + a R and 4 L^3 + a L^2 + b L + c: they meet the
bodies of 50 to 1e-6."""
ENOUGH = 5
"""Nodes across that parts in bending are said to need."""
TRUTH, WEAK = 12, 1e-3
"""Nodes across the bodies that others are held against, and the strength of pieces that lose their force."""

Traction = Callable[[str, FloatArray], FloatArray]


@dataclass(frozen=True)
class Thin:
    """A thin body: its outline, what of it is clamped, and the tractions (n, 2) at points (n, 2)."""

    name: str
    outline: Outline
    clamped: tuple[str, ...]
    traction: Traction


def ring(ratio: float) -> Thin:
    """Radius over thickness; pushes of 1 on 4 thicknesses of the outer surface."""
    outer = ratio + 0.5
    half = 2.0 / outer

    def traction(name: str, points: FloatArray) -> FloatArray:
        values = np.zeros_like(points)
        if name == "outer":
            angle = np.arctan2(points[:, 0], np.abs(points[:, 1]))
            push = np.where(np.abs(angle) < half, np.cos(0.5 * np.pi * angle / half) ** 2, 0.0)
            values[:, 1] = -push * np.sign(points[:, 1]) / (half * outer)
        return values

    return Thin(f"ring {ratio:g}", annulus((0.0, 0.0), (ratio - 0.5, outer)), (), traction)


def cantilever(ratio: float) -> Thin:
    """Length over thickness."""

    def traction(name: str, points: FloatArray) -> FloatArray:
        values = np.zeros_like(points)
        values[:, 1] = float(name == "right")
        return values

    return Thin(f"cantilever {ratio:g}", rectangle((0.0, ratio), (-0.5, 0.5)), ("left",), traction)


def portal(side: float = 10.0, fillet: float = 0.5) -> Thin:
    """Two clamped posts and a beam."""
    inner, top = side - 1.0, side - 1.0
    turns = [(1.0 + fillet, top - fillet), (inner - fillet, top - fillet)]
    curves: list[tuple[str, Curve]] = [
        ("left foot", Segment((0.0, 0.0), (1.0, 0.0))),
        ("left inside", Segment((1.0, 0.0), (1.0, top - fillet))),
        ("left fillet", Arc(turns[0], fillet, np.pi, -0.5 * np.pi)),
        ("below", Segment((1.0 + fillet, top), (inner - fillet, top))),
        ("right fillet", Arc(turns[1], fillet, 0.5 * np.pi, -0.5 * np.pi)),
        ("right inside", Segment((inner, top - fillet), (inner, 0.0))),
        ("right foot", Segment((inner, 0.0), (side, 0.0))),
        ("right", Segment((side, 0.0), (side, side))),
        ("above", Segment((side, side), (0.0, side))),
        ("left", Segment((0.0, side), (0.0, 0.0))),
    ]

    def traction(name: str, points: FloatArray) -> FloatArray:
        values = np.zeros_like(points)
        if name == "above":
            values[:, 1] = -1.0 / side
        if name == "left":
            up = np.clip(points[:, 1] - top, 0.0, 1.0)
            values[:, 0] = 2.0 * np.sin(np.pi * up) ** 2
        return values

    names, parts = zip(*curves, strict=True)
    return Thin(
        "portal" if side == 10.0 else f"portal {side:g}", Outline(names, parts), names[:7:6], traction
    )


def solved(thin: Thin, across: int, degree: int, seed: int = 0) -> tuple[float, float]:
    """Work of the loads, and the energy error 2U/W - 1; degree 0 is the program's own choice."""
    cloud = build_cloud(thin.outline, Spacing(1.0 / (across - 1)), seed)
    degree = degree or (HIGH_DEGREE if cloud.spacings_across >= MIN_HIGH_SPACINGS else LOW_DEGREE)
    model = BodyModel.build("body", cloud, MATERIAL, MlsSettings(degree))
    body = assemble(model, dict.fromkeys(thin.clamped, (True, True)), [], "auto")
    source = np.zeros(body.rows)
    for name, surface in cloud.surfaces.items():
        nodal = thin.traction(name, cloud.points[surface.index])
        between = thin.traction(name, surface.curve.points(Halves.of(surface, FINE).arc))
        source += body.source(name, nodal, held=False, between=between)
    found = body.system.solve(sparse.csc_array(source[:, None])).reshape(-1, 2)
    work = 0.0
    for name, surface in cloud.surfaces.items():
        if name not in thin.clamped:
            halves = Halves.of(surface, FINE)
            own, other = found[surface.index[halves.own]], found[surface.index[halves.other]]
            moved = halves.share[:, None] * own + (1.0 - halves.share)[:, None] * other
            force = halves.length[:, None] * thin.traction(name, surface.curve.points(halves.arc))
            work += float((force * moved).sum())
    stress = model.stress(found)
    told = twice_strain_energy(cloud, MATERIAL, stress) / work - 1.0
    if abs(told) > ENERGY_WARNING:
        told = min(told, told + energy_between_nodes(model, found, stress) / work, key=abs)
    return work, told


BODIES = [*map(ring, (5, 10, 20, 50)), *map(cantilever, (5, 10, 20, 50)), portal()]
SLENDER = [ring(100), cantilever(100)]


def bending(bodies: list[Thin], seeds: int, degrees: list[int], across: list[int]) -> list[dict[str, Any]]:
    """Errors of the compliance in percent, and those of the energy, clouds that cannot carry the degree left
    out."""
    lines = []
    for thin in bodies:
        for degree in degrees:
            for count in across:
                errors, told = [], []
                for seed in range(seeds):
                    try:
                        work, energy_error = solved(thin, count, degree, seed)
                    except NumericalError:
                        continue
                    errors.append(100.0 * (work / REFERENCES[thin.name] - 1.0))
                    told.append(100.0 * energy_error)
                line = {"body": thin.name, "degree": degree, "across": count}
                lines.append(line | {"errors": errors, "energy_errors": told})
                found = [*zip(errors, told, strict=True)] or [(np.nan, np.nan)]
                worst, shown = max(found, key=lambda one: abs(one[0]))
                which = f"{thin.name:14s} degree {degree or 'auto'}, {count} across"
                print(f"{which}: worst {worst:.3f} %, its energy {shown:.2f} %", flush=True)
    return lines


KINDS: Mapping[str, tuple[Callable[[float], Thin], tuple[float, ...]]] = {
    "ring": (ring, (3.0, 5.0, 8.0, 12.0, 20.0)),
    "cantilever": (cantilever, (3.0, 5.0, 8.0, 14.0, 25.0)),
    "portal": (portal, (6.0, 10.0, 14.0)),
}


@cache
def truth(kind: str, ratio: float) -> float:
    """Work of the loads with many nodes across."""
    return solved(KINDS[kind][0](ratio), TRUTH, 4)[0]


def energy(count: int) -> dict[str, Any]:
    """How often energy errors that warn and that fail go with true ones beyond ENERGY_LIMIT."""
    rng, strength = np.random.default_rng(0), pieces.EQUILIBRIUM_WEIGHT
    found: list[dict[str, Any]] = []
    for _ in range(count):
        kind = str(rng.choice(list(KINDS)))
        make, ratios = KINDS[kind]
        ratio, weak = float(rng.choice(ratios)), bool(rng.random() < 0.5)
        across, seed = int(rng.integers(3, 9)), int(rng.integers(1000))
        pieces.EQUILIBRIUM_WEIGHT = WEAK if weak else strength
        try:
            work, told = solved(make(ratio), across, 0, seed)
        except NumericalError:
            continue
        finally:
            pieces.EQUILIBRIUM_WEIGHT = strength
        true = work / truth(kind, ratio) - 1.0
        line = {"kind": kind, "ratio": ratio, "across": across, "weak": weak}
        found.append(line | {"true": true, "told": told})
    errors, shown = (np.abs([one[key] for one in found]) for key in ("true", "told"))
    warns, fails = shown > ENERGY_WARNING, shown > ENERGY_LIMIT
    large, small = errors > ENERGY_LIMIT, errors <= ENERGY_WARNING
    proper = np.array([one["across"] >= ENOUGH and not one["weak"] for one in found])
    figures = {
        "bodies": len(found),
        "wrong": int(large.sum()),
        "caught by a warning": float(warns[large].mean()),
        "caught by a failure": float(fails[large].mean()),
        "false warnings": float(warns[small].mean()),
        "false warnings, five nodes across, proper pieces": float(warns[proper & small].mean()),
        "false failures": float(fails[~large].mean()),
    }
    print(figures)
    return figures | {"each": found}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("what", choices=("bending", "slender", "energy"))
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--degree", type=int, nargs="+", default=[0, 2])
    parser.add_argument("--across", type=int, nargs="+", default=[3, 5, 8])
    parser.add_argument("--bodies", type=int, default=300)
    parser.add_argument("--out", type=Path, default=RESULTS / "thin_bodies.json")
    given = parser.parse_args()
    studies: dict[str, Callable[[], Any]] = {
        "bending": lambda: bending(BODIES, given.seeds, given.degree, given.across),
        "slender": lambda: bending(SLENDER, given.seeds, [0, 2], [8]),
        "energy": lambda: energy(given.bodies),
    }
    kept = json.loads(given.out.read_text()) if given.out.exists() else {}
    kept[given.what] = studies[given.what]()
    given.out.write_text(json.dumps(kept, indent=1) + "\n")


if __name__ == "__main__":
    main()
