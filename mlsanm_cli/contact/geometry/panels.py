"""Interpolation along a contact: Chebyshev points, Lagrange polynomials, logarithmic panels."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray

PANEL, PANEL_POINTS = 0.5, 10
"""Width of panels in the logarithm of the distance from a corner, and points per panel: corner terms are
accurate to 1e-6 for a corner of 25 degrees, to 1e-10 for 90 degrees."""


def chebyshev(first: float, last: float, count: int) -> FloatArray:
    """Chebyshev points (k,) of the first kind on an interval, increasing."""
    angle = np.pi * (np.arange(count) + 0.5) / count
    return 0.5 * (first + last) - 0.5 * (last - first) * np.cos(angle)


def lagrange(places: FloatArray, nodes: FloatArray) -> FloatArray:
    """Lagrange polynomials (e, k) at ``places`` (e,) for Chebyshev ``nodes`` (k,), or (e, k) individual ones,
    by the barycentric formula (Berrut and Trefethen 2004, doi:10.1137/S0036144502417715)."""
    count = nodes.shape[-1]
    factor = (-1.0) ** np.arange(count) * np.sin(np.pi * (np.arange(count) + 0.5) / count)
    apart = places[:, None] - nodes
    same = apart == 0.0
    share = factor / np.where(same, 1.0, apart)
    values = share / share.sum(axis=1, keepdims=True)
    row = same.any(axis=1)
    values[row] = same[row]
    return np.asarray(values)


def on_panels(x: FloatArray) -> tuple[FloatArray, sparse.csr_array]:
    """Chebyshev points (k,) on equal panels in ln x that cover ``x`` (e,) > 0, and the interpolation matrix
    (e, k) for functions smooth in ln x."""
    t = np.log(x)
    count = max(1, int(np.ceil(float(np.ptp(t)) / PANEL)))
    if count * PANEL_POINTS >= len(x):
        return x, sparse.csr_array(sparse.eye_array(len(x), format="csr"))
    width = float(np.ptp(t)) / count
    panel = np.clip(((t - t.min()) / width).astype(np.int64), 0, count - 1)
    nodes = chebyshev(0.0, 1.0, PANEL_POINTS)
    values = lagrange((t - t.min()) / width - panel, nodes)
    column = panel[:, None] * PANEL_POINTS + np.arange(PANEL_POINTS)
    start = np.arange(len(x) + 1) * PANEL_POINTS
    shape = len(x), count * PANEL_POINTS
    shares = sparse.csr_array((values.ravel(), column.ravel(), start), shape=shape)
    return np.exp(t.min() + width * (np.arange(count)[:, None] + nodes).ravel()), shares
