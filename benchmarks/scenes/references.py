"""References of scenes by finite elements: quadratic triangles, exact contact, two meshes.

    python benchmarks/scenes/references.py [--only NAME ...]

Frictionless scenes only. Contact is Signorini's law for nodal pressures (linear between vertices) against
weak gaps along the normal of one of both surfaces, solved by a primal-dual active set on the condensed
compliance. A first mesh finds the patches, two finer ones tell the figures and how far they agree. Writes
reference.json.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse as sparse
import scipy.sparse.linalg as linalg
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.optimize import nnls

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import itertools

import tomli_w

from benchmarks.scenes import (  # noqa: F401  (they register their scenes)
    assemblies,
    bending,
    fits,
    layers,
    machines,
    profiles,
    wedges,
)
from benchmarks.scenes.elements import Side, Solid, value_of
from benchmarks.scenes.judge import REFERENCE
from benchmarks.scenes.scene import SCENES, Array, Scene, Table
from mlsanm_cli.app.scene.clouds import outline_of
from mlsanm_cli.app.scene.imported import geometry_inspector
from mlsanm_cli.case.reading.read import load_case
from mlsanm_cli.cloud.curves import Outline
from mlsanm_cli.cloud.spacing import Spacing, Zone

SOFT = 1e-6
"""Springs that hold loose bodies where they last were, relative to their modulus over their area."""
SETTLED, ROUNDS = 1e-4, 60
PASSES = 200
TURNS, LEVEL = 6, 1e-5
"""Directions of contacts turn until they change by less, in radian."""
LEVELS = ((0.5, 0.1, 0.1), (0.4, 0.03, 0.06), (0.3, 0.02, 0.04), (0.12, 0.01, 0.026), (0.06, 0.006, 0.02))
"""Spacings of the meshes: over the thickness, at corners, and of patches over their width."""
Zones = list[tuple[Array, float, float]]
"""Place, spacing and radius."""


@dataclass(frozen=True)
class Motion:
    """An unknown or given motion (platen or obstacle) by its number among the extra unknowns."""

    unknown: int | None
    given: float


@dataclass
class Patch:
    """A contact's candidates: their places, arc lengths, tributary lengths and normals on the slave, and the
    directions that the ``flat`` and the ``steep``, more curved surface would give."""

    name: str
    side: Side
    rows: sparse.csr_matrix
    gap: Array
    normals: Array
    weight: Array
    places: Array
    flat: Array
    steep: Array


class Model:
    """All equations of a case for given zones."""

    def __init__(
        self,
        given: Table,
        outlines: dict[str, Outline],
        base: float,
        zones: dict[str, Zones],
        turns: dict[str, float],
    ) -> None:
        self.given = given
        self.turns = turns
        self.solids: dict[str, Solid] = {}
        first = 0
        for one in given["body"]:
            name, outline = one["name"], outlines[one["name"]]
            spacing = base * _thickness(outline)
            made = tuple(Zone.around(tuple(map(float, at)), h, r, 0.25) for at, h, r in zones.get(name, []))
            solid = Solid(
                outline,
                Spacing(spacing, made),
                given["material"][one["material"]],
                given["model"]["plane"],
                first,
            )
            self.solids[name] = solid
            first += solid.size
        self.dofs = first
        self.extra: list[float] = []  # forces on unknown motions
        self.moves: dict[str, list[tuple[float, int | None]]] = {}
        self.load = np.zeros(first)
        self.fixed: dict[int, tuple[float, int | None, float]] = {}
        self.stiffness = sparse.block_diag([s.stiffness for s in self.solids.values()]).tocsr()
        self.soft = np.concatenate([SOFT * s.young / s.mass.sum() * s.mass for s in self.solids.values()])
        self._supports()
        self._loads(outlines)
        self.patches = [self._contact(one) for one in given.get("contact", [])]

    def side(self, boundary: str) -> tuple[Solid, Side]:
        name, _, side = boundary.partition(".")
        return self.solids[name], self.solids[name].sides[side]

    def _supports(self) -> None:
        for one in self.given.get("support", []):
            axes = [axis for axis, key in enumerate(("ux", "uy")) if key in one]
            if "boundary" in one:
                _, side = self.side(one["boundary"])
                for axis in axes:
                    for dof in np.unique(side.dofs[:, :, axis]):
                        self.fixed[int(dof)] = (0.0, None, 0.0)
                if "spring" in one:
                    edge, t, _, weight = side.quadrature()
                    for axis, k in enumerate(one["spring"]):
                        if k:
                            vectors = np.zeros((len(edge), 2))
                            vectors[:, axis] = 1.0
                            rows = side.rows(edge, t, vectors, self.dofs)
                            self.stiffness = self.stiffness + rows.T @ sparse.diags(k * weight) @ rows
            else:
                solid = self.solids[one["body"]]
                node = int(np.argmin(np.hypot(*(solid.mesh.p.T - one["near"]).T)))
                for axis in axes:
                    self.fixed[int(solid.basis.nodal_dofs[axis, node]) + solid.first] = (0.0, None, 0.0)

    def _loads(self, outlines: dict[str, Outline]) -> None:
        plates: dict[str, list[Table]] = {}
        for one in self.given.get("load", []):
            kind = one["kind"]
            if kind in ("pressure", "traction"):
                _, side = self.side(one["boundary"])
                edge, t, s, weight = side.quadrature()
                places, normals = side.curve.points(s), side.curve.normals(s)
                if kind == "pressure":
                    traction = -value_of(one["pressure"], places)[:, None] * normals
                else:
                    traction = np.stack([value_of(v, places) for v in one["traction"]], axis=1)
                for axis in (0, 1):
                    vectors = np.zeros((len(edge), 2))
                    vectors[:, axis] = 1.0
                    self.load += side.rows(edge, t, vectors, self.dofs).T @ (weight * traction[:, axis])
            elif kind == "displacement":
                solid, side = self.side(one["boundary"])
                places = solid.basis.doflocs.T
                given = one.get("displacement", [one.get("ux"), one.get("uy")])
                for axis, value in enumerate(given):
                    dofs = np.unique(side.dofs[:, :, axis])
                    if value is not None:
                        for dof, u in zip(dofs, value_of(value, places[dofs - solid.first]), strict=True):
                            self.fixed[int(dof)] = (float(u), None, 0.0)
            elif kind == "body-force":
                solid = self.solids[one["body"]]
                self.load[solid.first : solid.first + solid.size] += solid.uniform(
                    np.array(one["body-force"])
                )
            else:
                plates.setdefault(one.get("boundary") or "obstacle " + one["obstacle"], []).append(one)
        for where, ones in plates.items():
            rigid = not where.startswith("obstacle ")
            moves = []
            for axis, (u, f) in enumerate((("ux", "fx"), ("uy", "fy"))):
                force = sum(one.get(f, 0.0) for one in ones)
                given = [one[u] for one in ones if u in one]
                driven = any(f in one for one in ones)
                if given or not driven:
                    moves.append((sum(given), None))
                else:
                    moves.append((0.0, len(self.extra)))
                    self.extra.append(force)
                # Otherwise the side slides along its plate.
                if rigid and (given or driven):
                    _, side = self.side(where)
                    for dof in np.unique(side.dofs[:, :, axis]):
                        self.fixed[int(dof)] = (moves[axis][0], moves[axis][1], 1.0)
            self.moves[where] = moves

    def _contact(self, one: Table) -> Patch:
        solid, side = self.side(one["slave"])
        edge, t, s, weight = side.quadrature()
        places, own = side.curve.points(s), side.curve.normals(s)
        moves = [(0.0, None)] * 2
        if "master" in one:
            _, other = self.side(one["master"])
            there = other.curve.closest(places)
            to, outward = other.curve.points(there), other.curve.normals(there)
            other_bend = bend(other.curve.curvature(there))
        else:
            to, outward = _obstacle(one["obstacle"], places)
            other_bend = 1.0 / one["obstacle"]["radius"] if one["obstacle"]["kind"] == "disk" else 0.0
            moves = self.moves.get("obstacle " + one["name"], moves)
        # Of the flatter surface, which the more curved one touches where it faces it; it turns with its body.
        own_more = bend(side.curve.curvature(s)) > other_bend
        flat, steep = (outward, -own) if own_more else (-own, outward)
        cos, sin = np.cos(self.turns.get(one["name"], 0.0)), np.sin(self.turns.get(one["name"], 0.0))
        normal = flat @ np.array([[cos, sin], [-sin, cos]])
        facing = (outward * own).sum(axis=1) < -0.3
        gap = ((places - to) * outward).sum(axis=1) / np.maximum((normal * outward).sum(axis=1), 0.3)
        if not own_more and one.get("obstacle", {}).get("kind") == "disk":
            # Straight to the disk, however far off that is drawn.
            radius, away = one["obstacle"]["radius"], places - one["obstacle"]["center"]
            ahead = (away * normal).sum(axis=1)
            aside = radius**2 - ((away**2).sum(axis=1) - ahead**2)
            gap = np.where(aside > 0.0, ahead - np.sqrt(np.maximum(aside, 0.0)), gap)
        rows = side.rows(edge, t, normal, self.dofs)
        wide = sparse.csr_matrix((len(edge), len(self.extra)))
        if "master" in one:
            there_edge, there_t = other.at(there)
            rows = rows - other.rows(there_edge, there_t, normal, self.dofs)
        else:
            columns = wide.tolil()
            for axis, (value, unknown) in enumerate(moves):
                gap = gap - normal[:, axis] * value
                if unknown is not None:
                    columns[:, unknown] = -normal[:, axis][:, None]
            wide = columns.tocsr()
        gap = gap - one.get("interference", 0.0)
        vertices, number = np.unique(side.ends, return_inverse=True)
        number = number.reshape(side.ends.shape)
        size = len(vertices)
        k = np.arange(len(edge))
        test = sparse.csr_matrix(
            (
                np.concatenate([weight * (1 - t), weight * t]) * np.tile(facing, 2),
                (np.concatenate([number[edge, 0], number[edge, 1]]), np.concatenate([k, k])),
            ),
            shape=(size, len(k)),
        )
        total = np.asarray(test.sum(axis=1)).ravel()
        keep = np.flatnonzero(total > 0.0)
        test = test[keep]
        mean = (test @ gap) / total[keep]
        reach = np.flatnonzero(mean < self.reach(mean, side.curve.length))
        test, keep = test[reach], keep[reach]
        return Patch(
            one["name"],
            side,
            test @ sparse.hstack([rows, wide]).tocsr(),
            test @ gap,
            test @ normal,
            total[keep],
            solid.mesh.p.T[vertices[keep]],
            test @ flat / total[keep, None],
            test @ steep / total[keep, None],
        )

    @staticmethod
    def reach(gaps: Array, long: float) -> float:
        """Initial gaps beyond which nothing is taken to touch."""
        return max(float(np.quantile(gaps, 0.6)), 0.02 * long) if len(gaps) > 60 else float("inf")

    def solve(self) -> tuple[Array, dict[str, Array]]:
        """Displacements of all dofs, and pressures of each contact's candidates."""
        count = self.dofs
        free = np.ones(count, bool)
        free[list(self.fixed)] = False
        number = np.cumsum(free) - 1
        inside = int(free.sum())
        rows, columns, values = [np.flatnonzero(free)], [number[free]], [np.ones(inside)]
        shift = np.zeros(count)
        for dof, (value, unknown, share) in self.fixed.items():
            shift[dof] = value
            if unknown is not None:
                rows.append(np.array([dof]))
                columns.append(np.array([inside + unknown]))
                values.append(np.array([share]))
        size = inside + len(self.extra)
        change = sparse.csr_matrix(
            (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(count, size)
        )
        young = max(s.young for s in self.solids.values())
        soft = change.T @ sparse.diags(self.soft) @ change
        soft = soft + sparse.diags(np.concatenate([np.zeros(inside), np.full(len(self.extra), SOFT * young)]))
        lu = linalg.splu((change.T @ self.stiffness @ change + soft).tocsc())
        right = change.T @ (self.load - self.stiffness @ shift)
        right[inside:] += self.extra
        both = sparse.vstack([p.rows for p in self.patches]).tocsr()
        coupling = both[:, :count] @ change
        coupling = coupling + sparse.csr_matrix(
            sparse.hstack([sparse.csr_matrix((both.shape[0], inside)), both[:, count:]])
        )
        drawn = np.concatenate([p.gap for p in self.patches]) + both[:, :count] @ shift
        answer = lu.solve(coupling.T.toarray())
        compliance = coupling @ answer
        moved, pressure = np.zeros(size), np.zeros(len(drawn))
        # The springs pull back to where the bodies last were: in the end they pull at nothing.
        for _ in range(ROUNDS):
            start = lu.solve(right + soft @ moved)
            found = signorini(compliance, drawn + coupling @ start, pressure > 0.0)
            away = float(np.abs(found - pressure).max())
            moved, pressure = start + answer @ found, found
            if away <= SETTLED * np.abs(pressure).max():
                break
        ends = np.cumsum([0, *(len(p.gap) for p in self.patches)])
        split = {p.name: pressure[a:b] for p, a, b in zip(self.patches, ends[:-1], ends[1:], strict=True)}
        return change @ moved + shift, split


def signorini(compliance: Array, gap: Array, closed: NDArray[np.bool_]) -> Array:
    """Pressures p >= 0 with C p + g >= 0 and no product of both; ``closed`` is a guess."""
    if not closed.any():
        closed = gap < 0.0
    size = np.sqrt(np.diag(compliance))
    for _ in range(PASSES):
        j = np.flatnonzero(closed)
        pressure = np.zeros(len(gap))
        pressure[j] = np.linalg.solve(compliance[np.ix_(j, j)], -gap[j])
        left = (compliance @ pressure + gap) / size
        new = np.where(closed, pressure > 0.0, left < -1e-9 * np.abs(gap / size).max())
        if np.array_equal(new, closed):
            return pressure
        closed = new
    # Where exchanges go round in circles: the same problem as non-negative least squares, slower but sure.
    scaled = compliance / np.outer(size, size)
    factor = np.linalg.cholesky(0.5 * (scaled + scaled.T) + 1e-13 * np.eye(len(gap)))
    found, _ = nnls(factor.T, -solve_triangular(factor, gap / size, lower=True), maxiter=40 * len(gap))
    return found / size


def turned(patch: Patch, pressure: Array) -> float:
    """The angle (radian) by which the directions of a contact have turned where a single patch touches."""
    closed = np.flatnonzero(pressure > 0.0)
    if not len(closed) or closed[-1] - closed[0] >= 2 * len(closed):
        return 0.0
    flat, steep = (complex(*(pressure @ normals)) for normals in (patch.flat, patch.steep))
    return float(np.angle(steep / flat))


def bend(curvature: Array) -> float:
    """Of a surface, in the middle."""
    return float(np.median(np.abs(curvature)))


def _obstacle(obstacle: Table, places: Array) -> tuple[Array, Array]:
    """Closest points of an obstacle, and its outward normals."""
    if obstacle["kind"] == "plane":
        normal = np.array(obstacle["normal"]) / np.hypot(*obstacle["normal"])
        away = (places - obstacle["point"]) @ normal
        return places - away[:, None] * normal, np.tile(normal, (len(places), 1))
    if obstacle["kind"] == "disk":
        away = places - obstacle["center"]
        normal = away / np.hypot(*away.T)[:, None] * (-1.0 if obstacle.get("inside") else 1.0)
        sign = -1.0 if obstacle.get("inside") else 1.0
        return np.array(obstacle["center"]) + sign * obstacle["radius"] * normal, normal
    points = np.array(obstacle["points"], float)
    best = np.full(len(places), np.inf)
    to, out = np.zeros_like(places), np.zeros_like(places)
    for a, b in itertools.pairwise(points):
        way = b - a
        t = np.clip((places - a) @ way / (way @ way), 0.0, 1.0)
        near = a + t[:, None] * way
        far = np.hypot(*(places - near).T)
        closer = far < best
        best = np.where(closer, far, best)
        to[closer] = near[closer]
        out[closer] = np.array([way[1], -way[0]]) / np.hypot(*way)  # the obstacle lies on the left
    return to, out


def _area(outline: Outline) -> float:
    """From points of the outline, its arcs by 4000 chords."""
    area = 0.0
    for curve in outline.curves:
        p = curve.points(np.linspace(0.0, curve.length, 4001))
        m, d = 0.5 * (p[1:] + p[:-1]), np.diff(p, axis=0)
        area += 0.5 * float((m[:, 0] * d[:, 1] - m[:, 1] * d[:, 0]).sum())
    return area


def _thickness(outline: Outline) -> float:
    """Twice the area over the perimeter."""
    return 2.0 * _area(outline) / sum(curve.length for curve in outline.curves)


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
        fine = share * _thickness(outline)
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
                limit = share * 2.5 * _thickness(model.outlines[owner])  # type: ignore[attr-defined]
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
            to, _ = _obstacle(one["obstacle"], places)
        gaps = np.hypot(*(places - to).T)
        near = np.flatnonzero(gaps <= gaps.min() + 1e-6 * curve.length)
        if len(near) < 40:
            for owner in owners:
                h = 0.02 * min(_thickness(outlines[o]) for o in owners)
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
        for name, write in scene.files.items():
            write(folder / name, lambda places: places)
        (folder / "case.toml").write_text(tomli_w.dumps(scene.case))
        case = load_case(folder / "case.toml", inspector=geometry_inspector).case
        outlines = {body.name: outline_of(case, body) for body in case.body}
    given = {**scene.case, "support": [*scene.case.get("support", []), *scene.supports]}
    began = time.process_time()
    zones = joined(corners(given, outlines, 0.1), first_touches(given, outlines))
    results, turns = [], dict[str, float]()
    for level, (base, edge, share) in enumerate(LEVELS[:meshes]):
        for _ in range(TURNS):
            model = Model(given, outlines, base, zones, {} if scene.straight_walls else turns)
            model.outlines = outlines  # type: ignore[attr-defined]
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
    """All frictionless scenes that ask for it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", default=[])
    given = parser.parse_args()
    for name, make in SCENES.items():
        scene = make()
        if scene.elements and (not given.only or any(part in name for part in given.only)):
            try:
                found = reference(scene)
            except (RuntimeError, ValueError, np.linalg.LinAlgError) as error:
                print(f"{name}: {error!r}", flush=True)
                continue
            known = json.loads(REFERENCE.read_text()) if REFERENCE.exists() else {}
            known[name] = found
            REFERENCE.write_text(json.dumps(known, indent=1) + "\n")
            print(name, {what: round(one["change"], 3) for what, one in found["figures"].items()}, flush=True)


if __name__ == "__main__":
    main()
