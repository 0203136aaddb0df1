"""Figures of a contact's pressure profile."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray

THRESHOLD = 0.01


def half_width(arc_length: FloatArray, pressure: FloatArray, around: float | None = None) -> float:
    """Half the distance between the outermost crossings of 1 % of the peak.

    ``arc_length`` (m,) increasing, ``pressure`` (m,) joined linearly. A profile that does not fall below the
    threshold before the last node ends there. On a closed surface of length ``around`` the longest stretch
    without pressure lies outside.
    """
    level = THRESHOLD * float(pressure.max(initial=0.0))
    above = np.flatnonzero(pressure > level)
    if level <= 0.0 or not len(above):
        return 0.0
    if around is not None:
        rests = np.diff(arc_length[above], append=arc_length[above[0]] + around)
        first = (above[int(np.argmax(rests))] + 1) % len(pressure)
        arc_length = np.roll(arc_length, -first)
        arc_length = np.append(np.mod(arc_length - arc_length[0], around), around)
        pressure = np.append(np.roll(pressure, -first), pressure[first])
        above = np.flatnonzero(pressure > level)
    return 0.5 * (
        _crossing(arc_length, pressure, level, above[-1], 1)
        - _crossing(arc_length, pressure, level, above[0], -1)
    )


def _crossing(arc: FloatArray, pressure: FloatArray, level: float, last: int, step: int) -> float:
    """Where the profile, followed outwards from node ``last`` above the level, comes down to it."""
    beyond = last + step
    if not 0 <= beyond < len(arc):
        return float(arc[last])
    fraction = (pressure[last] - level) / (pressure[last] - pressure[beyond])
    return float(arc[last] + fraction * (arc[beyond] - arc[last]))
