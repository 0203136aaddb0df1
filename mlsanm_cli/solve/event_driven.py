"""The load path of exact contact with Coulomb friction: its states, from event to event."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.coulomb import CoulombState, residual
from mlsanm_cli.contact.laws.event_driven import Event, event_driven_path, start
from mlsanm_cli.contact.laws.sliding import SlidingError
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import PathStep, State, stops, wanted_positions

ROWS = 40
"""Of the events of a stage with friction so many are stored as steps, evenly along it."""


@dataclass(frozen=True, eq=False)
class FrictionMark:
    """Where a path with exact friction is: the ``fraction`` of a stage that began at load factors (L,).

    ``found`` tells that no rates led to the state.
    """

    stage: int
    begin: FloatArray
    fraction: float
    state: CoulombState
    found: bool = False


def friction_path(built: CondensedScene, mark: FrictionMark | None = None) -> Iterator[PathStep]:
    """Exact contact with Coulomb friction, followed from event to event."""
    wanted, condensed = wanted_positions(built), built.condensed
    if mark is None:
        event = start(condensed, built.stages[0])
        mark = FrictionMark(0, event.state.factors, 0.0, event.state)
        first = coulomb_state(built, event.state, 0.0)
        yield PathStep(first, (first,) if 0.0 in wanted else (), factorizations=event.solves, mark=mark)
    state = mark.state
    for stage, end in enumerate(built.stages[1:]):
        if stage < mark.stage:
            continue
        within = mark if stage == mark.stage else FrictionMark(stage, state.factors, 0.0, state)
        places = {position - stage for position in stops(built) if stage < position <= stage + 1}
        halts = sorted(place for place in places if place > within.fraction)
        rows, reached = _Rows(built, within, places, wanted), within.fraction
        try:
            for event in event_driven_path(
                condensed, state, end, halts, within.begin, within.fraction, within.found
            ):
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
    """Makes steps of one stage's events: all wanted ones, and of the others as many as are worth storing."""

    def __init__(
        self, built: CondensedScene, within: FrictionMark, halts: set[float], wanted: tuple[float, ...]
    ) -> None:
        self._built, self._stage, self._halts, self._wanted = built, within.stage, halts, wanted
        self._begin, self._before, self._solves = within.begin, within.fraction, 0
        self._jump: str = ""
        self._pending: Event | None = None

    def add(self, event: Event) -> Iterator[PathStep]:
        """The step that ends at an event, if it is worth one."""
        self._solves += event.solves
        self._pending = event
        if event.jumped:
            self._jump = (
                f"the contact jumps to another state before position {self._stage + event.fraction:.6g}: "
                f"friction and pressure leave it no gradual way"
            )
        if event.fraction in self._halts or event.fraction >= self._before + 1.0 / ROWS or event.jumped:
            yield from self.last()

    def last(self) -> Iterator[PathStep]:
        """The step that ends at the last event."""
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
            mark=FrictionMark(
                self._stage, self._begin, self._pending.fraction, self._pending.state, self._pending.found
            ),
        )
        self._before, self._solves, self._jump, self._pending = self._pending.fraction, 0, "", None


def coulomb_state(built: CondensedScene, state: CoulombState, position: float) -> State:
    """An exact state with friction at a path position."""
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
        residual(built.condensed, state),
    )
