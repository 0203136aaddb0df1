"""Contacts with pressures at the nodes of the slave, which the master receives by transfer: local fits along
surfaces."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cells import GAUSS
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.joined import normals_towards
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.geometry.facing import turned
from mlsanm_cli.contact.geometry.pairing import MAX_FACING_COSINE, Pairing, facing_parts, opposed
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.pieces import turned_along
from mlsanm_cli.operators.stencil_weights import nodal_pairs
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, FINE_ROUND_OFF

WINDOW = 2.0
"""Half-width of the transfer window, in spacings."""
NEWTON_STEPS = 5
"""Newton steps to a point of the slave: quadratic convergence from an error of the order of the gap."""
WINDOW_SHARPNESS = 4.0
"""Squared residuals in the window are weighted by exp(-2 WINDOW_SHARPNESS r^2)."""


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
                along, normal = (
                    (pairing.tangent if tangential else pairing.normal)[chosen],
                    pairing.normal[chosen],
                )
                for part, own, on in facing_parts(pairing.slave, pairing.position[chosen], normal):
                    for component in (0, 1):
                        rows = body.condition_rows(part.name, component)[own]
                        entries = along[on, component], (rows, on)
                        source = source + sparse.csc_array(entries, shape=source.shape)
            if pairing.master is not None and pairing.master_body == name:
                source = source + _on_master(body, pairing, pairing.master, tangential)
            blocks.append(source)
        return sparse.csc_array(sparse.hstack(blocks))

    def resultants(
        self, body: ElasticBody, name: str, sources: sparse.csc_array, center: tuple[float, float]
    ) -> list[FloatArray]:
        whole: FloatArray = (body.resultants(center) @ sources).toarray()
        return np.split(whole, self.drivers // max(self._count, 1), axis=1)


def relative_rows(
    body: ElasticBody, name: str, pairing: Pairing, direction: FloatArray, at: IntArray
) -> sparse.csr_array:
    """Motion (w, 2N) of the slave relative to the master along ``direction``, at the points of indices
    ``at`` (w,). The slave moves with its node, the master by its moving least-squares value at the closest
    point."""
    nodes = len(body.model.cloud.points)
    block = sparse.csr_array((len(at), 2 * nodes))
    if len(at) and pairing.slave_body == name:
        block = block + nodal_pairs(pairing.node[at], direction[at], nodes)
    if len(at) and pairing.master_body == name:
        block = block - body.model.values_along(pairing.partner[at], direction[at])
    return sparse.csr_array(block)


def _on_master(body: ElasticBody, pairing: Pairing, master: Surface, tangential: bool) -> sparse.csc_array:
    """Reaction on the master to unit tractions on the slave along its normals or tangents: nodal tractions by
    transfer, and on the pieces exactly the opposite of the slave's forces."""
    shares = transfer(pairing, body.model.cloud)
    source = sparse.csc_array((body.rows, shares.shape[1]))
    # At a corner between two parts only those that face the slave receive its pressures.
    towards = slave_normals(pairing, feet(pairing, master, master.arc_length)[0]) if master.parts else None
    for part, place in master.members:
        faces = np.ones(len(place), dtype=bool)
        if towards is not None:
            faces = (part.normal * towards[place]).sum(axis=1) < MAX_FACING_COSINE
        some = (sparse.diags_array(faces.astype(float)) @ shares[place]).tocoo()
        rows, columns = some.coords
        # The reaction to p n is -p n, with n replaced by the master's own normal; likewise for the tangent.
        own = turned(part.normal) if tangential else part.normal
        for component in (0, 1):
            lines = body.condition_rows(part.name, component)[rows]
            values = -some.data * own[rows, component]
            source = source + sparse.csc_array((values, (lines, columns)), shape=source.shape)
    missing = _on_pieces(body, pairing, master, tangential) - body.loads @ source
    nodal = sparse.csc_array((body.rows - missing.shape[0], missing.shape[1]))
    return sparse.csc_array(source + sparse.vstack([nodal, missing], format="csc"))


