"""What the variants of a scene differ by."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import h5py
import numpy as np
from scipy.spatial import cKDTree

from benchmarks.scenes.judge import Ran, known, run_case
from benchmarks.scenes.scene import FORCE, PEAK, PLACE, Array, Scene, Table
from benchmarks.scenes.variants import Variant, halved, has_nodes, variants

SMALL = 0.05
"""Forces and displacements below this part of the scene's largest are compared with it instead."""
FACTOR = 3.0
"""How far an error estimate may be from the error."""
NOISE = 3e-4
"""Errors below this are not what an estimate is judged by."""


def through_variants(scene: Scene, base: Ran, folder: Path) -> list[Table]:
    """Run all variants of a scene that was solved, and compare."""
    found = []
    for variant in (halved(scene.case, spacings(base)), *variants()):
        if variant.name == "swapped" and not any("master" in one for one in scene.case.get("contact", [])):
            continue
        if variant.change(scene.case) == scene.case:  # the halves of meshes whose nodes are taken
            continue
        ran = run_case(scene, variant.change(scene.case), folder / variant.name, variant.move())
        found.append(_line(scene, variant, base, ran))
    return found


def spacings(ran: Ran) -> dict[str, tuple[float, dict[str, float]]]:
    """Spacing of every body far from its refinements, and the mean one along each of its boundaries."""
    told = {}
    with h5py.File(ran.folder / "run.h5") as file:
        for name, one in file["bodies"].items():
            points = one["points"][:]
            far = float(np.quantile(cKDTree(points).query(points, k=2)[0][:, 1], 0.95))
            names, index = one["boundary/name"].asstr()[:], one["boundary/index"][:]
            sides = {}
            for side in np.unique(names):
                steps = np.hypot(*np.diff(points[index[names == side]], axis=0).T)
                sides[str(side)] = float(np.median(steps)) if len(steps) else far
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
    peak = peaks(base, ran, variant, without=unbounded(scene.name))
    agrees = force <= FORCE and place <= PLACE and peak <= PEAK
    text = f"force {force:.2f} %, peak {peak:.2f} %, displacement {place:.2f} %"
    if variant.name == "halved" and not any(map(has_nodes, scene.case["body"])):
        ratio, told = estimates(base, ran)
        text += told
        agrees = agrees and ratio
    return {
        "variant": variant.name,
        "agrees": agrees,
        "text": text,
        "force": force,
        "peak": peak,
        "place": place,
    }


def vectors(ran: Ran, table: str, key: str, variant: Variant | None = None) -> dict[str, Array]:
    """Forces or displacements by name, turned back and in the units of the scene."""
    unit = 1.0
    if variant is not None:
        unit = variant.length * (variant.stress if key == "force" else 1.0)
    matrix = np.eye(2) if variant is None else variant.matrix
    sign = -1.0 if variant is not None and variant.name == "swapped" and key == "force" else 1.0
    found = {}
    for name, one in (ran.summary.get(table) or {}).items():
        turned = matrix.T @ np.array(one[key]) / unit
        found[name] = turned if sign > 0.0 else np.abs(turned)
    return found


def unbounded(name: str) -> set[str]:
    """Contacts whose peaks finite elements do not agree upon: pressures without a bound at corners."""
    figures = known().get(name, {}).get("figures", {})
    return {what[5:] for what, one in figures.items() if what[:5] == "peak " and one["change"] > PEAK / 3.0}


def difference(base: dict[str, Array], other: dict[str, Array], least: float = 0.0) -> float:
    """Largest in percent; of forces that cancel around a body, of ``least``, what presses and rubs there."""
    largest = max((float(np.hypot(*one)) for one in base.values()), default=0.0)
    largest = max(largest, least)
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


def estimates(base: Ran, fine: Ran) -> tuple[bool, str]:
    """Whether the estimated errors are near those against half of the spacing."""
    told = base.summary.get("error_estimate") or {}
    if told.get("displacement") is None:
        return True, ""
    away, size = 0.0, 0.0
    with h5py.File(base.folder / "run.h5") as coarse, h5py.File(fine.folder / "run.h5") as other:
        for name in coarse["bodies"]:
            at, last = coarse[f"bodies/{name}/points"][:], _last(coarse)
            points = other[f"bodies/{name}/points"][:]
            values = other[f"fields/{_last(other)}/{name}/displacement"][: len(points)]
            found = fitted(points, values, at)
            here = coarse[f"fields/{last}/{name}/displacement"][: len(at)]
            away += float(((found - here) ** 2).sum())
            size += float((found**2).sum())
    true = float(np.sqrt(away / size)) if size else 0.0
    ratio = told["displacement"] / true if true else 1.0
    fair = (true < NOISE and told["displacement"] < FACTOR * NOISE) or 1.0 / FACTOR <= ratio <= FACTOR
    return fair, f", estimated error {told['displacement']:.1e}, true {true:.1e}"


def fitted(points: Array, values: Array, at: Array) -> Array:
    """Quadratic fits (m, 2) to the 14 nearest values."""
    tree = cKDTree(points)
    far, near = tree.query(at, k=14)
    local = (points[near] - at[:, None]) / far[:, -1:, None]
    x, y = local[..., 0], local[..., 1]
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=2)
    weights = np.exp(-2.0 * (x**2 + y**2))[..., None]
    normal = np.swapaxes(weights * terms, 1, 2) @ terms
    right = np.swapaxes(weights * terms, 1, 2) @ values[near]
    return np.asarray(np.linalg.solve(normal, right)[:, 0])


def _last(file: h5py.File) -> str:
    return max((key for key in file["fields"] if key != "position"), key=int)
