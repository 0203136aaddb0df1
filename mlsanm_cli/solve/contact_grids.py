"""Which contacts get a grid of their own, over which range, and how fine.

The range is where surfaces come to touch: found on all that faces, with the few samples that this takes, and
then narrowed to what does touch in the states at the stages' ends and where fields are wanted. Grids are
halved where the pressures of these states bend, until what is estimated to be left is below the contact's
accuracy.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Literal, TypeAlias

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.case import Case, Contact
from mlsanm_cli.contact.geometry.contact_range import ContactRange
from mlsanm_cli.contact.geometry.near import Near
from mlsanm_cli.contact.geometry.pairing import Pairing, on_grid
from mlsanm_cli.contact.laws.active_set import ExactState
from mlsanm_cli.contact.laws.contact_status import ContactStatus
from mlsanm_cli.contact.response.condensed import Answers, Condensed, condense
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.memo import Memo
from mlsanm_cli.solve.direction_updates import turns, unturned

FIRST = 24
"""Intervals of an even grid over all that faces."""
PER_PLACE = 10
"""Intervals of even grids for each place where surfaces come close, or means over them would not see it."""
FINEST, GROWTH = 1e-3, 1.3
"""The first grid has intervals so much finer where surfaces are nearest, growing by this factor: where bodies
roll on each other, a few places alone cannot balance their loads."""
SAMPLES = 12
"""Samples of a range at first."""
MOST_SAMPLES = 96
SMOOTH = 1e-4
"""Samples are doubled until the last coefficients of the answer are below this part of the factor of its
logarithm. Its variation says nothing: rigid motions and bending make it a hundred times as much in layers."""
LEAST = 8
"""Intervals in contact that tell where it is."""
ENDING = 2e-3
"""Intervals at the end of a range that something touches are halved down to this part of the range."""
MARGIN = 0.3
"""The range goes on past the outermost contact by this part of the width between."""
NARROWED = 0.6
"""Ranges that would become narrower than this part of themselves are narrowed."""
WIDE = 0.05
"""Half the width of the patches that a search begins with, as a part of the range."""
ROUNDS = 60
MOST, SHORTEST = 2000, 1e-5
"""Grids of more intervals are not halved any more, nor intervals below this part of the range: pressures
under corners of obstacles have no bound."""
TURNED, SETTLED, TURNINGS = 3e-3, 3e-4, 4
"""Directions turn where they are off by the first angle, and then until they are off by less than the second,
so many times at most, or twice as many where a motion is held that they push along."""
FLAT = 1e-9
"""Surfaces whose gap varies by less than this part of the range are parallel."""
PLENTY = 300
"""Grids of more intervals are refined to less, by the cube of how many more: obstacles of many corners, or
of many patches, would cost minutes otherwise."""
SHARE, WORST = 0.7, 0.1
"""Intervals are halved that have more than this part of an equal share of the error, and of the largest."""
ACCURACY, RUBBING, SMOOTHED = 0.3, 2.0, 10.0
"""Grids are refined until their estimated error is this many times the accuracy asked for: without friction,
which costs next to nothing; with it, where every place that begins to slide is an event of the path; and
where friction is smoothed, which is 0.6 % off partial slip whatever the grid."""
UNSEEN = 1e-3
"""Overlaps between the nodes of grids are looked at closely from this part of the largest approach on."""
FEW = 2
"""Contacts without friction in more places than these are refined to what is asked for only: unknowns of all
are solved for together."""

Wanted: TypeAlias = Literal["ends", "every", "between"]
"""States at the ends of the stages, all that count, or some on the way that tell where surfaces touch."""
Search = Callable[[Condensed, Sequence[ContactStatus], Wanted], tuple[ExactState, ...]]
"""The exact states of a condensed scene, searched from sets if there are any."""


def find_grids(
    case: Case,
    scene: Scene,
    pairings: tuple[Pairing, ...],
    clear: Mapping[str, ContactRange],
    search: Search,
    memo: Memo,
) -> tuple[Condensed, tuple[ExactState, ...]] | None:
    """The scene condensed on grids that are wide and fine enough, and the exact states at the ends of its
    stages; None where a contact comes too close to a corner, or where it is does not settle."""
    places = len(case.contact) + sum(one.places - 1 for one in clear.values())
    accuracy = {contact.name: contact.accuracy * _effort(contact, places) for contact in case.contact}
    grids = {name: _first(one) for name, one in clear.items()}
    answers: Answers | None = None
    starts: list[ContactStatus] = []
    common: dict[str, float] = {}
    passed: dict[str, FloatArray] = {}
    looked = False
    every, turnings = False, TURNINGS * (2 if scene.held_motions else 1)
    condensed: Condensed | None = None
    for _ in range(ROUNDS):
        some = _on_grids(pairings, grids)
        if answers is None:
            answers = Answers.of(scene, some, memo)
        if condensed is None:
            condensed = condense(scene, some, memo, answers)
        starts = starts or [_near_enough(condensed.pairings)]
        states = search(condensed, starts, "every" if every else "ends")
        wanted = _ranged(condensed, grids, clear, states, passed)
        if wanted is None:
            return None
        if _same(wanted, grids):
            wanted = _sampled(scene, answers, grids)
        if _same(wanted, grids):
            wanted = _refined(condensed, grids, clear, states, accuracy, tractions=not every)
        if _same(wanted, grids):
            turned = None
            if every and turnings:
                turned = _turned(condensed, states, grids, scene.held_motions, common)
            if turned is None and every:
                if looked or not _passed(condensed, clear, search(condensed, (), "between"), passed):
                    return condensed, search(condensed, starts, "ends")
                looked = True
                continue
            every = True
            if turned is None:
                continue
            turnings -= 1
            wanted = turned
            clear = {name: replace(one, facing=turned[name].facing) for name, one in clear.items()}
        if any(wanted[name].samples_differ(grids[name]) for name in grids):
            answers = None
        grids = wanted
        later = [pairing for pairing in _on_grids(pairings, grids) if not pairing.bonded]
        starts = [_moved(condensed, later, state) for state in states]
        condensed = None
    return None


def _turned(
    condensed: Condensed,
    states: Sequence[ExactState],
    grids: Mapping[str, Near],
    held: Sequence[Mapping[str, FloatArray]],
    common: dict[str, float],
) -> dict[str, Near] | None:
    """The grids with directions as the bodies have turned in the last states where they touch, but for the
    angles ``common`` that would push along ``held`` motions, which are brought up to date; None where these
    are so already."""
    now: dict[str, float] = {}
    for state in states:
        now.update(turns(condensed, state))
    before = {name: grids[name].facing.turn for name in grids}
    after = {}
    for name, turn in before.items():
        was = turn - common.get(name, 0.0)
        angle = now.get(name, was)
        after[name] = (angle if abs(angle - was) > (SETTLED if was else TURNED) else was) + turn - was
    if held:
        last = states[-1]
        for name, angle in unturned(condensed, last, after, held).items():
            common[name] = common.get(name, 0.0) + angle
            after[name] += angle
        settled = all(abs(after[name] - turn) <= SETTLED for name, turn in before.items())
        if settled and not unturned(condensed, last, before, held):
            return None
    result = dict(grids)
    for name, angle in after.items():
        if angle != before[name]:
            result[name] = replace(grids[name], facing=replace(grids[name].facing, turn=angle))
    return None if _same(result, grids) else result


def _effort(contact: Contact, count: int) -> float:
    """How many times a contact's accuracy its grid is refined to, where surfaces touch in so many places."""
    if not contact.friction:
        return ACCURACY if count <= FEW else 1.0
    law = contact.regularization
    return SMOOTHED if law.law == "hyperbolic" and law.friction_law == "memory" else RUBBING