def _on_pieces(body: ElasticBody, pairing: Pairing, master: Surface, tangential: bool) -> sparse.csr_array:
    """Force and moment (3k, m) on the master's pieces by minus unit pressures, or tractions, of the slave,
    acting at the master's closest points. Integrated between neighbouring slave nodes and ends of the
    master's cells, exact for linear pressures."""
    slave, pieces, count = pairing.slave, body.pieces, pairing.count
    place = np.full(len(slave.index), -1, dtype=np.int64)
    place[pairing.position[pairing.candidate]] = np.arange(count)
    direction = (pairing.tangent if tangential else pairing.normal)[pairing.candidate]
    nodes = slave.arc_length
    ends = np.append(nodes, slave.curve.length) if slave.curve.closed else nodes
    middles = 0.5 * (master.arc_length[1:] + master.arc_length[:-1])
    if master.curve.closed:
        middles = np.append(middles, 0.5 * (master.arc_length[-1] + master.curve.length))
    cuts = np.unique(np.clip(np.concatenate([ends, feet(pairing, master, middles)[0]]), ends[0], ends[-1]))
    arc = master.curve.closest(slave.curve.points(0.5 * (cuts[1:] + cuts[:-1])))
    nearest = np.searchsorted(middles, arc)
    # Beyond the last middle of a closed surface the first node is nearest.
    owner = master.index[nearest % len(master.index)]
    first = np.searchsorted(ends, 0.5 * (cuts[1:] + cuts[:-1])) - 1
    total = sparse.csr_array((3 * pieces.count, count))
    for at, weight in GAUSS[2]:
        s = cuts[:-1] + at * np.diff(cuts)
        normal, own = slave.curve.normals(s), slave.curve.points(s)
        points, circle = master.curve.points(master.curve.closest(own)), body.model.cloud.around(own)
        share = (s - ends[first]) / (ends[first + 1] - ends[first])
        faces = opposed(pairing, s)
        for end, who, part in ((0, first, 1.0 - share), (1, (first + 1) % len(nodes), share)):
            on = np.flatnonzero((place[who] >= 0) & faces)
            turn = turned_along(slave.end_normals[first[on], end], normal[on])
            along = (turn @ direction[place[who[on]], :, None])[:, :, 0]
            force = -(circle * weight * np.diff(cuts) * part)[on, None] * along
            total = total + pieces.per_column(owner[on], points[on], force, place[who[on]], count)
    return sparse.csr_array(total)


def transfer(pairing: Pairing, master_cloud: Cloud) -> sparse.csr_array:
    """Matrix (b, m) from the candidates' pressures to those at the master's surface nodes.

    One-dimensional moving least squares of degree 1 along the slave, times the slave's length per length of
    the master: a constant pressure is reproduced where surfaces touch. Nodes outside the candidates' range
    receive none. The window fits the coarser spacing: a coarse master that only samples a fine slave's
    pressures would see a smooth load as an oscillation, and the compliance would lose its positivity. A
    pressure acts at the very point where its node's gap is measured, so that forces and work agree on both
    sides up to the fit.
    """
    master = pairing.master
    assert master is not None, "an obstacle has no nodes"
    arc, _, spacing = _unrolled(pairing)
    s, offset, stretch = feet(pairing, master, master.arc_length)
    slack = COARSE_ROUND_OFF * float(pairing.spacing.min())
    facing = (slave_normals(pairing, s) * master.normal).sum(axis=1) < MAX_FACING_COSINE
    if pairing.slave.curve.closed:
        s = np.where(s < pairing.arc[0] - slack, s + pairing.slave.curve.length, s)
    rows = np.flatnonzero(facing & (s >= arc[0] - slack) & (s <= arc[-1] + slack) & (offset <= slack))
    own = np.interp(s[rows], arc, spacing)
    # The slack keeps nodes at the edge of the window inside, independent of round-off and units.
    reach = (1.0 + COARSE_ROUND_OFF) * WINDOW * np.maximum(own, master_cloud.spacing[master.index[rows]])
    fit = candidates_fit(pairing, s[rows], reach).tocoo()
    inner, columns = fit.coords
    carried = fit.data * stretch[rows[inner]]
    return sparse.csr_array((carried, (rows[inner], columns)), shape=(len(s), fit.shape[1]))


