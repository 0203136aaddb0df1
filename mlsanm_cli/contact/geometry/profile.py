"""Characteristic values of a contact's pressure profile, and patches: where contact begins and ends."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray, runs_of
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.records import dataclass

THRESHOLD = 0.01
PEAK_SHARE, PEAK_RATIO = 0.02, 3.0
"""The peak is singular if it exceeds PEAK_RATIO the pressure that only a fraction PEAK_SHARE of the loaded
length exceeds."""
LEAST_POWER, HALVINGS, SINGULAR_REACH = 0.015, 5, 0.05
"""Or if pressures grow towards it by at least this power of the distance at every one of so many halvings
within this part of the loaded length."""
END_JUMP, END_SLOPE, LEAST_NODES = 0.01, 3.0, 10
"""Or if it exceeds that of its neighbour by this part of it, and its slope there the next one by this factor,
on at least so many nodes: less than 2.8 for a profile that falls with the root of the distance."""


def half_width(arc_length: FloatArray, pressure: FloatArray, axis: BoolArray | None = None) -> float:
    """Half the distance between the outermost crossings of 1 % of the regular peak, which unlike a singular
    one does not depend on the grid; the whole distance, a radius, if one of them is a node on an ``axis``
    (m,) of revolution. ``arc_length`` (m,) is increasing, ``pressure`` (m,) piecewise linear; a profile still
    above the threshold at the last node ends there.

    >>> place = np.array([0.0, 1.0, 2.0, 2.999, 3.0])
    >>> float(round(half_width(place, np.array([0.0, 1.0, 1.0, 1.0, 1e6])), 3))
    1.495
    """
    level = THRESHOLD * regular_peak(arc_length, pressure)
    above = np.flatnonzero(pressure > level)
    if level <= 0.0 or not len(above):
        return 0.0
    ends = []
    for last, step in ((above[0], -1), (above[-1], 1)):
        beyond, place = last + step, arc_length[last]
        if 0 <= beyond < len(arc_length):
            fraction = (pressure[last] - level) / (pressure[last] - pressure[beyond])
            place = place + fraction * (arc_length[beyond] - place)
        ends.append(float(place))
    radius = axis is not None and bool(axis[above[[0, -1]]].any())
    return (ends[1] - ends[0]) * (1.0 if radius else 0.5)


def unrolled(arc_length: FloatArray, around: float, pressure: FloatArray) -> tuple[IntArray, FloatArray]:
    """Nodes (m,) of a closed surface of length ``around``, starting in the middle of the longest stretch
    without pressure (m,), and their arc lengths, increasing past the surface's start from within its first
    turn.

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
    places = arc_length[order] + around * (order < first)
    return order, places - around * np.floor(places[0] / around)


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
    if 0 < top < len(pressure) - 1 and min(pressure[top - 1], pressure[top + 1]) > 0.0:
        return float(pressure[top])
    order = np.argsort(pressure)
    order = order[pressure[order] > 0.0]
    lengths = np.cumsum(np.gradient(arc_length)[order])
    rest = float(pressure[order][np.searchsorted(lengths, (1.0 - PEAK_SHARE) * lengths[-1])])
    if pressure[top] > PEAK_RATIO * rest:
        return rest
    # Pressures that grow towards the end by a power of the distance, or jump there.
    away = np.where(pressure > 0.0, np.abs(arc_length - arc_length[top]), np.inf)
    order = np.argsort(away)[: len(order)]
    if len(order) >= LEAST_NODES:
        jump, less = -np.diff(pressure[order[:3]])
        step, after = np.diff(away[order[:3]])  # 0 where round-off is largest between two nodes
        if jump > END_JUMP * pressure[order[1]] and jump * after > END_SLOPE * less * step:
            return rest
    places = 2.0 * away[order[min(1, len(order) - 1)]] * 2.0 ** np.arange(HALVINGS + 1)
    found = np.interp(places, away[order], pressure[order])
    grows = places[-1] <= SINGULAR_REACH * lengths[-1] and (found[:-1] >= 2.0**LEAST_POWER * found[1:]).all()
    return rest if grows else float(pressure[top])


def is_singular(arc_length: FloatArray, pressure: FloatArray) -> bool:
    """Whether the largest pressure (m,) is at a singular end."""
    return regular_peak(arc_length, pressure) < float(pressure.max(initial=0.0))


@dataclass(frozen=True)
class Patch:
    """One run of closed nodes: ``middle`` (2,), ``half_width`` and the ``edges`` (0 to 2, 2) where it opens,
    not at ends of the surface, which do not move with the load. ``spacing`` is that of nodes in the middle,
    ``uncertainty`` (0 to 2,) the distance between the last closed and the first open node at each edge,
    ``apart`` (0 to 2,) the initial gap there, ``finest`` the factor by which edges may be coarser."""

    middle: FloatArray
    half_width: float
    spacing: float
    edges: FloatArray
    uncertainty: FloatArray
    apart: FloatArray
    finest: float = 1.0


def contact_patches(pairing: Pairing, closed: BoolArray, corners: BoolArray | None = None) -> list[Patch]:
    """Patches of one contact with closed candidates ``closed`` (m,). The first and the last candidate are
    edges, too, if they are ``corners`` (m,)."""
    arc, curve, patches = pairing.arc[pairing.candidate], pairing.slave.curve, []
    for first, after in runs_of(closed):
        ends, edges, uncertainty = [arc[first], arc[after - 1]], [], []
        for place, (node, beyond) in enumerate(((first, first - 1), (after - 1, after))):
            inside = 0 <= beyond < len(arc)
            if inside:
                ends[place] = 0.5 * (arc[beyond] + arc[node])
            if inside or (corners is not None and after - first > 1 and corners[node]):
                neighbor = beyond if inside else node + (1, -1)[place]
                edges.append(ends[place])
                uncertainty.append(abs(float(arc[neighbor] - arc[node])))
        # Arc lengths may continue past the start of a closed curve.
        at = np.array([0.5 * (ends[0] + ends[1]), *edges])
        points = curve.points(np.mod(at, curve.length) if curve.closed else at)
        apart = np.interp(edges, arc, pairing.gap[pairing.candidate])
        width, spacing = 0.5 * float(ends[1] - ends[0]), pairing.spacing[pairing.candidate]
        nearest = float(spacing[int(np.argmin(np.abs(arc - at[0])))])
        patches.append(Patch(points[0], width, nearest, points[1:], np.array(uncertainty), apart))
    return patches
