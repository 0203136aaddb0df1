"""Random scenes of two to five bodies, judged by balance and by variants.

    python benchmarks/scenes/random_scenes.py [--count 40] [--first 0] [--keep DIR] [--only NUMBER ...]
        [--features | --forms | --frames | --pairs | --limits] [--no-variants]

Stacks of rectangles, polygons with rounded corners, disks and half-disks with all materials and laws, with
friction or not, pressed from above. A run that is done must balance (forces reported of every body add up to
1e-6 of the largest), and agree with itself turned by 90 degrees and on other clouds: forces 1 %, peaks 3 %
(not where contact reaches sharp corners), displacements 3 %; scenes of random_frames.py and random_forms.py
are compared with themselves upright in mm and N. Those of random_limits.py are judged by statics instead.
Writes random_scenes.json (``--out``).
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.scenes.compared import difference, peaks, vectors
from benchmarks.scenes.judge import SIDES, imbalance, run_case
from benchmarks.scenes.judge import judged as judged_by_figures
from benchmarks.scenes.parts import body as make_body
from benchmarks.scenes.parts import box, case, held, pair, platen, polygon, probe
from benchmarks.scenes.random_features import featured
from benchmarks.scenes.random_forms import formed
from benchmarks.scenes.random_frames import Frame, drawn_frame, framed
from benchmarks.scenes.random_limits import limited
from benchmarks.scenes.random_pairs import drawn_pair
from benchmarks.scenes.scene import FORCE, PEAK, PLACE, Scene, Table
from benchmarks.scenes.variants import Variant, variants

RESULTS = Path(__file__).resolve().parents[1] / "results"
MATERIALS = {
    "steel": {"E": 210e3, "nu": 0.3},
    "alloy": {"E": 71e3, "nu": 0.33},
    "nylon": {"E": 2.8e3, "nu": 0.38},
    "rubber": {"E": 50.0, "nu": 0.45},
    "wood": {"E1": 11e3, "E2": 0.9e3, "G12": 0.7e3, "nu12": 0.4, "E3": 0.6e3, "nu13": 0.3, "nu23": 0.3},
}


def drawn(number: int) -> tuple[Table, list[str]]:
    """The case of a number, and the contacts that no sharp corner can reach."""
    rng = np.random.default_rng([7, number])
    count = int(rng.integers(2, 6))
    plane = str(rng.choice(["strain", "stress"]))
    law = str(rng.choice(["default", "hyperbolic"], p=[0.65, 0.35]))
    friction = float(rng.choice([0.0, 0.0, 0.2, 0.5]))
    names = [f"body{i}" for i in range(count)]
    wood = rng.random() < 0.15
    choice = ["steel", "alloy", "nylon", "rubber"] + (["wood"] if wood else [])
    materials = [str(rng.choice(choice)) for _ in names]
    bodies, kinds, faces = [], [], []
    level = 0.0
    for i, name in enumerate(names):
        free = ["box", "round", "disk"] if 0 < i < count - 1 else ["box", "round", "half"]
        # Two flat faces on each other may be, a round body stands between flat ones.
        if kinds and kinds[-1] in ("disk", "half"):
            free = ["box", "round"]
        kind = str(rng.choice(free))
        wide, high = float(rng.uniform(4.0, 12.0)), float(rng.uniform(2.0, 6.0))
        made, low, top, level = _body(rng, name, materials[i], kind, wide, high, level, first=i == 0)
        bodies.append(made)
        kinds.append(kind)
        faces.append((low, top))
    contacts, smooth = [], []
    for i in range(1, count):
        slave, master = f"body{i}.{faces[i][0]}", f"body{i - 1}.{faces[i - 1][1]}"
        if rng.random() < 0.5:
            slave, master = master, slave
        extra: Table = {} if law == "default" else {"regularization": {"law": law}}
        contacts.append(pair(f"joint{i}", slave, master, friction, **extra))
        if "disk" in (kinds[i], kinds[i - 1]) or "half" in (kinds[i], kinds[i - 1]):
            smooth.append(f"joint{i}")
    soft = min(MATERIALS[m].get("E", 900.0) for m in materials)
    press = 0.01 * soft * 4.0
    down = f"body{count - 1}.{faces[-1][1]}"
    loads = [platen("press", down, fy=-press, ux=0.0)]
    stages = [{"press": 1.0}]
    # Disks, and what stands between two round bodies, roll away.
    rolls = "disk" in kinds or kinds.count("half") > 1
    if friction and rng.random() < 0.5 and not rolls:
        loads[0].pop("ux")
        loads.append(platen("shear", down, fx=0.3 * friction * press))
        stages.append({"shear": 1.0})
    given = case(
        plane,
        {m: MATERIALS[m] for m in sorted(set(materials))},
        bodies,
        support=[held(f"body0.{faces[0][0]}")],
        contact=contacts,
        load=loads,
        stage=stages,
        probe=[probe("middle", names[-1], 0.0, _inside(bodies[-1]))],
    )
    return given, smooth


def _body(
    rng: np.random.Generator,
    name: str,
    material: str,
    kind: str,
    wide: float,
    high: float,
    level: float,
    first: bool,
) -> tuple[Table, str, str, float]:
    """A body that stands on ``level``, its lower and upper boundary, and the level of its top."""
    if first:
        wide += 8.0
    if kind == "box":
        return (
            box(name, material, (-wide / 2, wide / 2), (level, level + high)),
            "bottom",
            "top",
            level + high,
        )
    if kind == "round":
        radius = float(rng.uniform(0.1, 0.35)) * high
        points = [(-wide / 2, level), (wide / 2, level), (wide / 2, level + high), (-wide / 2, level + high)]
        sides = ["low", "right", "up", "left"]
        made = polygon(name, material, points, names=sides, rounding=[radius] * 4)
        return made, "low", "up", level + high
    radius = 0.5 * high
    if kind == "disk":
        made = make_body(name, material, "disk", center=[0.0, level + radius], radius=radius)
        return made, "arc", "arc", level + high
    side = "upper" if first else "lower"
    center = [0.0, level + (0.0 if first else high)]
    made = make_body(name, material, "half-disk", center=center, radius=high, side=side)
    low, top = ("flat", "arc") if first else ("arc", "flat")
    return made, low, top, level + high


def _inside(one: Table) -> float:
    shape: Any = one["shape"]
    if shape["kind"] == "rectangle":
        return 0.5 * (shape["y"][0] + shape["y"][1])
    if shape["kind"] == "polygon":
        return 0.5 * (shape["points"][0][1] + shape["points"][2][1])
    return shape["center"][1] + (0.0 if shape["kind"] == "disk" else -0.5 * shape["radius"])


KINDS = {
    "stacks": ("seed", "turned"),
    "features": ("seed", "swapped"),
    "forms": ("seed", "swapped", "upright"),
    "frames": ("seed", "upright"),
    "pairs": ("seed", "swapped", "turned", "mirrored"),
}
"""Which variants judge which scenes."""


def scene_of(number: int, kind: str) -> tuple[Table, list[str], list[str], list[Variant]]:
    """Case, contacts that no sharp corner can reach, what it has, and its variants."""
    others = [one for one in variants() if one.name in KINDS[kind]]
    if kind == "stacks":
        return *drawn(number), [], others
    if kind == "features":
        return *featured(number), others
    if kind == "pairs":
        return *drawn_pair(number), [], others
    frame, draw = drawn_frame(number), formed if kind == "forms" else framed
    upright = Variant(
        "upright",
        lambda _: draw(number, Frame())[0],
        np.array([frame.turned(1.0, 0.0), frame.turned(0.0, 1.0)]),
        1.0 / frame.length,
        1.0 / frame.stress,
    )
    return *draw(number, frame), [*others, upright]


def judged(number: int, folder: Path, kind: str, compare: bool = True) -> Table:
    """How the scene came through, with its variants if they are to ``compare``."""
    if kind == "limits":
        return _by_statics(number, folder)
    given, smooth, chosen, others = scene_of(number, kind)
    scene = Scene(f"random{number}", "random", given)
    ran = run_case(scene, given, folder / "base", patience=60.0)
    law = given["contact"][0].get("regularization", {}).get("law", "default")
    told: Table = {
        "number": number,
        "bodies": [one["shape"]["kind"] for one in given["body"]],
        "law": law,
        "features": chosen,
        "friction": given["contact"][0]["friction"],
        "warnings": ran.summary.get("warnings", []),
    }
    if ran.code:
        return told | {"outcome": "too long" if ran.code == -1 else "refused", "text": ran.message[:400]}
    faults = []
    pressed = max((ran.result.pressed(name) for name in ran.summary.get("contacts") or {}), default=0.0)
    sides = imbalance(given, ran.result)
    if sides is not None and sides > SIDES:
        faults.append(f"forces on a body do not add up: {sides:.1e}")
    for variant in others if compare else ():
        if variant.name == "swapped" and not any("master" in one for one in given["contact"]):
            continue
        other = run_case(scene, variant.change(given), folder / variant.name, variant.move(), patience=60.0)
        if other.code:
            faults.append(f"{variant.name} refused: {other.message[:200]}")
            continue
        forces = vectors(ran, "contacts", "force"), vectors(other, "contacts", "force", variant)
        force = difference(*forces, least=pressed)
        place = difference(
            vectors(ran, "probes", "displacement"), vectors(other, "probes", "displacement", variant)
        )
        base = {**ran.summary, "contacts": {n: ran.summary["contacts"][n] for n in smooth}}
        peak = peaks(type(ran)(0, base, ran.said, ran.folder), other, variant)
        if force > FORCE or place > PLACE or peak > PEAK:
            faults.append(
                f"{variant.name}: force {force:.2f} %, peak {peak:.2f} %, displacement {place:.2f} %"
            )
    outcome = (
        "agrees" if not faults else ("differs with a warning" if told["warnings"] else "differs silently")
    )
    return told | {"outcome": outcome, "text": "; ".join(faults)}


def _by_statics(number: int, folder: Path) -> Table:
    """How a scene came through whose forces or limit load are known."""
    scene = limited(number)
    ran = run_case(scene, scene.case, folder / "base", patience=60.0)
    verdict = judged_by_figures(scene, ran)
    figures = [f"{what}: {got:.4g}, true {true:.4g}" for what, got, true, *_ in verdict.figures]
    return {
        "number": number,
        "bodies": [one["shape"]["kind"] for one in scene.case["body"]],
        "law": "default",
        "features": [scene.kind],
        "friction": scene.case["contact"][-1]["friction"],
        "warnings": list(verdict.warnings),
        "outcome": verdict.outcome,
        "text": "; ".join([*figures, verdict.message[:400]] if verdict.outcome != "right" else figures),
    }


def main() -> None:
    """Draw, run, print, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", type=int, nargs="+")
    for name in ("features", "forms", "frames", "pairs", "limits"):
        parser.add_argument(f"--{name}", dest="kind", action="store_const", const=name, default="stacks")
    parser.add_argument("--no-variants", action="store_true", help="run every scene once")
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--out", type=Path, default=RESULTS / "random_scenes.json")
    given = parser.parse_args()
    numbers = given.only or range(given.first, given.first + given.count)
    found = []
    with tempfile.TemporaryDirectory() as scratch:
        for number in numbers:
            folder = (given.keep or Path(scratch)) / str(number)
            one = judged(number, folder, given.kind, not given.no_variants)
            found.append(one)
            print(
                f"{number:4d} {one['outcome']:<24} {one['law']:<11} mu {one['friction']} "
                f"{' '.join([*one['bodies'], *one['features']])}\n     {one['text']}",
                flush=True,
            )
            for text in one["warnings"]:
                print(f"     warning: {text}", flush=True)
    totals = dict(Counter(one["outcome"] for one in found))
    print(totals)
    given.out.write_text(json.dumps({"totals": totals, "scenes": found}, indent=1) + "\n")


if __name__ == "__main__":
    main()
