"""Six classes of scenes that refused or misled meshfree programs, each with three spacings.

    python benchmarks/scenes/six_classes.py [--only NAME ...] [--out FILE]
    python benchmarks/scenes/six_classes.py --references

A thin ring between plates, a ring shrunk on a solid shaft with equal spacings, late contact of a cantilever,
a stiff sheet on a soft base, a bracket with rounded corners, a plate on two pins: with automatic spacings,
and with even ones of 1.5 times and half of the largest of these. Forces must be within 1 % of finite elements
(Lamé's formula for the ring on the shaft), peaks within 2 %, displacements within 1 %, and none refused.
``--references`` solves the finite elements again (six_classes_reference.json). Writes six_classes.json.
"""

from __future__ import annotations

import argparse
import copy
import json
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.scenes.compared import spacings
from benchmarks.scenes.judge import Ran, run_case
from benchmarks.scenes.scene import (
    Scene,
    Table,
    body,
    box,
    case,
    held,
    on_disk,
    on_plane,
    pair,
    pinned,
    platen,
    polygon,
    pressed,
    probe,
    solid,
)

RESULTS = Path(__file__).resolve().parents[1] / "results"
REFERENCE = Path(__file__).with_name("six_classes_reference.json")
STEEL, ALLOY, BRONZE = solid(206e3, 0.29), solid(70e3, 0.34), solid(105e3, 0.34)
LIMITS = {"force": 1.0, "peak": 2.0, "moved": 1.0, "apart": 1.0}
FACTORS = {"coarse": 1.5, "default": 1.0, "fine": 0.5}
BORE, RIM, FIT = 25.0, 32.0, 0.03
"""Radii of the ring on the shaft, and its interference."""


def ring() -> Scene:
    """Radius over thickness 14, between a rigid floor and an elastic plate that is pressed down."""
    given = case(
        "strain",
        {"alloy": ALLOY, "steel": STEEL},
        [
            body("ring", "alloy", "annulus", center=[0.0, 29.0], radii=[27.0, 29.0]),
            box("plate", "steel", (-14.0, 14.0), (58.0, 66.0)),
        ],
        support=[pinned("ring", (0.0, 2.0), "ux"), pinned("ring", (0.0, 56.0), "ux")],
        contact=[
            on_plane("floor", "ring.outer", (0.0, 0.0), (0.0, 1.0)),
            pair("head", "ring.outer", "plate.bottom"),
        ],
        load=[platen("press", "plate.top", ux=0.0, uy=-0.6)],
        probe=[probe("side", "ring", 29.0, 29.0)],
    )
    return Scene("ring between plates", "", given)


def shaft() -> Scene:
    """A bronze ring shrunk on a solid steel shaft."""
    given = case(
        "strain",
        {"bronze": BRONZE, "steel": STEEL},
        [
            body("ring", "bronze", "annulus", center=[0.0, 0.0], radii=[BORE, RIM]),
            body("shaft", "steel", "disk", center=[0.0, 0.0], radius=BORE),
        ],
        support=[pinned("shaft", (0.0, 0.0)), pinned("shaft", (0.0, 10.0), "ux")],
        contact=[pair("fit", "ring.inner", "shaft.arc", interference=FIT)],
        probe=[probe("rim", "ring", RIM, 0.0), probe("rim-left", "ring", -RIM, 0.0)],
    )
    return Scene("ring on a shaft", "", given)


def cantilever() -> Scene:
    """Clamped on the right and bent down; at two thirds of its length it meets a round elastic post."""
    given = case(
        "strain",
        {"alloy": ALLOY, "bronze": BRONZE},
        [
            box("beam", "alloy", (0.0, 60.0), (0.0, 4.0)),
            body("post", "bronze", "half-disk", center=[20.0, -12.15], radius=12.0, side="upper"),
        ],
        support=[held("beam.right"), held("post.flat")],
        contact=[pair("stop", "post.arc", "beam.bottom")],
        load=[pressed("push", "beam.top", 0.8)],
        probe=[probe("tip", "beam", 0.0, 2.0)],
    )
    return Scene("late cantilever", "", given)


