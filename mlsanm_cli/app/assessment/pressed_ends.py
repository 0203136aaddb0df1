"""Contacts with pressure at an end of their surfaces where the boundary continues without a corner."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mlsanm_cli.app.scene.contact_pairs import shape_of
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Contact
from mlsanm_cli.cloud.cloud import continuations
from mlsanm_cli.contact.geometry.obstacles import Chain
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import State

END_DISTANCE = 0.75
"""Distance from an end, in spacings, within which nodes belong to it."""
MIN_PRESSURE_SHARE = 0.2
"""Part of the mean pressure above which an end is pressed."""


def end_warnings(built: CondensedScene, state: State) -> Iterator[str]:
    """Warnings with the boundaries to add to contacts: the end node carries the pressure of the rest."""
    contacts = {contact.name: contact for contact in built.case.contact}
    for pairing in built.condensed.pairings:
        contact = contacts[pairing.name]
        span = built.condensed.spans[pairing.name]
        pressure, weight = state.pressure[span], built.condensed.weight[span]
        closed = state.closed[span]
        if not closed.any():
            continue
        mean = float(weight @ pressure) / float(weight[closed].sum())
        for (body, slave, _), side in zip(pairing.sides, contact.sides, strict=True):
            elastic = built.scene.bodies[body]
            cloud = elastic.model.cloud
            places = (pairing.points if slave else pairing.partner)[pairing.candidate]
            surface = pairing.surface_of(slave)
            for place, name in continuations(cloud, surface):
                node, beyond = surface.index[place], name.partition("/")[0]
                end = cloud.points[node]
                if elastic.held.get(name) == (True, True) or _ends_with(contact, end, cloud.spacing[node]):
                    continue
                if _is_bonded(built, body, end, cloud.spacing[node]):
                    continue
                near = np.hypot(*(places - end).T) <= END_DISTANCE * cloud.spacing[node]
                if (closed & near & (pressure > MIN_PRESSURE_SHARE * mean)).any():
                    listed = ", ".join(f'"{one}"' for one in (*side.boundaries, f"{body}.{beyond}"))
                    yield (
                        f"contact {pairing.name} is pressed up to the end of {side.label} near "
                        f"({end[0]:.6g}, {end[1]:.6g}), where {body}.{beyond} continues without a corner "
                        f"and should carry a part of the pressure: add it to the contact, as in "
                        f"contact.{pairing.name}.{'slave' if slave else 'master'} = [{listed}]"
                    )


def _is_bonded(built: CondensedScene, body: str, end: FloatArray, spacing: float) -> bool:
    """Whether a bond begins at the ``end`` (2,) of a surface of a body, as at a crack tip."""
    for pairing in built.condensed.bonds.pairings:
        for owner, places in ((pairing.slave_body, pairing.points), (pairing.master_body, pairing.partner)):
            if owner == body and (np.hypot(*(places - end).T) <= END_DISTANCE * spacing).any():
                return True
    return False


def _ends_with(contact: Contact, end: FloatArray, spacing: float) -> bool:
    """Whether an obstacle has a corner at the ``end`` (2,) of a surface, as a punch does."""
    shape = None if contact.obstacle is None else shape_of(contact.obstacle)
    if not isinstance(shape, Chain):
        return False
    corners = shape.points[~shape.smooth]
    return bool((np.hypot(*(corners - end).T) <= END_DISTANCE * spacing).any())
