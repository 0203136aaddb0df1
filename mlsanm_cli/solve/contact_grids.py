"""Contact grids: which contacts have one, over which range, and with which resolution.

The range is where surfaces touch: found with a few samples over all facing places, then narrowed to what
touches in the states at the ends of stages and where fields are requested. Intervals are halved where the
pressures of these states have large second differences, until the estimated error is below the accuracy of
the contact.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Literal, TypeAlias

import numpy as np

from mlsanm_cli.case import Case
from mlsanm_cli.contact.complementarity.problem import ContactStatus
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.contact_range import ContactRange
from mlsanm_cli.contact.geometry.pairing import Pairing, on_grid
from mlsanm_cli.contact.laws.contact_state import ContactState
from mlsanm_cli.contact.response.condensation import condense
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.responses import BodyResponses
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.memo import Memo
from mlsanm_cli.roundoff import ROUND_OFF
from mlsanm_cli.solve.direction_updates import rolling, turns, unturned
from mlsanm_cli.solve.grid_ranges import begun_open, first_grid, passed_beyond, ranged, touching_first
from mlsanm_cli.solve.grid_refinement import COMPRESSED_LIMITS, DENSE_LIMITS, refined, sampled

FIRST_HALF_WIDTH = 0.05
"""Half-width of the patches with which a search starts, relative to the range."""
MAX_ROUNDS = 60
TURN_ABOVE, TURN_TOLERANCE, MAX_TURNS = 1e-3, 3e-4, 4
"""Directions of pressures are rotated if they are off by the first angle, until they are off by less than the
second, at most so many times, or twice as many if a motion along them is fixed."""
EXACT_FACTOR, FRICTION_FACTOR = 0.25, 1.7
"""Estimated error of a grid over the requested accuracy at which refinement ends: without friction, at hardly
any cost; and with it, where every node that starts to slide is an event of the path."""
MAX_PATCHES, MAX_ENDS = 2, 10
"""Frictionless contacts with more patches, or on paths with more ends of stages and requested states, are
refined to the requested accuracy only: one grid is fine at the ends of contact in all states."""

Wanted: TypeAlias = Literal["ends", "known", "every", "between"]
"""States at the ends of the stages, of those that had one to start from, all that count, or some on the way
that show where surfaces touch."""
Path: TypeAlias = Callable[[Condensed], tuple[ContactState, ...]]
"""The states of the path of a condensed scene whose bodies flow, or those up to one at an end of a grid."""
Search = Callable[
    [Condensed, Sequence[ContactStatus], Wanted, Sequence[ContactState]], tuple[ContactState, ...]
]
"""The exact states of a condensed scene, searched from sets if there are any; some may be known."""


def find_grids(
    case: Case,
    scene: Scene,
    pairings: tuple[Pairing, ...],
    ranges: Mapping[str, ContactRange],
    search: Search,
    memo: Memo,
    path: Path | None = None,
) -> tuple[Condensed, tuple[ContactState, ...]] | None:
    """Condense a scene on grids that are wide and fine enough, with the exact states at the ends of its
    stages; None if a contact is too close to a corner, or its range does not converge. The search ends with
    the states of the ``path`` of bodies that flow, if given: their contacts are wider."""
    grids, passed = {name: first_grid(one) for name, one in ranges.items()}, touching_first(ranges)
    starts, common = list[ContactStatus](), dict[str, float]()
    places = len(case.contact) + sum(one.places - 1 for one in ranges.values())
    few = places <= MAX_PATCHES and len({*range(1, len(case.stage) + 1), *case.output.at}) <= MAX_ENDS
    effort = EXACT_FACTOR if few else 1.0
    accuracy = {
        one.name: one.accuracy * (FRICTION_FACTOR if one.friction else effort) for one in case.contact
    }
    exact = all(one.regularization.law == "exact" and not one.friction for one in case.contact)
    limits = COMPRESSED_LIMITS if exact else DENSE_LIMITS
    responses = resolved = None
    known: tuple[ContactState, ...] = ()
    looked = flows = settled = False
    every, turnings = False, MAX_TURNS * (2 if scene.held_motions else 1)
    condensed: Condensed | None = None
    some = _on_grids(pairings, grids, pairings)
    for _ in range(MAX_ROUNDS):
        if responses is None:
            responses = BodyResponses.of(scene, some, memo)
        if condensed is None:
            condensed = condense(scene, some, memo, responses)
        if settled:
            return condensed, search(condensed, [_starting_status(condensed.pairings)], "ends", ())
        which: Wanted = "every" if every else "known" if starts else "ends"
        starts = starts or [_starting_status(condensed.pairings)]
        states = path(condensed) if path and flows else search(condensed, starts, which, known)
        known = ()
        begun = begun_open(condensed, grids, ranges, states)
        if begun:
            ranges = {**ranges, **begun}
            grids = grids | {name: first_grid(one) for name, one in begun.items()}
            passed = {name: places for name, places in passed.items() if name not in begun}
            passed |= touching_first(begun)
            some = _on_grids(pairings, grids, some)
            starts, responses, condensed = [], None, None
            continue
        wanted = ranged(condensed, grids, ranges, states, passed)
        if wanted is None:
            return None
        if _same(wanted, grids) and responses is not resolved:
            wanted, resolved = sampled(scene, responses, grids), responses
        if _same(wanted, grids):
            # States with pressures above round-off of the largest of all.
            peaks = [float(state.pressure.max(initial=0.0)) for state in states]
            least = ROUND_OFF * max(peaks, default=0.0)
            loaded = [state for state, peak in zip(states, peaks, strict=True) if peak > least]
            wanted = refined(condensed, grids, ranges, loaded, accuracy, not every, limits)
            settled = flows
        if _same(wanted, grids):
            turned = None
            if settled:
                continue
            if every and turnings:
                turned = _turned(scene, condensed, states, grids, common)
            if turned is None and every:
                whole = all(
                    grids[name].first <= room.first and room.last <= grids[name].last
                    for name, room in ranges.items()
                )
                between = () if looked or whole else search(condensed, (), "between", ())
                if not passed_beyond(condensed, ranges, between, passed):
                    if path is None:
                        return condensed, search(condensed, starts, "ends", states)
                    flows = True
                    continue
                looked = True
                continue
            every = True
            if turned is None:
                known = states
                continue
            turnings -= 1
            wanted = turned
            ranges = {name: replace(one, facing=turned[name].facing) for name, one in ranges.items()}
        if any(wanted[name].samples_differ(grids[name]) for name in grids):
            responses = None
        grids = wanted
        some = _on_grids(pairings, grids, some)
        later = [pairing for pairing in some if not pairing.bonded]
        starts = [_moved(condensed, later, state) for state in states]
        condensed = None
    return None


def _turned(
    scene: Scene,
    condensed: Condensed,
    states: Sequence[ContactState],
    grids: Mapping[str, ContactGrid],
    common: dict[str, float],
) -> dict[str, ContactGrid] | None:
    """Grids with directions rotated with the bodies in the last states with contact, less the ``common``
    angles that would do work along held motions, which are updated; None if they are converged."""
    now: dict[str, float] = {}
    held = scene.held_motions
    for state in reversed(states):
        if rolling(scene, condensed, state):
            continue
        now = turns(scene, condensed, state) | now
        if len(now) == len(grids):
            break
    before = {name: grids[name].facing.turn for name in grids}
    after = {}
    for name, turn in before.items():
        was = turn - common.get(name, 0.0)
        angle = now.get(name, was)
        after[name] = (
            (angle if abs(angle - was) > (TURN_TOLERANCE if was else TURN_ABOVE) else was) + turn - was
        )
    if held:
        last = states[-1]
        for name, angle in unturned(condensed, last, after, held).items():
            common[name] = common.get(name, 0.0) + angle
            after[name] += angle
        settled = all(abs(after[name] - turn) <= TURN_TOLERANCE for name, turn in before.items())
        if settled and not unturned(condensed, last, before, held):
            return None
    changed = {
        name: replace(grids[name], facing=replace(grids[name].facing, turn=angle))
        for name, angle in after.items()
        if angle != before[name]
    }
    return {**grids, **changed} if changed else None


def _same(one: Mapping[str, ContactGrid], other: Mapping[str, ContactGrid]) -> bool:
    return all(one[name] is other[name] for name in one)


def _on_grids(
    pairings: Sequence[Pairing], grids: Mapping[str, ContactGrid], before: Sequence[Pairing]
) -> tuple[Pairing, ...]:
    """Contacts ``pairings`` with pressures on their ``grids``; those on grids ``before`` are kept."""
    return tuple(
        old if old.contact_grid is grids.get(new.name) else on_grid(new, grids[new.name])
        for new, old in zip(pairings, before, strict=True)
    )


def _starting_status(pairings: Sequence[Pairing]) -> ContactStatus:
    """Initial sets of a search: wide patches around the places of closest approach. Searches from few nodes
    may roll a body out of its contact."""
    closed, stuck = [np.zeros(0, dtype=bool)], [np.zeros(0, dtype=bool)]
    for pairing in pairings:
        gap = pairing.gap[pairing.candidate]
        close = gap <= gap.min()
        if not pairing.nodal:
            away = np.abs(pairing.grid.hats.place - pairing.grid.hats.place[int(np.argmin(gap))])
            close = away <= FIRST_HALF_WIDTH * (pairing.grid.last - pairing.grid.first)
        closed.append(gap <= gap[close].max())
        stuck += [closed[-1]] if pairing.friction else []
    sticking = np.concatenate(stuck)
    return ContactStatus(np.concatenate(closed), sticking, np.zeros(len(sticking)))


def _moved(condensed: Condensed, after: Sequence[Pairing], state: ContactState) -> ContactStatus:
    """Sets of a state interpolated to other grids."""
    closed, stuck, slip_sign = ([np.zeros(0)] for _ in range(3))
    for old, new in zip(condensed.pairings, after, strict=True):
        own = [state.closed[condensed.spans[old.name]].astype(float)]
        if old.friction:
            rubbing = condensed.tangential[old.name]
            own += [state.status.stuck[rubbing], np.sign(state.traction[rubbing])]
        if not (old.nodal or new.nodal):
            place, before = new.grid.hats.place, old.grid.hats.place
            own = [np.interp(place, before, values, 0.0, 0.0) for values in own]
        closed.append(own[0])
        if old.friction:
            touch, stick, sign = own
            stuck.append(stick)
            slips = (touch >= 0.5) & (stick < 0.5)
            slip_sign.append(np.where(slips, np.where(sign < 0.0, -1.0, 1.0), 0.0))
    touch, stick, sign = map(np.concatenate, (closed, stuck, slip_sign))
    return ContactStatus(touch >= 0.5, stick >= 0.5, sign)
