"""Right-hand sides of a body's system for unit loads, platen motions and contact tractions."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cells import GAUSS
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.geometry.facing import turned
from mlsanm_cli.contact.geometry.pairing import MAX_FACING_COSINE, Pairing, facing_parts, opposed
from mlsanm_cli.contact.geometry.surface_response import SurfaceResponse, pins_of
from mlsanm_cli.contact.geometry.transfer import feet, slave_normals, transfer
from mlsanm_cli.contact.response.linear_map import Columns
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.pieces import turned_along
from mlsanm_cli.mechanics.remainder import remainder_sources
from mlsanm_cli.mechanics.scene import Scene


def body_load_vectors(
    scene: Scene, name: str, pairings: tuple[Pairing, ...], columns: Columns
) -> sparse.csc_array:
    """All right-hand sides (rows, total) of one body; columns that do not act on it are empty."""
    body = scene.bodies[name]
    cloud = body.model.cloud
    few = np.zeros((body.rows, columns.loads + columns.motions))
    for load in scene.surface_loads:
        if load.body == name:
            few[:, load.number] += load.source(body)
    for force in scene.body_forces:
        if force.body == name:
            few[:, force.number] += body.force_source(force.values)
    for heating in scene.heated(name):
        few[:, heating.number] += heating.source(body)
    for platen, motion, by in scene.motions:
        for surface in platen.surfaces_of(name):
            pattern = platen.pattern(cloud.surfaces[surface], cloud.points, motion)
            few += np.outer(body.source(surface, pattern, held=True), by)
    blocks = [sparse.csc_array(few)]
    centred = any(name in motion for motion in scene.held_motions)
    sampled = {
        pairing.name: np.hsplit(_sample_sources(body, name, pairing, centred), 2)
        for pairing in pairings
        if pairing.grid is not None
    }
    for tangential in (False, True):
        for pairing in pairings:
            if pairing.grid is not None:
                blocks.append(sparse.csc_array(sampled[pairing.name][tangential]))
            elif pairing.friction or not tangential:
                blocks.append(_contact_sources(body, name, pairing, tangential))
    return sparse.csc_array(sparse.hstack(blocks, format="csc"))


def _sample_sources(body: ElasticBody, name: str, pairing: Pairing, centred: bool) -> FloatArray:
    """Right-hand sides (r, 2 drivers) of body ``name`` for the remainders of unit forces x, then y, at a
    contact grid's samples on the slave, with opposite ones on the master; and for uniform tractions where the
    mean is a driver."""
    grid = pairing.grid
    assert grid is not None
    total = np.zeros((body.rows, 2, grid.drivers))
    surfaces = (pairing.slave, pairing.master)
    for (own, slave, sign), surface in zip(pairing.sides, surfaces, strict=False):
        if own != name:
            continue
        pins, first = pins_of(grid, slave), grid.count + grid.covers
        response = SurfaceResponse.of(grid, body.model.kernel, slave)
        held = {pin.node: response.smooth(np.array([pin.place]))[0] for _, pin in pins}
        sources = remainder_sources(body, grid.forces(body.model.kernel, slave), centred, held)
        total[:, :, : grid.count] += sign * sources.reshape(body.rows, 2, grid.count)
        for number, pin in pins:
            for component, row in body.pin_rows(pin.node):
                total[row, component, first + number] += sign
        if grid.covers and surface is not None:
            for component, axis in enumerate(np.eye(2)):
                along = np.tile(axis, (len(surface.index), 1))
                total[:, component, grid.count] += sign * body.source(surface.name, along, held=False)
    return total.reshape(body.rows, -1)


def _contact_sources(body: ElasticBody, name: str, pairing: Pairing, tangential: bool) -> sparse.csc_array:
    """Right-hand sides of body ``name`` for unit nodal pressures, or tractions, of a contact."""
    source = sparse.csc_array((body.rows, int(pairing.candidate.sum())))
    if pairing.slave_body == name:
        source = source + _on_slave(body, pairing, pairing.tangent if tangential else pairing.normal)
    if pairing.master is not None and pairing.master_body == name:
        source = source + _on_master(body, pairing, pairing.master, tangential)
    return source


def _on_slave(body: ElasticBody, pairing: Pairing, direction: FloatArray) -> sparse.csc_array:
    """Unit tractions along ``direction`` (w, 2) on the slave."""
    chosen = np.flatnonzero(pairing.candidate)
    columns = np.arange(len(chosen))
    source = sparse.csc_array((body.rows, len(chosen)))
    parts = facing_parts(pairing.slave, pairing.position[chosen], pairing.normal[chosen])
    for part, own, on in parts:
        for component in (0, 1):
            rows = body.condition_rows(part.name, component)[own]
            values = direction[chosen[on], component]
            source = source + sparse.csc_array((values, (rows, columns[on])), shape=source.shape)
    return source


def _on_master(body: ElasticBody, pairing: Pairing, master: Surface, tangential: bool) -> sparse.csc_array:
    """Reaction on the master to unit tractions on the slave along its normals or tangents: nodal tractions by
    transfer, and on the pieces exactly the opposite of the slave's forces."""
    direction = pairing.tangent if tangential else pairing.normal
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
    missing = _on_pieces(body, pairing, master, direction) - body.loads @ source
    nodal = sparse.csc_array((body.rows - missing.shape[0], missing.shape[1]))
    return sparse.csc_array(source + sparse.vstack([nodal, missing], format="csc"))


