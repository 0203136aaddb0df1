"""Warnings of the last state at finite strain: contacts with too few nodes, and bodies held at points."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mlsanm_cli.app.checks.energy import NODE_FORCE_SHIFT
from mlsanm_cli.app.checks.verdicts import ENERGY_WARNING
from mlsanm_cli.app.finite.fields import SceneForces
from mlsanm_cli.app.finite.patches import between_nodes
from mlsanm_cli.app.finite.refinement import is_automatic
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.finite.pair import BodyContact
from mlsanm_cli.contact.finite.sides import ContactSide
from mlsanm_cli.solve.state import State

MIN_CONTACT_NODES, MIN_FREE_NODES = 4, 6
"""Number of nodes in a contact below which its pressures are not reliable; the second where it ends between
nodes: of two half-disks with 3 and 5 nodes in contact forces were 4.9 and 0.8 % off, peaks 12 and 2 %."""
MIN_LATERAL_SHARE = 1e-3
"""Lateral part of a force below which its direction is not reported."""
RESOLVED_NODES = 20
"""Number of nodes in a contact up to which half a spacing at its ends matters."""


def few_nodes(scene: FiniteScene, state: State) -> Iterator[str]:
    """Warnings of contacts with too few nodes, or that may touch between nodes."""
    for contact, here, _ in scene.contacts.each:
        side = contact.slave
        closed, gap = state.closed[here], state.gap[here]
        near = int(np.argmin(gap))
        spacing = float(side.weight[near])
        # A corner touches by one node, however fine nodes are.
        at_corners = np.isin(np.flatnonzero(closed), side.corners).all()
        coarser = "" if is_automatic(scene.case, contact) else ', or leave the spacing to "auto"'
        if not closed.any():
            if between_nodes(side, state, here):
                yield (
                    f"contact {contact.name}: no node of {side.name} is in contact, but it may touch between "
                    f"its nodes, {spacing:.3g} apart: use finer nodes there"
                )
        elif not at_corners and (closed.sum() < MIN_CONTACT_NODES or _few_to_free_ends(side, closed)):
            lean = _lean(side, closed, state.solver["normal"][here])
            leans = f", lateral error {100.0 * lean:.2g} %" if lean > MIN_LATERAL_SHARE else ""
            yield (
                f"contact {contact.name}: too few nodes of {side.name} in contact for accurate pressures "
                f"({closed.sum()}, {spacing:.3g} apart){leans}: use finer nodes there{coarser}"
            )
        elif isinstance(contact, BodyContact) and closed.sum() < RESOLVED_NODES:
            yield from _ends(contact, closed, state.solver["place"][here])


def _few_to_free_ends(side: ContactSide, closed: BoolArray) -> bool:
    """Whether some ``closed`` nodes (c,) are next to open ones of a smooth part of a side, and few nodes are
    closed, with their images behind planes of symmetry."""
    ends = np.flatnonzero(closed & ~(np.roll(closed, 1) & np.roll(closed, -1)))
    mirrored = any(axis is not None and closed[end] for end, axis in zip((0, -1), side.mirrors, strict=True))
    few = closed.sum() * (2 if mirrored else 1) < MIN_FREE_NODES
    return bool(few and not np.isin(ends, side.corners).all())


def _lean(side: ContactSide, closed: BoolArray, normal: FloatArray) -> float:
    """Possible lateral part of the force on few ``closed`` nodes (c,): its place is known to half of their
    distance, over which the ``normal`` (c, 2) turns."""
    numbers = np.flatnonzero(closed)
    beside = (numbers[:, None] + np.array([-1, 1])) % side.count
    turned = np.hypot(*(normal[beside] - normal[numbers, None]).T)
    if side.around is None:
        turned = turned[(np.abs(beside - numbers[:, None]) == 1).T]
    return float(0.5 * turned.max(initial=0.0) / len(numbers))


def _ends(contact: BodyContact, closed: BoolArray, place: FloatArray) -> Iterator[str]:
    """Warnings of ends of the master surface between nodes of the slave."""
    slave, master = contact.slave, contact.master
    if master.around is not None:
        return
    for number, end in ((0, master.arc[0]), (-1, master.arc[-1])):
        beside = np.flatnonzero(closed & (np.abs(place - end) < slave.weight))
        beside = beside[(beside > 0) & (beside < slave.count - 1)] if slave.around is None else beside
        free = beside[~closed[beside - 1] | ~closed[(beside + 1) % slave.count]]
        if len(free):
            x, y = master.places[number]
            yield (
                f"contact {contact.name}: the end of {master.name} at ({x:.6g}, {y:.6g}) presses "
                f"between nodes of {slave.name}, {slave.weight[free[0]]:.3g} apart: the position of "
                f"its force is uncertain by half of that; use finer nodes there"
            )


def held_at_points(scene: FiniteScene, state: State) -> Iterator[str]:
    """Warnings of bodies held at single nodes whose displacement depends on the spacing."""
    forces, parts = SceneForces.of(scene, state), scene.parts(state.displacement)
    for name, body in scene.bodies.items():
        nodes = body.elastic.held_nodes[: len(body.elastic.held_nodes) - body.pins]
        counts = np.array([sum(axis == one for _, one in nodes) for axis in (0, 1)])
        if not counts.any():
            continue
        cloud, own = body.elastic.model.cloud, parts[name]
        force = np.where(counts, forces.bodies[name].total / np.maximum(counts, 1), 0.0)
        soft = body.elastic.model.material.contact_compliance(np.eye(2))
        angle = body.turn(own)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        bent = cloud.points + own.reshape(-1, 2) - cloud.points @ turn.T
        bent = np.abs(bent - cloud.areas @ bent / cloud.areas.sum()).max()
        part = float((NODE_FORCE_SHIFT * soft * np.abs(force)).max() / bent) if bent else 0.0
        if part > ENERGY_WARNING:
            yield (
                f"body {name} is held at single nodes: displacements next to a point force are unbounded, "
                f"and grow by up to {100 * part:.2g} % of the deformation when body.{name}.spacing is "
                "halved; support a part of a boundary (from, to), or a small hole"
            )
