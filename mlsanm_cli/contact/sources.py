"""Right-hand sides of a body's system for unit loads, platen motions and contact pressures."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.contact.linear_map import Columns
from mlsanm_cli.contact.pairing import Pairing, transfer
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.scene import Scene


def body_sources(
    scene: Scene, name: str, pairings: tuple[Pairing, ...], spans: Mapping[str, slice], columns: Columns
) -> sparse.csc_array:
    """All right-hand sides (rows, total) of one body; a column that does not act on it is empty."""
    body = scene.bodies[name]
    cloud = body.model.cloud
    few = np.zeros((body.rows, columns.loads + columns.motions))
    for load in scene.surface_loads:
        if load.body == name:
            few[:, load.number] += body.source(load.surface, load.values, load.held)
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
    for pairing in pairings:
        span = spans[pairing.name]
        block = sparse.csc_array((body.rows, span.stop - span.start))
        if pairing.slave_body == name:
            block = block + _on_slave(body, pairing)
        if pairing.master_body == name:
            block = block + _on_master(body, pairing)
        blocks.append(block)
    return sparse.csc_array(sparse.hstack(blocks, format="csc"))


def _on_slave(body: ElasticBody, pairing: Pairing) -> sparse.csc_array:
    """Tractions p n on the slave, n the master's outward normal."""
    chosen = np.flatnonzero(pairing.candidate)
    columns = np.arange(len(chosen))
    source = sparse.csc_array((body.rows, len(chosen)))
    for component in (0, 1):
        rows = body.condition_rows(pairing.slave.name, component)[pairing.position[chosen]]
        values = pairing.normal[chosen, component]
        source = source + sparse.csc_array((values, (rows, columns)), shape=source.shape)
    return source


def _on_master(body: ElasticBody, pairing: Pairing) -> sparse.csc_array:
    """Tractions -p n on the master's own nodes, p carried over along the slave surface."""
    shares = transfer(pairing, body.model.cloud).tocoo()
    rows, columns = shares.coords
    source = sparse.csc_array((body.rows, shares.shape[1]))
    for component in (0, 1):
        lines = body.condition_rows(pairing.master.name, component)[rows]
        values = -shares.data * pairing.master.normal[rows, component]
        source = source + sparse.csc_array((values, (lines, columns)), shape=source.shape)
    return source
