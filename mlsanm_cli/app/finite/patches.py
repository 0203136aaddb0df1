"""Contact patches along a path at finite strain, and their numbers of nodes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, TypeAlias

import numpy as np

from mlsanm_cli.app.finite.fields import SceneForces
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.case import Case
from mlsanm_cli.contact.finite.node_curve import wrapped
from mlsanm_cli.contact.finite.pair import BodyContact
from mlsanm_cli.contact.finite.sides import ContactSide
from mlsanm_cli.contact.finite.update import AnyContact
from mlsanm_cli.solve.state import PathStep, State

NODES_PER_WIDTH, REFERENCE_ACCURACY = 18.0, 1e-3
"""Nodes over the width of a contact at this accuracy of its peak; errors decrease with their square."""
MARGIN = 1.3
"""Refined patches have this many times the nodes required: their widths are known to a spacing."""
MAX_REFINEMENT = 8.0
"""Largest refinement at a time: the width of a patch is known to the distance of its nodes."""
MIN_FORCE_SHARE = 0.02
"""Patches with less than this part of the force of a contact are ignored."""


Patch: TypeAlias = tuple[IntArray, float]
"""Numbers (k,) of consecutive closed nodes of a slave, and their width."""
Touched: TypeAlias = Mapping[str, Mapping[str, Any]]
"""Patches of a run so far, by contact, plain values: for each side the ``spacing`` (c,) required in the
requested states, infinite where there is no patch, and the nodes near any patch (``swept``); the fewest nodes
``across`` a patch, None without one, whether there are too few (``coarse``), and the ``forces`` (2,) on the
slave in the requested states by position."""


def touched_after(touched: Touched, scene: FiniteScene, step: PathStep) -> dict[str, dict[str, Any]]:
    """The patches of a run after another step."""
    found = {contact.name: _taken_up(touched, contact) for contact in scene.contacts.pairs}
    ends = [step.state] if step.state.position.is_integer() else []
    # Before loading there are no patches.
    wanted = {one.position: one for one in (*step.saved, *ends) if one.position > 0.0}
    for position, state in {**wanted, step.state.position: step.state}.items() if found else ():
        known = position in wanted
        forces = SceneForces.of(scene, state).contacts if known else {}
        for contact, here, _ in scene.contacts.each:
            own = found[contact.name]
            if known:
                own["forces"][repr(float(position))] = forces[contact.name][0].tolist()
            asked = across_of(scene.case, contact.name)
            for patch in patches(contact, state, here):
                _add(own, contact, patch, state.solver["place"][here], asked if known else None)
    return found


def _taken_up(touched: Touched, contact: AnyContact) -> dict[str, Any]:
    """A copy of what is known about a contact."""
    counts = [side.count for side in contact.sides]
    known = touched.get(contact.name, {})
    return {
        "spacing": [np.array(one) for one in known.get("spacing", [np.full(n, np.inf) for n in counts])],
        "swept": [np.array(one) for one in known.get("swept", [np.zeros(n, dtype=bool) for n in counts])],
        "across": known.get("across"),
        "coarse": known.get("coarse", False),
        "forces": dict(known.get("forces", {})),
    }


def _add(
    own: dict[str, Any], contact: AnyContact, patch: Patch, place: FloatArray, asked: float | None
) -> None:
    """Adds a patch to what is known about a contact; ``asked`` are the nodes required across it in a
    requested state."""
    sides, (numbers, width) = contact.sides, patch
    marks = [_widened(sides[0], numbers)]
    if isinstance(contact, BodyContact):
        marks.append(_faced(sides[1], place[numbers], width))
    for been, mark in zip(own["swept"], marks, strict=True):
        been |= mark
    count = len(numbers)
    # A corner in contact has one node, whatever the spacing.
    if asked is None or (count == 1 and int(numbers[0]) in sides[0].corners):
        return
    own["across"] = count if own["across"] is None else min(own["across"], count)
    own["coarse"] = own["coarse"] or count < asked
    finest = float(sides[0].weight[numbers].min())
    for spacing, mark in zip(own["spacing"], marks, strict=True):
        spacing[mark] = np.minimum(spacing[mark], max(width / (MARGIN * asked), finest / MAX_REFINEMENT))


def wanted_spacings(known: Mapping[str, Any]) -> Iterator[FloatArray]:
    """Required spacings (c,) of each side of a contact; nodes that only intermediate states touch get that of
    the nearest node with one."""
    for spacing, swept in zip(known["spacing"], known["swept"], strict=True):
        near, places = np.flatnonzero(np.isfinite(spacing)), np.flatnonzero(swept)
        wanted = np.full(len(spacing), np.inf)
        if len(near):
            wanted[places] = np.asarray(spacing)[near[np.abs(places[:, None] - near).argmin(axis=1)]]
        yield wanted


def across_of(case: Case, contact: str) -> float:
    """Nodes over a patch required for the accuracy of a contact."""
    accuracy = next(one.accuracy for one in case.contact if one.name == contact)
    return NODES_PER_WIDTH * float(np.sqrt(REFERENCE_ACCURACY / accuracy))


def patches(contact: AnyContact, state: State, here: slice) -> Iterator[Patch]:
    """Loaded patches of a contact in a state; its nodes are ``here`` in the state's arrays."""
    slave, closed = contact.slave, state.closed[here]
    load = np.hypot(state.pressure[here], state.traction[here]) * slave.weight
    numbers = np.flatnonzero(closed)
    if not len(numbers) and between_nodes(slave, state, here):
        near = int(np.argmin(state.gap[here]))
        yield np.array([near]), float(slave.weight[near])
    if not load.sum():
        return
    # A single open node between closed ones does not divide a patch.
    parts = np.split(numbers, np.flatnonzero(np.diff(numbers) > 2) + 1)
    if slave.around is not None and len(parts) > 1 and numbers[0] + slave.count - numbers[-1] <= 2:
        parts = [np.concatenate([parts[-1], parts[0]]), *parts[1:-1]]
    for part in parts:
        if load[part].sum() >= MIN_FORCE_SHARE * load.sum():
            yield part, float(slave.weight[part].sum())


def between_nodes(side: ContactSide, state: State, here: slice) -> bool:
    """Whether a side without closed nodes may touch between them, by the relative rotation of the surfaces
    from the nearest node to the next; its nodes are ``here`` in the state's arrays."""
    gap, near = state.gap[here], int(np.argmin(state.gap[here]))
    beside = slice(max(near - 1, 0), near + 2)
    against = (side.outward + state.solver["normal"][here])[beside]
    turned = np.hypot(*np.diff(against, axis=0).T).max(initial=0.0)
    return bool(gap[near] < turned * side.weight[near] / 8.0)


def _widened(side: ContactSide, numbers: IntArray) -> BoolArray:
    """Mask (c,) of the nodes ``numbers`` of a side and the adjacent ones."""
    found = np.zeros(side.count, dtype=bool)
    for step in (-1, 0, 1):
        beside = numbers + step
        found[beside % side.count if side.around is not None else np.clip(beside, 0, side.count - 1)] = True
    return found


def _faced(side: ContactSide, places: FloatArray, width: float) -> BoolArray:
    """Mask (c,) of the nodes of a master within the arc lengths ``places`` that a patch of a ``width``
    faces, and the adjacent ones."""
    middle = float(places[len(places) // 2])
    away, reach = (wrapped(one - middle, side.around) for one in (side.arc, places))
    more = width / len(places)
    inside = np.flatnonzero((away >= reach.min() - more) & (away <= reach.max() + more))
    return _widened(side, inside if len(inside) else np.array([int(np.argmin(np.abs(away)))]))
