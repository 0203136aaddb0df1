"""Contact pressures as loads of a body: a unit traction in x and in y for every node that may touch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.contact.finite.rigid import RigidContact
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.finite.loads import Loads


def with_contacts(loads: Loads, body: ElasticBody, contacts: Sequence[RigidContact]) -> Loads:
    """The ``loads`` and, behind them, 2c unit tractions: x and y of every node of the contacts in turn,
    linear between the nodes."""
    more = 2 * sum(one.count for one in contacts)
    if not more:
        return loads
    sources = np.hstack([loads.sources, np.zeros((len(loads.sources), more))])
    tractions = {name: _wider(given, more) for name, given in loads.tractions.items()}
    force = None if loads.force is None else _wider(loads.force, more)
    first = loads.count
    for contact in contacts:
        halves = Halves.of(body.model.cloud.surfaces[contact.surface], FINE)
        shape = (len(halves.arc), 2, loads.count + more)
        hats, every = tractions.setdefault(contact.surface, np.zeros(shape)), np.arange(len(halves.arc))
        for component in (0, 1):
            columns = first + 2 * np.arange(contact.count) + component
            sources[body.condition_rows(contact.surface, component), columns] = 1.0
            hats[every, component, columns[halves.own]] += halves.share
            hats[every, component, columns[halves.other]] += 1.0 - halves.share
        first += 2 * contact.count
    return replace(loads, count=loads.count + more, sources=sources, tractions=tractions, force=force)


def _wider(values: FloatArray, more: int) -> FloatArray:
    """``values`` (e, 2, L) with nothing for ``more`` loads."""
    return np.concatenate([values, np.zeros((*values.shape[:2], more))], axis=2)
