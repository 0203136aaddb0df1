"""Load paths that end where a ``[[stop]]`` of the case is reached.

Every method can continue after any of its steps, and save states at any position of the next one. The step in
which a limit is passed is therefore repeated with the positions of a root search among the saved ones; for
power series that is an evaluation of the series with a correction.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Stop
from mlsanm_cli.contact.response.linear_map import LinearMap
from mlsanm_cli.continuation.roots import root
from mlsanm_cli.errors import RunError
from mlsanm_cli.roundoff import FINE_ROUND_OFF
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.functionals import platen_displacements, probe_values
from mlsanm_cli.solve.state import Checkpoint, PathStep, State, output_positions

LIMIT_TOLERANCE = 1e-10
"""Relative accuracy with which limits are reached."""
SAMPLES = 65
AXES = {"x": 0, "y": 1}
Follow = Callable[[CondensedScene, Checkpoint | None], Iterator[PathStep]]
"""Returns the path of a scene, or the part after a checkpoint."""


class _NotSaved(Exception):
    """A path saves no state at a requested position."""


class StoppedPath:
    """The path of a scene, or its remaining part, up to a stop of the case. ``reached`` is that stop once the
    path has ended at it."""

    def __init__(
        self, built: CondensedScene, start: Checkpoint | None, last: State | None, follow: Follow
    ) -> None:
        """``follow`` returns the path; ``last`` is the row of its ``start``, if there is one. RunError if a
        stop refers to an unknown quantity."""
        self._built, self._start, self._last, self._follow = built, start, last, follow
        self.reached: Stop | None = None
        for stop in built.case.stop:
            if stop.what == "force" and stop.of not in _forces(built):
                raise RunError(
                    f"[[stop]]: the force of {stop.of} is not known",
                    f"there are: {', '.join(_forces(built))}",
                )

    def steps(self) -> Iterator[PathStep]:
        """The steps; the last one ends at the stop and saves its state."""
        stops = self._built.case.stop
        if not stops:
            yield from self._follow(self._built, self._start)
            return
        begin, before = self._start, self._last
        armed = np.zeros(len(stops), dtype=bool) if begin is None else begin.armed
        if begin is not None and begin.ended_by >= 0:
            self.reached = stops[begin.ended_by]
            return
        for step in self._follow(self._built, begin):
            values = np.array([excess(self._built, stop, step.state) for stop in stops])
            passed = [k for k in range(len(stops)) if armed[k] and values[k] >= 0.0]
            passed += [k for k, stop in enumerate(stops) if stop.what == "fold" and turning(step) is not None]
            if passed:
                ends = [(self._end(k, begin, before, step), k) for k in passed]
                end, number = min(ends, key=lambda one: one[0].state.position)
                self.reached = stops[number]
                yield replace(end, checkpoint=Checkpoint(end.state, armed=armed, ended_by=number))
                return
            armed = armed | (values < 0.0)
            if step.checkpoint is not None:
                step = replace(step, checkpoint=replace(step.checkpoint, armed=armed))
            begin, before = step.checkpoint, step.state
            yield step

    def _end(self, number: int, begin: Checkpoint | None, before: State | None, step: PathStep) -> PathStep:
        """The ``step`` from ``begin``, whose row was ``before``, ended where a stop is reached."""
        stop, last = self._built.case.stop[number], step.state.position
        if stop.what == "fold":
            highest = turning(step)
            assert highest is not None
            return self._to(begin, highest - FINE_ROUND_OFF * max(1.0, highest)) or _ended(step)
        value = excess(self._built, stop, step.state)
        found = {last: (value, step)}
        first = last if before is None else before.position

        def beyond(place: float) -> float:
            if place in (first, last):
                return excess(self._built, stop, before) if before and place == first else value
            end = self._to(begin, place)
            if end is None:
                raise _NotSaved
            found[place] = excess(self._built, stop, end.state), end
            return found[place][0]

        if last - first > FINE_ROUND_OFF * max(1.0, last) and value > 0.0:
            with suppress(_NotSaved):
                root(beyond, first, last, FINE_ROUND_OFF * max(1.0, last))
        slack = LIMIT_TOLERANCE * max(abs(stop.above or 0.0), abs(stop.below or 0.0))
        return _ended(found[min(place for place, (value, _) in found.items() if value >= -slack)][1])

    def _to(self, begin: Checkpoint | None, place: float) -> PathStep | None:
        """The step that ends at a position, None if the path saves no state there."""
        case = self._built.case
        at = tuple(sorted({*output_positions(self._built), place}))
        output = case.output.model_copy(update={"at": at})
        built = replace(self._built, case=case.model_copy(update={"output": output}))
        near = FINE_ROUND_OFF * max(1.0, place)
        for step in self._follow(built, begin):
            for state in (*step.saved, step.state):
                if abs(state.position - place) <= near:
                    earlier = tuple(one for one in step.saved if one.position < state.position)
                    return replace(step, state=state, saved=(*earlier, state))
            if step.state.position > place:
                return None
        return None


def excess(built: CondensedScene, stop: Stop, state: State) -> float:
    """By how much a state is beyond a stop's limit; negative before it, -1 of a fold."""
    if stop.what == "fold":
        return -1.0
    value = value_of(built, stop, state)
    if stop.above is not None:
        return value - stop.above
    assert stop.below is not None
    return stop.below - value


