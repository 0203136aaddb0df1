"""Contacts that are pressed up to an end of their surfaces where a body continues without a corner."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mlsanm_cli.cloud.joined import SMOOTH
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import State

NEAR = 0.75
"""Nodes within so many spacings of an end are there."""
PRESSED = 0.2
"""Ends with more than this part of the mean pressure are pressed."""


def end_warnings(built: CondensedScene, state: State) -> Iterator[str]:
    """What to take into which contact, as a node at such an end bears what belongs beyond it."""
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
            for node, beyond in smooth_ends(elastic, pairing.surface_of(slave)):
                end = cloud.points[node]
                near = np.hypot(*(places - end).T) <= NEAR * cloud.spacing[node]
                if (closed & near & (pressure > PRESSED * mean)).any():
                    listed = ", ".join(f'"{name}"' for name in (*side.boundaries, f"{body}.{beyond}"))
                    yield (
                        f"contact {pairing.name} is pressed up to the end of {side.label} near "
                        f"({end[0]:.6g}, {end[1]:.6g}), where {body}.{beyond} continues without a corner, "
                        f"so that a single node carries the pressure there: add it to the contact, as in "
                        f"contact.{pairing.name}.{'slave' if slave else 'master'} = [{listed}]"
                    )


def smooth_ends(body: ElasticBody, surface: Surface) -> Iterator[tuple[int, str]]:
    """The nodes at the ends of a surface where others that are not clamped continue without a corner, and
    what a case calls these."""
    if surface.curve.closed:
        return
    own = {part.name for part, _ in surface.members}
    for place in (0, -1):
        node, normal = surface.index[place], surface.normal[place]
        for name, other in body.model.cloud.surfaces.items():
            if name in own or body.held.get(name) == (True, True):
                continue
            for there in (0, -1):
                smooth = float(other.normal[there] @ normal) > np.cos(SMOOTH)
                if smooth and other.index[there] == node:
                    yield int(node), name.partition("/")[0]