def _same(one: Mapping[str, Near], other: Mapping[str, Near]) -> bool:
    return all(one[name] is other[name] for name in one)


def _first(clear: ContactRange) -> Near:
    """A coarse grid over all that faces, finer towards where the surfaces are nearest; even where they touch
    all along."""
    looks = clear.facing.gap(np.linspace(clear.first, clear.last, FIRST + 1))
    # Waves might be looked at in their troughs alone.
    if clear.places == 1 and float(np.ptp(looks)) <= FLAT * (clear.last - clear.first):
        even = clear.hats(np.linspace(clear.first, clear.last, FIRST + 1))
        return Near(clear.facing, clear.first, clear.last, SAMPLES, even, clear.centers, clear.corners)
    widest = (clear.last - clear.first) / max(FIRST, PER_PLACE * clear.places)
    parts = [np.array([clear.first, clear.nearest, clear.last])]
    for sign, room in ((-1.0, clear.nearest - clear.first), (1.0, clear.last - clear.nearest)):
        steps = [FINEST * widest]
        while sum(steps) < room:
            steps.append(min(GROWTH * steps[-1], widest))
        away = np.cumsum(steps)
        parts.append(clear.nearest + sign * away[:-1] * room / away[-1])
    hats = clear.hats(np.unique(np.concatenate(parts)))
    return Near(
        clear.facing, clear.first, clear.last, SAMPLES, hats, clear.centers, clear.corners, rough=True
    )


