"""Contact grids: which contacts have one, over which range, and with which resolution.

The range is where surfaces touch: found with a few samples over all facing places, then narrowed to what
touches in the states at the ends of stages and where fields are requested. Intervals are halved where the
pressures of these states have large second differences, until the estimated error is below the accuracy of
the contact.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.contact.complementarity.problem import ContactStatus
from mlsanm_cli.contact.geometry.contact_grid import ContactRange
from mlsanm_cli.contact.geometry.pairing import Pairing, on_grid
from mlsanm_cli.contact.laws.contact_state import ContactState
from mlsanm_cli.contact.response.condensation import condense
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.responses import BodyResponses
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.laws.von_mises import VonMises
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.memo import Memo
from mlsanm_cli.roundoff import ROUND_OFF
from mlsanm_cli.solve.condensed_scene import CondensedScene, factors_at
from mlsanm_cli.solve.contact_states import contact_states
from mlsanm_cli.solve.direction_updates import rolling, turns, unturned
from mlsanm_cli.solve.grid_fitting import (
    COMPRESSED_LIMITS,
    DENSE_LIMITS,
    GridFit,
    begun_open,
    passed_beyond,
    ranged,
    refined,
    sampled,
)

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

MAX_LEVELS = 40
"""Largest number of levels of output that determine contact grids."""
LEVELS_BETWEEN = 8
"""Subdivisions of a stage at which contacts are checked to stay in the ranges of their grids; fewer with many
stages."""

States = tuple[ContactState, ...]
Search = Callable[[Condensed, Sequence[ContactStatus]], States]
"""The states of a condensed scene at the levels looked at, searched from sets."""


def find_grids(
    case: Case,
    scene: Scene,
    pairings: tuple[Pairing, ...],
    ranges: Mapping[str, ContactRange],
    stages: FloatArray,
    memo: Memo,
    laws: Mapping[str, VonMises],
) -> tuple[Condensed, States] | None:
    """Condense a scene on grids that are wide and fine enough, with the exact states at the ends of its
    ``stages`` (T + 1, L); None if a contact is too close to a corner, or its range does not converge.

    Grids are first fitted to the states at the ends of the stages, then to those at all positions with
    fields, then directions of pressures are rotated with the bodies, and ranges extended to contacts
    between. Bodies with ``laws`` flow: their contacts are wider, and grids end fitted to the whole path."""
    search, ends = _GridSearch(case, scene, pairings, ranges, memo), stages[1:]
    every_so_many = -(-len(case.output.at) // MAX_LEVELS) or 1
    positions = sorted({*range(len(stages)), *case.output.at[::every_so_many]})
    levels = np.stack([factors_at(stages, position) for position in positions[1:]])

    def at_ends(condensed: Condensed, starts: Sequence[ContactStatus]) -> States:
        # Stages beyond a limit load are not tried again.
        return contact_states(scene, condensed, stages, ends[: len(starts) or None], starts)

    def at_levels(condensed: Condensed, starts: Sequence[ContactStatus]) -> States:
        return contact_states(scene, condensed, stages, levels, starts, skips=True)

    def on_path(condensed: Condensed, _: Sequence[ContactStatus]) -> States:
        # As far as there are states, or up to one whose contacts reach an end of a grid that is no end of a
        # surface.
        from mlsanm_cli.solve.plastic_path import plastic_path  # for few runs

        built = CondensedScene(case, scene, condensed, stages, (), np.nan, laws)
        states = list[ContactState]()
        with suppress(NumericalError):
            for state in (step.state for step in plastic_path(built)):
                shift = built.at(state).condensed.watched.constant - condensed.watched.constant
                states.append(replace(state.contacts(condensed.friction_nodes), shift=shift))
                if condensed.cut(state.pressure):
                    break
        return tuple(states)

    settled = search.settle(at_ends, tractions=True)
    if settled and len(search.states) < len(levels):
        settled = search.settle(at_levels)
    while settled and (search.turn() or search.extend(stages)):
        settled = search.settle(at_levels)
    states = search.states
    if settled and laws:
        settled = search.settle(on_path, repeats=False)
    if not settled:
        return None
    condensed = search.condensed
    if laws:
        return condensed, contact_states(scene, condensed, stages, ends)
    reached = tuple(one for one in states if (ends == one.factors).all(axis=1).any())
    if len(reached) == len(ends):
        return condensed, reached
    if len(condensed.friction_nodes):
        return condensed, reached or states
    return condensed, contact_states(scene, condensed, stages, ends, search.starts)


class _GridSearch:
    """Grids of a scene during their search, and the ``condensed`` scene on them with the ``states`` looked at
    last and the sets from which the next ones are searched."""

    def __init__(
        self,
        case: Case,
        scene: Scene,
        pairings: tuple[Pairing, ...],
        ranges: Mapping[str, ContactRange],
        memo: Memo,
    ) -> None:
        self._scene, self._memo, self._nodal = scene, memo, pairings
        self._fits = {name: GridFit.of(name, room) for name, room in ranges.items()}
        self._pairings = pairings
        self._responses: BodyResponses | None = None
        self._sampled: BodyResponses | None = None
        self.starts: list[ContactStatus] = []
        self.states: States = ()
        self._turns, self._extended = MAX_TURNS * (2 if scene.held_motions else 1), False
        # Directions of pressures: their angles with the bodies, and those common to held motions.
        self._angles = {name: room.facing.turn for name, room in ranges.items()}
        self._common = dict.fromkeys(ranges, 0.0)
        places = len(case.contact) + sum(one.places - 1 for one in ranges.values())
        few = places <= MAX_PATCHES and len({*range(1, len(case.stage) + 1), *case.output.at}) <= MAX_ENDS
        effort = EXACT_FACTOR if few else 1.0
        self._accuracy = {
            one.name: one.accuracy * (FRICTION_FACTOR if one.friction else effort) for one in case.contact
        }
        exact = all(one.regularization.law == "exact" and not one.friction for one in case.contact)
        self._limits = COMPRESSED_LIMITS if exact else DENSE_LIMITS
        self._condense()

    def settle(self, search: Search, tractions: bool = False, repeats: bool = True) -> bool:
        """Fit ranges, samples and intervals to the states of a ``search`` until none of them changes; False
        if they do not converge. Edges of stick zones are resolved if ``tractions`` count: at the ends of
        stages only, as every level between them has others. Unless it ``repeats``, intervals are halved once,
        and the states are those before."""
        for _ in range(MAX_ROUNDS):
            self.states = search(self.condensed, self.starts)
            # States with pressures above round-off of the largest of all.
            peaks = [float(state.pressure.max(initial=0.0)) for state in self.states]
            least = ROUND_OFF * max(peaks, default=0.0)
            loaded = [state for state, peak in zip(self.states, peaks, strict=True) if peak > least]
            scene, condensed, fits = self._scene, self.condensed, self._fits.values()
            new = [begun_open(condensed, fit, self.states) for fit in fits]
            if not self._changed(new):
                within = [ranged(condensed, fit, self.states) for fit in fits]
                new = [fit for fit in within if fit is not None]
                if len(new) < len(fits):
                    return False
            if not self._changed(new) and self._responses is not self._sampled:
                assert self._responses is not None
                self._sampled = self._responses
                new = [sampled(scene, self._responses, fit) for fit in new]
            if not self._changed(new):
                new = [
                    refined(condensed, fit, loaded, self._accuracy[fit.name], tractions, self._limits)
                    for fit in new
                ]
                if not repeats or not self._changed(new):
                    self._take(new)
                    return True
            self._take(new)
        return False

    def _changed(self, fits: Sequence[GridFit]) -> bool:
        return any(fit.grid is not self._fits[fit.name].grid for fit in fits)

    def _take(self, fits: Sequence[GridFit]) -> None:
        """Condense on other grids, if they have changed."""
        before, changed = self._fits, self._changed(fits)
        self._fits = {fit.name: fit for fit in fits}
        if not changed:
            return
        if any(fit.grid.unfolding != before[fit.name].grid.unfolding for fit in fits):
            self._responses = None
        begun = any(fit.room.first != before[fit.name].room.first for fit in fits)
        old = self.condensed
        self._condense()
        moved = [pairing for pairing in self._pairings if not pairing.bonded]
        self.starts = [] if begun else [_moved(old, moved, state) for state in self.states]

    def _condense(self) -> None:
        grids = {name: fit.grid for name, fit in self._fits.items()}
        # Those whose grid has not changed are kept.
        self._pairings = tuple(
            old if old.contact_grid is grids.get(new.name) else on_grid(new, grids[new.name])
            for new, old in zip(self._nodal, self._pairings, strict=True)
        )
        if self._responses is None:
            self._responses = BodyResponses.of(self._scene, self._pairings, self._memo)
        self.condensed = condense(self._scene, self._pairings, self._memo, self._responses)

    def extend(self, stages: FloatArray) -> bool:
        """Whether contacts between the levels looked at, which are without friction, pass beyond their
        ranges, which are then extended. To be asked once."""
        inside = any(fit.inside for fit in self._fits.values())
        if self._extended or not inside or len(self.condensed.friction_nodes):
            return False
        self._extended = True
        count = max(2, min(LEVELS_BETWEEN, MAX_LEVELS // (len(stages) - 1)))
        between = [factors_at(stages, k / count) for k in range(count * (len(stages) - 1)) if k % count]
        states = contact_states(self._scene, self.condensed, stages, np.stack(between), skips=True)
        before = self._fits
        self._fits = {name: passed_beyond(self.condensed, fit, states) for name, fit in before.items()}
        return any(fit is not before[name] for name, fit in self._fits.items())

    def turn(self) -> bool:
        """Whether the directions of pressures rotate with the bodies in the last states with contact, less
        the common angles that would do work along held motions."""
        if not self._turns:
            return False
        now: dict[str, float] = {}
        scene, condensed, held = self._scene, self.condensed, self._scene.held_motions
        for state in reversed(self.states):
            if not rolling(scene, condensed, state):
                now = turns(scene, condensed, state) | now
            if len(now) == len(self._fits):
                break
        for name, angle in now.items():
            if abs(angle - self._angles[name]) > (TURN_TOLERANCE if self._angles[name] else TURN_ABOVE):
                self._angles[name] = angle
        before = {name: fit.grid.facing.turn for name, fit in self._fits.items()}
        after = {name: angle + self._common[name] for name, angle in self._angles.items()}
        if held:
            for name, angle in unturned(condensed, self.states[-1], after, held).items():
                self._common[name] += angle
                after[name] += angle
            settled = all(abs(after[name] - turn) <= TURN_TOLERANCE for name, turn in before.items())
            if settled and not unturned(condensed, self.states[-1], before, held):
                return False
        if after == before:
            return False
        self._turns -= 1
        self._take([fit.turned(after[name]) for name, fit in self._fits.items()])
        return True


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