def sheet() -> Scene:
    """A stiff strip on a soft base, pressed in its middle by a stamp with a round nose: its ends lift."""
    given = case(
        "stress",
        {"steel": STEEL, "soft": solid(1200.0, 0.35)},
        [
            box("strip", "steel", (-18.0, 18.0), (0.0, 1.2)),
            box("base", "soft", (-25.0, 25.0), (-14.0, 0.0)),
            body("stamp", "steel", "half-disk", center=[0.0, 7.2], radius=6.0, side="lower"),
        ],
        support=[held("base.bottom"), pinned("strip", (0.0, 0.6), "ux")],
        contact=[pair("seat", "base.top", "strip.bottom"), pair("nose", "stamp.arc", "strip.top")],
        load=[platen("press", "stamp.flat", fy=-90.0)],
        probe=[probe("end", "strip", 18.0, 0.6)],
    )
    return Scene("sheet on a base", "", given)


def bracket() -> Scene:
    """An angle on a wall, all corners but the clamped ones rounded, its arm on a round elastic foot."""
    corners = [(0.0, 0.0), (5.0, 0.0), (5.0, 21.0), (36.0, 21.0), (36.0, 27.0), (0.0, 27.0)]
    given = case(
        "strain",
        {"alloy": ALLOY, "steel": STEEL},
        [
            polygon(
                "angle",
                "alloy",
                corners,
                names=["wall", "inside", "under", "tip", "top", "back"],
                rounding=[0.0, 0.0, 4.0, 2.0, 2.0, 6.0],
            ),
            body("foot", "steel", "half-disk", center=[28.0, 14.0], radius=7.0, side="upper"),
        ],
        support=[held("angle.wall")],
        contact=[pair("rest", "foot.arc", "angle.under")],
        load=[platen("lift", "foot.flat", ux=0.0, uy=0.15)],
        probe=[probe("tip", "angle", 36.0, 24.0)],
    )
    return Scene("bracket", "", given)


def pins() -> Scene:
    """A plate with two holes on a tight rigid and a looser one, both with clearance, pulled down aside."""
    holes = [
        {"name": "near", "center": [12.0, 30.0], "radius": 6.0},
        {"name": "far", "center": [48.0, 30.0], "radius": 6.0},
    ]
    given = case(
        "stress",
        {"alloy": ALLOY},
        [
            polygon(
                "plate",
                "alloy",
                [(0.0, 0.0), (60.0, 0.0), (60.0, 45.0), (0.0, 45.0)],
                names=["low", "right", "up", "left"],
                holes=holes,
            )
        ],
        contact=[
            on_disk("one", "plate.near", (12.0, 30.02), 5.98),
            on_disk("two", "plate.far", (48.0, 30.05), 5.95),
        ],
        load=[
            {"name": "pull", "boundary": "plate.low", "kind": "traction", "traction": [0.0, "-20 - 0.2*x"]},
        ],
        probe=[probe("corner", "plate", 60.0, 0.0)],
    )
    return Scene("plate on two pins", "", given)


SIX = {make.__name__: make for make in (ring, shaft, cantilever, sheet, bracket, pins)}


def shrunk() -> Table:
    """Lamé's figures of the ring on the shaft in plane strain: even pressure, growth of the rim."""

    def plane(material: Table) -> tuple[float, float]:
        E, nu = material["E"], material["nu"]
        return E / (1.0 - nu**2), nu / (1.0 - nu)

    (outer, nu_outer), (inner, nu_inner) = plane(BRONZE), plane(STEEL)
    wide = RIM**2 - BORE**2
    pressure = FIT / (BORE * (((RIM**2 + BORE**2) / wide + nu_outer) / outer + (1.0 - nu_inner) / inner))
    grows = 2.0 * pressure * BORE**2 * RIM / (wide * outer)
    return {"peak fit": pressure, "apart rim,rim-left": [-2.0 * grows, 0.0]}