def _on_grids(pairings: Sequence[Pairing], grids: Mapping[str, Near]) -> tuple[Pairing, ...]:
    return tuple(
        on_grid(pairing, grids[pairing.name]) if pairing.name in grids else pairing for pairing in pairings
    )


def _near_enough(pairings: Sequence[Pairing]) -> ContactStatus:
    """Sets to begin a search with: wide patches about where surfaces are nearest. Searches from
    few places may roll a body out of its contact."""
    found = [np.zeros(0, dtype=bool)]
    for pairing in pairings:
        gap = pairing.gap[pairing.candidate]
        if pairing.near is None:
            found.append(gap <= gap.min())
            continue
        place, least = pairing.near.hats.place, int(np.argmin(gap))
        beside = np.abs(place - place[least]) <= WIDE * (pairing.near.last - pairing.near.first)
        found.append(gap <= gap[beside].max())
    stuck = [closed for closed, pairing in zip(found[1:], pairings, strict=True) if pairing.friction]
    sticking = np.concatenate([np.zeros(0, dtype=bool), *stuck])
    return ContactStatus(np.concatenate(found), sticking, np.zeros(len(sticking)))


def _moved(condensed: Condensed, after: Sequence[Pairing], state: ExactState) -> ContactStatus:
    """The sets of a state on other grids."""
    closed, stuck, slip_sign = ([np.zeros(0)] for _ in range(3))
    for old, new in zip(condensed.pairings, after, strict=True):
        span = condensed.spans[old.name]
        own = [state.active[span].astype(float), state.stuck[span].astype(float)]
        if old.friction:
            own.append(np.sign(state.traction[condensed.tangential[old.name]]))
        if old.near is not None and new.near is not None:
            place, before = new.near.hats.place, old.near.hats.place
            own = [np.interp(place, before, values, 0.0, 0.0) for values in own]
        closed.append(own[0])
        if old.friction:
            stuck.append(own[1])
            slip_sign.append(
                np.where((own[0] >= 0.5) & (own[1] < 0.5), np.where(own[2] < 0.0, -1.0, 1.0), 0.0)
            )
    touch, stick = (np.concatenate(some) >= 0.5 for some in (closed, stuck))
    return ContactStatus(touch, stick, np.concatenate(slip_sign))


def _passed(
    condensed: Condensed,
    clear: Mapping[str, ContactRange],
    states: Sequence[ExactState],
    passed: dict[str, FloatArray],
) -> bool:
    """Whether surfaces touch in some states beyond the ranges of their grids: ``passed`` then has the first
    and the last of all places."""
    beyond = False
    for pairing in condensed.pairings:
        near, span = pairing.near, condensed.spans[pairing.name]
        if near is None or pairing.bonded or not states:
            continue
        touched = [
            pairing.arc[condensed.touched(one.factors, one.motion, one.pressure, one.traction)[pairing.name]]
            for one in states
        ]
        seen = _summits(condensed, pairing.name, clear[pairing.name], states)
        closed = near.hats.place[np.any([state.active[span] for state in states], axis=0)]
        places = np.concatenate([closed, seen, *touched])
        if len(places) and (places.min() < near.first or places.max() > near.last):
            passed[pairing.name] = np.array([places.min(), places.max()])
            beyond = True
    return beyond


