"""Transfer of pressures from slave to master nodes, and values between nodes: local fits along surfaces."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.joined import normals_towards
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.geometry.pairing import MAX_FACING_COSINE, Pairing
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, FINE_ROUND_OFF

WINDOW = 2.0
"""Half-width of the transfer window, in spacings."""
NEWTON_STEPS = 5
"""Newton steps to a point of the slave: quadratic convergence from an error of the order of the gap."""
WINDOW_SHARPNESS = 4.0
"""Squared residuals in the window are weighted by exp(-2 WINDOW_SHARPNESS r^2)."""


def transfer(pairing: Pairing, master_cloud: Cloud) -> sparse.csr_array:
    """Matrix (b, m) from the candidates' pressures to those at the master's surface nodes.

    One-dimensional moving least squares of degree 1 along the slave, times the slave's length per length of
    the master: a constant pressure is reproduced where surfaces touch. Nodes outside the candidates' range
    receive none. The window fits the coarser spacing: a coarse master that only samples a fine slave's
    pressures would see a smooth load as an oscillation, and the compliance would lose its positivity. A
    pressure acts at the very point where its node's gap is measured, so that forces and work agree on both
    sides up to the fit.
    """
    master = pairing.master
    assert master is not None, "an obstacle has no nodes"
    arc, _, spacing = _unrolled(pairing)
    s, offset, stretch = feet(pairing, master, master.arc_length)
    slack = COARSE_ROUND_OFF * float(pairing.spacing.min())
    facing = (slave_normals(pairing, s) * master.normal).sum(axis=1) < MAX_FACING_COSINE
    if pairing.slave.curve.closed:
        s = np.where(s < pairing.arc[0] - slack, s + pairing.slave.curve.length, s)
    rows = np.flatnonzero(facing & (s >= arc[0] - slack) & (s <= arc[-1] + slack) & (offset <= slack))
    own = np.interp(s[rows], arc, spacing)
    # The slack keeps nodes at the edge of the window inside, independent of round-off and units.
    reach = (1.0 + COARSE_ROUND_OFF) * WINDOW * np.maximum(own, master_cloud.spacing[master.index[rows]])
    fit = candidates_fit(pairing, s[rows], reach).tocoo()
    inner, columns = fit.coords
    carried = fit.data * stretch[rows[inner]]
    return sparse.csr_array((carried, (rows[inner], columns)), shape=(len(s), fit.shape[1]))


def feet(pairing: Pairing, master: Surface, arc: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sources on the slave of the pressures at ``arc`` (b,) along the master: arc lengths (b,), distances
    (b,) by which they miss, and the slave's length per length of the master (b,). The given point is the
    closest one to its source, which Newton's method finds from the slave's closest point."""
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
        # Where surfaces do not face each other nothing is transferred, whatever the stretch.
        stretch = (1.0 + curvature * gap) / np.maximum(cosine, -MAX_FACING_COSINE)
        # The curves run in opposite directions, each with its material on the left.
        moved = s + stretch * off
        s = np.mod(moved, slave.length) if slave.closed else np.clip(moved, 0.0, slave.length)
    return s, np.abs(off), stretch


def slave_normals(pairing: Pairing, s: FloatArray) -> FloatArray:
    """Normals (b, 2) of the slave at arc lengths ``s`` (b,); at a corner that ends the candidates, those of
    their side."""
    curve = pairing.slave.curve
    if pairing.slave.parts and pairing.candidate.any():
        first, last = pairing.arc[pairing.candidate][[0, -1]]
        small = COARSE_ROUND_OFF * float(pairing.spacing.min())
        s = np.where(np.abs(s - first) <= small, first + small, s)
        s = np.where(np.abs(s - last) <= small, last - small, s)
    return curve.normals(np.mod(s, curve.length) if curve.closed else s)


def candidates_fit(pairing: Pairing, s: FloatArray, reach: FloatArray) -> sparse.csr_array:
    """:func:`surface_fit` of the candidates' values; on a closed surface windows continue across the
    seam."""
    arc, weight, _ = _unrolled(pairing)
    fit = surface_fit(arc, weight, s, reach).tocoo()
    rows, columns = fit.coords
    count = int(pairing.candidate.sum())
    return sparse.csr_array((fit.data, (rows, columns % count)), shape=(len(s), count))


def _unrolled(pairing: Pairing) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Arc lengths, surface lengths and spacings (m,) of the candidates; if they cover a closed surface, of
    three turns (3m,), so that windows continue across the seam."""
    chosen = pairing.candidate
    arc, weight, spacing = pairing.arc[chosen], pairing.weight[chosen], pairing.spacing[chosen]
    if not pairing.all_around:
        return arc, weight, spacing
    turns = pairing.slave.curve.length * np.arange(-1, 2)
    return (turns[:, None] + arc).ravel(), np.tile(weight, 3), np.tile(spacing, 3)


def surface_fit(arc: FloatArray, weight: FloatArray, s: FloatArray, reach: FloatArray) -> sparse.csr_array:
    """Weights (r, m) of local linear fits to nodal values at ``arc`` (m,), evaluated at arc lengths ``s``
    (r,). ``weight`` (m,) are the nodes' surface lengths, ``reach`` (r,) the half-widths of windows, which
    contain at least the two nearest nodes. Linear functions are reproduced."""
    nearest = np.clip(np.searchsorted(arc, s), 1, max(len(arc) - 1, 1))
    first = np.minimum(np.searchsorted(arc, s - reach), nearest - 1)
    last = np.maximum(np.searchsorted(arc, s + reach, side="right"), np.minimum(nearest + 1, len(arc)))
    count = last - first
    start = np.cumsum(count) - count
    columns = np.repeat(first - start, count) + np.arange(count.sum())
    offset = (arc[columns] - np.repeat(s, count)) / np.repeat(reach, count)
    # Where even the nearest candidates lie outside the window, all weights would underflow: shift the
    # exponent, as only their ratios matter.
    least = np.minimum.reduceat(offset**2, start) if len(start) else np.zeros(0)
    shift = np.repeat(np.where(least > 1.0, least, 0.0), count)
    share = np.exp(-2.0 * WINDOW_SHARPNESS * (offset**2 - shift)) * weight[columns]
    s0, s1, s2 = (np.repeat(np.add.reduceat(share * offset**k, start), count) for k in range(3))
    # A window with a single node can only carry its constant.
    slope = s0 * s2 - s1**2 > FINE_ROUND_OFF * s0**2
    share = np.where(slope, share * (s2 - s1 * offset) / np.where(slope, s0 * s2 - s1**2, 1.0), share / s0)
    rows = np.repeat(np.arange(len(s)), count)
    return sparse.csr_array((share, (rows, columns)), shape=(len(s), len(arc)))
