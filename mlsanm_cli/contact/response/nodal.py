"""Contacts with pressures at the nodes of the slave, which the master receives by transfer."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cells import GAUSS
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.geometry.facing import turned
from mlsanm_cli.contact.geometry.pairing import MAX_FACING_COSINE, Pairing, facing_parts, opposed
from mlsanm_cli.contact.geometry.transfer import feet, slave_normals, transfer
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.pieces import turned_along
from mlsanm_cli.operators.stencil_weights import nodal_pairs


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

    def rows(self, body: ElasticBody, name: str) -> sparse.csr_array:
        both = self.both_rows(body, name)
        return sparse.csr_array(sparse.vstack(both if self._pairing.friction else both[:1]))

    def sources(self, body: ElasticBody, name: str, centred: bool) -> sparse.csc_array:
        pairing, blocks = self._pairing, []
        for tangential in (False, True)[: 2 if pairing.friction else 1]:
            source = sparse.csc_array((body.rows, self._count))
            if pairing.slave_body == name:
                source = source + _on_slave(body, pairing, tangential)
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


def _on_slave(body: ElasticBody, pairing: Pairing, tangential: bool) -> sparse.csc_array:
    """Right-hand sides (r, m) of unit pressures, or tractions, on the slave."""
    chosen = np.flatnonzero(pairing.candidate)
    direction = (pairing.tangent if tangential else pairing.normal)[chosen]
    source = sparse.csc_array((body.rows, len(chosen)))
    for part, own, on in facing_parts(pairing.slave, pairing.position[chosen], pairing.normal[chosen]):
        for component in (0, 1):
            rows = body.condition_rows(part.name, component)[own]
            entries = direction[on, component], (rows, on)
            source = source + sparse.csc_array(entries, shape=source.shape)
    return source


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
