"""Where contacts at finite strain touch along a path, and with how many nodes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from mlsanm_cli.app.finite.fields import SceneForces
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.app.finite.states import FiniteStep
from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.case import Case
from mlsanm_cli.contact.finite.exact import AnyContact, Pressed
from mlsanm_cli.contact.finite.pair import BodyContact
from mlsanm_cli.contact.finite.sides import ContactSide

ACROSS, AT = 14.0, 1e-3
"""Nodes over the width of a contact at this accuracy; errors decrease with their square. Forces of half a
disk on a block are 0.13 % off with 11 nodes."""
ENOUGH = 0.6
"""This part of the nodes that are asked for is enough."""
FINER = 8.0
"""Nodes become at most so many times finer at a time: to their distance the width is known."""
LEAST = 0.02
"""Patches that carry less than this part of a contact's force do not count."""


@dataclass(frozen=True)
class Patch:
    """Closed nodes ``numbers`` (k,) of a contact's slave that follow each other, over a ``width``."""

    numbers: IntArray
    width: float


@dataclass
class Touched:
    """What contacts have touched so far in a run, by name: for each side spacings (c,) that patches of states
    wanted ask for, infinite where none do, and which nodes were near a patch at all (``swept``); the fewest
    nodes ``across`` a patch, the force (2,) on the slave in states wanted by position, and which are
    ``coarse``."""

    spacing: dict[str, list[FloatArray]] = field(default_factory=dict)
    swept: dict[str, list[BoolArray]] = field(default_factory=dict)
    across: dict[str, int] = field(default_factory=dict)
    forces: dict[str, dict[str, list[float]]] = field(default_factory=dict)
    coarse: list[str] = field(default_factory=list)

    @classmethod
    def read(cls, figures: Mapping[str, Any]) -> Touched:
        """From the figures that a run has stored."""
        stored = dict(figures.get("touched", {}))
        for name in ("spacing", "swept"):
            stored[name] = {
                key: [np.array(one) for one in sides] for key, sides in stored.get(name, {}).items()
            }
        return cls(**stored)

    @property
    def plain(self) -> dict[str, Any]:
        """As plain values."""
        return asdict(self)

    def add(self, scene: FiniteScene, step: FiniteStep) -> None:
        """Take in a finished step."""
        wanted = list(step.saved)
        if step.state.position == round(step.state.position):
            wanted.append(step.state)
        # Before loading surfaces only just touch.
        wanted = [state for state in wanted if state.position > 0.0]
        for state in {one.position: one for one in (*wanted, step.state)}.values():
            if state.pressed is None:
                continue
            known, first = any(one is state for one in wanted), 0
            forces = SceneForces.of(scene, state).contacts if known else {}
            for contact in scene.contacts:
                here = slice(first, first + contact.slave.count)
                first = here.stop
                if known:
                    force = forces[contact.name][0].tolist()
                    self.forces.setdefault(contact.name, {})[repr(float(state.position))] = force
                for patch in patches(contact, state.pressed, here):
                    self._take(scene.case, contact, patch, state.pressed.place[here], known)

    def _take(self, case: Case, contact: AnyContact, patch: Patch, place: FloatArray, wanted: bool) -> None:
        name, sides = contact.name, contact.sides
        spacing = self.spacing.setdefault(name, [np.full(side.count, np.inf) for side in sides])
        swept = self.swept.setdefault(name, [np.zeros(side.count, dtype=bool) for side in sides])
        marks = [_widened(sides[0], patch.numbers)]
        if isinstance(contact, BodyContact):
            marks.append(_faced(sides[1], place[patch.numbers], patch.width))
        for been, mark in zip(swept, marks, strict=True):
            been |= mark
        count, asked = len(patch.numbers), across_of(case, name)
        # A corner that touches by itself does so with one node, however fine they are.
        if not wanted or (count == 1 and int(patch.numbers[0]) in sides[0].corners):
            return
        self.across[name] = min(self.across.get(name, count), count)
        if count < ENOUGH * asked and name not in self.coarse:
            self.coarse.append(name)
        finest = float(sides[0].weight[patch.numbers].min())
        for mine, mark in zip(spacing, marks, strict=True):
            mine[mark] = np.minimum(mine[mark], max(patch.width / asked, finest / FINER))

    def wanted(self, contact: str) -> Iterator[FloatArray]:
        """For each side of a contact the spacings (c,) that are asked for: what was touched on the way only
        is like the nearest that is."""
        for spacing, swept in zip(self.spacing[contact], self.swept[contact], strict=True):
            known, places = np.flatnonzero(np.isfinite(spacing)), np.flatnonzero(swept)
            found = np.full(len(spacing), np.inf)
            if len(known):
                like = known[np.abs(places[:, None] - known).argmin(axis=1)]
                found[places] = spacing[like]
            yield found


