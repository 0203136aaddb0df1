"""Contacts with pressures at the nodes of the slave, whose forces act at the closest points of the master,
and a correction of short-wave tractions and slips, which least squares do not resolve."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cells import GAUSS, Halves
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.geometry.pairing import Pairing, facing_parts, opposed
from mlsanm_cli.contact.response.compressed import LinearMap
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.pieces import turned_along
from mlsanm_cli.operators.stencil_weights import nodal_pairs
from mlsanm_cli.roundoff import FINE_ROUND_OFF

if TYPE_CHECKING:
    from mlsanm_cli.contact.response.basis import Drivers

FIXED_POINT_STEPS = 8
"""Steps to a point of the slave, whose errors fall by the product of gap and curvature in each."""
FIT_WINDOW, WINDOW_SHARPNESS = 6.0, 4.0
"""Half-width of the windows of local fits in spacings, and s in their weights exp(-2 s r^2) at a fraction r:
linear functions are unaffected."""
ALTERNATING_COMPLIANCE = 3.0 / np.pi
"""Compliance times E*/h for a traction of alternating sign from node to node.

A traction cos(k x) displaces the surface of a half-plane by 2/(E* k) cos(k x), and k = pi/h gives 2/pi; the
measured additional half compensates for slightly longer waves."""


class NodalBasis:
    """The discretisation of a contact by the candidates' pressures and, with friction, tractions, which are
    the drivers; the samples are these nodes' own gaps and slips."""

    def __init__(self, pairing: Pairing) -> None:
        self._pairing, self._count = pairing, pairing.count
        self.drivers = self.samples = pairing.count * (2 if pairing.friction else 1)

    def by_values(self, which: int) -> sparse.csr_array:
        return sparse.csr_array(sparse.eye_array(self.drivers, self._count, k=-which * self._count))

    def means(self, which: int) -> sparse.csr_array:
        return sparse.csr_array(self.by_values(which).T)

    def both_rows(self, body: ElasticBody, name: str) -> list[sparse.csr_array]:
        """Changes of gaps, and slips (m, 2N), by displacements of body ``name``."""
        at, pairing = np.flatnonzero(self._pairing.candidate), self._pairing
        return [relative_rows(body, name, pairing, one, at) for one in (pairing.normal, pairing.tangent)]

    def rows(self, body: ElasticBody, name: str, lost: bool = False) -> sparse.csr_array:
        both = self.both_rows(body, name)[: 2 if self._pairing.friction else 1]
        return sparse.csr_array(sparse.vstack(both) * (not lost))

    def sources(self, body: ElasticBody, name: str, centred: bool) -> sparse.csc_array:
        pairing, blocks = self._pairing, []
        for tangential in (False, True)[: 2 if pairing.friction else 1]:
            source = sparse.csc_array((body.rows, self._count))
            if pairing.slave_body == name:
                chosen = np.flatnonzero(pairing.candidate)
                normal = pairing.normal[chosen]
                along = pairing.tangent[chosen] if tangential else normal
                for part, own, on in facing_parts(pairing.slave, pairing.position[chosen], normal):
                    for component in (0, 1):
                        rows = body.condition_rows(part.name, component)[own]
                        entries = along[on, component], (rows, on)
                        source = source + sparse.csc_array(entries, shape=source.shape)
            if pairing.master is not None and pairing.master_body == name:
                source = source + _on_master(body, pairing, pairing.master, tangential)
            blocks.append(source)
        return sparse.csc_array(sparse.hstack(blocks))

    def resultants(self, body: ElasticBody, name: str, sources: sparse.csc_array) -> list[FloatArray]:
        whole: FloatArray = (body.resultants() @ sources).toarray()
        return np.split(whole, self.drivers // max(self._count, 1), axis=1)


def relative_rows(
    body: ElasticBody, name: str, pairing: Pairing, direction: FloatArray, at: IntArray
) -> sparse.csr_array:
    """Motion (w, 2N) of the slave relative to the master along ``direction`` at the points ``at`` (w,): of a
    node, and of the moving least-squares value at the closest point."""
    nodes = len(body.model.cloud.points)
    block = sparse.csr_array((len(at), 2 * nodes))
    if len(at) and pairing.slave_body == name:
        block = block + nodal_pairs(pairing.node[at], direction[at], nodes)
    if len(at) and pairing.master_body == name:
        block = block - body.model.values_along(pairing.partner[at], direction[at])
    return sparse.csr_array(block)


def _on_master(body: ElasticBody, pairing: Pairing, master: Surface, tangential: bool) -> sparse.csc_array:
    """Reaction on the master to unit pressures, or tractions, on the slave (r, m): forces at the closest
    points, on the pieces, and their averages over the lengths of the nodes as tractions. Integrated between
    slave nodes and ends of the master's cells, exact for linear pressures."""
    slave, pieces, count, around = pairing.slave, body.pieces, pairing.count, body.model.cloud.around
    place = np.full(len(slave.index), -1, dtype=np.int64)
    place[pairing.position[pairing.candidate]] = np.arange(count)
    direction = (pairing.tangent if tangential else pairing.normal)[pairing.candidate]
    nodes = slave.arc_length
    ends = np.append(nodes, slave.curve.length) if slave.curve.closed else nodes
    middles = 0.5 * (master.arc_length[1:] + master.arc_length[:-1])
    if master.curve.closed:
        middles = np.append(middles, 0.5 * (master.arc_length[-1] + master.curve.length))
    cuts = np.unique(np.clip(np.concatenate([ends, _opposite(slave, master, middles)]), ends[0], ends[-1]))
    arc = master.curve.closest(slave.curve.points(0.5 * (cuts[1:] + cuts[:-1])))
    # Beyond the last middle of a closed surface the first node is nearest.
    owner = np.searchsorted(middles, arc) % len(master.index)
    first = np.searchsorted(ends, 0.5 * (cuts[1:] + cuts[:-1])) - 1
    loads = sparse.csr_array((3 * pieces.count, count))
    felt = []
    for at, weight in GAUSS[2]:
        s = cuts[:-1] + at * np.diff(cuts)
        normal, own = slave.curve.normals(s), slave.curve.points(s)
        points, circle = master.curve.points(master.curve.closest(own)), around(own)
        share = (s - ends[first]) / (ends[first + 1] - ends[first])
        faces = opposed(pairing, s)
        for end, who, part in ((0, first, 1.0 - share), (1, (first + 1) % len(nodes), share)):
            on = np.flatnonzero((place[who] >= 0) & faces)
            turn = turned_along(slave.end_normals[first[on], end], normal[on])
            along = (turn @ direction[place[who[on]], :, None])[:, :, 0]
            force = -(circle * weight * np.diff(cuts) * part)[on, None] * along
            column = place[who[on]]
            loads = loads + pieces.per_column(master.index[owner[on]], points[on], force, column, count)
            felt.append((owner[on], column, force, arc[on]))
    node, column, force, arc = (np.concatenate(some) for some in zip(*felt, strict=True))
    source = sparse.csc_array((body.rows, count))
    for part, members in master.members:
        numbers = np.full(len(master.index), -1, dtype=np.int64)
        numbers[members] = np.arange(len(members))
        on = numbers[node] >= 0
        if master.parts:
            s = master.arc_length[members]
            on &= (arc >= s.min()) & (arc <= s.max())
        where = numbers[node[on]]
        # Circles have no length at a node on an axis of revolution, the part of the surface at it has.
        halves = Halves.of(part)
        lengths = halves.length * around(part.curve.points(halves.arc))
        size = np.bincount(halves.own, lengths, len(part.index))[where]
        for component in (0, 1):
            rows = body.condition_rows(part.name, component)[where]
            entries = force[on, component] / size, (rows, column[on])
            source = source + sparse.csc_array(entries, shape=source.shape)
    missing = loads - body.loads @ source
    nodal = sparse.csc_array((body.rows - missing.shape[0], missing.shape[1]))
    return sparse.csc_array(source + sparse.vstack([nodal, missing], format="csc"))


def _opposite(slave: Surface, master: Surface, arc: FloatArray) -> FloatArray:
    """Arc lengths (b,) on the slave of the points whose closest points on the master are at ``arc`` (b,)."""
    s = slave.curve.closest(master.curve.points(arc))
    for _ in range(FIXED_POINT_STEPS):
        off = master.curve.closest(slave.curve.points(s)) - arc
        if master.curve.closed:
            off -= master.curve.length * np.round(off / master.curve.length)
        # The curves run in opposite directions, each with its material on the left.
        s, whole = s + off, slave.curve.length
        s = np.mod(s, whole) if slave.curve.closed else np.clip(s, 0.0, whole)
    return s


def correct_short_waves(
    gap: LinearMap, slip: LinearMap, drivers: Drivers, half_planes: Mapping[str, FloatArray]
) -> tuple[LinearMap, LinearMap, sparse.csr_array]:
    """Gaps (m,) and slips (n,) of all frictional contacts with short waves approximately as on a half-plane,
    with 1/E* (m, 2, 2) at the nodes of every contact, and what of them displacements do not cause (m + n, m +
    n).

    Let F be a local linear fit along the surface. Slips due to anything but the contact's own tractions are
    smooth; their short waves come from the clouds' irregularity, and they become F s. Least squares respond
    less to a traction t the shorter its waves: its deviation from the fit gets the compliance 3 h/(pi E*) (t
    - F t) in addition. Without this, tractions of sticking nodes oscillate from node to node. With G t the
    linear function closest to t over the whole contact, slips due to G t are fitted like the others, so that
    a patch under uniform stress stays exact. On a closed surface F continues across the seam and G t is
    constant.

    Gaps depend on F t only, and slips due to pressures on F p only: with short waves of t in the gaps but not
    of p in the slips, the compliance loses its positivity for spacings that grow along the contact. On bodies
    of revolution short waves only get their compliance: fits of one of two coupled responses would cost
    flexible rings their positivity.
    """
    m, n = len(gap.constant), len(slip.constant)
    pairings = [one for one in drivers.frictional if one.nodal and not one.bonded]
    if not pairings:
        return gap, slip, sparse.csr_array((m + n, m + n))
    gap, slip = gap.take(np.arange(m)), slip.take(np.arange(n))
    beyond = np.zeros((m + n, m + n))
    by_pressure, by_traction = beyond[:, :m], beyond[:, m:]
    for pairing in pairings:
        own, facing = drivers.tangential[pairing.name], drivers.spans[pairing.name]
        fit = slip_fit(pairing)
        short = np.eye(len(fit)) - fit
        along = half_planes[pairing.name][:, 1, 1]
        shortest = ALTERNATING_COMPLIANCE * along * pairing.spacing[pairing.candidate]
        if pairing.revolved:
            by_traction[m:][own, own] = shortest[:, None] * short
            slip.traction[own, own] += by_traction[m:][own, own]
            continue
        by_traction[:m, own] = -gap.traction[:, own] @ short
        gap.traction[:, own] += by_traction[:m, own]
        compliance = slip.traction[own, own].copy()
        for array in slip.parts:
            array[own] = fit @ array[own]
        by_pressure[m:][own, facing] = -slip.pressure[own, facing] @ short
        slip.pressure[own, facing] += by_pressure[m:][own, facing]
        arc, weight = pairing.arc[pairing.candidate], pairing.weight[pairing.candidate, None]
        basis = np.stack([np.ones(len(arc)), arc - arc.mean()], axis=1)
        basis = basis[:, : min(1 if pairing.all_around else 2, len(arc))]
        linear = basis @ np.linalg.solve(basis.T @ (weight * basis), (weight * basis).T)
        by_own = compliance - short @ compliance @ linear
        slip.traction[own, own] = by_own + shortest[:, None] * short
        by_traction[m:][own, own] = slip.traction[own, own] - fit @ compliance
    return gap, slip, sparse.csr_array(beyond)


def slip_fit(pairing: Pairing) -> FloatArray:
    """The local linear fit F (n, n) of nodal values along a contact, across the seam of a closed surface."""
    chosen, turns = pairing.candidate, np.zeros(1)
    arc, weight, reach = pairing.arc[chosen], pairing.weight[chosen], FIT_WINDOW * pairing.spacing[chosen]
    if pairing.all_around:
        turns = pairing.slave.curve.length * np.arange(-1.0, 2.0)
    offset = (turns[:, None, None] + arc - arc[:, None]) / reach[:, None]
    share = np.where(np.abs(offset) <= 1.0, np.exp(-2.0 * WINDOW_SHARPNESS * offset**2) * weight, 0.0)
    s0, s1, s2 = ((share * offset**k).sum(axis=(0, 2))[:, None] for k in range(3))
    # A window with a single node can only carry its constant.
    slope, both = s0 * s2 - s1**2 > FINE_ROUND_OFF * s0**2, s0 * s2 - s1**2
    fit = np.where(slope, (s2 - s1 * offset) / np.where(slope, both, 1.0), 1.0 / s0)
    return np.asarray((share * fit).sum(axis=0))
