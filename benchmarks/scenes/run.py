"""Scenes that nobody tuned, written from the docs alone and run with defaults, judged by references.

    python benchmarks/scenes/run.py [--only NAME ...] [--variants] [--altered SEED] [--jobs 1]
    python benchmarks/scenes/run.py --folder six_classes | incompressible

A scene is right, refused (with its message), wrong with a warning or silently wrong: figures within the
limits of statics, closed formulas (expected.toml) or finite elements (reference.json, by references.py).
``--variants`` runs what came through again, with half of the spacing, other seeds, slave and master swapped,
turned by 90 degrees, mirrored, in other units. ``--altered`` draws materials, loads and friction anew, and
compares with other clouds what came through. ``--folder`` runs the scenes of a folder of cases/:
``six_classes`` are difficult for meshfree methods, with automatic spacings and with even ones of 1.5 times
and half of the largest of these. NAME is a part of a scene's or class's name. Writes scenes.json,
altered_scenes.json or FOLDER.json (``--out``).
"""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
from collections.abc import Collection
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.scenes.compared import ALL, spacings, through_variants
from benchmarks.scenes.judge import Ran, Verdict, judged, run_case
from benchmarks.scenes.scene import Scene, Table, names, options, scene
from benchmarks.scenes.variants import altered, evenly_spaced

RESULTS = Path(__file__).resolve().parents[1] / "results"
OUTCOMES = (
    "right",
    "refused",
    "wrong with a warning",
    "silently wrong",
    "without a reference",
    "too long",
    "crashed",
)
SPACINGS = {"coarse": 1.5, "fine": 0.5}


def solved(chosen: Scene, folder: Path, variants: Collection[str], fails: Path | None) -> Verdict:
    """Run and judge one scene, with ``variants`` by name."""
    folder = folder / chosen.name
    ran = run_case(chosen, chosen.case, folder / "base")
    verdict = judged(chosen, ran)
    if ran.code == 0:
        verdict.variants.extend(through_variants(chosen, ran, folder, variants))
        verdict.variants.extend(_spaced(chosen, ran, folder, how) for how in SPACINGS if how in variants)
    if fails is not None and verdict.outcome != "right":
        fails.mkdir(parents=True, exist_ok=True)
        shutil.copy(folder / "base" / "case.toml", fails / f"{Path(chosen.name).name}.toml")
        for file in chosen.files:
            shutil.copy(file, fails / file.name)
    return verdict


def _spaced(chosen: Scene, base: Ran, folder: Path, how: str) -> Table:
    """A run with even spacings, judged by the scene's figures."""
    given = evenly_spaced(chosen.case, spacings(base), SPACINGS[how])
    verdict = judged(chosen, run_case(chosen, given, folder / how))
    errors = {what: error for what, *_, error, _ in verdict.figures}
    told = ", ".join(f"{what} {error:+.2f} %" for what, error in errors.items())
    text = f"{verdict.outcome}, {verdict.nodes} nodes: {told or verdict.message}"
    more = {"nodes": verdict.nodes, "errors": errors, "warnings": verdict.warnings}
    return {"variant": how, "agrees": verdict.outcome == "right", "text": text, **more}


def told(verdict: Verdict) -> str:
    """What is printed of a scene."""
    size = f"{verdict.nodes} nodes, {verdict.cpu:.1f} s" if verdict.nodes and verdict.cpu else ""
    lines = [f"{verdict.scene:<24} {verdict.outcome:<22} {size}"]
    for what, got, true, error, limit in verdict.figures:
        mark = "" if abs(error) <= limit else "   <--"
        lines.append(f"    {what:<28} {got:<12.6g} reference {true:<12.6g} {error:+.2f} %{mark}")
    if verdict.sides is not None and verdict.sides > 1e-6:
        lines.append(f"    forces reported on a body do not add up: {verdict.sides:.1e} of the largest   <--")
    lines += [f"    {verdict.message}"] if verdict.message else []
    lines += [f"    warning: {text}" for text in verdict.warnings]
    for one in verdict.variants:
        mark = "" if one["agrees"] else "   <--"
        lines.append(f"    variant {one['variant']:<9} {one['text']}{mark}")
    return "\n".join(lines)


def main() -> None:
    """Run, print, write."""
    parser = options(__doc__)
    parser.add_argument("--variants", action="store_true")
    parser.add_argument("--altered", type=int, metavar="SEED")
    parser.add_argument("--folder", default=".", help="a folder of cases/")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--keep", type=Path, help="a folder for the runs; a temporary one by default")
    parser.add_argument("--fails", type=Path, help="a folder for the cases of scenes that are not right")
    given = parser.parse_args()
    scenes = [scene(name) for name in names(given.folder)]
    name, variants = "scenes", ALL if given.variants else ()
    if given.only:
        scenes = [one for one in scenes if any(part in f"{one.name} {one.kind}" for part in given.only)]
    if given.folder != ".":
        name = given.folder
        variants = (*variants, *(SPACINGS if name == "six_classes" else ()))
    elif given.altered is not None:
        name, variants = "altered_scenes", variants or ("seed",)
        scenes = [altered(one, given.altered) for one in scenes]
    out = given.out or RESULTS / f"{name}.json"
    kept = json.loads(out.read_text())["scenes"] if out.exists() and given.only else []
    found = {one["scene"]: one for one in kept}
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(given.jobs) as pool:
        folder = given.keep or Path(scratch)
        for verdict in pool.map(lambda one: solved(one, folder, variants, given.fails), scenes):
            print(told(verdict), flush=True)
            found[verdict.scene] = verdict.table()
            totals = {outcome: sum(v["outcome"] == outcome for v in found.values()) for outcome in OUTCOMES}
            out.write_text(json.dumps({"totals": totals, "scenes": list(found.values())}, indent=1) + "\n")
    print("\n" + ", ".join(f"{count} {outcome}" for outcome, count in totals.items() if count))


if __name__ == "__main__":
    main()