def feet(pairing: Pairing, master: Surface, arc: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sources on the slave of the pressures at ``arc`` (b,) along the master: arc lengths (b,), distances
    (b,) by which they miss, and the slave's length per length of the master (b,). The given point is the
    closest one to its source, which Newton's method finds from the slave's closest point."""
    slave, points = pairing.slave.curve, master.curve.points(arc)
    s = slave.closest(points)
    normal = normals_towards(master.curve, arc, slave.normals(s))
    curvature = master.curve.curvature(arc)
    for _ in range(NEWTON_STEPS):
        off = master.curve.closest(slave.points(s)) - arc
        if master.curve.closed:
            off -= master.curve.length * np.round(off / master.curve.length)
        cosine = -(slave_normals(pairing, s) * normal).sum(axis=1)
        gap = ((slave.points(s) - points) * normal).sum(axis=1)
        # Where surfaces do not face each other nothing is transferred, whatever the stretch.
        stretch = (1.0 + curvature * gap) / np.maximum(cosine, -MAX_FACING_COSINE)
        # The curves run in opposite directions, each with its material on the left.
        moved = s + stretch * off
        s = np.mod(moved, slave.length) if slave.closed else np.clip(moved, 0.0, slave.length)
    return s, np.abs(off), stretch


def slave_normals(pairing: Pairing, s: FloatArray) -> FloatArray:
    """Normals (b, 2) of the slave at arc lengths ``s`` (b,); at a corner that ends the candidates, those of
    their side."""
    curve = pairing.slave.curve
    if pairing.slave.parts and pairing.candidate.any():
        first, last = pairing.arc[pairing.candidate][[0, -1]]
        small = COARSE_ROUND_OFF * float(pairing.spacing.min())
        s = np.where(np.abs(s - first) <= small, first + small, s)
        s = np.where(np.abs(s - last) <= small, last - small, s)
    return curve.normals(np.mod(s, curve.length) if curve.closed else s)


def candidates_fit(pairing: Pairing, s: FloatArray, reach: FloatArray) -> sparse.csr_array:
    """:func:`surface_fit` of the candidates' values; on a closed surface windows continue across the
    seam."""
    arc, weight, _ = _unrolled(pairing)
    fit = surface_fit(arc, weight, s, reach).tocoo()
    rows, columns = fit.coords
    count = int(pairing.candidate.sum())
    return sparse.csr_array((fit.data, (rows, columns % count)), shape=(len(s), count))


def _unrolled(pairing: Pairing) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Arc lengths, surface lengths and spacings (m,) of the candidates; if they cover a closed surface, of
    three turns (3m,), so that windows continue across the seam."""
    chosen = pairing.candidate
    arc, weight, spacing = pairing.arc[chosen], pairing.weight[chosen], pairing.spacing[chosen]
    if not pairing.all_around:
        return arc, weight, spacing
    turns = pairing.slave.curve.length * np.arange(-1, 2)
    return (turns[:, None] + arc).ravel(), np.tile(weight, 3), np.tile(spacing, 3)


def surface_fit(arc: FloatArray, weight: FloatArray, s: FloatArray, reach: FloatArray) -> sparse.csr_array:
    """Weights (r, m) of local linear fits to nodal values at ``arc`` (m,), evaluated at arc lengths ``s``
    (r,). ``weight`` (m,) are the nodes' surface lengths, ``reach`` (r,) the half-widths of windows, which
    contain at least the two nearest nodes. Linear functions are reproduced."""
    nearest = np.clip(np.searchsorted(arc, s), 1, max(len(arc) - 1, 1))
    first = np.minimum(np.searchsorted(arc, s - reach), nearest - 1)
    last = np.maximum(np.searchsorted(arc, s + reach, side="right"), np.minimum(nearest + 1, len(arc)))
    count = last - first
    start = np.cumsum(count) - count
    columns = np.repeat(first - start, count) + np.arange(count.sum())
    offset = (arc[columns] - np.repeat(s, count)) / np.repeat(reach, count)
    # Where even the nearest candidates lie outside the window, all weights would underflow: shift the
    # exponent, as only their ratios matter.
    least = np.minimum.reduceat(offset**2, start) if len(start) else np.zeros(0)
    shift = np.repeat(np.where(least > 1.0, least, 0.0), count)
    share = np.exp(-2.0 * WINDOW_SHARPNESS * (offset**2 - shift)) * weight[columns]
    s0, s1, s2 = (np.repeat(np.add.reduceat(share * offset**k, start), count) for k in range(3))
    # A window with a single node can only carry its constant.
    slope = s0 * s2 - s1**2 > FINE_ROUND_OFF * s0**2
    share = np.where(slope, share * (s2 - s1 * offset) / np.where(slope, s0 * s2 - s1**2, 1.0), share / s0)
    rows = np.repeat(np.arange(len(s)), count)
    return sparse.csr_array((share, (rows, columns)), shape=(len(s), len(arc)))
