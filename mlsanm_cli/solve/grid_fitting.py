"""Fitting of contact grids to states: the range, narrowed to the contact, samples of the responses of bodies,
and halving of intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.complementarity.problem import FEASIBLE
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid, ContactRange
from mlsanm_cli.contact.geometry.surface_response import SurfaceResponse
from mlsanm_cli.contact.laws.contact_state import ContactState
from mlsanm_cli.contact.response.compressed import COMPRESSED_CONTACT
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.responses import BodyResponses
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, ROUND_OFF

FIRST_INTERVALS = 24
"""Intervals of the even grid over all facing surfaces."""
INTERVALS_PER_MINIMUM = 10
"""Intervals of even grids for each minimum of the gap, so that means over them represent it."""
FINEST_INTERVAL, INTERVAL_GROWTH = 1e-3, 1.3
"""Length of the intervals of the first grid where surfaces are nearest, relative to the others, and its
growth."""
FIRST_SAMPLES = 12
"""Initial number of samples of a range."""
MIN_CLOSED = 8
"""Number of intervals in contact that suffices to locate it."""
MIN_END_INTERVAL = 2e-3
"""Intervals at the end of a range in contact are halved down to this part of the range."""
RANGE_MARGIN = 0.3
"""Extension of the range beyond the outermost contact, relative to the width of the contact."""
MIN_NARROWING = 0.6
"""Ranges are narrowed if the new width is below this part of the old one."""
TOUCHING = 1e-3
"""Gap, relative to the range, below which surfaces touch as drawn."""
MAX_OPEN_SHARE = 0.1
"""Open part of a closed surface above which it is not in contact all around."""
MIN_OVERLAP = 1e-3
"""Overlap between grid nodes, relative to the largest approach, above which it is examined."""
MAX_SAMPLES = 96
SAMPLE_TOLERANCE = 1e-4
"""Samples are doubled until the last coefficients of the response are below this part of the factor of its
logarithm."""
MIN_INTERVAL = 1e-5
"""Intervals below this part of the range are not halved: pressures under corners of obstacles are
unbounded."""
MIN_CLAMPED_INTERVAL = 0.25
"""Least interval beside clamped sides, relative to the reach of their corner: stresses are singular there
without contact, and clouds do not resolve more."""
DENSE_LIMITS, COMPRESSED_LIMITS = (300, 2000), (5000, 20_000)
"""Numbers of intervals above which grids are refined to a lower accuracy, by the cube of the ratio, and above
which they are not refined, of paths that need dense matrices and of others."""
END_ERROR_SHARE = 0.3
"""Intervals at the ends of a grid with this part of the largest error are halved twice at once; further
halvings save nothing."""
EQUAL_SHARE, WORST_SHARE, WORST_SHARE_OF_MANY = 0.7, 0.1, 0.02
"""Intervals are halved whose error is above this part of an equal share, and of the largest: more at once in
grids with many intervals, as each round takes long."""
WORST_SHARE_WITHOUT_FRICTION, QUARTER_RATIO = 0.05, 4.0
"""Part of the largest error without friction, where rounds take longer than more intervals do; and intervals
with more than this multiple of the least error of halved ones are quartered, but not for tractions."""


class GridFit(NamedTuple):
    """The ``grid`` of a contact within its ``room``, and places (e,) that the contact has ``passed``."""

    name: str
    room: ContactRange
    grid: ContactGrid
    passed: FloatArray

    @classmethod
    def of(cls, name: str, room: ContactRange) -> GridFit:
        """The first grid. Passed are places where surfaces overlap before any load, as curves through points
        of an arc do slightly, and where curved ones are nearest if they touch as drawn: contacts move on from
        there."""
        (places, gaps), long = (values[1:-1] for values in room.drawn_gaps), room.last - room.first
        nearest = np.array([room.nearest])
        touches = np.ptp(gaps) > TOUCHING * long and room.facing.gap(nearest)[0] < TOUCHING * long
        passed = np.append(places[gaps < -ROUND_OFF * long], nearest if touches else [])
        return cls(name, room, first_grid(room), passed)

    @property
    def inside(self) -> bool:
        """Whether the room goes on beyond the grid."""
        return self.room.first < self.grid.first or self.grid.last < self.room.last

    def turned(self, angle: float) -> GridFit:
        """The same with directions of pressures at an ``angle``."""
        facing = replace(self.grid.facing, turn=angle)
        grid = self.grid if angle == self.grid.facing.turn else replace(self.grid, facing=facing)
        return self._replace(room=replace(self.room, facing=facing), grid=grid)


def first_grid(limits: ContactRange) -> ContactGrid:
    """Coarse grid over all facing places, finer towards the closest approach; uniform for parallel
    surfaces."""
    places = np.linspace(limits.first, limits.last, FIRST_INTERVALS + 1)
    gaps, length = limits.facing.gap(places), limits.last - limits.first
    # A uniform grid might sample waves at their troughs only.
    parallel = limits.places == 1 and float(np.ptp(gaps)) <= ROUND_OFF * length
    if not parallel:
        widest = length / max(FIRST_INTERVALS, INTERVALS_PER_MINIMUM * limits.places)
        finest, nearest = FINEST_INTERVAL * widest, limits.nearest
        before = nearest - _growing(nearest - limits.first, finest, widest)
        after = nearest + _growing(limits.last - nearest, finest, widest)
        fixed = [limits.first, nearest, limits.last]
        places = spaced_apart(np.concatenate([fixed, before, after]), 0.5 * finest)
    grid = ContactGrid(limits.facing, limits.first, limits.last, FIRST_SAMPLES, limits.hats(places))
    grid = replace(grid, centers=limits.centers, corners=limits.corners, provisional=not parallel)
    return replace(grid, planes=limits.planes, pins=limits.pins)


def _growing(room: float, step: float, widest: float) -> FloatArray:
    """Places between 0 and ``room`` with intervals growing from ``step`` to at most ``widest``."""
    if room <= 0.0:
        return np.zeros(0)
    steps = [step]
    while sum(steps) < room:
        steps.append(min(INTERVAL_GROWTH * steps[-1], widest))
    away = np.cumsum(steps)
    return np.asarray(away[:-1] * room / away[-1])


def spaced_apart(nodes: FloatArray, least: float) -> FloatArray:
    """Sorted ``nodes`` without inner ones closer than ``least`` to the one before or to the last: intervals
    of round-off length would be refined without end."""
    nodes = np.unique(nodes)
    kept = np.diff(nodes, prepend=-np.inf) >= least
    kept &= nodes <= nodes[-1] - least
    kept[-1] = True
    return np.asarray(nodes[kept])


def begun_open(condensed: Condensed, fit: GridFit, states: Sequence[ContactState]) -> GridFit:
    """The fit of a closed curve whose grid begins inside a contact begun anew in the middle of the part open
    in all states, if it is not in contact all around."""
    name, room, grid, _ = fit
    if not room.around or fit.inside:
        return fit
    places = np.flatnonzero(_pressed(condensed, name, states))
    if not len(places) or (places[0] > 0 and places[-1] < len(grid.hats.place) - 1):
        return fit
    long, at = room.last - room.first, grid.hats.place[places]
    after = np.append(at[1:], at[0] + long)
    widest = int(np.argmax(after - at))
    if after[widest] - at[widest] <= MAX_OPEN_SHARE * long:
        return fit
    middle = 0.5 * float(at[widest] + after[widest])
    first = middle if widest < len(at) - 1 else middle - long
    nearest = float(first + np.mod(room.nearest - first, long))
    return GridFit.of(name, replace(room, first=first, last=first + long, nearest=nearest))


def ranged(condensed: Condensed, fit: GridFit, states: Sequence[ContactState]) -> GridFit | None:
    """The fit with a range that contains the contact, and where it passed on its way; None if it comes to the
    end of the room. Nodes beyond a grid that touch are included in its range from then on: they are paired in
    directions other than those of the grid, and may be open on it."""
    name, room, grid, _ = fit
    nodes, steps = grid.hats.nodes, grid.hats.steps
    places = np.flatnonzero(_pressed(condensed, name, states))
    touched, seen = _overlapping(condensed, fit, states)
    beyond = np.append(touched, seen[(seen < grid.first) | (seen > grid.last)])
    if not grid.provisional:
        fit = fit._replace(passed=np.append(fit.passed, beyond))
    if not len(places):
        if len(beyond):
            fit = fit._replace(grid=first_grid(room))
        return fit
    low, high = nodes[places[0]], nodes[places[-1] + 2]
    width = high - low
    reached = np.concatenate([[low, high], beyond, seen, fit.passed])
    low, high = float(reached.min()), float(reached.max())
    if (low <= room.first and not room.whole[0]) or (high >= room.last and not room.whole[1]):
        # Intervals at a closed end that are too long to tell whether the contact reaches it.
        ends = np.zeros(len(steps), dtype=bool)
        ends[:2] |= places[0] == 0
        ends[-2:] |= places[-1] == len(steps) - 2
        ends &= steps > MIN_END_INTERVAL * (grid.last - grid.first)
        if not ends.any():
            return None
        return fit._replace(grid=replace(grid, hats=grid.hats.halved(ends)))
    first, last = room.extended(low - RANGE_MARGIN * width, high + RANGE_MARGIN * width)
    if room.around and (first == room.first or last == room.last):
        first, last = room.first, room.last
    long, count = room.last - room.first, INTERVALS_PER_MINIMUM * room.places
    if room.first < grid.first >= low or room.last > grid.last <= high or len(beyond):
        first, last = min(first, grid.first), max(last, grid.last)
        # Coarser than at the final contact: the contact may have moved far.
        step = max(float(np.median(steps)), width / FIRST_INTERVALS)
        widest = max(step, long / max(FIRST_INTERVALS, count))
        before = grid.first - _growing(grid.first - first, step, widest)
        after = grid.last + _growing(last - grid.last, step, widest)
        inner = nodes[(nodes > grid.first) & (nodes < grid.last)]
        nodes = np.concatenate([[first], before, after, inner, [last]])
        wider = room.hats(spaced_apart(nodes, 0.5 * float(steps[steps > 0.0].min())))
        grid = replace(grid, first=first, last=last, hats=wider)
    elif len(places) < MIN_CLOSED:
        # Intervals within two of closed places; those between contacts are not refined.
        near = np.zeros(len(steps), dtype=bool)
        near[np.clip(places[:, None] + np.arange(-1, 3), 0, len(steps) - 1)] = True
        grid = replace(grid, hats=grid.hats.halved(near))
    elif grid.provisional or last - first < MIN_NARROWING * (grid.last - grid.first):
        intervals = max(FIRST_INTERVALS, round(count * (last - first) / long))
        even = room.hats(np.linspace(first, last, intervals + 1))
        grid = replace(grid, first=first, last=last, count=FIRST_SAMPLES, hats=even, provisional=False)

    return fit._replace(grid=grid)


def passed_beyond(condensed: Condensed, fit: GridFit, states: Sequence[ContactState]) -> GridFit:
    """The fit of a contact that has passed places where its surfaces touch in some states beyond its grid."""
    closed = np.any([one.closed[condensed.spans[fit.name]] for one in states], axis=0)
    places = np.concatenate([fit.grid.hats.place[closed], *_overlapping(condensed, fit, states)])
    if not len(places) or (places.min() >= fit.grid.first and places.max() <= fit.grid.last):
        return fit
    return fit._replace(passed=np.append(fit.passed, places))


def _pressed(condensed: Condensed, name: str, states: Sequence[ContactState]) -> BoolArray:
    """Mask (m,) of places closed in some state with pressures above round-off; a body without loads touches
    at one place however fine the grid is."""
    span = condensed.spans[name]
    some = [
        state.closed[span]
        & (state.pressure[span].max(initial=0.0) > FEASIBLE * state.pressure.max(initial=0.0))
        for state in states
    ]
    return np.asarray(np.any(some, axis=0))


def _overlapping(
    condensed: Condensed, fit: GridFit, states: Sequence[ContactState]
) -> tuple[FloatArray, FloatArray]:
    """Places of overlaps in a state away from its contact: paired nodes beyond a grid, and summits of a
    profile between its nodes; within the grid, where halving decides, also possible ones."""
    pairing, (places, drawn) = condensed.pairing_of(fit.name), fit.room.drawn_gaps
    hats, span, watched = pairing.grid.hats, condensed.spans[fit.name], condensed.watched_of(fit.name)
    own = pairing.grid.gap
    beyond_grid = pairing.arc[~pairing.candidate]
    # Nodal gaps are measured to the closest place instead of along the directions of pressures, which differs
    # after large motions.
    others = pairing.grid.facing.gap(beyond_grid) if len(beyond_grid) else beyond_grid
    at = np.concatenate([hats.place, beyond_grid])
    order = np.argsort(at)
    interval = np.clip(np.searchsorted(hats.nodes, places) - 1, 0, len(hats.steps) - 1)
    beyond = (places < hats.nodes[0]) | (places > hats.nodes[-1])
    chosen, touched = np.zeros(len(places), dtype=bool), np.zeros(len(beyond_grid), dtype=bool)
    for state in states:
        gap = (condensed.watched(*state.unknowns) + state.shift)[watched]
        touched |= gap < 0.0
        moved = np.concatenate([state.gap[span] - own, gap - others])
        closed = state.closed[span]
        touching = np.pad(closed, 2)
        apart = ~(touching[:-3] | touching[1:-2] | touching[2:-1] | touching[3:])
        shallow = MIN_OVERLAP * float(np.abs(moved[: len(own)][closed]).max(initial=0.0))
        way = moved[order]
        # Between distant nodes a rotating body moves along a curve: the error of linear interpolation, from
        # second differences.
        steps, second = np.maximum(np.diff(at[order]), np.finfo(float).tiny), np.zeros(len(way))
        second[1:-1] = np.abs(np.diff(np.diff(way) / steps)) / (at[order][2:] - at[order][:-2])
        between = np.clip(np.searchsorted(at[order], places) - 1, 0, len(way) - 2)
        unsure = (0.25 * steps**2 * np.maximum(second[:-1], second[1:]))[between]
        overlap = drawn + np.interp(places, at[order], way) < np.where(beyond, -unsure, unsure) - shallow
        chosen |= overlap & (apart[interval] | beyond)
    return beyond_grid[touched], places[chosen]


def sampled(scene: Scene, answers: BodyResponses, fit: GridFit) -> GridFit:
    """The fit with as many samples as the responses of the bodies require."""
    pairing = next(one for one in answers.drivers.on_grids if one.name == fit.name)
    grid, count = pairing.grid, pairing.grid.count
    if count >= MAX_SAMPLES:
        return fit
    log = sum(
        np.abs(SurfaceResponse.of(grid, scene.bodies[body].model.kernel, slave).tensors[0]).max()
        for body, slave, _ in pairing.sides
    )
    size = grid.coefficients(answers.smooth(pairing))
    aim, last = SAMPLE_TOLERANCE * float(log), float(size[-2:].max())
    # Coefficients decay algebraically where a range reaches corners, else geometrically; then few tell how
    # fast, so that more are looked at.
    half = max(float(size[count // 2 - 2 : count // 2].max()), last)
    cornered = bool(grid.corners_of(True) or grid.corners_of(False))
    decay, power, most = last / (half or 1.0), *((1, MAX_SAMPLES) if cornered else (2, 4 * grid.count))
    while last > aim and count < min(MAX_SAMPLES, most):
        decay = decay**power
        last, count = last * decay, 2 * count
    return fit if count == grid.count else fit._replace(grid=replace(fit.grid, count=count))


def refined(
    condensed: Condensed,
    fit: GridFit,
    states: Sequence[ContactState],
    accuracy: float,
    tractions: bool,
    limits: tuple[int, int],
) -> GridFit:
    """The fit with intervals halved where the pressures of the states require it, up to ``limits``, and
    ``tractions`` if they count. Those at the ends of a grid with the largest errors are halved once more
    towards the end, where errors of unbounded pressures decrease slowly."""
    grid, steps = fit.grid, fit.grid.hats.steps
    if len(steps) >= limits[1]:
        return fit
    each = [grid_errors(condensed, fit.name, state, tractions) for state in states]
    places = _overlapping(condensed, fit, states)[1]
    chosen = np.isin(np.arange(len(steps)), np.searchsorted(grid.hats.nodes, places) - 1)
    quartered, free = np.zeros_like(chosen), condensed.pairing_of(fit.name).friction == 0.0
    many = len(steps) > COMPRESSED_CONTACT
    aim = accuracy * max(1.0, len(steps) / limits[0]) ** 3
    part = WORST_SHARE_OF_MANY if many else WORST_SHARE_WITHOUT_FRICTION if free else WORST_SHARE
    # Ends of other states are no part of a state's error, and its share is one of the intervals that
    # contribute; many patches end everywhere, and rounds take long.
    for errors in each:
        if float(np.linalg.norm(errors)) > aim:
            count = len(errors) if many else float(errors.sum()) ** 2 / float((errors**2).sum())
            least = max(EQUAL_SHARE * aim / np.sqrt(count), part * float(errors.max()))
            chosen |= errors > least
            quartered |= (free or not tractions) & (errors > QUARTER_RATIO * least)
    chosen &= steps > _shortest(grid)
    if not chosen.any():
        return fit
    errors, ends = np.max(each, axis=0, initial=0.0), np.flatnonzero(steps > 0.0)[[0, -1]]
    large = chosen & (errors >= END_ERROR_SHARE * errors.max())
    once = replace(grid, hats=grid.hats.halved(chosen))
    hats = once.hats
    within = np.searchsorted(grid.hats.nodes, 0.5 * (hats.nodes[1:] + hats.nodes[:-1])) - 1
    again = (chosen & quartered)[np.clip(within, 0, len(chosen) - 1)]
    again[np.flatnonzero(hats.steps > 0.0)[[0, -1]]] |= large[ends]
    again &= hats.steps > _shortest(once)
    return fit._replace(grid=replace(once, hats=hats.halved(again)))


def grid_errors(condensed: Condensed, name: str, state: ContactState, tractions: bool = True) -> FloatArray:
    """Contribution of every interval of a contact grid to the relative L2 error of its pressures, and
    ``tractions`` if they count, in a state; 0 for the shortest ones."""
    pairing, pressure = condensed.pairing_of(name), state.pressure[condensed.spans[name]]
    hats = pairing.grid.hats
    if np.abs(pressure).max(initial=0.0) <= COARSE_ROUND_OFF * np.abs(state.pressure).max(initial=0.0):
        return np.zeros(len(hats.steps))
    parts = [hats.errors(pressure)]
    if pairing.friction and tractions:
        parts.append(hats.errors(state.traction[condensed.tangential[name]]) / pairing.friction)
    errors = np.linalg.norm(parts, axis=0) / hats.norm(pressure)
    return np.where(hats.steps <= _shortest(pairing.grid), 0.0, errors)


def _shortest(grid: ContactGrid) -> FloatArray:
    """Lengths (e,) below which intervals are not halved."""
    least = np.full(len(grid.hats.steps), MIN_INTERVAL * (grid.last - grid.first))
    for slave in (True, False):
        for corner in grid.corners_of(slave):
            if corner.wedge.clamped:
                away = corner.distance(grid.facing.side(grid.hats.nodes, slave)[0])
                longer = np.maximum(least, MIN_CLAMPED_INTERVAL * corner.reach)
                least = np.where(np.minimum(away[:-1], away[1:]) < corner.reach, longer, least)
    return least
