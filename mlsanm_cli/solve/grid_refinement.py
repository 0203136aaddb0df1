"""Refinement of contact grids: samples of the responses of the bodies, and halving of intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.contact_range import ContactRange
from mlsanm_cli.contact.geometry.surface_response import SurfaceResponse
from mlsanm_cli.contact.laws.contact_state import ContactState
from mlsanm_cli.contact.response.compressed import COMPRESSED_CONTACT
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.responses import BodyResponses
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.roundoff import COARSE_ROUND_OFF
from mlsanm_cli.solve.grid_ranges import summits

MAX_SAMPLES = 96
SAMPLE_TOLERANCE = 1e-4
"""Samples are doubled until the last coefficients of the response are below this part of the factor of its
logarithm."""
MIN_INTERVAL = 1e-5
"""Intervals below this part of the range are not halved: pressures under corners of obstacles are
unbounded."""
MIN_CLAMPED_INTERVAL = 0.25
"""Least interval beside clamped sides, relative to the reach of their corner: stresses are singular there
without contact, and clouds do not resolve more."""
DENSE_LIMITS, COMPRESSED_LIMITS = (300, 2000), (5000, 20_000)
"""Numbers of intervals above which grids are refined to a lower accuracy, by the cube of the ratio, and above
which they are not refined, of paths that need dense matrices and of others."""
END_ERROR_SHARE = 0.3
"""Intervals at the ends of a grid with this part of the largest error are halved twice at once; further
halvings save nothing."""
EQUAL_SHARE, WORST_SHARE, WORST_SHARE_OF_MANY = 0.7, 0.1, 0.02
"""Intervals are halved whose error is above this part of an equal share, and of the largest: more at once in
grids with many intervals, as each round takes long."""
WORST_SHARE_WITHOUT_FRICTION, QUARTER_RATIO = 0.05, 4.0
"""Part of the largest error without friction, where rounds take longer than more intervals do; and intervals
with more than this multiple of the least error of halved ones are quartered, but not for tractions."""


def sampled(scene: Scene, answers: BodyResponses, grids: Mapping[str, ContactGrid]) -> dict[str, ContactGrid]:
    """Grids with as many samples as the responses of the bodies require."""
    result = dict(grids)
    for pairing in answers.drivers.on_grids:
        grid = pairing.grid
        if grid.count >= MAX_SAMPLES:
            continue
        log = sum(
            np.abs(SurfaceResponse.of(grid, scene.bodies[body].model.kernel, slave).tensors[0]).max()
            for body, slave, _ in pairing.sides
        )
        kernel = answers.smooth(pairing)
        size = grid.coefficients(kernel)
        aim, last = SAMPLE_TOLERANCE * float(log), float(size[-2:].max())
        # Coefficients of smooth functions decay geometrically; few tell how fast, so that more are looked at.
        half = max(float(size[grid.count // 2 - 2 : grid.count // 2].max()), last)
        decay, count = last / (half or 1.0), grid.count
        while last > aim and count < min(MAX_SAMPLES, 4 * grid.count):
            last, decay, count = last * decay**2, decay**2, 2 * count
        if count > grid.count:
            result[pairing.name] = replace(grids[pairing.name], count=count)
    return result


def refined(
    condensed: Condensed,
    grids: Mapping[str, ContactGrid],
    ranges: Mapping[str, ContactRange],
    states: Sequence[ContactState],
    accuracy: Mapping[str, float],
    tractions: bool,
    limits: tuple[int, int] = DENSE_LIMITS,
) -> dict[str, ContactGrid]:
    """Grids halved where the pressures of the states require it, up to ``limits``, and ``tractions`` if they
    count: at the ends of stages only, as every level between them has other edges of stick zones."""
    result = dict(grids)
    for name, grid in grids.items():
        each = [grid_errors(condensed, name, [state], tractions) for state in states]
        if len(grid.hats.steps) >= limits[1]:
            continue
        places = summits(condensed, name, ranges[name], states)
        chosen = np.isin(np.arange(len(grid.hats.steps)), np.searchsorted(grid.hats.nodes, places) - 1)
        aim = accuracy[name] * max(1.0, len(chosen) / limits[0]) ** 3
        quartered = np.zeros_like(chosen)
        free = condensed.pairing_of(name).friction == 0.0
        many = len(chosen) > COMPRESSED_CONTACT
        part = WORST_SHARE_OF_MANY if many else WORST_SHARE_WITHOUT_FRICTION if free else WORST_SHARE
        # Ends of other states are no part of a state's error, and its share is one of the intervals that
        # contribute; many patches end everywhere, and rounds take long.
        for errors in each:
            if float(np.linalg.norm(errors)) > aim:
                count = len(errors) if many else float(errors.sum()) ** 2 / float((errors**2).sum())
                least = max(EQUAL_SHARE * aim / np.sqrt(count), part * float(errors.max()))
                chosen |= errors > least
                quartered |= (free or not tractions) & (errors > QUARTER_RATIO * least)
        errors = np.max(each, axis=0, initial=0.0)
        chosen &= grid.hats.steps > _shortest(grid)
        if chosen.any():
            result[name] = _halved(grid, chosen, quartered, errors)
    return result


def _halved(grid: ContactGrid, chosen: BoolArray, quartered: BoolArray, errors: FloatArray) -> ContactGrid:
    """Grid with ``chosen`` intervals (e,) halved, and those of them to be ``quartered`` halved twice; those
    at its ends with the largest ``errors`` are halved once more towards the end, where errors of unbounded
    pressures decrease slowly."""
    first, last = np.flatnonzero(grid.hats.steps > 0.0)[[0, -1]]
    large = chosen & (errors >= END_ERROR_SHARE * errors.max())
    at_ends = bool(large[first]), bool(large[last])
    hats = grid.hats.halved(chosen)
    within = np.searchsorted(grid.hats.nodes, 0.5 * (hats.nodes[1:] + hats.nodes[:-1])) - 1
    again = (chosen & quartered)[np.clip(within, 0, len(chosen) - 1)]
    again[np.flatnonzero(hats.steps > 0.0)[[0, -1]]] |= at_ends
    grid = replace(grid, hats=hats)
    again &= grid.hats.steps > _shortest(grid)
    return replace(grid, hats=grid.hats.halved(again)) if again.any() else grid


def grid_errors(
    condensed: Condensed, name: str, states: Sequence[ContactState], tractions: bool = True
) -> FloatArray:
    """Contribution of every interval of a contact grid to the relative L2 error of its pressures, and
    ``tractions`` if they count, in the worst of the states; 0 for the shortest ones."""
    pairing = condensed.pairing_of(name)
    hats, worst = pairing.grid.hats, np.zeros(len(pairing.grid.hats.steps))
    for state in states:
        pressure = state.pressure[condensed.spans[name]]
        size = hats.norm(pressure)
        if np.abs(pressure).max(initial=0.0) <= COARSE_ROUND_OFF * np.abs(state.pressure).max(initial=0.0):
            continue
        parts = [hats.errors(pressure)]
        if pairing.friction and tractions:
            parts.append(hats.errors(state.traction[condensed.tangential[name]]) / pairing.friction)
        worst = np.maximum(worst, np.linalg.norm(parts, axis=0) / size)
    worst[hats.steps <= _shortest(pairing.grid)] = 0.0
    return worst


def _shortest(grid: ContactGrid) -> FloatArray:
    """Lengths (e,) below which intervals are not halved."""
    least = np.full(len(grid.hats.steps), MIN_INTERVAL * (grid.last - grid.first))
    for slave in (True, False):
        for corner in grid.corners_of(slave):
            if corner.wedge.clamped:
                away = corner.distance(grid.facing.side(grid.hats.nodes, slave)[0])
                away = np.minimum(away[:-1], away[1:])
                least = np.where(
                    away < corner.reach, np.maximum(least, MIN_CLAMPED_INTERVAL * corner.reach), least
                )
    return least
