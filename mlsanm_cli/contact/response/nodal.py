"""Contacts with pressures at the nodes of the slave, whose forces act at the closest points of the master."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cells import GAUSS
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.geometry.pairing import Pairing, facing_parts, opposed
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.pieces import turned_along
from mlsanm_cli.operators.stencil_weights import nodal_pairs

FIXED_POINT_STEPS = 8
"""Steps to a point of the slave, whose errors fall by the product of gap and curvature in each."""


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
        size = part.weight[where] * around(body.model.cloud.points[part.index[where]])
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
