"""Load path of exact contact with Coulomb friction, from event to event."""

from __future__ import annotations

from collections.abc import Iterator

from mlsanm_cli.contact.laws.contact_status import ContactSolution
from mlsanm_cli.contact.laws.coulomb import CoulombState, residual
from mlsanm_cli.contact.laws.event_driven import Event, event_driven_path
from mlsanm_cli.contact.laws.event_driven import start as first_event
from mlsanm_cli.contact.laws.limit_load import SlidingError
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import (
    UNLOADED,
    Checkpoint,
    FrictionHistory,
    PathStep,
    State,
    output_positions,
    stops,
)

MAX_ROWS = 40
"""Largest number of events of a stage with friction that are stored as steps, evenly distributed."""


def friction_path(built: CondensedScene, start: Checkpoint | None = None) -> Iterator[PathStep]:
    """Path of exact contact with Coulomb friction, from event to event."""
    wanted, condensed = output_positions(built), built.condensed
    if start is None:
        typical = max((float(end.pressure.max(initial=0.0)) for end in built.ends), default=0.0)
        event = first_event(condensed, built.stages[0], typical)
        state, begun, reached = event.state, 0, 0.0
        first = coulomb_state(built, state, 0.0)
        saved = (first,) if 0.0 in wanted else ()
        yield PathStep(first, saved, factorizations=event.solves, checkpoint=_checkpoint(first, state))
    else:
        state, begun, reached = _restored(start), start.stage, start.fraction
    for stage, (begin, end) in enumerate(zip(built.stages[:-1], built.stages[1:], strict=True)):
        if stage < begun:
            continue
        reached = reached if stage == begun else 0.0
        places = {position - stage for position in stops(built) if stage < position <= stage + 1}
        halts = sorted(place for place in places if place > reached)
        rows = _Rows(built, stage, reached, places, wanted)
        try:
            for event in event_driven_path(condensed, state, end, halts, begin, reached):
                state, reached = event.state, event.fraction
                yield from rows.add(event)
        except SlidingError as error:
            yield from rows.last()
            where = f" at position {stage + error.fraction:.9g}"
            raise SlidingError(error.fraction, where) from error
        except NumericalError as error:
            yield from rows.last()
            raise NumericalError(
                f"{error.message} beyond position {stage + reached:.9g}", error.hint
            ) from error


class _Rows:
    """Steps of the events of a stage: all requested states, and a limited number of others."""

    def __init__(
        self, built: CondensedScene, stage: int, reached: float, halts: set[float], wanted: tuple[float, ...]
    ) -> None:
        self._built, self._stage, self._halts, self._wanted = built, stage, halts, wanted
        self._before, self._solves = reached, 0
        self._jump: str = ""
        self._unloaded = False
        self._pending: Event | None = None

    def add(self, event: Event) -> Iterator[PathStep]:
        """Step that ends at an event, if it is to be stored."""
        self._solves += event.solves
        self._pending = event
        unloaded = _share(self._built, event.state, self._stage + event.fraction) < UNLOADED
        if event.jumped and not self._unloaded:
            self._jump = (
                f"the contact snaps to another state before position {self._stage + event.fraction:.6g}: "
                f"there is no continuous path"
            )
        if event.fraction in self._halts or event.fraction >= self._before + 1.0 / MAX_ROWS or event.jumped:
            yield from self.last()
        self._unloaded = unloaded

    def last(self) -> Iterator[PathStep]:
        """Step that ends at the last event."""
        if self._pending is None:
            return
        position = self._stage + self._pending.fraction
        state = coulomb_state(self._built, self._pending.state, position)
        yield PathStep(
            state,
            (state,) if position in self._wanted else (),
            iterations=self._solves,
            factorizations=self._solves,
            solves=4 * self._solves,
            warning=self._jump,
            checkpoint=_checkpoint(state, self._pending.state),
        )
        self._before, self._solves, self._jump, self._pending = self._pending.fraction, 0, "", None


def _checkpoint(state: State, exact: CoulombState) -> Checkpoint:
    return Checkpoint(state, FrictionHistory(exact.sets, exact.stick_reference))


def _restored(start: Checkpoint) -> CoulombState:
    """Exact state of a checkpoint."""
    state, history = start.state, start.history
    assert history is not None
    values = ContactSolution(state.pressure, state.traction, state.motion, state.gap, state.slip)
    return CoulombState(state.factors, values, history.sets, history.stick_reference, state.work)


def coulomb_state(built: CondensedScene, state: CoulombState, position: float) -> State:
    """Exact state with friction as a state of the path at a position."""
    values, sets = state.values, state.sets
    return State(
        position,
        state.factors,
        values.pressure,
        values.gap,
        values.motion,
        values.traction,
        values.slip,
        state.work,
        sets.status(built.condensed.friction_nodes),
        _share(built, state, position) * residual(built.condensed, state),
    )


def _share(built: CondensedScene, state: CoulombState, position: float) -> float:
    """Pressures over the least by which residuals are measured, if they are below."""
    before = max((float(end.pressure.max(initial=0.0)) for end in built.ends[: int(position)]), default=0.0)
    least, now = UNLOADED * before, float(state.values.pressure.max(initial=0.0))
    return now / least if now < least else 1.0