def _ranged(
    condensed: Condensed,
    grids: Mapping[str, Near],
    clear: Mapping[str, ContactRange],
    states: Sequence[ExactState],
    passed: Mapping[str, FloatArray],
) -> dict[str, Near] | None:
    """The grids with ranges that suit what touches, and where it ``passed`` on its way; None where that comes
    to the end of a clear range."""
    touched = [
        condensed.touched(state.factors, state.motion, state.pressure, state.traction) for state in states
    ]
    result = dict(grids)
    for pairing in condensed.pairings:
        name = pairing.name
        if name not in grids:
            continue
        near, room, nodes = grids[name], clear[name], grids[name].hats.nodes
        closed = np.any([state.active[condensed.spans[name]] for state in states], axis=0)
        seen = _summits(condensed, name, room, states)
        beyond = np.concatenate(
            [
                pairing.arc[np.any([masks[name] for masks in touched], axis=0)],
                seen[(seen < near.first) | (seen > near.last)],
            ]
        )
        places = np.flatnonzero(closed)
        if not len(places):
            if len(beyond):
                result[name] = _first(room)
            continue
        low, high = nodes[places[0]], nodes[places[-1] + 2]
        width = high - low
        reached = np.concatenate([[low, high], beyond, seen, passed.get(name, np.zeros(0))])
        low, high = float(reached.min()), float(reached.max())
        short = low <= room.first and not room.whole[0], high >= room.last and not room.whole[1]
        if any(short):
            coarse = _coarse_ends(near, places)
            if not coarse.any():
                return None
            result[name] = replace(near, hats=near.hats.halved(coarse))
            continue
        first, last = max(room.first, low - MARGIN * width), min(room.last, high + MARGIN * width)
        if room.around and (first == room.first or last == room.last):
            first, last = room.first, room.last
        outgrown = room.first < near.first >= low or room.last > near.last <= high
        if outgrown or len(beyond):
            inner = nodes[(nodes > near.first) & (nodes < near.last)]
            first, last = min(first, near.first), max(last, near.last)
            # Not as fine as where something touches at last: it may have come a long way.
            steps = max(float(np.median(near.hats.steps)), width / FIRST)
            more = [np.arange(near.first - steps, first, -steps), np.arange(near.last + steps, last, steps)]
            wider = room.hats(np.unique(np.concatenate([[first], *more, inner, [last]])))
            result[name] = replace(near, first=first, last=last, hats=wider)
        elif len(places) < LEAST:
            middle = np.zeros(len(near.hats.steps), dtype=bool)
            middle[max(places[0] - 1, 0) : places[-1] + 3] = True
            result[name] = replace(near, hats=near.hats.halved(middle))
        elif near.rough or last - first < NARROWED * (near.last - near.first):
            share = PER_PLACE * room.places * (last - first) / (room.last - room.first)
            even = room.hats(np.linspace(first, last, max(FIRST, round(share)) + 1))
            result[name] = replace(near, first=first, last=last, count=SAMPLES, hats=even, rough=False)
    return result


def _coarse_ends(near: Near, places: IntArray) -> BoolArray:
    """Which intervals (m + 1,) at an end of the range that closed ``places`` come to are too long to tell
    whether they do."""
    steps = near.hats.steps
    ends = np.zeros(len(steps), dtype=bool)
    ends[:2] |= places[0] == 0
    ends[-2:] |= places[-1] == len(steps) - 2
    return ends & (steps > ENDING * (near.last - near.first))


