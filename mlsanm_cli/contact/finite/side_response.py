"""Near-field correction of the response of sides to their own tractions.

For the undeformed body the displacements K of a side's nodes due to unit tractions there, linear between
nodes, are computed as for contact grids: closed-form near fields and a smooth remainder
(:mod:`mlsanm_cli.mechanics.remainder`). The cloud alone responds with C. The change of the response with the
state is smooth and represented by local fits F along the side::

    displacement of the side = F u + Q (K - F C) Q^T T

with the cloud's displacements u and the nodes' rotations Q. Short waves of tractions T thus do not depend on
the cloud, and small loads give the small-strain response.

Equation (25) of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
import scipy.sparse as sparse
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.contact.finite.meeting import vectors_along
from mlsanm_cli.contact.finite.near_field import exact_compliance
from mlsanm_cli.contact.finite.sides import ContactSide
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.projector import Projector
from mlsanm_cli.mechanics.finite.tangent import load_columns
from mlsanm_cli.mechanics.near_field import ComplexArray
from mlsanm_cli.mechanics.rigid import free_motions
from mlsanm_cli.records import dataclass

CORNER_NODES = 2
"""Up to this many nodes from corners without near field no correction is made, from twice as many on the full
one."""
HALF_WINDOW = 4
"""Half-width of the fits' windows, in nodes: they suppress waves shorter than about six nodes."""
DEEP = 0.5
"""Nodes at this part of the largest depth are far from all sides."""


Correction: TypeAlias = tuple[FloatArray, FloatArray]
"""Correction for a side's c nodes, x and y in turn: fit F (2c, 2c) and K - F C (2c, 2c)."""


def side_correction(
    side: ContactSide, projector: Projector, first: int, center: complex | None
) -> Correction:
    """From a body's equations in the undeformed state, whose loads from number ``first`` on are the unit
    tractions; in hollows near fields end at a ``center``."""
    body = projector.body.elastic
    share = np.where(np.isin(side.nodes, [node for node, _ in body.held_nodes]), 0.0, _share(side))
    still, none = np.zeros(body.model.unknowns), np.zeros(projector.body.loads.count)
    columns = load_columns(projector.body, still, none, slice(first, first + 2 * side.count))
    moved = -projector.factorised(still, none).solve_unrefined(projector.scaled(columns.toarray()))
    both = np.repeat(share, 2)
    fit = np.diag(1.0 - both) + both[:, None] * _fit(side)
    fitted = fit @ moved[(2 * side.nodes[:, None] + np.arange(2)).ravel()]
    deep, free = _deep(projector.body)
    exact, inside = exact_compliance(side, body, center, np.flatnonzero(share), deep)
    # The motion of a loose body on the whole is that of the cloud.
    apart = inside - moved[(2 * deep[:, None] + np.arange(2)).ravel()]
    offset = free(side.places) @ np.linalg.lstsq(free(body.model.cloud.points[deep]), apart)[0]
    return fit, _uneven(side, both[:, None] * (exact - fitted - offset) * both, share)


def no_correction(side: ContactSide) -> Correction:
    """Where no near field is known."""
    return np.eye(2 * side.count), np.zeros((2 * side.count,) * 2)


@dataclass(frozen=True)
class SideResponse:
    """Displacements (2s,) of sides in a state: ``smooth`` (2s, 2s) applied to the cloud's, plus
    ``by_traction`` (2s, 2s), which changes with the former by ``by_turning`` (2s, 2s)."""

    smooth: sparse.csr_array
    by_traction: FloatArray
    by_turning: FloatArray

    @classmethod
    def of(
        cls,
        sides: Sequence[tuple[ContactSide, slice]],
        corrections: Sequence[Correction],
        displacement: FloatArray,
        traction: FloatArray,
    ) -> SideResponse:
        """From the sides and their ranges, their corrections, the cloud's ``displacement`` (2s,) of their
        nodes, and their ``traction``."""
        fits = [fit for fit, _ in corrections] or [np.zeros((0, 0))]
        smooth = sparse.csr_array(sparse.block_diag(fits, format="csr"))
        surface = smooth @ displacement
        by_traction, by_turning = (np.zeros((len(surface),) * 2) for _ in range(2))
        for (side, here), (_, missing) in zip(sides, corrections, strict=True):
            turn, angles = side.turned(surface[here].reshape(-1, 2))
            whole = by_traction[here, here] = _turned(missing, turn)
            own, pulled = (_across(one) for one in (whole @ traction[here], traction[here]))
            by_turning[here, here] = (own - whole @ pulled) @ angles
        return cls(smooth, by_traction, by_turning)

    def moved(self, displacement: FloatArray, traction: FloatArray) -> FloatArray:
        """Displacements (2s,) of the sides."""
        return np.asarray(self.smooth @ displacement + self.by_traction @ traction)

    def changed(self, displacement: FloatArray) -> FloatArray:
        """Derivative of these, applied to changes (2s, ...) of the cloud's displacements."""
        smooth = self.smooth @ displacement
        return np.asarray(smooth + self.by_turning @ smooth)


