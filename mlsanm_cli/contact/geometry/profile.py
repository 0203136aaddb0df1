"""Characteristic values of a contact's pressure profile."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray

THRESHOLD = 0.01
PEAK_SHARE, PEAK_RATIO = 0.02, 3.0
"""The peak is singular if it exceeds PEAK_RATIO the pressure that only a fraction PEAK_SHARE of the loaded
length exceeds."""


def half_width(arc_length: FloatArray, pressure: FloatArray) -> float:
    """Half the distance between the outermost crossings of 1 % of the regular peak, which unlike a singular
    one does not depend on the grid.

    ``arc_length`` (m,) is increasing, ``pressure`` (m,) piecewise linear. A profile still above the threshold
    at the last node ends there.

    >>> place = np.array([0.0, 1.0, 2.0, 2.999, 3.0])
    >>> float(round(half_width(place, np.array([0.0, 1.0, 1.0, 1.0, 1e6])), 3))
    1.495
    """
    level = THRESHOLD * regular_peak(arc_length, pressure)
    above = np.flatnonzero(pressure > level)
    if level <= 0.0 or not len(above):
        return 0.0
    return 0.5 * (
        _crossing(arc_length, pressure, level, above[-1], 1)
        - _crossing(arc_length, pressure, level, above[0], -1)
    )


def unrolled(arc_length: FloatArray, around: float, pressure: FloatArray) -> tuple[IntArray, FloatArray]:
    """Nodes (m,) of a closed surface of length ``around``, starting in the middle of the longest stretch
    without pressure (m,), and their arc lengths, increasing past the surface's start.

    >>> unrolled(np.arange(6.0), 6.0, np.array([2.0, 1.0, 0.0, 0.0, 0.0, 1.0]))
    (array([3, 4, 5, 0, 1, 2]), array([3., 4., 5., 6., 7., 8.]))
    """
    count, pressed = len(pressure), np.flatnonzero(pressure > 0.0)
    if not 0 < len(pressed) < count:
        return np.arange(count), arc_length
    apart = np.diff(np.append(pressed, pressed[0] + count))
    widest = int(apart.argmax())
    first = int(pressed[widest] + apart[widest] // 2) % count
    order = np.roll(np.arange(count), -first)
    return order, arc_length[order] + around * (order < first)


def regular_peak(arc_length: FloatArray, pressure: FloatArray) -> float:
    """The largest pressure (m,); if it is at a singular end, and so depends on the grid, the largest on all
    but a fraction PEAK_SHARE of the loaded length.

    >>> place = np.array([0.0, 0.5, 1.0, 1.5, 1.99, 2.0])
    >>> regular_peak(place, np.array([1.0, 1.0, 1.0, 1.1, 1.2, 50.0]))
    1.2
    """
    if len(arc_length) < 2 or not (pressure > 0.0).any():
        return float(pressure.max(initial=0.0))
    top = int(pressure.argmax())
    inside = 0 < top < len(pressure) - 1 and min(pressure[top - 1], pressure[top + 1]) > 0.0
    order = np.argsort(pressure)
    order = order[pressure[order] > 0.0]
    lengths = np.cumsum(np.gradient(arc_length)[order])
    rest = float(pressure[order][np.searchsorted(lengths, (1.0 - PEAK_SHARE) * lengths[-1])])
    return float(pressure[top]) if inside or pressure[top] <= PEAK_RATIO * rest else rest


def is_singular(arc_length: FloatArray, pressure: FloatArray) -> bool:
    """Whether the largest pressure (m,) is at a singular end."""
    return regular_peak(arc_length, pressure) < float(pressure.max(initial=0.0))


def _crossing(arc: FloatArray, pressure: FloatArray, level: float, last: int, step: int) -> float:
    """Arc length at which the profile falls to ``level``, going outwards from node ``last`` above it."""
    beyond = last + step
    if not 0 <= beyond < len(arc):
        return float(arc[last])
    fraction = (pressure[last] - level) / (pressure[last] - pressure[beyond])
    return float(arc[last] + fraction * (arc[beyond] - arc[last]))
