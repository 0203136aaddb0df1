"""Load paths that end where a ``[[stop]]`` of the case is reached.

Every method can continue after any of its steps, and save states at any position of the next one. The step in
which a limit is passed is therefore repeated with the positions of a root search among the saved ones; for
power series that is an evaluation of the series with a correction.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Stop
from mlsanm_cli.io.columns import Quantities
from mlsanm_cli.solve.state import Checkpoint, PathStep, State

LIMIT_TOLERANCE = 1e-10
"""Relative accuracy with which limits are reached."""
SAMPLES = 65
AXES = {"x": 0, "y": 1}
Follow = Callable[[Checkpoint | None, tuple[float, ...]], Iterator[PathStep]]
"""Returns the path, or the part after a checkpoint, with further positions of saved states."""
Measure = Callable[[Stop, State], float]
"""Returns the value in a state of the quantity of a stop."""


class StoppedPath:
    """A path, or its remaining part, up to one of the ``stops``. ``reached`` is that stop once the path has
    ended at it."""

    def __init__(
        self, stops: Sequence[Stop], follow: Follow, measure: Measure, last: State | None, tolerance: float
    ) -> None:
        """``last`` is the row of the checkpoint where the path begins, if there is one; ``tolerance`` the
        accuracy of positions, per stage."""
        self._stops, self._follow, self._measure = stops, follow, measure
        self._last, self._tolerance = last, tolerance
        self.reached: Stop | None = None

    def steps(self, begin: Checkpoint | None) -> Iterator[PathStep]:
        """The steps; the last one ends at the stop and saves its state."""
        stops, before = self._stops, self._last
        if not stops:
            yield from self._follow(begin, ())
            return
        armed = np.zeros(len(stops), dtype=bool) if begin is None else begin.armed
        if begin is not None and begin.ended_by >= 0:
            self.reached = stops[begin.ended_by]
            return
        for step in self._follow(begin, ()):
            values = np.array([self._excess(stop, step.state) for stop in stops])
            passed = [k for k in range(len(stops)) if armed[k] and values[k] >= 0.0]
            passed += [k for k, stop in enumerate(stops) if stop.what == "fold" and turning(step) is not None]
            if passed:
                ends = [(self._end(stops[k], begin, before, step), k) for k in passed]
                end, number = min(ends, key=lambda one: one[0].state.position)
                self.reached = stops[number]
                if all(one.position != end.state.position for one in end.saved):
                    end = replace(end, saved=(*end.saved, end.state))
                yield replace(end, checkpoint=Checkpoint(end.state, armed=armed, ended_by=number))
                return
            armed = armed | (values < 0.0)
            if step.checkpoint is not None:
                step = replace(step, checkpoint=replace(step.checkpoint, armed=armed))
            begin, before = step.checkpoint, step.state
            yield step

    def _excess(self, stop: Stop, state: State) -> float:
        """By how much a state is beyond a stop's limit; negative before it, -1 of a fold."""
        if stop.what == "fold":
            return -1.0
        value = self._measure(stop, state)
        return value - stop.above if stop.above is not None else (stop.below or 0.0) - value

    def _end(self, stop: Stop, begin: Checkpoint | None, before: State | None, step: PathStep) -> PathStep:
        """The ``step`` from ``begin``, whose row was ``before``, ended where a stop is reached."""
        last = step.state.position
        near = self._tolerance * max(1.0, last)
        if stop.what == "fold":
            highest = turning(step)
            assert highest is not None
            return self._to(begin, highest - near) or step
        value = self._excess(stop, step.state)
        found = {last: (value, step)}
        first = last if before is None else before.position

        def beyond(place: float) -> float:
            if place in (first, last):
                return self._excess(stop, before) if before and place == first else value
            end = self._to(begin, place)
            if end is None:
                raise LookupError("the path saves no state at a requested position")
            found[place] = self._excess(stop, end.state), end
            return found[place][0]

        if last - first > near and value > 0.0:
            from mlsanm_cli.continuation.series import root  # for few runs

            with suppress(LookupError):
                root(beyond, first, last, near)
        slack = LIMIT_TOLERANCE * max(abs(stop.above or 0.0), abs(stop.below or 0.0))
        return found[min(place for place, (value, _) in found.items() if value >= -slack)][1]

    def _to(self, begin: Checkpoint | None, place: float) -> PathStep | None:
        """The step that ends at a position, None if the path saves no state there."""
        for step in self._follow(begin, (place,)):
            for state in (*step.saved, step.state):
                if abs(state.position - place) <= self._tolerance * max(1.0, place):
                    earlier = tuple(one for one in step.saved if one.position < state.position)
                    return replace(step, state=state, saved=(*earlier, state))
            if step.state.position > place or turning(step) is not None:
                return None
        return None


def measured(
    stop: Stop, quantities: Quantities, forces: Mapping[str, FloatArray], weights: Mapping[str, FloatArray]
) -> float:
    """The value of the quantity of a stop among the ``quantities`` of a state; ``forces`` (2,) are those of
    loads, supports and contacts by name, ``weights`` (m,) the lengths of the nodes of contacts."""
    if stop.what == "force":
        return _along(stop, forces[stop.of])
    if stop.what == "displacement":
        moved = quantities["displacements"]
        if stop.of not in moved:
            moved = {name: values["displacement"] for name, values in quantities["probes"].items()}
        return _along(stop, moved[stop.of])
    if stop.what == "von_mises":
        return float(quantities["probes"][stop.of]["von_mises"])
    contact = quantities["contacts"][stop.of]
    closed = contact["status"] != 0
    if stop.what == "area":
        return float(weights[stop.of] @ closed)
    # Open nodes do not slip; their number depends on the range of the grid.
    values = np.abs(contact["slip"][closed]) if stop.what == "slip" else contact["pressure"]
    return float(np.nan_to_num(values).max(initial=0.0))


def turning(step: PathStep) -> float | None:
    """Position of the maximum of the load within a step, None if it does not turn back."""
    if step.limit_points:
        return next((position for position, highest in step.limit_points if highest), None)
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


def _along(stop: Stop, vector: FloatArray) -> float:
    return float(np.hypot(*vector)) if stop.component == "size" else float(vector[AXES[stop.component]])
