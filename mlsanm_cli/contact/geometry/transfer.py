"""What pressures on slave nodes are on the master, and values between nodes: local fits along surfaces."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.joined import normals_towards
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.geometry.pairing import MAX_FACING_COSINE, SLACK, Pairing

WINDOW = 2.0
"""Half-width of the window over which pressures are carried to the master, in spacings."""
NEWTON_STEPS = 5
"""Newton steps to a point on the slave; the error, initially a part of the gap, decreases quadratically."""
WINDOW_SHARPNESS = 4.0
"""Squared residuals in the window are weighted by exp(-2 WINDOW_SHARPNESS r^2)."""


def transfer(pairing: Pairing, master_cloud: Cloud) -> sparse.csr_array:
    """Pressure at the master's surface nodes (b, m) from the candidates' pressures (m,).

    One-dimensional moving least squares of degree 1 along the slave surface, times the slave's length per
    length of the master: a constant pressure is reproduced where surfaces touch. Nodes outside the
    candidates' range receive none. The window is as wide as the coarser of the two spacings asks for: a
    coarse master that only sampled a fine slave's pressures would take an oscillation from node to node for
    a smooth load, and the compliance would lose its positivity.

    A pressure is transferred to the very place where its node's gap is measured, and by the slave's length
    there, so that forces and work are the same on both sides up to the fit. Taken from the closest point of
    the slave instead, a pressure is displaced and stretched by a part of the order of the square of contact
    width over radius, whatever the spacings: on clouds fine enough the compliance then loses its positivity.
    """
    master = pairing.master
    assert master is not None, "an obstacle has no nodes"
    arc, _, spacing = _unrolled(pairing)
    s, offset, stretch = feet(pairing, master, master.arc_length)
    slack = 1e-6 * float(pairing.spacing.min())
    facing = (slave_normals(pairing, s) * master.normal).sum(axis=1) < MAX_FACING_COSINE
    if pairing.slave.curve.closed:
        s = np.where(s < pairing.arc[0] - slack, s + pairing.slave.curve.length, s)
    rows = np.flatnonzero(facing & (s >= arc[0] - slack) & (s <= arc[-1] + slack) & (offset <= slack))
    own = np.interp(s[rows], arc, spacing)
    # The slack keeps nodes at the window's very edge inside, whatever round-off and the unit of length say.
    reach = (1.0 + SLACK) * WINDOW * np.maximum(own, master_cloud.spacing[master.index[rows]])
    fit = candidates_fit(pairing, s[rows], reach).tocoo()
    inner, columns = fit.coords
    carried = fit.data * stretch[rows[inner]]
    return sparse.csr_array((carried, (rows[inner], columns)), shape=(len(s), fit.shape[1]))


def feet(pairing: Pairing, master: Surface, arc: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where on the slave the places at ``arc`` (b,) along the master have their pressures from: arc lengths
    (b,), how far each misses its place (b,), and the slave's length per length of the master (b,).

    There the closest point of the master is the place, found by Newton's method from the place's own closest
    point.
    """
    slave, points = pairing.slave.curve, master.curve.points(arc)
    s = slave.closest(points)
    normal = normals_towards(master.curve, arc, slave.normals(s))
    curvature = master.curve.curvature(arc)
    for _ in range(NEWTON_STEPS):
        off = master.curve.closest(slave.points(s)) - arc
        if master.curve.closed:
            off -= master.curve.length * np.round(off / master.curve.length)
        cosine = -(slave_normals(pairing, s) * normal).sum(axis=1)
        gap = ((slave.points(s) - points) * normal).sum(axis=1)
        # Where surfaces do not face each other nothing is carried over, whatever their stretch.
        stretch = (1.0 + curvature * gap) / np.maximum(cosine, -MAX_FACING_COSINE)
        # The two curves run past each other, each with its material on the left.
        moved = s + stretch * off
        s = np.mod(moved, slave.length) if slave.closed else np.clip(moved, 0.0, slave.length)
    return s, np.abs(off), stretch


