"""Bonded surfaces neither separate nor slide: their tractions, which cancel the relative motion caused by
load factors f, motions q, pressures p and tractions t of the other contacts, are eliminated.

Least squares respond less to tractions the shorter their waves, and tractions are singular at the ends of
bonds. They are therefore linear between knots KNOT_SPACING spacings apart, and displacements averaged with
the same hat functions agree on both sides (mortar method).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.geometry.pairing import Pairing, facing_spacing
from mlsanm_cli.contact.response.basis import Drivers, spans
from mlsanm_cli.contact.response.compressed import SINGULAR, LinearMap
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF

KNOT_SPACING = 3.0
"""Distance of the knots, in spacings of the coarser surface."""
KNOT_TURNS = ((0.6, 1.5), (0.35, 2.0))
"""Along curves knots are no farther apart than these angles (radian), if that is so many spacings."""
STRETCH_GAP = 3.0
"""Nodes farther apart than this many spacings belong to separate stretches of a bond."""


@dataclass(frozen=True)
class Bonds:
    """The bonded contacts ``pairings``, with the ``spans`` of their b nodes among those of all bonds.

    ``tractions`` (2b,) maps the unknowns of the other contacts, ``kept`` (u,) among all, to the bonds' own
    pressures and then tractions, ``own`` (2b,) among all. ``response`` (2b, 2b) maps gaps and slips of the
    bonds to the tractions that close them; ``effects`` (m + n + k, 2b) are the changes of gaps, slips and
    force imbalance by these.
    """

    pairings: tuple[Pairing, ...]
    spans: Mapping[str, slice]
    tractions: LinearMap
    kept: IntArray
    own: IntArray
    response: FloatArray
    effects: FloatArray

    @classmethod
    def none(cls) -> Bonds:
        """No bonds."""
        no, nothing = np.zeros(0, dtype=np.int64), np.zeros((0, 0))
        return cls((), {}, LinearMap.zeros(0, (0, 0, 0, 0)), no, no, nothing, nothing)

    def whole(self, unknowns: Sequence[FloatArray]) -> FloatArray:
        """The unknowns f, q, p, t extended to the pressures and tractions of all contacts."""
        if not self.pairings:
            return np.concatenate(unknowns)
        total = np.zeros(len(self.kept) + len(self.own))
        total[self.kept], total[self.own] = np.concatenate(unknowns), self.tractions(*unknowns)
        return total

    def values(self, name: str, unknowns: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
        """Pressures and tractions (m,) of one bond."""
        pressure, traction = np.split(self.tractions(*unknowns), 2)
        return pressure[self.spans[name]], traction[self.spans[name]]

    def opened(self, gaps: FloatArray, slips: FloatArray) -> Bonds:
        """Bonds that also close ``gaps`` (b,) and ``slips`` (b,), which arise from something else."""
        more = self.response @ np.concatenate([gaps, slips])
        return replace(self, tractions=self.tractions.shifted(more))

    def acting(self, linear: LinearMap) -> FloatArray:
        """Columns (r, 2b) of a map of all unknowns for the tractions of bonds."""
        if not self.pairings:
            return np.zeros((len(linear.constant), 0))
        return np.hstack(linear.parts[1:])[:, self.own]

    def reduced(self, linear: LinearMap) -> LinearMap:
        """A map of all unknowns as a map of those of the other contacts."""
        if not self.pairings:
            return linear
        rest = LinearMap.of_rows(np.hstack(linear.parts[1:])[:, self.kept], self.tractions.counts)
        return (rest + self.tractions.combined(self.acting(linear))).shifted(linear.constant)


def bind(scene: Scene, drivers: Drivers, gap: LinearMap, slip: LinearMap) -> Bonds:
    """Solve for the bonded tractions, from the candidates' gaps (m,) and slips (n,) of all contacts; initial
    gaps remain. Raises NumericalError if they are not determined."""
    bonded = tuple(pairing for pairing in drivers.pairings if pairing.bonded)
    if not bonded:
        return Bonds.none()
    loads, motions, pressures, tractions = drivers.counts
    each = (drivers.spans, drivers.tangential)
    gaps, slips = (np.concatenate([np.r_[ranges[one.name]] for one in bonded]) for ranges in each)
    own = loads + motions + np.append(gaps, pressures + slips)
    kept = np.setdiff1d(np.arange(sum(drivers.counts)), own)
    held = np.concatenate([np.hstack(one.parts[1:]) for one in (gap.take(gaps), slip.take(slips))])
    shapes = [_shapes(pairing, scene) for pairing in bonded]
    whole = sparse.block_diag([*shapes, *shapes]).toarray()
    weight = np.concatenate([pairing.weight[pairing.candidate] for pairing in bonded])
    means = (np.tile(weight, 2)[:, None] * whole).T
    matrix, known = means @ held[:, own] @ whole, means @ np.hstack([held[:, kept], np.eye(len(own))])
    tiny = np.finfo(float).tiny
    columns = 1.0 / np.maximum(np.abs(matrix).max(axis=0), tiny)
    rows = 1.0 / np.maximum(np.abs(matrix * columns).max(axis=1), tiny)
    scaled = rows[:, None] * (matrix * columns)
    if not np.linalg.cond(scaled, 1) < 1.0 / SINGULAR:
        raise NumericalError(
            f"the tractions of bonded contact {bonded[0].name} are not determined",
            f"use more similar spacings along {' and '.join(bonded[0].names)}",
        )
    solution = columns[:, None] * np.linalg.solve(scaled, rows[:, None] * known)
    # One step of iterative refinement.
    rest = rows[:, None] * (known - matrix @ solution)
    solved = -whole @ (solution + columns[:, None] * np.linalg.solve(scaled, rest))
    by_others, response = np.split(solved, [len(kept)], axis=1)
    others = LinearMap.of_rows(by_others, (loads, motions, pressures - len(gaps), tractions - len(slips)))
    ranges = spans([one.name for one in bonded], [one.count for one in bonded])
    return Bonds(bonded, ranges, others, kept, own, response, np.zeros((0, len(own))))


def _shapes(pairing: Pairing, scene: Scene) -> FloatArray:
    """Hat functions (m, c) between knots for a bond's pressures and tractions."""
    chosen = pairing.candidate
    assert pairing.master_body is not None, "nothing is bonded to an obstacle"
    facing = facing_spacing(pairing, scene.bodies[pairing.master_body].model.cloud)
    spacing = np.maximum(pairing.spacing[chosen], facing)
    arc = pairing.arc[chosen]
    angle = np.unwrap(np.arctan2(*pairing.slave.curve.normals(arc).T))
    if pairing.all_around:
        around = arc[0] + pairing.slave.curve.length
        closed = np.unwrap(np.append(angle, angle[0]))
        knots = _knots(np.append(arc, around), np.append(spacing, spacing[0]), closed, least=3)
        periodic = _hats(arc, knots)
        return np.column_stack([periodic[:, 0] + periodic[:, -1], periodic[:, 1:-1]])
    cuts = np.flatnonzero(np.diff(arc) > STRETCH_GAP * np.maximum(spacing[1:], spacing[:-1])) + 1
    parts = zip(*(np.split(one, cuts) for one in (arc, spacing, angle)), strict=True)
    hats = [_hats(own, _knots(own, *of_nodes)) for own, *of_nodes in parts]
    return np.asarray(sparse.block_diag(hats).toarray())


def _knots(arc: FloatArray, spacing: FloatArray, angle: FloatArray, least: int = 1) -> FloatArray:
    """Knots from the first to the last of nodes at ``arc`` (m,), with ``spacing`` and the ``angle`` of the
    normal (m,) there; ``least`` intervals between them."""
    if len(arc) == 1:
        return arc
    steps = 2.0 * np.diff(arc) / (spacing[1:] + spacing[:-1])
    shares = steps / KNOT_SPACING
    for turn, least_steps in KNOT_TURNS:
        shares = np.maximum(shares, np.minimum(np.abs(np.diff(angle)) / turn, steps / least_steps))
    share = np.concatenate([[0.0], np.cumsum(shares)])
    count = max(least, int(share[-1] + ROUND_OFF))
    return np.asarray(np.interp(np.linspace(0.0, share[-1], count + 1), share, arc))


def _hats(arc: FloatArray, knots: FloatArray) -> FloatArray:
    """Values (m, c) at ``arc`` (m,) of the hat functions on ``knots`` (c,)."""
    return np.stack([np.interp(arc, knots, unit) for unit in np.eye(len(knots))], axis=1)
