"""Right-hand sides of a body's system for unit loads, platen motions and contact tractions."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.linear_map import Columns
from mlsanm_cli.contact.pairing import Pairing, transfer, turned
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.scene import Scene


def body_sources(
    scene: Scene, name: str, pairings: tuple[Pairing, ...], columns: Columns
) -> sparse.csc_array:
    """All right-hand sides (rows, total) of one body; a column that does not act on it is empty."""
    body = scene.bodies[name]
    cloud = body.model.cloud
    few = np.zeros((body.rows, columns.loads + columns.motions))
    for load in scene.surface_loads:
        if load.body == name:
            few[:, load.number] += body.source(load.surface, load.values, load.held)
    for force in scene.body_forces:
        if force.body == name:
            few[:, force.number] += body.force_source(force.values)
    degrees = scene.degrees(name)
    if degrees.any():
        few[:, : columns.loads] += np.outer(body.heat_source, degrees)
    unknown = columns.loads
    for platen in scene.platens:
        for motion in platen.motions:
            if platen.body == name:
                pattern = platen.pattern(cloud.surfaces[platen.surface], cloud.points, motion.component)
                source = body.source(platen.surface, pattern, held=True)
                if motion.prescribed is None:
                    few[:, unknown] = source
                else:
                    few[:, : columns.loads] += np.outer(source, motion.prescribed)
            unknown += motion.prescribed is None
    blocks = [sparse.csc_array(few)]
    blocks += [_contact_sources(body, name, pairing, tangential=False) for pairing in pairings]
    blocks += [
        _contact_sources(body, name, pairing, tangential=True) for pairing in pairings if pairing.friction
    ]
    return sparse.csc_array(sparse.hstack(blocks, format="csc"))


def _contact_sources(body: ElasticBody, name: str, pairing: Pairing, tangential: bool) -> sparse.csc_array:
    """What unit pressures, or unit tractions, of a contact do to the body called ``name``."""
    source = sparse.csc_array((body.rows, int(pairing.candidate.sum())))
    if pairing.slave_body == name:
        source = source + _on_slave(body, pairing, pairing.tangent if tangential else pairing.normal)
    if pairing.master is not None and pairing.master_body == name:
        normal = pairing.master.normal
        # The reaction to p n is -p n, whose n the master's own normal stands for; likewise the tangent.
        source = source + _on_master(body, pairing, pairing.master, turned(normal) if tangential else normal)
    return source


def _on_slave(body: ElasticBody, pairing: Pairing, direction: FloatArray) -> sparse.csc_array:
    """Unit tractions along ``direction`` (w, 2) on the slave."""
    chosen = np.flatnonzero(pairing.candidate)
    columns = np.arange(len(chosen))
    source = sparse.csc_array((body.rows, len(chosen)))
    for component in (0, 1):
        rows = body.condition_rows(pairing.slave.name, component)[pairing.position[chosen]]
        values = direction[chosen, component]
        source = source + sparse.csc_array((values, (rows, columns)), shape=source.shape)
    return source


def _on_master(
    body: ElasticBody, pairing: Pairing, master: Surface, direction: FloatArray
) -> sparse.csc_array:
    """Unit tractions against ``direction`` (b, 2) on the master's own nodes, carried over along the slave."""
    shares = transfer(pairing, body.model.cloud).tocoo()
    rows, columns = shares.coords
    source = sparse.csc_array((body.rows, shares.shape[1]))
    for component in (0, 1):
        lines = body.condition_rows(master.name, component)[rows]
        values = -shares.data * direction[rows, component]
        source = source + sparse.csc_array((values, (lines, columns)), shape=source.shape)
    return source
