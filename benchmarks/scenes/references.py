"""References of scenes by finite elements: quadratic triangles, exact contact, two meshes.

    python benchmarks/scenes/references.py [--only NAME ...]

Frictionless scenes only. Contact is Signorini's law for nodal pressures (linear between vertices) against
weak gaps along the normal of one of both surfaces, solved by a primal-dual active set on the condensed
compliance. A first mesh finds the patches, two finer ones tell the figures and how far they agree. Writes
reference.json.
"""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))


import tomli_w

from benchmarks.scenes.elements import obstacle_at, thickness
from benchmarks.scenes.judge import REFERENCE
from benchmarks.scenes.scene import Array, Scene, Table, expected, options, scene
from benchmarks.scenes.signorini import Model, Zones, turned
from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.outlines import geometry_of
from mlsanm_cli.case.reading.read import load_case
from mlsanm_cli.cloud.curves import Outline

TURNS, LEVEL = 6, 1e-5
"""Directions of contacts turn until they change by less, in radian."""
LEVELS = ((0.5, 0.1, 0.1), (0.4, 0.03, 0.06), (0.3, 0.02, 0.04), (0.12, 0.01, 0.026), (0.06, 0.006, 0.02))
"""Spacings of the meshes: over the thickness, at corners, and of patches over their width."""


def corners(given: Table, outlines: dict[str, Outline], share: float) -> dict[str, Zones]:
    """Fine zones at ends of held or glued sides, of contacts' sides, and inward corners."""
    zones: dict[str, Zones] = {}
    busy = [one["boundary"] for key in ("support", "load") for one in given.get(key, []) if "boundary" in one]
    busy += [one[key] for one in given.get("contact", []) for key in ("slave", "master") if key in one]
    partners: dict[str, list[str]] = {}
    for one in given.get("contact", []):
        if "master" in one:
            for a, b in ((one["slave"], one["master"]), (one["master"], one["slave"])):
                partners.setdefault(a, []).append(b.split(".")[0])
    for name, outline in outlines.items():
        fine = share * thickness(outline)
        for side, curve in zip(outline.names, outline.curves, strict=True):
            if f"{name}.{side}" in busy and not curve.closed:
                for at in curve.points(np.array([0.0, curve.length])):
                    for owner in {name, *partners.get(f"{name}.{side}", [])}:
                        zones.setdefault(owner, []).append((at, fine, 0.0))
        for loop in outline.loops:
            parts = outline.curves[loop]
            for one, after in zip(parts, (*parts[1:], parts[0]), strict=True):
                a, b = one.normals(np.array([one.length]))[0], after.normals(np.array([0.0]))[0]
                if a[0] * b[1] - a[1] * b[0] < -1e-3:
                    zones.setdefault(name, []).append((after.points(np.array([0.0]))[0], fine, 0.0))
    return zones