def across_of(case: Case, contact: str) -> float:
    """Nodes over a patch that the accuracy of a contact asks for."""
    accuracy = next(one.accuracy for one in case.contact if one.name == contact)
    return ACROSS * float(np.sqrt(AT / accuracy))


def patches(contact: AnyContact, pressed: Pressed, here: slice) -> Iterator[Patch]:
    """The patches of a contact in a state, those that carry something; what is ``here`` among all slaves'
    nodes is its own."""
    slave, closed = contact.slave, pressed.sets.closed[here]
    load = np.hypot(pressed.pressure[here], pressed.shear[here]) * slave.weight
    numbers = np.flatnonzero(closed)
    if not len(numbers) and between_nodes(slave, pressed, here):
        near = int(np.argmin(pressed.gap[here]))
        yield Patch(np.array([near]), float(slave.weight[near]))
    if not load.sum():
        return
    # A node between closed ones that is open is none of an edge.
    parts = np.split(numbers, np.flatnonzero(np.diff(numbers) > 2) + 1)
    if slave.around is not None and len(parts) > 1 and numbers[0] + slave.count - numbers[-1] <= 2:
        parts = [np.concatenate([parts[-1], parts[0]]), *parts[1:-1]]
    for part in parts:
        if load[part].sum() >= LEAST * load.sum():
            yield Patch(part, float(slave.weight[part].sum()))


def between_nodes(side: ContactSide, pressed: Pressed, here: slice) -> bool:
    """Whether a side none of whose nodes, ``here`` among all slaves', is closed may touch between them: by
    how it and what it faces turn against each other from the nearest node to the next."""
    gap, near = pressed.gap[here], int(np.argmin(pressed.gap[here]))
    beside = slice(max(near - 1, 0), near + 2)
    against = (side.outward + pressed.normal[here])[beside]
    turned = np.hypot(*np.diff(against, axis=0).T).max(initial=0.0)
    return bool(gap[near] < turned * side.weight[near] / 8.0)


def _widened(side: ContactSide, numbers: IntArray) -> BoolArray:
    """The nodes (c,) of a side that are ``numbers`` or next to them."""
    found = np.zeros(side.count, dtype=bool)
    for step in (-1, 0, 1):
        beside = numbers + step
        found[beside % side.count if side.around is not None else np.clip(beside, 0, side.count - 1)] = True
    return found


def _faced(side: ContactSide, places: FloatArray, width: float) -> BoolArray:
    """The nodes (c,) of a master within the ``places`` along it that a patch of a ``width`` faces, and next
    to them."""
    middle = float(places[len(places) // 2])
    away, reach = side.arc - middle, places - middle
    if side.around is not None:
        half = 0.5 * side.around
        away, reach = (np.mod(one + half, side.around) - half for one in (away, reach))
    more = width / len(places)
    inside = np.flatnonzero((away >= reach.min() - more) & (away <= reach.max() + more))
    return _widened(side, inside if len(inside) else np.array([int(np.argmin(np.abs(away)))]))