def slave_normals(pairing: Pairing, s: FloatArray) -> FloatArray:
    """Normals (b, 2) of the slave at arc lengths ``s`` (b,); where candidates end at a corner, those of the
    side that they are on."""
    curve = pairing.slave.curve
    if pairing.slave.parts and pairing.candidate.any():
        first, last = pairing.arc[pairing.candidate][[0, -1]]
        small = SLACK * float(pairing.spacing.min())
        s = np.where(np.abs(s - first) <= small, first + small, s)
        s = np.where(np.abs(s - last) <= small, last - small, s)
    return curve.normals(np.mod(s, curve.length) if curve.closed else s)


def candidates_fit(pairing: Pairing, s: FloatArray, reach: FloatArray) -> sparse.csr_array:
    """Values at arc lengths ``s`` (r,) of local linear fits to those of the candidates (m,): weights (r, m).

    ``reach`` (r,) are the windows' half-widths. All around a closed surface they run on across the seam.
    """
    arc, weight, _ = _unrolled(pairing)
    fit = surface_fit(arc, weight, s, reach).tocoo()
    rows, columns = fit.coords
    count = int(pairing.candidate.sum())
    return sparse.csr_array((fit.data, (rows, columns % count)), shape=(len(s), count))


def _unrolled(pairing: Pairing) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Arc lengths, surface lengths and spacings (m,) of the candidates; where they go all around, those of
    the turns before and after too (3m,), so that windows run on across the seam."""
    chosen = pairing.candidate
    arc, weight, spacing = pairing.arc[chosen], pairing.weight[chosen], pairing.spacing[chosen]
    if not pairing.all_around:
        return arc, weight, spacing
    turns = pairing.slave.curve.length * np.arange(-1, 2)
    return (turns[:, None] + arc).ravel(), np.tile(weight, 3), np.tile(spacing, 3)


def surface_fit(arc: FloatArray, weight: FloatArray, s: FloatArray, reach: FloatArray) -> sparse.csr_array:
    """Values at arc lengths ``s`` (r,) of local linear fits to nodal values (m,) at ``arc``: weights (r, m).

    ``weight`` (m,) are the nodes' surface lengths, ``reach`` (r,) the windows' half-widths. Linear functions
    are reproduced.
    """
    first, last = _window(arc, s, reach)
    count = last - first
    start = np.cumsum(count) - count
    columns = np.repeat(first - start, count) + np.arange(count.sum())
    offset = (arc[columns] - np.repeat(s, count)) / np.repeat(reach, count)
    # Between candidates far apart even the nearest ones lie outside the window: their weights would underflow
    # to 0 / 0. Only the ratios of weights count.
    nearest = np.minimum.reduceat(offset**2, start) if len(start) else np.zeros(0)
    shift = np.repeat(np.where(nearest > 1.0, nearest, 0.0), count)
    share = np.exp(-2.0 * WINDOW_SHARPNESS * (offset**2 - shift)) * weight[columns]
    s0, s1, s2 = (np.repeat(np.add.reduceat(share * offset**k, start), count) for k in range(3))
    # A window with a single node can only carry its constant.
    slope = s0 * s2 - s1**2 > 1e-12 * s0**2
    share = np.where(slope, share * (s2 - s1 * offset) / np.where(slope, s0 * s2 - s1**2, 1.0), share / s0)
    rows = np.repeat(np.arange(len(s)), count)
    return sparse.csr_array((share, (rows, columns)), shape=(len(s), len(arc)))


def _window(arc: FloatArray, s: FloatArray, reach: FloatArray) -> tuple[IntArray, IntArray]:
    """Ranges [first, last) of ``arc`` (m,) within ``reach`` (r,) of ``s`` (r,), at least the two nearest."""
    nearest = np.clip(np.searchsorted(arc, s), 1, max(len(arc) - 1, 1))
    first = np.minimum(np.searchsorted(arc, s - reach), nearest - 1)
    last = np.maximum(np.searchsorted(arc, s + reach, side="right"), np.minimum(nearest + 1, len(arc)))
    return first, last
