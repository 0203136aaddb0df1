"""How fine a contact grid is: samples of the bodies' answers, and intervals halved where pressures bend."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.contact_range import ContactRange
from mlsanm_cli.contact.laws.active_set import ExactState
from mlsanm_cli.contact.response.compressed import COMPRESSED_CONTACT
from mlsanm_cli.contact.response.condensation import BodyResponses
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.solve.grid_ranges import summits

MOST_SAMPLES = 96
SMOOTH = 1e-4
"""Samples are doubled until the last coefficients of the answer are below this part of the factor of its
logarithm. Its variation says nothing: rigid motions and bending make it a hundred times as much in layers."""
SHORTEST = 1e-5
"""Intervals below this part of the range are not halved any more: pressures under corners of obstacles have
no bound."""
BY_CLAMPED = 0.25
"""Beside clamped sides intervals are no shorter than this part of the reach of their corner: stresses are
singular there but for the contact, and clouds resolve that no further."""
DENSE, COMPRESSED = (300, 2000), (5000, 20_000)
"""Grids of more intervals are refined to less, by the cube of how many more, and of how many more they are
not refined at all: obstacles of many corners, or of many patches, would cost minutes otherwise. The first
two numbers are those of paths that need dense matrices, the others of paths that do not."""
NOTHING = 1e-6
"""Pressures below this part of the largest in the scene are those of contacts that carry nothing."""
AT_ENDS = 0.3
"""Intervals at a grid's ends with this part of the largest error are halved once more at once; two and
three more save nothing further."""
SHARE, WORST, WORST_OF_MANY = 0.7, 0.1, 0.02
"""Intervals are halved that have more than this part of an equal share of the error, and of the largest: of
grids with many intervals more at once, as each round takes long."""
FREE, TWICE = 0.05, 4.0
"""Without friction, where rounds take longer than what more intervals do, this part of the largest; and those
that have so many times the least error of halved ones are quartered: halves have a sixth."""


def sampled(scene: Scene, answers: BodyResponses, grids: Mapping[str, ContactGrid]) -> dict[str, ContactGrid]:
    """The grids with as many samples as the bodies' answers need."""
    result = dict(grids)
    for pairing in answers.observation.pairings:
        grid = pairing.grid
        if grid is None or grid.count >= MOST_SAMPLES:
            continue
        log = sum(
            np.abs(grid.singular(scene.bodies[body].model.kernel, slave)[0]).max()
            for body, slave, _ in pairing.sides
        )
        kernel = answers.smooth(pairing)
        if grid.last_coefficients(kernel) > SMOOTH * float(log):
            result[pairing.name] = replace(grids[pairing.name], count=2 * grid.count)
    return result


def refined(
    condensed: Condensed,
    grids: Mapping[str, ContactGrid],
    ranges: Mapping[str, ContactRange],
    states: Sequence[ExactState],
    accuracy: Mapping[str, float],
    tractions: bool,
    limits: tuple[int, int] = DENSE,
) -> dict[str, ContactGrid]:
    """The grids halved where the pressures, and ``tractions`` if they count, of the states need it, up to
    ``limits``.

    Between the ends of stages tractions do not: every level on the way has its own edges of sticking, and a
    grid fine at all of them would be fine everywhere.
    """
    result = dict(grids)
    for name, grid in grids.items():
        errors = grid_errors(condensed, name, states, tractions)
        if len(errors) >= limits[1]:
            continue
        places = summits(condensed, name, ranges[name], states)
        chosen = np.isin(np.arange(len(errors)), np.searchsorted(grid.hats.nodes, places) - 1)
        aim = accuracy[name] * max(1.0, len(errors) / limits[0]) ** 3
        quartered = np.zeros_like(chosen)
        if float(np.sqrt((errors**2).sum())) > aim:
            free = condensed.pairing_of(name).friction == 0.0
            part = WORST_OF_MANY if len(errors) > COMPRESSED_CONTACT else FREE if free else WORST
            least = max(SHARE * aim / np.sqrt(len(errors)), part * float(errors.max()))
            chosen |= errors > least
            quartered = free & (errors > TWICE * least)
        chosen &= grid.hats.steps > _shortest(grid)
        if chosen.any():
            result[name] = _halved(grid, chosen, quartered, errors)
    return result


def _halved(grid: ContactGrid, chosen: BoolArray, quartered: BoolArray, errors: FloatArray) -> ContactGrid:
    """The grid with ``chosen`` intervals (e,) halved, and those of them that are to be ``quartered`` once
    more; those at its ends that have the largest ``errors`` once more towards the end, as errors fall slowly
    where pressures have no bound."""
    first, last = np.flatnonzero(grid.hats.steps > 0.0)[[0, -1]]
    large = chosen & (errors >= AT_ENDS * errors.max())
    at_ends = bool(large[first]), bool(large[last])
    hats = grid.hats.halved(chosen)
    within = np.searchsorted(grid.hats.nodes, 0.5 * (hats.nodes[1:] + hats.nodes[:-1])) - 1
    again = (chosen & quartered)[np.clip(within, 0, len(chosen) - 1)]
    again[np.flatnonzero(hats.steps > 0.0)[[0, -1]]] |= at_ends
    grid = replace(grid, hats=hats)
    again &= grid.hats.steps > _shortest(grid)
    return replace(grid, hats=grid.hats.halved(again)) if again.any() else grid


def grid_errors(
    condensed: Condensed, name: str, states: Sequence[ExactState], tractions: bool = True
) -> FloatArray:
    """What every interval of a contact's grid has of the relative L2 error of its pressures, and of tractions
    if these count, in the worst of some states; but for the shortest, where pressures have no bound."""
    pairing = condensed.pairing_of(name)
    assert pairing.grid is not None
    hats, worst = pairing.grid.hats, np.zeros(len(pairing.grid.hats.steps))
    for state in states:
        pressure = state.pressure[condensed.spans[name]]
        size = hats.norm(pressure)
        if np.abs(pressure).max(initial=0.0) <= NOTHING * np.abs(state.pressure).max(initial=0.0):
            continue
        parts = [hats.errors(pressure)]
        if pairing.friction and tractions:
            parts.append(hats.errors(state.traction[condensed.tangential[name]]) / pairing.friction)
        worst = np.maximum(worst, np.linalg.norm(parts, axis=0) / size)
    worst[hats.steps <= _shortest(pairing.grid)] = 0.0
    return worst


def _shortest(grid: ContactGrid) -> FloatArray:
    """Lengths (e,) below which a grid's intervals are not halved any more."""
    least = np.full(len(grid.hats.steps), SHORTEST * (grid.last - grid.first))
    for slave in (True, False):
        for corner in grid.corners_of(slave):
            if corner.wedge.clamped:
                away = corner.distance(grid.facing.side(grid.hats.nodes, slave)[0])
                away = np.minimum(away[:-1], away[1:])
                least = np.where(away < corner.reach, np.maximum(least, BY_CLAMPED * corner.reach), least)
    return least
