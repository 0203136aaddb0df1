"""Knots of contact tractions at finite strain: where they are needed is found on a path with coarse ones,
graded towards the places where surfaces are nearest. By a size function of the arc length along a side, knots
are as close as the nodes of the cloud, and closer across patches of contact and next to the places where
pressures begin or friction begins to slip, by a part of the distance to these."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np

from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.finite.contact_path import contact_path
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.complementarity.problem import OPEN, STICK
from mlsanm_cli.contact.finite.contacts import AnyContact
from mlsanm_cli.contact.finite.node_curve import wrapped
from mlsanm_cli.contact.finite.pair import BodyContact
from mlsanm_cli.contact.finite.sides import ContactSide, SideNodes
from mlsanm_cli.contact.geometry.profile import unrolled
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.roundoff import COARSE_ROUND_OFF
from mlsanm_cli.solve.state import State

GROWTH = 0.25
"""Distance of knots over that from the nearest mark."""
FIRST_SIZE = 1e-4
"""Distance of the first knots at the nearest place, relative to the length of a side."""
END_SIZE, SWEPT_SIZE = 2e-3, 0.05
"""Distance of knots at the ends of a patch, relative to its width, in requested states and in others."""
ACROSS, SWEPT_ACROSS = 24, 12
"""Least number of intervals across a patch, in requested states and in others."""
REFERENCE_ACCURACY = 1e-3
"""Accuracy of pressures with ACROSS intervals."""
FEW, MAX_PASSES = 5, 2
"""Patches with fewer closed knots are located again, by at most so many coarse paths."""
SAMPLES = 200
"""Samples of the size function on either side of a mark."""

Knots: TypeAlias = Sequence[Sequence[FloatArray]]
"""Arc lengths of the knots of all sides of all contacts."""
Sizes: TypeAlias = FloatArray
"""Where knots of a side are to be closer than its nodes: first and last arc length of patches and largest
size within (k, 3). Marks are patches without length, where knots are placed."""


def size_at(nodes: SideNodes, sizes: Sizes, arc: FloatArray) -> FloatArray:
    """Sizes (e,) at arc lengths (e,)."""
    step = np.pad(np.diff(nodes.ends), 1, mode="edge" if nodes.around is None else "wrap")
    cloud = np.interp(arc, nodes.ends, 0.5 * (step[1:] + step[:-1])[: len(nodes.ends)])
    size = cloud
    for first, last, most in sizes:
        away = np.abs(wrapped(arc - 0.5 * (first + last), nodes.around)) - 0.5 * (last - first)
        size = np.minimum(size, most + GROWTH * np.maximum(away, 0.0))
    # Next to corners, which are crushed, and without near fields tractions are as fine as the cloud.
    return np.where(nodes.at(arc, nodes.inner) < 1.0, cloud, size)


def knots(nodes: SideNodes, sizes: Sizes) -> FloatArray:
    """Arc lengths (g,) of knots on a side: corners, marks, and as many between them as sizes ask for."""
    first, last = float(nodes.ends[0]), float(nodes.ends[-1])
    fixed = np.unique([first, last, *nodes.arc[list(nodes.corners)]])
    marks = sizes[sizes[:, 0] == sizes[:, 1]]
    for mark, _, least in marks[np.argsort(marks[:, 2])]:
        place = mark if nodes.around is None else first + np.mod(mark - first, nodes.around)
        inside = first < place < last
        if inside and np.abs(fixed - place).min() > max(least, size_at(nodes, sizes, np.array([place]))[0]):
            fixed = np.sort(np.append(fixed, place))
    found = [np.array([first])]
    crowd = np.concatenate([np.zeros(1), np.geomspace(0.1 * FIRST_SIZE, 1.0, SAMPLES)])
    for one, other in pairwise(fixed):
        edges = np.unique([one, other, *sizes[:, :2].ravel()])[:, None, None]
        crowded = edges + np.array([[1.0], [-1.0]]) * (other - one) * crowd
        arc = np.concatenate([np.linspace(one, other, SAMPLES), crowded.ravel()])
        arc = np.unique(np.clip(arc, one, other))
        inverse = 1.0 / size_at(nodes, sizes, arc)
        total = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(arc) * (inverse[1:] + inverse[:-1]))])
        count = max(int(np.ceil(total[-1] - COARSE_ROUND_OFF)), 1)
        found.append(np.interp(np.linspace(0.0, total[-1], count + 1), total, arc)[1:])
    arc = np.concatenate(found)
    return arc if nodes.around is None else arc[:-1]


def with_knots(scene: FiniteScene, arcs: Knots) -> FiniteScene:
    """The scene with knots at other arc lengths."""
    pairs = list[AnyContact]()
    for contact, own in zip(scene.contacts.pairs, arcs, strict=True):
        both = zip(contact.sides, own, strict=True)
        sides = [ContactSide.on(side.nodes, np.asarray(arc)) for side, arc in both]
        changed: dict[str, Any] = dict(zip(("slave", "master"), sides, strict=False))
        pairs.append(replace(contact, **changed))
    return replace(scene, contacts=replace(scene.contacts, pairs=tuple(pairs)))


def located(scene: FiniteScene, context: RunContext) -> FiniteScene:
    """The scene with knots for the patches that a path with coarse ones finds, as far as it can be followed;
    the first knots are graded towards the places where the undeformed sides are nearest."""
    met, sizes = scene.undeformed_contacts, []
    gap = np.where(met.facing, met.gap, np.inf)
    for contact, here, _ in scene.contacts.each:
        least = FIRST_SIZE * float(np.ptp(contact.slave.nodes.ends))
        marks = [(arc, arc, least) for arc in _minima(contact.slave, gap[here])]
        sizes.append(_both(contact, met.place[here], np.array(marks).reshape(-1, 3)))
    wanted = {*scene.case.output.at, *np.arange(1.0, len(scene.stages)).tolist()}
    accuracy = {one.name: one.accuracy for one in scene.case.contact}
    for _ in range(MAX_PASSES):
        scene, fewest, reached = with_knots(scene, _arcs(scene, sizes)), np.inf, 0.0
        sizes = [[np.zeros((0, 3)) for _ in contact.sides] for contact in scene.contacts.pairs]
        steps = contact_path(scene, coarse=True)
        while reached < np.inf:
            context.stopper.check()
            try:
                state = next(steps).state
            except StopIteration:
                reached = np.inf
                break
            except NumericalError:
                break
            reached, requested = state.position, state.position in wanted
            for number, (contact, here, _) in enumerate(scene.contacts.each):
                for count, own in _patches(contact, state, here, requested, accuracy[contact.name]):
                    fewest = min(fewest, count) if requested else fewest
                    more = _both(contact, state.solver["place"][here], own)
                    sizes[number] = [np.vstack(one) for one in zip(sizes[number], more, strict=True)]
        if fewest >= FEW and reached == np.inf:
            break
    return replace(with_knots(scene, _arcs(scene, sizes)), located=reached)


def _arcs(scene: FiniteScene, sizes: Sequence[Sequence[Sizes]]) -> Knots:
    each = zip((contact.sides for contact in scene.contacts.pairs), sizes, strict=True)
    return [[knots(side.nodes, one) for side, one in zip(*both, strict=True)] for both in each]


def _minima(side: ContactSide, gap: FloatArray) -> Iterator[float]:
    """Arc lengths of the least gaps: of the parabolas through three knots."""
    count = side.count
    for i in np.flatnonzero(np.isfinite(gap)).tolist():
        three = np.array([i - 1, i, i + 1])
        if side.around is None and not 0 < i < count - 1:
            continue
        three %= count
        x, y = wrapped(side.arc[three] - side.arc[i], side.around), gap[three]
        if not np.isfinite(y).all():
            continue
        left, right = (y[1] - y[0]) / -x[0], (y[2] - y[1]) / x[2]
        bend = (right - left) / (0.5 * (x[2] - x[0]))
        if left < 0.0 <= right and bend > COARSE_ROUND_OFF / float(np.ptp(side.nodes.ends)):
            yield float(side.arc[i] + 0.5 * x[0] - left / bend)


def _both(contact: AnyContact, place: FloatArray, sizes: Sizes) -> list[Sizes]:
    """Sizes of all sides of a contact from those of its slave, whose knots face the ``place`` (c,)."""
    if not isinstance(contact, BodyContact):
        return [sizes]
    arc, around = contact.slave.arc, contact.slave.around
    ends = sizes[:, :2] if around is None else arc[0] + np.mod(sizes[:, :2] - arc[0], around)
    facing = place if contact.around is None else np.unwrap(place, period=contact.around)
    opposite = np.sort(np.interp(ends, arc, facing), axis=1)
    return [sizes, np.column_stack([opposite, sizes[:, 2]])]


def _patches(
    contact: AnyContact, state: State, here: slice, requested: bool, accuracy: float
) -> Iterator[tuple[int, Sizes]]:
    """Number of the closed knots of every patch of a slave in a state, and sizes for the ``accuracy`` of its
    pressures, whose error decreases with the square of the distance."""
    slave, order = contact.slave, np.arange(contact.slave.count)
    arc, pressure = slave.arc, state.pressure[here]
    if slave.around is not None:
        order, arc = unrolled(arc, slave.around, pressure)
    pressure, status = pressure[order], state.status[here][order]
    sense = state.solver["slip_sign"][here][order]
    closed, stick = np.flatnonzero(status != OPEN), status == STICK
    finer = np.sqrt(accuracy / REFERENCE_ACCURACY)
    for part in np.split(closed, np.flatnonzero(np.diff(closed) > 2) + 1) if len(closed) else ():
        (first, begins), (last, stops) = (_end(arc, pressure, part, way) for way in (-1, 1))
        width = max(last - first, float(slave.weight[order[part]].min()))
        size = (END_SIZE * finer if requested else SWEPT_SIZE) * width
        marks = [end for end, graded in ((first, begins), (last, stops)) if graded]
        if requested and contact.friction:
            # Between knots one of which sticks, or which slip in opposite senses.
            a, b = part[:-1], part[1:]
            changes = (stick[a] != stick[b]) | (~stick[a] & (sense[a] * sense[b] < 0.0))
            marks += (0.5 * (arc[a] + arc[b]))[changes].tolist()
        inner = width * (finer / ACROSS if requested else 1.0 / SWEPT_ACROSS)
        yield len(part), np.array([(first, last, inner), *((mark, mark, size) for mark in marks)])


def _end(arc: FloatArray, pressure: FloatArray, part: IntArray, way: int) -> tuple[float, bool]:
    """Arc length of an end of a patch, where the squares of its last two pressures tend to zero, at most at
    the next knot; and whether that is off the ends of the side, and pressures decrease there: under
    the edges of a punch they are singular, and only as fine as the cloud."""
    i = int(part[0 if way < 0 else -1])
    beyond, inner = i + way, i - way
    if not 0 <= beyond < len(arc):
        return float(arc[i]), False
    step = float(arc[beyond] - arc[i])
    if len(part) == 1 or not pressure[inner] > pressure[i]:
        return float(arc[i] + 0.5 * step), len(part) == 1
    reach = pressure[i] ** 2 / (pressure[inner] ** 2 - pressure[i] ** 2) * abs(arc[inner] - arc[i])
    return float(arc[i] + min(reach / abs(step), 1.0) * step), True
