"""Which contacts get a grid of their own, over which range, and how fine.

The range is where surfaces come to touch: found on all that faces, with the few samples that this takes, and
then narrowed to what does touch in the states at the stages' ends and where fields are wanted. Grids are
halved where the pressures of these states bend, until what is estimated to be left is below the contact's
accuracy.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.app.near_geometry import Clear
from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.contact.active_set import ExactState
from mlsanm_cli.contact.condensed import Answers, Condensed, condense
from mlsanm_cli.contact.grid import Hats
from mlsanm_cli.contact.near import Near
from mlsanm_cli.contact.near_answers import sides
from mlsanm_cli.contact.pairing import Pairing, on_grid
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.memo import Memo

FIRST = 24
"""Intervals of the first grid over all that faces."""
SAMPLES = 12
"""Samples of a range at first."""
MOST_SAMPLES = 96
SMOOTH = 1e-4
"""Samples are doubled until the last coefficients of the answer are below this part of its variation."""
LEAST = 8
"""Intervals in contact that tell where it is."""
MARGIN = 0.6
"""The range goes on past the outermost contact by this part of the width between."""
NARROWED = 0.6
"""Ranges that would become narrower than this part of themselves are narrowed."""
ROUNDS = 60
MOST = 2000
"""Grids of more intervals are not halved any more."""
SHARE, WORST = 0.7, 0.1
"""Intervals are halved that have more than this part of an equal share of the error, and of the largest."""
ACCURACY = 0.3
"""Grids are refined until their estimated error is this part of the accuracy asked for: the estimate is that
of the best piecewise linear pressures, and within a factor of two."""

Search = Callable[[Condensed, Sequence[BoolArray], bool], tuple[ExactState, ...]]
"""The exact states of a condensed scene, searched from sets of closed places if there are any: all that count,
or only those at the ends of the stages."""


def find_grids(
    case: Case,
    scene: Scene,
    pairings: tuple[Pairing, ...],
    clear: Mapping[str, Clear],
    search: Search,
    memo: Memo,
) -> tuple[Condensed, tuple[ExactState, ...]] | None:
    """The scene condensed on grids that are wide and fine enough, and the exact states at the ends of its
    stages; None where a contact comes too close to a corner."""
    accuracy = {contact.name: ACCURACY * contact.accuracy for contact in case.contact}
    grids = {name: _first(one) for name, one in clear.items()}
    answers: Answers | None = None
    starts: list[BoolArray] = []
    every = False
    for _ in range(ROUNDS):
        some = _on_grids(pairings, grids)
        answers = answers or Answers.of(scene, some, memo)
        condensed = condense(scene, some, memo, answers)
        states = search(condensed, starts, every)
        wanted = _ranged(condensed, grids, clear, states)
        if wanted is None:
            return None
        if _same(wanted, grids):
            wanted = _sampled(scene, answers, grids)
        if _same(wanted, grids):
            wanted = _refined(condensed, grids, states, accuracy)
        if _same(wanted, grids):
            if every:
                return condensed, search(condensed, starts, False)
            every = True
            continue
        if any(wanted[name].samples_differ(grids[name]) for name in grids):
            answers = None
        grids = wanted
        starts = [_moved(some, _on_grids(pairings, grids), state.active) for state in states]
    raise NumericalError(
        f"the contact grid was still changing after {ROUNDS} rounds", "raise contact.NAME.accuracy"
    )


def _same(one: Mapping[str, Near], other: Mapping[str, Near]) -> bool:
    return all(one[name] is other[name] for name in one)


def _first(clear: Clear) -> Near:
    """A coarse grid over all that faces."""
    hats = Hats(np.linspace(clear.first, clear.last, FIRST + 1))
    return Near(clear.facing, clear.first, clear.last, SAMPLES, hats, clear.centers)


def _on_grids(pairings: Sequence[Pairing], grids: Mapping[str, Near]) -> tuple[Pairing, ...]:
    return tuple(
        on_grid(pairing, grids[pairing.name]) if pairing.name in grids else pairing for pairing in pairings
    )


def _moved(before: Sequence[Pairing], after: Sequence[Pairing], closed: BoolArray) -> BoolArray:
    """The ``closed`` candidates (m,) of a scene on other grids."""
    found, first = [], 0
    for old, new in zip(before, after, strict=True):
        count = int(old.candidate.sum())
        own, first = closed[first : first + count], first + count
        if old.near is not None and new.near is not None:
            share = np.interp(new.near.hats.place, old.near.hats.place, own.astype(float), 0.0, 0.0)
            own = share >= 0.5
        found.append(own)
    return np.concatenate(found)


def _ranged(
    condensed: Condensed, grids: Mapping[str, Near], clear: Mapping[str, Clear], states: Sequence[ExactState]
) -> dict[str, Near] | None:
    """The grids with ranges that suit what touches; None where that comes to the end of a clear range."""
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
        beyond = pairing.arc[np.any([masks[name] for masks in touched], axis=0)]
        places = np.flatnonzero(closed)
        if not len(places):
            if len(beyond):
                result[name] = _first(room)
            continue
        low, high = nodes[places[0]], nodes[places[-1] + 2]
        width = high - low
        if len(beyond):
            low, high = min(low, float(beyond.min())), max(high, float(beyond.max()))
        if low <= room.first or high >= room.last:
            return None
        first, last = max(room.first, low - MARGIN * width), min(room.last, high + MARGIN * width)
        if low <= near.first or high >= near.last or len(beyond):
            inner = nodes[(nodes > near.first) & (nodes < near.last)]
            first, last = min(first, near.first), max(last, near.last)
            steps = np.median(near.hats.steps)
            more = [np.arange(near.first - steps, first, -steps), np.arange(near.last + steps, last, steps)]
            wider = Hats(np.unique(np.concatenate([[first], *more, inner, [last]])))
            result[name] = replace(near, first=first, last=last, hats=wider)
        elif len(places) < LEAST:
            middle = np.zeros(len(near.hats.steps), dtype=bool)
            middle[max(places[0] - 1, 0) : places[-1] + 3] = True
            result[name] = replace(near, hats=near.hats.halved(middle))
        elif last - first < NARROWED * (near.last - near.first):
            result[name] = replace(
                near, first=first, last=last, count=SAMPLES, hats=near.hats.within(first, last)
            )
    return result


def _sampled(scene: Scene, answers: Answers, grids: Mapping[str, Near]) -> dict[str, Near]:
    """The grids with as many samples as the bodies' answers need."""
    result = dict(grids)
    for pairing in answers.observation.pairings:
        near = pairing.near
        if near is None or near.count >= MOST_SAMPLES:
            continue
        log = sum(
            np.abs(near.singular(scene.bodies[body].model.kernel, slave)[0]).max()
            for body, slave, _ in sides(pairing)
        )
        kernel = answers.smooth(pairing)
        if near.last_coefficients(kernel) > SMOOTH * max(float(log), float(np.ptp(kernel))):
            result[pairing.name] = replace(grids[pairing.name], count=2 * near.count)
    return result