def _sampled(scene: Scene, answers: Answers, grids: Mapping[str, Near]) -> dict[str, Near]:
    """The grids with as many samples as the bodies' answers need."""
    result = dict(grids)
    for pairing in answers.observation.pairings:
        near = pairing.near
        if near is None or near.count >= MOST_SAMPLES:
            continue
        log = sum(
            np.abs(near.singular(scene.bodies[body].model.kernel, slave)[0]).max()
            for body, slave, _ in pairing.sides
        )
        kernel = answers.smooth(pairing)
        if near.last_coefficients(kernel) > SMOOTH * float(log):
            result[pairing.name] = replace(grids[pairing.name], count=2 * near.count)
    return result


def _refined(
    condensed: Condensed,
    grids: Mapping[str, Near],
    clear: Mapping[str, ContactRange],
    states: Sequence[ExactState],
    accuracy: Mapping[str, float],
    tractions: bool,
) -> dict[str, Near]:
    """The grids halved where the pressures, and ``tractions`` if they count, of the states need it.

    Between the ends of stages tractions do not: every level on the way has its own edges of sticking, and a
    grid fine at all of them would be fine everywhere.
    """
    result = dict(grids)
    for name, near in grids.items():
        errors = grid_errors(condensed, name, states, tractions)
        if len(errors) >= MOST:
            continue
        summits = _summits(condensed, name, clear[name], states)
        chosen = np.isin(np.arange(len(errors)), np.searchsorted(near.hats.nodes, summits) - 1)
        aim = accuracy[name] * max(1.0, len(errors) / PLENTY) ** 3
        if float(np.sqrt((errors**2).sum())) > aim:
            chosen |= errors > max(SHARE * aim / np.sqrt(len(errors)), WORST * float(errors.max()))
        chosen &= near.hats.steps > SHORTEST * (near.last - near.first)
        if chosen.any():
            result[name] = replace(near, hats=near.hats.halved(chosen))
    return result


def _summits(condensed: Condensed, name: str, room: ContactRange, states: Sequence[ExactState]) -> FloatArray:
    """Places (e,) where surfaces overlap in a state away from all that touches there: summits of a profile
    that neither means over wide hats nor the nodes beyond them see."""
    pairing = condensed.pairing_of(name)
    assert pairing.near is not None
    hats, span, watched = pairing.near.hats, condensed.spans[name], condensed.watched_of(name)
    places, drawn = room.looks
    own = hats.at_places(pairing.near.facing.gap(hats.points)[:, None])[:, 0]
    beyond_grid = pairing.arc[~pairing.candidate]
    # Not from the nodes' own gaps: these are measured towards the closest place, not along the directions of
    # pressures, which is not the same where surfaces come a long way.
    others = pairing.near.facing.gap(beyond_grid) if len(beyond_grid) else beyond_grid
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
        overlap = drawn + np.interp(places, at[order], way) < -shallow - unsure
        chosen |= overlap & (apart[interval] | beyond)
    return places[chosen]


def _bends(at: FloatArray, values: FloatArray) -> FloatArray:
    """How far (n - 1,) ``values`` (n,) may be off the straight lines between their places ``at`` (n,),
    increasing, by the second differences at both ends of each."""
    steps = np.maximum(np.diff(at), np.finfo(float).tiny)
    second = np.zeros(len(at))
    second[1:-1] = np.abs(np.diff(np.diff(values) / steps)) / (at[2:] - at[:-2])
    return np.asarray(0.25 * steps**2 * np.maximum(second[:-1], second[1:]))


def grid_errors(
    condensed: Condensed, name: str, states: Sequence[ExactState], tractions: bool = True
) -> FloatArray:
    """What every interval of a contact's grid has of the relative L2 error of its pressures, and of tractions
    if these count, in the worst of some states."""
    pairing = condensed.pairing_of(name)
    assert pairing.near is not None
    hats, worst = pairing.near.hats, np.zeros(len(pairing.near.hats.steps))
    for state in states:
        pressure = state.pressure[condensed.spans[name]]
        size = hats.norm(pressure)
        parts = [hats.errors(pressure)]
        if pairing.friction and tractions:
            parts.append(hats.errors(state.traction[condensed.tangential[name]]) / pairing.friction)
        if size > 0.0:
            worst = np.maximum(worst, np.linalg.norm(parts, axis=0) / size)
    return worst
