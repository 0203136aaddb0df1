"""Signorini contact of bodies of finite elements: all equations of a case on one mesh, and their solution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse
import scipy.sparse.linalg as linalg
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.optimize import nnls

from benchmarks.scenes.elements import Side, Solid, obstacle_at, thickness, value_of
from benchmarks.scenes.scene import Array, Table
from mlsanm_cli.cloud.curves import Outline
from mlsanm_cli.cloud.spacing import Spacing, Zone

SOFT = 1e-6
"""Springs that hold loose bodies where they last were, relative to their modulus over their area."""
SETTLED, ROUNDS = 1e-4, 60
PASSES = 200
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
        self.given, self.outlines, self.turns = given, outlines, turns
        self.solids: dict[str, Solid] = {}
        first = 0
        for one in given["body"]:
            name, outline = one["name"], outlines[one["name"]]
            spacing = base * thickness(outline)
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
                for k, rows in zip(one.get("spring", ()), side.components(self.dofs), strict=False):
                    weight = k * side.quadrature()[3]
                    self.stiffness = self.stiffness + rows.T @ sparse.diags(weight) @ rows
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
                _, _, s, weight = side.quadrature()
                places, normals = side.curve.points(s), side.curve.normals(s)
                if kind == "pressure":
                    traction = -value_of(one["pressure"], places)[:, None] * normals
                else:
                    traction = np.stack([value_of(v, places) for v in one["traction"]], axis=1)
                for rows, along in zip(side.components(self.dofs), traction.T, strict=True):
                    self.load += rows.T @ (weight * along)
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
            to, outward = obstacle_at(one["obstacle"], places)
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
        wide = np.zeros((len(edge), len(self.extra)))
        if "master" in one:
            rows = rows - other.rows(*other.at(there), normal, self.dofs)
        else:
            for along, (value, unknown) in zip(normal.T, moves, strict=True):
                gap = gap - along * value
                if unknown is not None:
                    wide[:, unknown] = -along
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
            test @ sparse.hstack([rows, sparse.csr_matrix(wide)]).tocsr(),
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
