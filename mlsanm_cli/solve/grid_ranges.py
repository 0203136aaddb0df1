"""The range of a contact grid: where surfaces come to touch, found coarsely and then narrowed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.contact_range import ContactRange
from mlsanm_cli.contact.laws.active_set import ExactState
from mlsanm_cli.contact.response.condensed import Condensed

FIRST = 24
"""Intervals of an even grid over all that faces."""
PER_PLACE = 10
"""Intervals of even grids for each place where surfaces come close, or means over them would not see it."""
FINEST, GROWTH = 1e-3, 1.3
"""The first grid has intervals so much finer where surfaces are nearest, growing by this factor: where bodies
roll on each other, a few places alone cannot balance their loads."""
SAMPLES = 12
"""Samples of a range at first."""
LEAST = 8
"""Intervals in contact that are enough to locate it."""
ENDING = 2e-3
"""Intervals at the end of a range that something touches are halved down to this part of the range."""
MARGIN = 0.3
"""The range continues past the outermost contact by this part of the width between."""
NARROWED = 0.6
"""Ranges that would become narrower than this part of themselves are narrowed."""
FLAT = 1e-9
"""Surfaces whose gap varies by less than this part of the range are parallel."""
NOTHING = 1e-10
"""Pressures below this part of the largest of all contacts are round-off."""
OPEN = 0.1
"""Surfaces that stay open over a larger part of a range that goes all around do not touch all around."""
UNSEEN = 1e-3
"""Overlaps between the nodes of grids are looked at closely from this part of the largest approach on."""


def first_grid(limits: ContactRange) -> ContactGrid:
    """A coarse grid over all that faces, finer towards where the surfaces are nearest; even where they touch
    all along."""
    gaps = limits.facing.gap(np.linspace(limits.first, limits.last, FIRST + 1))
    # Waves might be looked at in their troughs alone.
    if limits.places == 1 and float(np.ptp(gaps)) <= FLAT * (limits.last - limits.first):
        even = limits.hats(np.linspace(limits.first, limits.last, FIRST + 1))
        return ContactGrid(
            limits.facing, limits.first, limits.last, SAMPLES, even, limits.centers, limits.corners
        )
    widest = (limits.last - limits.first) / max(FIRST, PER_PLACE * limits.places)
    parts = [np.array([limits.first, limits.nearest, limits.last])]
    for sign, room in ((-1.0, limits.nearest - limits.first), (1.0, limits.last - limits.nearest)):
        parts.append(limits.nearest + sign * _growing(room, FINEST * widest, widest))
    hats = limits.hats(spaced_apart(np.concatenate(parts), 0.5 * FINEST * widest))
    return ContactGrid(
        limits.facing,
        limits.first,
        limits.last,
        SAMPLES,
        hats,
        limits.centers,
        limits.corners,
        provisional=True,
    )


def overlapping(ranges: Mapping[str, ContactRange]) -> dict[str, FloatArray]:
    """Places where surfaces overlap as drawn, as curves through points of an arc do by a trace: they touch
    there before any load, wherever they do under it."""
    found = {}
    for name, room in ranges.items():
        places, gaps = (values[1:-1] for values in room.drawn_gaps)
        found[name] = places[gaps < -FLAT * (room.last - room.first)]
    return {name: places for name, places in found.items() if len(places)}


def _growing(room: float, step: float, widest: float) -> FloatArray:
    """Places between 0 and ``room``, the first intervals as long as ``step``, the last ones ``widest``."""
    if room <= 0.0:
        return np.zeros(0)
    steps = [step]
    while sum(steps) < room:
        steps.append(min(GROWTH * steps[-1], widest))
    away = np.cumsum(steps)
    return np.asarray(away[:-1] * room / away[-1])


def spaced_apart(nodes: FloatArray, least: float) -> FloatArray:
    """The ``nodes``, sorted, without those inside that are nearer than ``least`` to the one before or to the
    last: round-off would make intervals of no length, next to which halving would go on down to such."""
    nodes = np.unique(nodes)
    kept = np.diff(nodes, prepend=-np.inf) >= least
    kept &= nodes <= nodes[-1] - least
    kept[-1] = True
    return np.asarray(nodes[kept])


def ranged(
    condensed: Condensed,
    grids: Mapping[str, ContactGrid],
    ranges: Mapping[str, ContactRange],
    states: Sequence[ExactState],
    passed: dict[str, FloatArray],
) -> dict[str, ContactGrid] | None:
    """The grids with ranges that suit what touches, and where it ``passed`` on its way; None where that comes
    to the end of the range that it may have.

    Nodes beyond a grid that touch stay within its range from then on: far from each other they meet others
    than the grid's places do, and may not touch on it.
    """
    touched = [
        condensed.touched(state.factors, state.motion, state.pressure, state.traction) for state in states
    ]
    result = dict(grids)
    for pairing in condensed.pairings:
        name = pairing.name
        if name not in grids:
            continue
        grid, room, nodes = grids[name], ranges[name], grids[name].hats.nodes
        closed = np.any([_pressed(state, condensed.spans[name]) for state in states], axis=0)
        seen = summits(condensed, name, room, states)
        beyond = np.concatenate(
            [
                pairing.arc[np.any([masks[name] for masks in touched], axis=0)],
                seen[(seen < grid.first) | (seen > grid.last)],
            ]
        )
        if len(beyond) and not grid.provisional:
            passed[name] = np.concatenate([passed.get(name, np.zeros(0)), beyond])
        places = np.flatnonzero(closed)
        if not len(places):
            if len(beyond):
                result[name] = first_grid(room)
            continue
        low, high = nodes[places[0]], nodes[places[-1] + 2]
        width = high - low
        reached = np.concatenate([[low, high], beyond, seen, passed.get(name, np.zeros(0))])
        low, high = float(reached.min()), float(reached.max())
        short = low <= room.first and not room.whole[0], high >= room.last and not room.whole[1]
        if any(short):
            coarse = _coarse_ends(grid, places)
            if not coarse.any():
                return None
            result[name] = replace(grid, hats=grid.hats.halved(coarse))
            continue
        first, last = max(room.first, low - MARGIN * width), min(room.last, high + MARGIN * width)
        if room.around and (first == room.first or last == room.last):
            first, last = room.first, room.last
        outgrown = room.first < grid.first >= low or room.last > grid.last <= high
        if outgrown or len(beyond):
            inner = nodes[(nodes > grid.first) & (nodes < grid.last)]
            first, last = min(first, grid.first), max(last, grid.last)
            # Not as fine as where something touches at last: it may have come a long way.
            steps = max(float(np.median(grid.hats.steps)), width / FIRST)
            widest = max(steps, (room.last - room.first) / max(FIRST, PER_PLACE * room.places))
            more = [
                grid.first - _growing(grid.first - first, steps, widest),
                grid.last + _growing(last - grid.last, steps, widest),
            ]
            nodes = np.concatenate([[first], *more, inner, [last]])
            finest = float(grid.hats.steps[grid.hats.steps > 0.0].min())
            wider = room.hats(spaced_apart(nodes, 0.5 * finest))
            result[name] = replace(grid, first=first, last=last, hats=wider)
        elif len(places) < LEAST:
            result[name] = replace(grid, hats=grid.hats.halved(_beside(places, len(grid.hats.steps))))
        elif grid.provisional or last - first < NARROWED * (grid.last - grid.first):
            share = PER_PLACE * room.places * (last - first) / (room.last - room.first)
            even = room.hats(np.linspace(first, last, max(FIRST, round(share)) + 1))
            result[name] = replace(grid, first=first, last=last, count=SAMPLES, hats=even, provisional=False)
    return result


def _beside(places: IntArray, count: int) -> BoolArray:
    """Which of ``count`` intervals are next to closed ``places``, two on either side; not those between: two
    crests would halve all of a sheet."""
    near = np.zeros(count, dtype=bool)
    near[np.clip(places[:, None] + np.arange(-1, 3), 0, count - 1)] = True
    return near


def begun_open(
    condensed: Condensed,
    grids: Mapping[str, ContactGrid],
    ranges: Mapping[str, ContactRange],
    states: Sequence[ExactState],
) -> dict[str, ContactRange]:
    """The ranges that go all around and begin where something touches, begun in the middle of what stays open
    in all states instead; none of those that touch all around.

    Where a pin is drawn in the middle of its hole nothing tells where it will be pressed to. Pressures are
    independent of each other on both sides of where a range begins.
    """
    found = {}
    for name, grid in grids.items():
        room = ranges[name]
        if not room.around or (grid.first, grid.last) != (room.first, room.last):
            continue
        closed = np.any([_pressed(state, condensed.spans[name]) for state in states], axis=0)
        places = np.flatnonzero(closed)
        if not len(places) or (places[0] > 0 and places[-1] < len(closed) - 1):
            continue
        long, at = room.last - room.first, grid.hats.place[places]
        after = np.roll(at, -1)
        after[-1] += long
        widest = int(np.argmax(after - at))
        if after[widest] - at[widest] > OPEN * long:
            middle = 0.5 * float(at[widest] + after[widest])
            first = middle if widest < len(at) - 1 else middle - long
            nearest = first + np.mod(room.nearest - first, long)
            found[name] = replace(room, first=first, last=first + long, nearest=float(nearest))
    return found


def _pressed(state: ExactState, span: slice) -> BoolArray:
    """Which places (m,) of a contact touch in a state; none where only round-off presses, as under a body
    that no load acts on, which touches at one place however fine the grid is."""
    nothing = float(state.pressure[span].max(initial=0.0)) <= NOTHING * float(state.pressure.max(initial=0.0))
    return np.zeros_like(state.active[span]) if nothing else state.active[span]


def _coarse_ends(grid: ContactGrid, places: IntArray) -> BoolArray:
    """Which intervals (m + 1,) at an end of the range that closed ``places`` reach are too long to
    show whether they do."""
    steps = grid.hats.steps
    ends = np.zeros(len(steps), dtype=bool)
    ends[:2] |= places[0] == 0
    ends[-2:] |= places[-1] == len(steps) - 2
    return ends & (steps > ENDING * (grid.last - grid.first))


def passed_beyond(
    condensed: Condensed,
    ranges: Mapping[str, ContactRange],
    states: Sequence[ExactState],
    passed: dict[str, FloatArray],
) -> bool:
    """Whether surfaces touch in some states beyond the ranges of their grids: ``passed`` then has the first
    and the last of all places."""
    beyond = False
    for pairing in condensed.pairings:
        grid, span = pairing.grid, condensed.spans[pairing.name]
        if grid is None or pairing.bonded or not states:
            continue
        touched = [
            pairing.arc[condensed.touched(one.factors, one.motion, one.pressure, one.traction)[pairing.name]]
            for one in states
        ]
        seen = summits(condensed, pairing.name, ranges[pairing.name], states)
        closed = grid.hats.place[np.any([state.active[span] for state in states], axis=0)]
        places = np.concatenate([closed, seen, *touched])
        if len(places) and (places.min() < grid.first or places.max() > grid.last):
            places = np.concatenate([places, passed.get(pairing.name, places)])
            passed[pairing.name] = np.array([places.min(), places.max()])
            beyond = True
    return beyond


def summits(condensed: Condensed, name: str, room: ContactRange, states: Sequence[ExactState]) -> FloatArray:
    """Places (e,) where surfaces overlap in a state away from all that touches there: summits of a profile
    that neither means over wide hats nor the nodes beyond them see."""
    pairing = condensed.pairing_of(name)
    assert pairing.grid is not None
    hats, span, watched = pairing.grid.hats, condensed.spans[name], condensed.watched_of(name)
    places, drawn = room.drawn_gaps
    own = pairing.grid.gap
    beyond_grid = pairing.arc[~pairing.candidate]
    # Not from the nodes' own gaps: these are measured towards the closest place, not along the directions of
    # pressures, which is not the same where surfaces come a long way.
    others = pairing.grid.facing.gap(beyond_grid) if len(beyond_grid) else beyond_grid
    at = np.concatenate([hats.place, beyond_grid])
    order = np.argsort(at)
    interval = np.clip(np.searchsorted(hats.nodes, places) - 1, 0, len(hats.steps) - 1)
    beyond = (places < hats.nodes[0]) | (places > hats.nodes[-1])
    chosen = np.zeros(len(places), dtype=bool)
    for state in states:
        gap = condensed.watched(state.factors, state.motion, state.pressure, state.traction)[watched]
        moved = np.concatenate([state.gap[span] - own, gap - others])
        closed = state.active[span]
        touching = np.pad(closed, 2)
        apart = ~(touching[:-3] | touching[1:-2] | touching[2:-1] | touching[3:])
        shallow = UNSEEN * float(np.abs(moved[: len(own)][closed]).max(initial=0.0))
        way = moved[order]
        # Between nodes far apart a body that turns moves along a curve.
        between = np.clip(np.searchsorted(at[order], places) - 1, 0, len(way) - 2)
        unsure = _bends(at[order], way)[between]
        overlap = drawn + np.interp(places, at[order], way) < -shallow + unsure
        chosen |= overlap & (apart[interval] | beyond)
    return places[chosen]


def _bends(at: FloatArray, values: FloatArray) -> FloatArray:
    """How far (n - 1,) ``values`` (n,) may be off the straight lines between their places ``at`` (n,),
    increasing, by the second differences at both ends of each."""
    steps = np.maximum(np.diff(at), np.finfo(float).tiny)
    second = np.zeros(len(at))
    second[1:-1] = np.abs(np.diff(np.diff(values) / steps)) / (at[2:] - at[:-2])
    return np.asarray(0.25 * steps**2 * np.maximum(second[:-1], second[1:]))
