"""Mortar coupling of two straight chains of quadratic edges with piecewise linear multipliers.

The multiplier lives at the slave's vertices. With phi_i its hat functions and s the slave's arc length, the
weak gap and slip are  integral phi_i (u_slave - u_master) ds.  Both chains run along x; the pieces between
all their vertices are integrated with three Gauss points each, which is exact for straight edges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scenes import Array

Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Chain:
    """``x``, ``y`` (n+1,) of the vertices, ascending in x; ``dofs`` (3, n, 2): ends and middle, x and y."""

    x: Array
    y: Array
    dofs: Integers


@dataclass(frozen=True)
class Mortar:
    """``jump`` (2m, dofs): rows 0..m-1 along y (normal), m..2m-1 along x; ``weight`` and ``gap`` (m,)."""

    x: Array
    jump: sparse.csr_matrix
    weight: Array
    gap: Array


def couple(slave: Chain, master: Chain, circle: float | None, dofs: int) -> Mortar:
    """Mortar matrices; ``circle`` is the radius the slave's gap is measured with, None for a flat slave."""
    inside = (master.x > slave.x[0]) & (master.x < slave.x[-1])
    breaks = np.unique(np.concatenate([slave.x, master.x[inside]]))
    breaks = breaks[np.concatenate([[True], np.diff(breaks) > 1e-12])]
    middle, half = 0.5 * (breaks[1:] + breaks[:-1]), 0.5 * np.diff(breaks)
    points, gauss = np.polynomial.legendre.leggauss(3)
    x = middle + half * points[:, None]
    on_slave = np.clip(np.searchsorted(slave.x, middle) - 1, 0, len(slave.x) - 2)
    on_master = np.clip(np.searchsorted(master.x, middle) - 1, 0, len(master.x) - 2)
    stretch = np.hypot(np.diff(slave.x), np.diff(slave.y)) / np.diff(slave.x)
    weights = half * gauss[:, None] * stretch[on_slave]

    s, m = local(slave, x, on_slave), local(master, x, on_master)
    hats = np.stack([1.0 - s, s])
    weighted = hats * weights
    rows = np.stack([on_slave, on_slave + 1])
    count = len(slave.x)
    blocks = []
    for axis in (1, 0):
        entries = [np.einsum("iqk,jqk->ijk", weighted, quadratic(s)).ravel()]
        entries.append(-np.einsum("iqk,jqk->ijk", weighted, quadratic(m)).ravel())
        row = np.broadcast_to(rows[:, None], (2, 3, len(middle))).ravel()
        columns = [
            np.broadcast_to(chain.dofs[None, :, piece, axis], (2, 3, len(middle))).ravel()
            for chain, piece in ((slave, on_slave), (master, on_master))
        ]
        where = (np.concatenate([row, row]), np.concatenate(columns))
        blocks.append(sparse.csr_matrix((np.concatenate(entries), where), shape=(count, dofs)))
    gap = np.zeros_like(x) if circle is None else circle - np.sqrt(circle**2 - x**2)
    return Mortar(
        x=slave.x,
        jump=sparse.csr_matrix(sparse.vstack(blocks)),
        weight=np.bincount(rows.ravel(), weighted.sum(axis=1).ravel(), count),
        gap=np.bincount(rows.ravel(), np.einsum("iqk,qk->ik", weighted, gap).ravel(), count),
    )


def local(chain: Chain, x: Array, piece: Integers) -> Array:
    """Coordinate 0 to 1 of x on its edge."""
    return (x - chain.x[piece]) / np.diff(chain.x)[piece]


def quadratic(t: Array) -> Array:
    """Shape functions of a quadratic edge: two ends and the middle."""
    return np.stack([(1.0 - t) * (1.0 - 2.0 * t), t * (2.0 * t - 1.0), 4.0 * t * (1.0 - t)])