def _deep(body: FiniteBody) -> tuple[IntArray, Callable[[FloatArray], FloatArray]]:
    """Nodes (m,) of a loose body far from its sides, at which it moves on the whole, and its free motions
    (2n, d) of places (n, 2); none of others.

    What clouds answer is seen from pins, and there it is as wrong as next to the sides: as a motion of one
    side against all others that would be a spring.
    """
    elastic = body.elastic
    cloud, bearing = elastic.model.cloud, elastic.held_nodes[: len(elastic.held_nodes) - body.pins]
    free = free_motions(cloud, elastic.held, bearing, elastic.springs)
    if not body.pins:
        return np.zeros(0, dtype=np.int64), lambda places: np.zeros((2 * len(places), 0))
    outer = np.concatenate([surface.index for surface in cloud.surfaces.values()])
    depth = nearest(cKDTree(cloud.points[outer]), cloud.points)[0]
    return np.flatnonzero(depth >= DEEP * depth.max()), free.patterns


def _turned(part: FloatArray, turn: ComplexArray) -> FloatArray:
    rotation = np.array([[turn.real, -turn.imag], [turn.imag, turn.real]]).transpose(2, 0, 1)
    count = len(turn)
    found = np.einsum(
        "iab,ibjc,jdc->iajd", rotation, part.reshape(count, 2, count, 2), rotation, optimize=True
    )
    return np.asarray(found.reshape(2 * count, 2 * count))


def _across(values: FloatArray) -> sparse.csr_array:
    """Derivative (2c, c) of vectors (2c,) by their rotation angles."""
    return vectors_along(np.stack([-values[1::2], values[::2]], axis=1))


def _uneven(side: ContactSide, missing: FloatArray, share: FloatArray) -> FloatArray:
    """Part of the correction ``missing`` (2c, 2c) for non-uniform tractions: the cloud responds exactly to a
    uniform one. Where the ``share`` (c,) is below 1, near corners, only some neighbours count, and terms that
    cancel elsewhere would remain: there it acts on differences from the node's own traction."""
    count, number = side.count, np.arange(side.count)
    blocks = missing.reshape(count, 2, count, 2).copy()
    near = np.abs(number[:, None] - number) <= 3 * HALF_WINDOW
    blocks[number, :, number] -= np.einsum("ibjd,ij->ibd", blocks, (1.0 - share)[:, None] * near)
    blocks -= blocks.sum(axis=2)[:, :, None] * (side.weight / side.weight.sum())[:, None]
    return blocks.reshape(missing.shape)


def _fit(side: ContactSide) -> FloatArray:
    """Local cubic fits along the side at its nodes (2c, 2c), continued behind planes of symmetry."""
    count, number = side.count, np.arange(side.count)
    copies = [(side.arc, number, np.ones(2))]
    if side.around is not None:
        copies += [(side.arc + turn, number, np.ones(2)) for turn in (-side.around, side.around)]
    for end, axis in enumerate(side.mirrors):
        if axis is not None:
            behind = np.delete(number, -end)
            copies.append((2.0 * side.arc[-end] - side.arc[behind], behind, 1.0 - 2.0 * np.eye(2)[axis]))
    arc, node = (np.concatenate(one) for one in list(zip(*copies, strict=True))[:2])
    sign = np.concatenate([np.tile(one, (len(nodes), 1)) for _, nodes, one in copies])
    order = np.argsort(arc)
    arc, node, sign, own = arc[order], node[order], sign[order], np.argsort(order)
    fit = np.zeros((count, 2, count, 2))
    for i in number:
        here = int(own[i])
        low, high = max(0, here - 3 * HALF_WINDOW), min(len(arc), here + 3 * HALF_WINDOW + 1)
        x, away = arc[low:high] - side.arc[i], np.arange(low, high) - here
        weight = np.exp(-((away / HALF_WINDOW) ** 2.0))
        basis = (x / np.abs(x).max())[:, None] ** np.arange(min(4, len(x)))
        values = np.linalg.solve(basis.T @ (weight[:, None] * basis), basis.T * weight)[0]
        for c in (0, 1):
            np.add.at(fit[i, c, :, c], node[low:high], values * sign[low:high, c])
    return fit.reshape(2 * count, 2 * count)


def _share(side: ContactSide) -> FloatArray:
    """Fraction (c,) of the correction: zero at held nodes, except on planes of symmetry, and near corners
    without near field."""
    number = np.arange(side.count)
    ends = (0, side.count - 1)
    mirrored = {end for end, axis in zip(ends, side.mirrors, strict=True) if axis is not None}
    known = {end for end, one in zip(ends, side.wedges, strict=True) if one is not None}
    away = np.full(side.count, np.inf)
    for corner in side.corners:
        if corner not in mirrored | known:
            apart = np.abs(number - corner)
            apart = apart if side.around is None else np.minimum(apart, side.count - apart)
            away = np.minimum(away, apart)
    held = side.held & ~np.isin(number, list(mirrored))
    return np.where(held, 0.0, np.clip(away / CORNER_NODES - 1.0, 0.0, 1.0))
