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
from mlsanm_cli.io.schema import Quantities
from mlsanm_cli.solve.state import Checkpoint, PathStep, State

LIMIT_TOLERANCE = 1e-10
"""Relative accuracy with which limits are reached."""
AXES = {"x": 0, "y": 1}
Follow = Callable[[Checkpoint | None, tuple[float, ...]], Iterator[PathStep]]
"""Returns the path, or the part after a checkpoint, with further positions of saved states."""
Measure = Callable[[Stop, State], float]
"""Returns the value in a state of the quantity of a stop."""


def stopped_path(
    stops: Sequence[Stop],
    follow: Follow,
    measure: Measure,
    begin: Checkpoint | None,
    before: State | None,
    tolerance: float,
) -> Iterator[PathStep]:
    """The steps after a checkpoint ``begin``, whose row was ``before``, up to the first of the ``stops``: the
    last one ends there, saves its state, and has its number in its checkpoint. ``tolerance`` is the accuracy
    of positions, per stage."""

    if not stops:
        yield from follow(begin, ())
        return

    armed, near = np.zeros(len(stops), dtype=bool) if begin is None else begin.armed, 0.0

    def excess(stop: Stop, state: State) -> float:
        """By how much a state is beyond a stop's limit; negative before it, -1 of a fold."""
        if stop.what == "fold":
            return -1.0
        value = measure(stop, state)
        return value - stop.above if stop.above is not None else (stop.below or 0.0) - value

    def cut(place: float) -> PathStep | None:
        """The next step ended at a position, None if the path saves no state there."""
        for step in follow(begin, (place,)):
            for state in (*step.saved, step.state):
                if abs(state.position - place) <= near:
                    earlier = tuple(one for one in step.saved if one.position < state.position)
                    return replace(step, state=state, saved=(*earlier, state))
            if step.state.position > place or turning(step) is not None:
                return None
        return None

    def passed(stop: Stop, step: PathStep) -> PathStep:
        """The ``step`` cut where it passes a stop."""
        last, value = step.state.position, excess(stop, step.state)
        first, cuts = last if before is None else before.position, {last: (value, step)}

        def beyond(place: float) -> float:
            if place in (first, last):
                return excess(stop, before) if before and place == first else value
            end = cut(place)
            if end is None:
                raise LookupError("the path saves no state at a requested position")
            cuts[place] = excess(stop, end.state), end
            return cuts[place][0]

        if last - first > near and value > 0.0:
            from mlsanm_cli.continuation.series import root  # for few runs

            with suppress(LookupError):
                root(beyond, first, last, near)
        slack = LIMIT_TOLERANCE * max(abs(stop.above or 0.0), abs(stop.below or 0.0))
        return cuts[min(place for place, (value, _) in cuts.items() if value >= -slack)][1]

    for step in follow(begin, ()):
        values, fold = np.array([excess(stop, step.state) for stop in stops]), turning(step)
        near, ends = tolerance * max(1.0, step.state.position), list[tuple[PathStep, int]]()
        for number, stop in enumerate(stops):
            if stop.what == "fold" and fold is not None:
                ends.append((cut(fold - near) or step, number))
            elif armed[number] and values[number] >= 0.0:
                ends.append((passed(stop, step), number))
        if ends:
            end, number = min(ends, key=lambda one: one[0].state.position)
            if all(one.position != end.state.position for one in end.saved):
                end = replace(end, saved=(*end.saved, end.state))
            yield replace(end, checkpoint=Checkpoint(end.state, armed=armed, ended_by=number))
            return
        armed = armed | (values < 0.0)
        if step.checkpoint is not None:
            step = replace(step, checkpoint=replace(step.checkpoint, armed=armed))
        begin, before = step.checkpoint, step.state
        yield step


def turning(step: PathStep) -> float | None:
    """Position of the first maximum of the load within a step."""
    return next((position for position, highest in step.limit_points if highest), None)


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


def _along(stop: Stop, vector: FloatArray) -> float:
    return float(np.hypot(*vector)) if stop.component == "size" else float(vector[AXES[stop.component]])