def _refined(
    condensed: Condensed,
    grids: Mapping[str, Near],
    states: Sequence[ExactState],
    accuracy: Mapping[str, float],
) -> dict[str, Near]:
    """The grids halved where the pressures and tractions of the states need it."""
    result = dict(grids)
    for name, near in grids.items():
        errors = grid_errors(condensed, name, states)
        total, aim = float(np.sqrt((errors**2).sum())), accuracy[name]
        if total <= aim or len(errors) >= MOST:
            continue
        share = max(SHARE * aim / np.sqrt(len(errors)), WORST * float(errors.max()))
        result[name] = replace(near, hats=near.hats.halved(errors > share))
    return result


def grid_errors(condensed: Condensed, name: str, states: Sequence[ExactState]) -> FloatArray:
    """What every interval of a contact's grid has of the relative L2 error of its pressures and tractions, in
    the worst of some states."""
    pairing = next(one for one in condensed.pairings if one.name == name)
    assert pairing.near is not None
    hats, worst = pairing.near.hats, np.zeros(len(pairing.near.hats.steps))
    for state in states:
        pressure = state.pressure[condensed.spans[name]]
        size = hats.norm(pressure)
        parts = [hats.errors(pressure)]
        if pairing.friction:
            parts.append(hats.errors(state.traction[condensed.tangential[name]]) / pairing.friction)
        if size > 0.0:
            worst = np.maximum(worst, np.linalg.norm(parts, axis=0) / size)
    return worst