def found_zones(model: Model, pressures: dict[str, Array], share: float) -> dict[str, Zones]:
    """Fine zones where a mesh found contact."""
    zones: dict[str, Zones] = {}
    for one, patch in zip(model.given["contact"], model.patches, strict=True):
        p = pressures[patch.name]
        closed = np.flatnonzero(p > 0.0)
        if not len(closed):
            continue
        # Parts by gaps between neighbours larger than three of their own lengths.
        at = patch.places[closed]
        order = np.argsort(patch.side.curve.closest(at))
        at, long = at[order], patch.weight[closed][order]
        breaks = np.flatnonzero(np.hypot(*np.diff(at, axis=0).T) > 2.2 * np.maximum(long[1:], long[:-1]))
        for group in np.split(np.arange(len(at)), breaks + 1):
            wide = float(long[group].sum())
            # Pressed on few vertices, a patch is narrower than they are.
            if len(group) <= 3:
                wide *= 0.5
            h = share * wide
            for boundary in [one["slave"], *([one["master"]] if "master" in one else [])]:
                owner = boundary.split(".")[0]
                limit = share * 2.5 * thickness(model.outlines[owner])
                for k in group[:: max(1, len(group) // 40)]:
                    zones.setdefault(owner, []).append(
                        (at[k], min(h, limit), max(0.75 * wide / min(len(group), 40), 1.5 * h))
                    )
                for k in (group[0], group[-1]):
                    zones.setdefault(owner, []).extend(
                        [(at[k], 0.5 * min(h, limit), h), (at[k], 0.1 * min(h, limit), 0.0)]
                    )
    return zones


def figures(model: Model, moved: Array, pressures: dict[str, Array]) -> Table:
    """Forces, peaks and displacements of probes, by name."""
    told: Table = {}
    for patch in model.patches:
        p = pressures[patch.name]
        told[f"force {patch.name}"] = (patch.normals.T @ p).tolist()
        told[f"peak {patch.name}"] = float(p.max())
    for one in model.given.get("probe", []):
        told[f"moved {one['name']}"] = model.solids[one["body"]].at(one["point"], moved).tolist()
    return told if model.given["support"] else floating(told)


def floating(told: Table) -> Table:
    """Nothing holds the bodies in common: displacements count from that of the first probe."""
    probes = [what for what in told if what.startswith("moved ")]
    if len(probes) < 2:
        return told
    rest = {what: value for what, value in told.items() if what not in probes}
    first = np.array(told[probes[0]])
    names = [what.split()[1] for what in probes]
    return rest | {
        f"apart {names[0]},{name}": (np.array(told[what]) - first).tolist()
        for name, what in zip(names[1:], probes[1:], strict=True)
    }


def first_touches(given: Table, outlines: dict[str, Outline]) -> dict[str, Zones]:
    """Fine zones where gaps of curved surfaces are least, which a coarse mesh may not see."""
    zones: dict[str, Zones] = {}
    for one in given.get("contact", []):
        name, _, side = one["slave"].partition(".")
        curve = outlines[name].curves[outlines[name].names.index(side)]
        places = curve.points(np.linspace(0.0, curve.length, 2001))
        owners = [name]
        if "master" in one:
            owner, _, other_side = one["master"].partition(".")
            other = outlines[owner].curves[outlines[owner].names.index(other_side)]
            to = other.points(other.closest(places))
            owners.append(owner)
        else:
            to, _ = obstacle_at(one["obstacle"], places)
        gaps = np.hypot(*(places - to).T)
        near = np.flatnonzero(gaps <= gaps.min() + 1e-6 * curve.length)
        if len(near) < 40:
            for owner in owners:
                h = 0.02 * min(thickness(outlines[o]) for o in owners)
                zones.setdefault(owner, []).append((places[gaps.argmin()], h, 2.0 * h))
    return zones


def joined(*several: dict[str, Zones]) -> dict[str, Zones]:
    return {
        name: [zone for each in several for zone in each.get(name, [])] for each in several for name in each
    }


def reference(scene: Scene, meshes: int = len(LEVELS)) -> Table:
    """Figures of the finer of two ``meshes``, the last ones, and their changes in percent."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for file in scene.files:
            shutil.copy(file, folder)
        (folder / "case.toml").write_text(tomli_w.dumps(scene.case))
        case = load_case(folder / "case.toml", geometry_of=geometry_of).case
        boundaries = Boundaries.of(case)
        outlines = {body.name: boundaries.outline(body.name) for body in case.body}
    given = {**scene.case, "support": [*scene.case.get("support", []), *scene.supports]}
    began = time.process_time()
    zones = joined(corners(given, outlines, 0.1), first_touches(given, outlines))
    results, turns = [], dict[str, float]()
    for level, (base, edge, share) in enumerate(LEVELS[:meshes]):
        for _ in range(TURNS):
            model = Model(given, outlines, base, zones, {} if scene.straight_walls else turns)
            moved, pressures = model.solve()
            before, turns = turns, {one.name: turned(one, pressures[one.name]) for one in model.patches}
            if scene.straight_walls or all(abs(turns[k] - before.get(k, 0.0)) < LEVEL for k in turns):
                break
        results.append(figures(model, moved, pressures))
        print(
            f"  {scene.name} {level}: {model.dofs} dofs, {time.process_time() - began:.0f} s",
            results[-1],
            flush=True,
        )
        zones = joined(corners(given, outlines, edge), found_zones(model, pressures, share))
    told = {
        what: {"value": value, "change": change(results[-2], results[-1], what)}
        for what, value in results[-1].items()
    }
    return {"figures": told, "dofs": int(model.dofs), "seconds": round(time.process_time() - began, 1)}


def change(coarse: Table, fine: Table, what: str) -> float:
    """In percent, relative to the figure."""
    a, b = np.atleast_1d(coarse[what]), np.atleast_1d(fine[what])
    size = float(np.hypot(*b)) if len(b) == 2 else float(np.abs(b[0]))
    return 100.0 * float(np.linalg.norm(a - b)) / size if size else float("inf")


def main() -> None:
    """All scenes with references by finite elements."""
    parser = options(__doc__)
    given = parser.parse_args()
    for name in expected():
        chosen = scene(name)
        if chosen.elements and (not given.only or any(part in name for part in given.only)):
            try:
                # The fifth mesh of the thinnest ring is large.
                found = reference(chosen, 4 if name == "six_classes/ring" else len(LEVELS))
            except (RuntimeError, ValueError, np.linalg.LinAlgError) as error:
                print(f"{name}: {error!r}", flush=True)
                continue
            known = json.loads(REFERENCE.read_text()) if REFERENCE.exists() else {}
            known[name] = found
            REFERENCE.write_text(json.dumps(known, indent=1) + "\n")
            print(name, {what: round(one["change"], 3) for what, one in found["figures"].items()}, flush=True)


if __name__ == "__main__":
    main()