def known() -> dict[str, Table]:
    """Figures of all scenes by name."""
    elements = json.loads(REFERENCE.read_text()) if REFERENCE.exists() else {}
    told = {
        name: {what: one["value"] for what, one in entry["figures"].items()}
        for name, entry in elements.items()
    }
    return told | {"shaft": shrunk()}


def errors(ran: Ran, told: Table) -> dict[str, float]:
    """In percent, by figure; the distance of vectors."""
    found = {}
    for what, true in told.items():
        sort, _, key = what.partition(" ")
        if sort == "peak":
            found[what] = 100.0 * (ran.result.peak(key) / true - 1.0)
            continue
        if sort == "apart":
            first, other = (ran.result.moved(name) for name in key.split(","))
            got = other - first
        else:
            got = ran.result.force(key) if sort == "force" else ran.result.moved(key)
        size = sum(v * v for v in true) ** 0.5
        found[what] = 100.0 * sum((a - b) ** 2 for a, b in zip(got, true, strict=True)) ** 0.5 / size
    return found


def spaced(given: Table, far: dict[str, float], factor: float) -> Table:
    """A case with even spacings, ``factor`` times those of a run ``far`` from its refinements; a shaft has
    those of its ring."""
    made = copy.deepcopy(given)
    for one in made["body"]:
        one["spacing"] = factor * (min(far.values()) if "shaft" in far else far[one["name"]])
    return made


def measured(name: str, scratch: Path) -> dict[str, Table]:
    """All spacings of one scene: errors, or why it was refused."""
    scene, told, found = SIX[name](), known()[name], dict[str, Table]()
    base: Ran | None = None
    for how in ("default", "coarse", "fine"):
        given = scene.case
        if base is not None:
            given = spaced(given, {one: far for one, (far, _) in spacings(base).items()}, FACTORS[how])
        ran = run_case(scene, given, scratch / name / how, lambda places: places)
        base = base or ran
        if ran.code:
            found[how] = {"refused": ran.message}
            continue
        away = errors(ran, told)
        missed = [what for what, error in away.items() if abs(error) > LIMITS[what.split()[0]]]
        found[how] = {
            "nodes": ran.summary["nodes"],
            "errors": away,
            "missed": missed,
            "warnings": ran.summary["warnings"],
        }
    return found


def references(names: list[str]) -> None:
    """Finite elements of all scenes without a formula."""
    from benchmarks.scenes.references import reference  # scikit-fem, for this only

    for name in names:
        if name != "shaft":
            told = json.loads(REFERENCE.read_text()) if REFERENCE.exists() else {}
            told[name] = reference(SIX[name](), 4 if name == "ring" else 5)  # its fifth mesh is large
            REFERENCE.write_text(json.dumps(told, indent=1) + "\n")
            print(name, {what: round(one["change"], 3) for what, one in told[name]["figures"].items()})


def main() -> int:
    """Run, print, write; 1 if anything is refused or beyond its limit."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", default=list(SIX), choices=list(SIX), metavar="NAME")
    parser.add_argument("--references", action="store_true")
    parser.add_argument("--out", type=Path, default=RESULTS / "six_classes.json")
    given = parser.parse_args()
    if given.references:
        references(given.only)
        return 0
    found: dict[str, Table] = {}
    bad = 0
    with tempfile.TemporaryDirectory() as scratch:
        for name in given.only:
            found[name] = measured(name, Path(scratch))
            for how, one in found[name].items():
                bad += "refused" in one or bool(one["missed"])
                figures = ", ".join(f"{what} {error:.2f} %" for what, error in one.get("errors", {}).items())
                print(f"{name:<11} {how:<8} {one.get('nodes', '')} {figures or one['refused']}", flush=True)
                for line in (
                    *(f"beyond: {what}" for what in one.get("missed", ())),
                    *one.get("warnings", ()),
                ):
                    print(f"    {line}", flush=True)
    given.out.write_text(json.dumps(found, indent=1) + "\n")
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(main())