def value_of(built: CondensedScene, stop: Stop, state: State) -> float:
    """Value of the quantity of a stop in a state."""
    condensed = built.condensed
    if stop.what == "force":
        return _along(stop, _forces(built)[stop.of](*state.unknowns))
    if stop.what == "displacement":
        moved = platen_displacements(built, state)
        if stop.of in moved:
            return _along(stop, moved[stop.of])
        return _along(stop, probe_values(built, stop.of, state)["displacement"])
    if stop.what == "von_mises":
        return float(probe_values(built, stop.of, state)["von_mises"])
    span = condensed.spans[stop.of]
    if stop.what == "area":
        return float(condensed.weight[span] @ state.closed[span])
    if stop.what == "slip":
        own = condensed.tangential.get(stop.of)
        if own is None:
            return 0.0
        # Open nodes do not slip; their number depends on the range of the grid.
        closed = state.closed[condensed.friction_nodes[own]]
        return float(np.abs(state.slip[own][closed]).max(initial=0.0))
    return float(state.pressure[span].max(initial=0.0))


def turning(step: PathStep) -> float | None:
    """Position of the maximum of the load within a step, None if it does not turn back."""
    if "position" not in step.series:
        return None
    from mlsanm_cli.continuation import Branch

    position, length = step.series["position"], float(step.series_attributes["length"])
    nothing = np.zeros((len(position), 0))
    branch = Branch(nothing, position, length, step.series.get("denominator"))
    low, high = 0.0, length
    for _ in range(6):
        places = np.linspace(low, high, SAMPLES)
        values = branch.weights(places) @ branch.terms[1]
        best = int(np.argmax(values))
        low, high = places[max(best - 1, 0)], places[min(best + 1, SAMPLES - 1)]
    highest = float(values[best])
    end = branch.evaluate(length)[1]
    return highest if highest > end + LIMIT_TOLERANCE * max(1.0, abs(end)) else None


def _ended(step: PathStep) -> PathStep:
    """A step whose end is that of the path, and is saved."""
    if any(state.position == step.state.position for state in step.saved):
        return step
    return replace(step, saved=(*step.saved, step.state))


def _forces(built: CondensedScene) -> Mapping[str, LinearMap]:
    return {**built.condensed.contact_forces, **built.condensed.forces}


def _along(stop: Stop, vector: FloatArray) -> float:
    return float(np.hypot(*vector)) if stop.component == "size" else float(vector[AXES[stop.component]])
