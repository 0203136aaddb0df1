"""Knots of contact tractions at finite strain: where they are needed is found on a path with coarse ones.

By a size function of the arc length along a side, knots are as close as the nodes of the cloud, and closer
across patches of contact and next to the places where pressures begin or friction begins to slip, by a part
of the distance to these. The first knots are graded towards the places where surfaces are nearest.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TypeAlias

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
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.records import dataclass
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


@dataclass(frozen=True)
class Sizes:
    """Where knots of a side are to be closer than its nodes: ``marks`` (k, 2) with arc lengths and sizes
    there, and ``patches`` (m, 3) with their first and last arc length and the largest size within."""

    marks: FloatArray
    patches: FloatArray

    @classmethod
    def of(cls, marks: Sequence[Sequence[float]], patches: Sequence[Sequence[float]] = ()) -> Sizes:
        """From rows."""
        return cls(np.array(marks).reshape(-1, 2), np.array(patches).reshape(-1, 3))

    def plus(self, other: Sizes) -> Sizes:
        """Both together."""
        both = zip((self.marks, self.patches), (other.marks, other.patches), strict=True)
        return Sizes(*map(np.vstack, both))

    def at(self, nodes: SideNodes, arc: FloatArray) -> FloatArray:
        """Sizes (e,) at arc lengths (e,)."""
        # Distances of neighbours at the nodes, at the ends of the intervals.
        step = np.diff(nodes.ends)
        first, last = (step[:1], step[-1:]) if nodes.around is None else (step[-1:], step[:1])
        spacings = 0.5 * (np.append(first, step) + np.append(step, last))
        cloud = np.interp(arc, nodes.ends, spacings)
        size = cloud.copy()
        for mark, least in self.marks:
            size = np.minimum(size, least + GROWTH * np.abs(wrapped(arc - mark, nodes.around)))
        for first, last, most in self.patches:
            middle, half = 0.5 * (first + last), 0.5 * (last - first)
            away = np.maximum(np.abs(wrapped(arc - middle, nodes.around)) - half, 0.0)
            size = np.minimum(size, most + GROWTH * away)
        # Next to corners, which are crushed, and without near fields tractions are as fine as the cloud.
        inner = nodes.inner if nodes.around is None else np.append(nodes.inner, nodes.inner[0])
        return np.where(np.interp(arc, nodes.ends, inner.astype(float)) < 1.0, cloud, size)


def knots(nodes: SideNodes, sizes: Sizes) -> FloatArray:
    """Arc lengths (g,) of knots on a side: corners, marks, and as many between them as sizes ask for."""
    first, last = float(nodes.ends[0]), float(nodes.ends[-1])
    fixed = np.unique([first, last, *nodes.arc[list(nodes.corners)]])
    marks = sizes.marks[np.argsort(sizes.marks[:, 1])]
    for mark, least in marks:
        place = mark if nodes.around is None else first + np.mod(mark - first, nodes.around)
        inside = first < place < last
        if inside and np.abs(fixed - place).min() > max(least, sizes.at(nodes, np.array([place]))[0]):
            fixed = np.sort(np.append(fixed, place))
    found = [np.array([first])]
    crowd = np.concatenate([np.zeros(1), np.geomspace(0.1 * FIRST_SIZE, 1.0, SAMPLES)])
    for one, other in pairwise(fixed):
        inner = [np.linspace(one, other, SAMPLES)]
        inner += [one + (other - one) * crowd, other - (other - one) * crowd]
        for edges in sizes.marks[:, 0], sizes.patches[:, :2].ravel():
            inner += [edge + way * (other - one) * crowd for edge in edges for way in (1.0, -1.0)]
        arc = np.unique(np.clip(np.concatenate(inner), one, other))
        inverse = 1.0 / sizes.at(nodes, arc)
        total = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(arc) * (inverse[1:] + inverse[:-1]))])
        count = max(int(np.ceil(total[-1] - COARSE_ROUND_OFF)), 1)
        found.append(np.interp(np.linspace(0.0, total[-1], count + 1), total, arc)[1:])
    arc = np.concatenate(found)
    return arc if nodes.around is None else arc[:-1]


def knots_of(scene: FiniteScene) -> Knots:
    """Arc lengths of all knots."""
    return [[side.arc for side in contact.sides] for contact in scene.contacts.pairs]


def with_knots(scene: FiniteScene, arcs: Knots) -> FiniteScene:
    """The scene with knots at other arc lengths."""
    pairs = list[AnyContact]()
    for contact, own in zip(scene.contacts.pairs, arcs, strict=True):
        both = zip(contact.sides, own, strict=True)
        slave, *others = (ContactSide.on(side.nodes, np.asarray(arc)) for side, arc in both)
        if isinstance(contact, BodyContact):
            pairs.append(replace(contact, slave=slave, master=others[0]))
        else:
            pairs.append(replace(contact, slave=slave))
    return replace(scene, contacts=replace(scene.contacts, pairs=tuple(pairs)))


def located(scene: FiniteScene, context: RunContext) -> FiniteScene:
    """The scene with knots for the patches that a path with coarse ones finds; the first knots are graded
    towards the places where the undeformed sides are nearest."""
    factors, sizes = np.append(scene.stages[0], np.zeros(scene.contacts.free)), []
    for contact in scene.contacts.pairs:
        still, slave = np.zeros((sum(side.count for side in contact.sides), 2)), contact.slave
        met, least = contact.meet(still, factors, None), FIRST_SIZE * float(np.ptp(slave.nodes.ends))
        marks = [(arc, least) for arc in _minima(slave, np.where(met.facing, met.gap, np.inf))]
        sizes.append(_both(contact, met.place, Sizes.of(marks)))
    for _ in range(MAX_PASSES):
        scene = with_knots(scene, _arcs(scene, sizes))
        sizes, closed, reached = _touched(scene, context)
        if closed >= FEW and reached == np.inf:
            break
    return replace(with_knots(scene, _arcs(scene, sizes)), located=reached)


def _arcs(scene: FiniteScene, sizes: Sequence[Sequence[Sizes]]) -> Knots:
    return [
        [knots(side.nodes, one) for side, one in zip(contact.sides, own, strict=True)]
        for contact, own in zip(scene.contacts.pairs, sizes, strict=True)
    ]


def _minima(side: ContactSide, gap: FloatArray) -> Iterator[float]:
    """Arc lengths of the least gaps: of the parabolas through three knots."""
    count = side.count
    for i in np.flatnonzero(np.isfinite(gap)).tolist():
        before, after = (i - 1, i + 1) if side.around is None else ((i - 1) % count, (i + 1) % count)
        if not 0 <= before < after + count or after >= count:
            continue
        x = wrapped(side.arc[[before, i, after]] - side.arc[i], side.around)
        y = gap[[before, i, after]]
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
    slave, master = contact.slave, contact.master
    order = np.argsort(slave.arc)
    period = master.around
    facing = place[order] if period is None else np.unwrap(place[order], period=period)

    def opposite(arc: FloatArray) -> FloatArray:
        if slave.around is not None:
            arc = slave.arc[0] + np.mod(arc - slave.arc[0], slave.around)
        return np.interp(arc, slave.arc[order], facing)

    marks, patches = sizes.marks.copy(), sizes.patches.copy()
    marks[:, 0] = opposite(marks[:, 0])
    ends = np.stack([opposite(patches[:, 0]), opposite(patches[:, 1])], axis=1)
    patches[:, :2] = np.sort(ends, axis=1)
    return [sizes, Sizes(marks, patches)]


def _touched(scene: FiniteScene, context: RunContext) -> tuple[list[list[Sizes]], float, float]:
    """Sizes for the patches on a coarse path, the fewest closed knots of a patch, and the position up to
    which the path could be followed, infinity for its end."""
    sizes = [[Sizes.of(()) for _ in contact.sides] for contact in scene.contacts.pairs]
    fewest, wanted = np.inf, {*scene.case.output.at, *np.arange(1.0, len(scene.stages)).tolist()}
    steps, reached = contact_path(scene, coarse=True), 0.0
    while True:
        context.stopper.check()
        try:
            state = next(steps).state
        except StopIteration:
            return sizes, fewest, np.inf
        except NumericalError:
            return sizes, fewest, reached
        reached = state.position
        for number, (contact, here, _) in enumerate(scene.contacts.each):
            accuracy = next(one.accuracy for one in scene.case.contact if one.name == contact.name)
            for numbers, own in _patches(contact, state, here, state.position in wanted, accuracy):
                if state.position in wanted:
                    fewest = min(fewest, len(numbers))
                more = _both(contact, state.solver["place"][here], own)
                sizes[number] = [one.plus(other) for one, other in zip(sizes[number], more, strict=True)]


def _patches(
    contact: AnyContact, state: State, here: slice, requested: bool, accuracy: float
) -> Iterator[tuple[IntArray, Sizes]]:
    """The closed knots of every patch of a slave in a state, and sizes for the ``accuracy`` of its pressures,
    whose error decreases with the square of the distance."""
    slave, status, pressure = contact.slave, state.status[here], state.pressure[here]
    numbers = np.flatnonzero(status != OPEN)
    if not len(numbers):
        return
    parts = np.split(numbers, np.flatnonzero(np.diff(numbers) > 2) + 1)
    if slave.around is not None and len(parts) > 1 and numbers[0] + slave.count - numbers[-1] <= 2:
        parts = [np.concatenate([parts[-1], parts[0]]), *parts[1:-1]]
    finer = np.sqrt(accuracy / REFERENCE_ACCURACY)
    for part in parts:
        ends = [_end(slave, pressure, part, way) for way in (-1, 1)]
        length = ends[1][0] - ends[0][0]
        length = length if slave.around is None else length % slave.around
        first, last = ends[0][0], ends[0][0] + float(length)
        width = max(last - first, float(slave.weight[part].min()))
        size = (END_SIZE * finer if requested else SWEPT_SIZE) * width
        marks = [(arc, size) for arc, graded in ends if graded]
        if requested and contact.friction:
            marks += [(arc, size) for arc in _edges(slave, state, here, part)]
        inner = width * (finer / ACROSS if requested else 1.0 / SWEPT_ACROSS)
        yield part, Sizes.of(marks, [(first, last, inner)])


def _end(side: ContactSide, pressure: FloatArray, part: IntArray, way: int) -> tuple[float, bool]:
    """Arc length of an end of a patch, where the squares of its last two pressures tend to zero, at most at
    the next knot; and whether that is off the ends of the side, and pressures decrease there: under
    the edges of a punch they are singular, and only as fine as the cloud."""
    i = int(part[0 if way < 0 else -1])
    beyond, inner = i + way, i - way
    if side.around is not None:
        beyond, inner = beyond % side.count, inner % side.count
    elif not 0 <= beyond < side.count:
        return float(side.arc[i]), False
    step = float(wrapped(side.arc[[beyond]] - side.arc[i], side.around)[0])
    if len(part) == 1 or not pressure[inner] > pressure[i]:
        return float(side.arc[i] + 0.5 * step), len(part) == 1
    back = float(wrapped(side.arc[[inner]] - side.arc[i], side.around)[0])
    reach = pressure[i] ** 2 / (pressure[inner] ** 2 - pressure[i] ** 2) * abs(back)
    return float(side.arc[i] + min(reach / abs(step), 1.0) * step), True


def _edges(side: ContactSide, state: State, here: slice, part: IntArray) -> Iterator[float]:
    """Arc lengths between closed knots of a patch one of which sticks, or which slip in opposite senses."""
    stick, sense = state.status[here] == STICK, state.solver["slip_sign"][here]
    for one, other in pairwise(part.tolist()):
        if stick[one] != stick[other] or (not stick[one] and sense[one] * sense[other] < 0.0):
            step = float(wrapped(side.arc[[other]] - side.arc[one], side.around)[0])
            yield float(side.arc[one] + 0.5 * step)
