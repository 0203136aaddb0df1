"""Scenes that nobody tuned, written from the docs alone and run with defaults, judged by references.

    python benchmarks/scenes/run.py [--only NAME ...] [--variants] [--altered SEED] [--jobs 1]

A scene is right, refused (with its message), wrong with a warning or silently wrong: figures within the
limits of statics, closed formulas or finite elements (reference.json, by elements.py). ``--variants`` runs
what came through again, with half of the spacing, other seeds, slave and master swapped, turned by 90
degrees, mirrored, in other units. ``--altered`` draws materials, loads and friction anew, and compares with
other clouds what came through. NAME is a part of a scene's or class's name. Writes scenes.json or
altered_scenes.json (``--out``).
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
from collections.abc import Collection
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.scenes.altered import altered
from benchmarks.scenes.compared import ALL, through_variants
from benchmarks.scenes.every import SCENES
from benchmarks.scenes.judge import Verdict, judged, run_case

RESULTS = Path(__file__).resolve().parents[1] / "results"
OUTCOMES = (
    "right",
    "refused",
    "wrong with a warning",
    "silently wrong",
    "without a reference",
    "too long",
    "crashed",
    "cannot be expressed",
)


def solved(
    name: str, folder: Path, variants: Collection[str], seed: int | None, fails: Path | None
) -> Verdict:
    """Run and judge one scene, altered by a ``seed`` if there is one, with ``variants`` by name."""
    scene = SCENES[name]() if seed is None else altered(SCENES[name](), seed)
    if scene.missing:
        return Verdict(scene.name, scene.kind, "cannot be expressed", message=f"missing key: {scene.missing}")
    ran = run_case(scene, scene.case, folder / name / "base", lambda places: places)
    verdict = judged(scene, ran)
    if variants and ran.code == 0:
        verdict.variants.extend(through_variants(scene, ran, folder / name, variants))
    if fails is not None and verdict.outcome != "right":
        fails.mkdir(parents=True, exist_ok=True)
        shutil.copy(folder / name / "base" / "case.toml", fails / f"{name}.toml")
        for file in scene.files:
            shutil.copy(folder / name / "base" / file, fails / file)
    return verdict


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
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME")
    parser.add_argument("--variants", action="store_true")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--keep", type=Path, help="a folder for the runs; a temporary one by default")
    parser.add_argument("--fails", type=Path, help="a folder for the cases of scenes that are not right")
    parser.add_argument("--altered", type=int, metavar="SEED")
    given = parser.parse_args()
    out = given.out or RESULTS / ("scenes.json" if given.altered is None else "altered_scenes.json")
    if given.variants:
        variants: Collection[str] = ALL
    else:
        variants = () if given.altered is None else ("seed",)
    names = [
        name
        for name, make in SCENES.items()
        if not given.only or any(part in name or part in make().kind for part in given.only)
    ]
    kept = json.loads(out.read_text())["scenes"] if out.exists() and given.only else []
    found = {one["scene"]: one for one in kept}
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(given.jobs) as pool:
        folder = given.keep or Path(scratch)
        for verdict in pool.map(
            lambda name: solved(name, folder, variants, given.altered, given.fails), names
        ):
            print(told(verdict), flush=True)
            found[verdict.scene] = verdict.table()
            totals = {outcome: sum(v["outcome"] == outcome for v in found.values()) for outcome in OUTCOMES}
            out.write_text(json.dumps({"totals": totals, "scenes": list(found.values())}, indent=1) + "\n")
    print("\n" + ", ".join(f"{count} {outcome}" for outcome, count in totals.items() if count))


if __name__ == "__main__":
    main()
