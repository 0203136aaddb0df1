"""Random scenes in any frame and any units, judged by balance and variants, or by statics.

    python benchmarks/scenes/random_scenes.py [--count 40] [--first 0] [--keep DIR] [--only NUMBER ...]
        [--limits | --friction] [--no-variants]

Stacks of bodies of random_stacks.py are turned by any angle and written in one of three systems of units. A
run that is done must balance (forces reported of every body add up to 1e-6 of the largest), and agree with
itself on other clouds, with slaves and masters swapped, and upright in mm and N: forces 1 %, peaks 3 % (not
where contact reaches sharp corners), displacements 3 %. ``--limits`` runs scenes of random_limits.py, which
statics judges, ``--friction`` those of random_friction.py, whose states must obey the laws. Writes
random_scenes.json (``--out``).
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import tomllib
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.scenes import random_friction
from benchmarks.scenes.compared import difference, peaks, vectors
from benchmarks.scenes.judge import SIDES, Ran, imbalance, judged, run_case
from benchmarks.scenes.random_limits import limited
from benchmarks.scenes.random_stacks import stack
from benchmarks.scenes.scene import FORCE, PEAK, PLACE, Scene, Table
from benchmarks.scenes.variants import Frame, Variant, variants
from mlsanm_cli.io.run_reader import read_run

RESULTS = Path(__file__).resolve().parents[1] / "results"
UNITS = ((1.0, 1.0), (1e-3, 1e6), (1e3, 1e-3))
"""Lengths and stresses: mm and N, m and Pa, and others."""


def drawn_frame(number: int, aligned: bool = False) -> Frame:
    """Upright, at right angles, or at any angle if the scene is not to be ``aligned`` with the axes."""
    rng = np.random.default_rng([13, number])
    anyhow = rng.uniform(-180.0, 180.0)
    angle = float(rng.choice([0.0, 90.0, 180.0, anyhow, anyhow]))
    angle = 90.0 * round(angle / 90.0) if aligned else angle
    return Frame.turned(angle, *UNITS[int(rng.integers(len(UNITS)))])


def aligned(given: Table) -> bool:
    """Whether a case cannot be written at any angle: with half-disks, or with one component free."""
    scalar = [
        {"fx", "fy", "ux", "uy"} & set(one) not in (set(), {"ux", "uy"})
        for key in ("load", "support")
        for one in given.get(key, [])
    ]
    return any(scalar) or any(one["shape"]["kind"] == "half-disk" for one in given["body"])


def stacked(number: int, folder: Path, compare: bool) -> Table:
    """How a stack came through, with its variants if they are to ``compare``."""
    upright, smooth, words = stack(number)
    frame = drawn_frame(number, aligned(upright))
    given = frame.case(upright)
    scene = Scene(f"random{number}", "random", given)
    ran = run_case(scene, given, folder / "base", patience=60.0)
    told: Table = {"number": number, "words": words, "warnings": ran.summary.get("warnings", [])}
    if ran.code:
        return told | {"outcome": "too long" if ran.code == -1 else "refused", "text": ran.message[:400]}
    sides = imbalance(given, ran.result) or 0.0
    faults = [f"forces on a body do not add up: {sides:.1e}"] if sides > SIDES else []
    back = Variant("upright", lambda _: upright, frame.matrix.T, 1.0 / frame.length, 1.0 / frame.stress)
    others = [one for one in variants() if one.name in ("seed", "swapped")] if compare else []
    for variant in (*others, back) if compare else ():
        if variant.name == "swapped" and not any("master" in one for one in given["contact"]):
            continue
        other = run_case(scene, variant.change(given), folder / variant.name, variant.move(), 60.0)
        if other.code:
            faults.append(f"{variant.name} refused: {other.message[:200]}")
        else:
            faults += _differences(ran, other, variant, smooth)
    silently = "differs with a warning" if told["warnings"] else "differs silently"
    return told | {"outcome": silently if faults else "agrees", "text": "; ".join(faults)}


def _differences(ran: Ran, other: Ran, variant: Variant, smooth: list[str]) -> list[str]:
    pressed = max((ran.result.pressed(name) for name in ran.summary.get("contacts") or {}), default=0.0)
    forces = vectors(ran, "contacts", "force"), vectors(other, "contacts", "force", variant)
    places = vectors(ran, "probes", "displacement"), vectors(other, "probes", "displacement", variant)
    force, place = difference(*forces, least=pressed), difference(*places)
    peak = peaks(ran, other, variant, set(ran.summary["contacts"]) - set(smooth))
    if force <= FORCE and place <= PLACE and peak <= PEAK:
        return []
    return [f"{variant.name}: force {force:.2f} %, peak {peak:.2f} %, displacement {place:.2f} %"]


def by_statics(number: int, folder: Path) -> Table:
    """How a scene came through whose forces or limit load are known."""
    scene = limited(number, drawn_frame(number))
    verdict = judged(scene, run_case(scene, scene.case, folder / "base", patience=60.0))
    figures = [f"{what}: {got:.4g}, true {true:.4g}" for what, got, true, *_ in verdict.figures]
    return {
        "number": number,
        "words": [scene.kind, f"mu {scene.case['contact'][-1]['friction']:.3g}"],
        "warnings": list(verdict.warnings),
        "outcome": verdict.outcome,
        "text": "; ".join([*figures, verdict.message[:400]] if verdict.outcome != "right" else figures),
    }


def by_laws(number: int, folder: Path) -> Table:
    """Whether the accepted states of a scene with friction obey the laws."""
    law = ("exact", "hyperbolic")[number % 2]
    given = tomllib.loads(random_friction.scene(number // 2, law))
    ran = run_case(Scene(f"friction{number}", "random", given), given, folder / "base")
    faults: list[str] = []
    if ran.summary.get("contacts"):
        faults = random_friction.faults(ran.summary, read_run(ran.folder).contacts["interface"], law)
    outcome = ("breaks a law" if faults else "right") if ran.code in (0, 3) else "refused"
    words = [law, f"mu {given['contact'][0]['friction']:.3g}"]
    warnings = ran.summary.get("warnings", [])
    text = "; ".join([ran.message if ran.code else "", *faults])
    return {"number": number, "words": words, "warnings": warnings, "outcome": outcome, "text": text}


def main() -> None:
    """Draw, run, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", type=int, nargs="+")
    kinds = parser.add_mutually_exclusive_group()
    kinds.add_argument("--limits", action="store_true", help="scenes whose limit loads statics tells")
    kinds.add_argument("--friction", action="store_true", help="scenes that slip to and fro")
    parser.add_argument("--no-variants", action="store_true", help="run every scene once")
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--out", type=Path, default=RESULTS / "random_scenes.json")
    given = parser.parse_args()
    found = []
    with tempfile.TemporaryDirectory() as scratch:
        for number in given.only or range(given.first, given.first + given.count):
            folder = (given.keep or Path(scratch)) / str(number)
            if given.limits or given.friction:
                one = (by_statics if given.limits else by_laws)(number, folder)
            else:
                one = stacked(number, folder, not given.no_variants)
            found.append(one)
            print(
                f"{number:4d} {one['outcome']:<24} {' '.join(one['words'])}\n     {one['text']}", flush=True
            )
            for text in one["warnings"]:
                print(f"     warning: {text}", flush=True)
    totals = dict(Counter(one["outcome"] for one in found))
    print(totals)
    given.out.write_text(json.dumps({"totals": totals, "scenes": found}, indent=1) + "\n")


if __name__ == "__main__":
    main()
