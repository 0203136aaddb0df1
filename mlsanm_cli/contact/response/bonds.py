"""Bonded surfaces: their tractions are eliminated as linear functions of the other unknowns.

Bonded surfaces neither separate nor slide: their tractions cancel the relative motion caused by loads f,
motions q, pressures p and tractions t of the other contacts.

Least squares respond less to tractions the shorter their waves, and tractions are singular at the ends of
bonds. They are therefore linear between knots KNOT_SPACING spacings apart, and displacements averaged with
the same hat functions agree on both sides (mortar method). With a knot at every node tractions oscillate; the
correction used for friction (:mod:`mlsanm_cli.contact.response.short_waves`) would soften the bond.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.geometry.pairing import Pairing, facing_spacing
from mlsanm_cli.contact.response.dense import DenseSystem, SingularSystemError
from mlsanm_cli.contact.response.drivers import Drivers
from mlsanm_cli.contact.response.linear_map import Columns, LinearMap
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
    """The bonded contacts ``pairings``, with the ``spans`` of their nodes among those of all bonds.

    ``pressure`` and ``traction`` (b,) are maps from the unknowns of the other contacts, which ``free`` (m,)
    marks among all pressures and ``sliding`` (n,) among all tractions. ``response`` (2b, 2b) maps gaps and
    slips of the bonds to the pressures and tractions that close them.
    """

    pairings: tuple[Pairing, ...]
    spans: Mapping[str, slice]
    pressure: LinearMap
    traction: LinearMap
    free: BoolArray
    sliding: BoolArray
    response: FloatArray

    @classmethod
    def none(cls) -> Bonds:
        """No bonds."""
        nothing, no = Columns(0, 0, 0).zeros(0), np.zeros(0, dtype=bool)
        return cls((), {}, nothing, nothing, no, no, np.zeros((0, 0)))

    def whole(self, unknowns: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """The unknowns f, q, p, t extended to the pressures and tractions of all contacts."""
        f, q, p, t = unknowns
        if not self.pairings:
            return f, q, p, t
        pressure, traction = np.zeros(len(self.free)), np.zeros(len(self.sliding))
        pressure[self.free], traction[self.sliding] = p, t
        pressure[~self.free], traction[~self.sliding] = self.pressure(f, q, p, t), self.traction(f, q, p, t)
        return f, q, pressure, traction

    def values(self, name: str, unknowns: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
        """Pressures and tractions (m,) of one bond."""
        own = self.spans[name]
        return self.pressure.take(own)(*unknowns), self.traction.take(own)(*unknowns)

    def opened(self, gaps: FloatArray, slips: FloatArray) -> Bonds:
        """Bonds that also close ``gaps`` (b,) and ``slips`` (b,), which arise from something else."""
        more = np.split(self.response @ np.concatenate([gaps, slips]), 2)
        maps = zip((self.pressure, self.traction), more, strict=True)
        pressure, traction = (replace(one, constant=one.constant + by) for one, by in maps)
        return replace(self, pressure=pressure, traction=traction)

    def acting(self, linear: LinearMap) -> FloatArray:
        """Columns (r, 2b) of a map of all unknowns for the pressures and tractions of bonds."""
        if not self.pairings:
            return np.zeros((len(linear.constant), 0))
        return np.hstack([linear.pressure[:, ~self.free], linear.traction[:, ~self.sliding]])

    def reduced(self, linear: LinearMap) -> LinearMap:
        """A map of all unknowns as a map of those of the other contacts."""
        if not self.pairings:
            return linear
        pressure, traction = linear.pressure[:, ~self.free], linear.traction[:, ~self.sliding]
        own = self.pressure.combined(pressure) + self.traction.combined(traction)
        kept = linear.pressure[:, self.free], linear.traction[:, self.sliding]
        return own + replace(linear, pressure=kept[0], traction=kept[1])


def bind(
    scene: Scene, pairings: tuple[Pairing, ...], drivers: Drivers, gap: LinearMap, slip: LinearMap
) -> Bonds:
    """Solve for the bonded tractions, from the candidates' gaps (m,) and slips (n,) of all ``pairings``.

    Initial gaps remain. Raises NumericalError if the tractions are not determined.
    """
    bonded = tuple(pairing for pairing in pairings if pairing.bonded)
    if not bonded:
        return Bonds.none()
    free, sliding = np.ones(len(gap.constant), dtype=bool), np.ones(len(slip.constant), dtype=bool)
    spans, first = {}, 0
    for pairing in bonded:
        own = drivers.spans[pairing.name]
        free[own], sliding[drivers.tangential[pairing.name]] = False, False
        spans[pairing.name] = slice(first, first + own.stop - own.start)
        first += own.stop - own.start
    held = [gap.take(~free), slip.take(~sliding)]
    matrix = np.concatenate([np.hstack([one.pressure[:, ~free], one.traction[:, ~sliding]]) for one in held])
    rest = [
        np.hstack([one.load, one.motion, one.pressure[:, free], one.traction[:, sliding]]) for one in held
    ]
    shapes = [_shapes(pairing, scene) for pairing in bonded]
    whole = sparse.block_diag([*shapes, *shapes]).toarray()
    weight = np.concatenate([pairing.weight[pairing.candidate] for pairing in bonded])
    means = (np.tile(weight, 2)[:, None] * whole).T
    try:
        system = DenseSystem(means @ matrix @ whole, whole.shape[1])
        known = np.hstack([np.concatenate(rest), np.eye(2 * first)])
        solved = -whole @ system.solve(means @ known)
    except SingularSystemError as error:
        raise NumericalError(
            f"the tractions of bonded contact {bonded[0].name} are not determined",
            f"use more similar spacings along {' and '.join(bonded[0].names)}",
        ) from error
    ends = np.cumsum([gap.load.shape[1], gap.motion.shape[1], int(free.sum()), int(sliding.sum())])
    *parts, response = np.split(solved, ends, axis=1)
    halves = zip(*(np.split(part, 2) for part in parts), strict=True)
    maps = [LinearMap(np.zeros(first), *half) for half in halves]
    return Bonds(bonded, spans, maps[0], maps[1], free, sliding, response)


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
