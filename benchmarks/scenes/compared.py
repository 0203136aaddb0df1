"""What the variants of a scene differ by."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import h5py
import numpy as np
from scipy.spatial import cKDTree

from benchmarks.scenes.judge import SIDES, Ran, imbalance, known, run_case
from benchmarks.scenes.scene import FORCE, PEAK, PLACE, Array, Scene, Table
from benchmarks.scenes.variants import Spacings, Variant, halved, variants

SIZED = "estimated to be off by"
"""Warnings that name a size of an error."""
SMALL = 0.05
"""Forces and displacements below this part of the scene's largest are compared with it instead."""

ALL = ("halved", *(variant.name for variant in variants()))
"""Names of the variants."""


def through_variants(scene: Scene, base: Ran, folder: Path, names: Collection[str]) -> list[Table]:
    """Run the variants with some ``names`` of a scene that was solved, and compare."""
    found = []
    finer = [halved(scene.case, spacings(base))] if "halved" in names else []
    for variant in (*finer, *(one for one in variants() if one.name in names)):
        if variant.name == "swapped" and not any("master" in one for one in scene.case.get("contact", [])):
            continue
        if variant.name == "halved" and variant.change(scene.case) == scene.case:
            continue  # meshes whose nodes are taken
        ran = run_case(scene, variant.change(scene.case), folder / variant.name, variant.move())
        found.append(_line(scene, variant, base, ran))
    return found


def spacings(ran: Ran) -> dict[str, Spacings]:
    """Those of all bodies in a run."""
    told = {}
    with h5py.File(ran.folder / "run.h5") as file:
        for name, one in file["bodies"].items():
            points = one["points"][:]
            far = float(np.quantile(np.asarray(cKDTree(points).query(points, k=2)[0])[:, 1], 0.95))
            names, index = one["boundary/name"].asstr()[:], one["boundary/index"][:]
            sides = {}
            for side in np.unique(names):
                places = points[index[names == side]]
                steps = np.hypot(*np.diff(places, axis=0).T)
                if len(steps):
                    ordered = np.sort(steps)
                    half = float(ordered[np.searchsorted(np.cumsum(ordered), 0.5 * ordered.sum())])
                    some = {tuple(places[i].tolist()): float(steps[i]) for i in (0, steps.argmin(), -1)}
                    sides[str(side)] = half, some
            told[name] = (far, sides)
    return told


def _line(scene: Scene, variant: Variant, base: Ran, ran: Ran) -> Table:
    if ran.code:
        text = f"refused: {ran.message[:300]}"
        return {"variant": variant.name, "agrees": False, "text": text}
    pressed = max((base.result.size(name) for name in base.summary.get("contacts") or {}), default=0.0)
    force = difference(
        vectors(base, "contacts", "force"), vectors(ran, "contacts", "force", variant), least=pressed
    )
    place = difference(
        vectors(base, "probes", "displacement"), vectors(ran, "probes", "displacement", variant)
    )
    sides = imbalance(variant.change(scene.case), ran.result) or 0.0
    singular = unbounded(scene.name) | ended(base) & ended(ran)
    peak = peaks(base, ran, variant, without=singular)
    spread = max((spreads(base, ran, name, variant.name == "swapped") for name in singular), default=0.0)
    agrees = force <= FORCE and place <= PLACE and max(peak, spread) <= PEAK
    text = f"force {force:.2f} %, peak {peak:.2f} %, displacement {place:.2f} %"
    text += f", force along singular contacts {spread:.2f} %" if singular else ""
    warned = sorted(
        {says for one in (base, ran) for says in one.summary.get("warnings", ()) if SIZED in says}
    )
    text += f"; warned: {'; '.join(warned)}" if warned and not agrees else ""
    text += f", forces on a body do not add up: {sides:.1e}" if sides > SIDES else ""
    return {
        "variant": variant.name,
        "agrees": (agrees or bool(warned)) and sides <= SIDES,
        "text": text,
        "force": force,
        "peak": peak,
        "place": place,
        "spread": spread,
        "sides": sides,
        "warned": warned,
    }


def vectors(ran: Ran, table: str, key: str, variant: Variant | None = None) -> dict[str, Array]:
    """Forces or displacements by name, turned back and in the units of the scene."""
    unit, matrix = 1.0, np.eye(2)
    if variant is not None:
        unit, matrix = variant.length * (variant.stress if key == "force" else 1.0), variant.matrix
    sign = -1.0 if variant is not None and variant.name == "swapped" and key == "force" else 1.0
    found = {}
    for name, one in (ran.summary.get(table) or {}).items():
        turned = matrix.T @ np.array(one[key]) / unit
        found[name] = turned if sign > 0.0 else np.abs(turned)
    return found


def unbounded(name: str) -> set[str]:
    """Contacts whose peaks finite elements do not agree upon: pressures without a bound at corners."""
    figures = known().get(name, {}).get("figures", {})
    return {what[5:] for what, one in figures.items() if what[:5] == "peak " and one["change"] > PEAK}


def ended(ran: Ran) -> set[str]:
    """Contacts whose peaks a run says to have no bound: at sharp ends."""
    return {name for name, one in (ran.summary.get("contacts") or {}).items() if one.get("singular_ends")}


def spreads(base: Ran, ran: Ran, name: str, swapped: bool) -> float:
    """How far the parts of a contact's force up to a place along it are apart, in percent of the force.

    What is left to compare of pressures without a bound. Variants may go along a contact the other way.
    """
    shares = []
    for one in (base, ran):
        pressed = one.result.last(name, "pressure") * one.result.read(f"contacts/{name}/weight")
        s = one.result.read(f"contacts/{name}/arc_length")
        s = (s - s[0]) / (s[-1] - s[0])
        summed = np.cumsum(pressed)
        if not summed[-1] > 0.0:
            return 0.0
        shares.append((s, (summed - 0.5 * pressed) / summed[-1]))
    places = np.linspace(0.0, 1.0, 101)
    (s, share), (t, other) = shares
    ways = ((t, other), (1.0 - t[::-1], 1.0 - other[::-1]))
    first = np.interp(places, s, share)
    return 100.0 * min(float(np.abs(first - np.interp(places, *way)).max()) for way in ways)


def difference(base: dict[str, Array], other: dict[str, Array], least: float = 0.0) -> float:
    """Largest in percent; of forces that cancel around a body, of ``least``, what presses and rubs there."""
    largest = max([least, *(float(np.hypot(*one)) for one in base.values())])
    if not largest:
        return 0.0
    worst = 0.0
    for name, one in base.items():
        unsigned = np.abs(one) if (other[name] >= 0.0).all() and (one < 0.0).any() else one
        scale = max(float(np.hypot(*one)), SMALL * largest)
        away = min(float(np.hypot(*(each - other[name]))) for each in (one, unsigned))
        worst = max(worst, 100.0 * away / scale)
    return worst


def peaks(base: Ran, ran: Ran, variant: Variant, without: Collection[str] = ()) -> float:
    """Largest difference of peak pressures in percent; at the ends of bonds they have no bound."""
    found = [
        100.0
        * abs(ran.summary["contacts"][name]["peak_pressure"] / variant.stress / one["peak_pressure"] - 1.0)
        for name, one in (base.summary.get("contacts") or {}).items()
        if one["peak_pressure"] and name not in without and "peak_tension" not in one
    ]
    return max(found, default=0.0)