def _on_pieces(
    body: ElasticBody, pairing: Pairing, master: Surface, direction: FloatArray
) -> sparse.csr_array:
    """Force and moment (3k, m) on the master's pieces by minus unit tractions along ``direction`` (w, 2) of
    the slave, acting at the master's closest points. Integrated between neighbouring slave nodes and ends of
    the master's cells, exact for linear pressures."""
    slave, pieces = pairing.slave, body.pieces
    place = np.full(len(slave.index), -1, dtype=np.int64)
    chosen = np.flatnonzero(pairing.candidate)
    place[pairing.position[chosen]] = np.arange(len(chosen))
    nodes, around = slave.arc_length, slave.curve.closed
    ends = np.append(nodes, slave.curve.length) if around else nodes
    middles = 0.5 * (master.arc_length[1:] + master.arc_length[:-1])
    if master.curve.closed:
        middles = np.append(middles, 0.5 * (master.arc_length[-1] + master.curve.length))
    cuts = np.unique(np.clip(np.concatenate([ends, feet(pairing, master, middles)[0]]), ends[0], ends[-1]))
    owner = master.index[
        _nearest(master, master.curve.closest(slave.curve.points(0.5 * (cuts[1:] + cuts[:-1]))))
    ]
    first = np.searchsorted(ends, 0.5 * (cuts[1:] + cuts[:-1])) - 1
    total = sparse.csr_array((3 * pieces.count, len(chosen)))
    for at, weight in GAUSS[2]:
        s = cuts[:-1] + at * np.diff(cuts)
        normal, points = (
            slave.curve.normals(s),
            master.curve.points(master.curve.closest(slave.curve.points(s))),
        )
        circle = body.model.cloud.around(slave.curve.points(s))
        share = (s - ends[first]) / (ends[first + 1] - ends[first])
        faces = opposed(pairing, s)
        for end, who, part in ((0, first, 1.0 - share), (1, (first + 1) % len(nodes), share)):
            on = np.flatnonzero((place[who] >= 0) & faces)
            turn = turned_along(slave.end_normals[first[on], end], normal[on])
            along = (turn @ direction[chosen[place[who[on]]], :, None])[:, :, 0]
            force = -(circle * weight * np.diff(cuts) * part)[on, None] * along
            total = total + pieces.per_column(owner[on], points[on], force, place[who[on]], len(chosen))
    return sparse.csr_array(total)


def _nearest(surface: Surface, arc: FloatArray) -> IntArray:
    """Index (e,) of the surface node nearest along it to arc lengths ``arc`` (e,)."""
    s = surface.arc_length
    found = np.searchsorted(0.5 * (s[1:] + s[:-1]), arc)
    if surface.curve.closed:
        found = np.where(arc > 0.5 * (s[-1] + surface.curve.length), 0, found)
    return np.asarray(found, dtype=np.int64)
