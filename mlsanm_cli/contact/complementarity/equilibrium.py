"""Static equilibrium of the motions by linear programming: limit loads, and motions left undetermined.

Pressures and tractions within their limits that balance the loads exist, or a combination of the balances, a
mechanism, shows that there are none (Farkas' lemma; Livesley 1978, doi:10.1002/nme.1620121207, for masonry).
Without equilibrium a problem has no state; with it there may be none either, as slip is not associated with
Coulomb's cone.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.complementarity.basis import null_space
from mlsanm_cli.contact.complementarity.problem import (
    BACKWARD,
    CLOSES,
    FORWARD,
    GRAZING,
    OPENS,
    ContactStatus,
    Problem,
)

BALANCED = 1e-8
"""Part of a load up to which it counts as balanced: the accuracy of the linear program."""


def equilibrium(
    balances: FloatArray,
    nodes: IntArray,
    friction: FloatArray,
    constant: FloatArray,
    load: FloatArray,
    status: ContactStatus | None = None,
    allowed: BoolArray | None = None,
) -> tuple[float, FloatArray, FloatArray] | None:
    """Largest part up to 1 of a ``load`` (k,) that pressures and tractions (m + n,) balance beside the rows
    ``constant`` (k,), these, and the mechanism (k,) of the ``balances`` (k, N) that stops a larger one.
    Friction acts at ``nodes`` (n,). None if not even ``constant`` is balanced. For rates the conditions are
    those of a ``status`` and its ``allowed`` changes."""
    from scipy.optimize import linprog  # for few runs

    k, count, n = len(balances), balances.shape[1] - len(balances), len(nodes)
    m, size = count - n, max(np.abs(constant).max(initial=0.0), np.abs(load).max(initial=0.0))
    if not size:
        return 1.0, np.zeros(count), np.zeros(k)
    held = apart = np.zeros(m, dtype=bool)
    may = np.ones(2 * n, dtype=bool)
    if status is not None and allowed is not None:
        held, apart = status.closed & ~allowed[OPENS], ~status.closed & ~allowed[CLOSES]
        may = allowed[FORWARD : BACKWARD + 1, nodes].ravel()
    unit = np.abs(balances).max(axis=0, initial=0.0)
    unit = size / np.where(unit > 0.0, unit, 1.0)
    unit[m:count] = unit[:m][nodes]
    bounds = [(None if h else 0.0, 0.0 if a else None) for h, a in zip(held, apart, strict=True)]
    bounds += [(0.0, 0.0) if a else (None, None) for a in apart[nodes]]
    bounds += [(None, None)] * k + [(0.0, 1.0)]
    # Rows of t - mu p <= 0 and -t - mu p <= 0.
    each, sides = np.arange(n), np.repeat([1.0, -1.0], n)
    tangential = sparse.csr_array((sides, (np.arange(2 * n), np.tile(m + each, 2))), (2 * n, count + k + 1))
    normal = sparse.csr_array(
        (np.tile(-friction, 2), (np.arange(2 * n), np.tile(nodes, 2))), tangential.shape
    )
    limits = (tangential + normal)[np.flatnonzero(may)]
    conditions: Any = limits if may.any() else None
    found = linprog(
        np.append(np.zeros(count + k), -1.0),
        A_ub=conditions,
        b_ub=np.zeros(limits.shape[0]) if may.any() else None,
        A_eq=np.hstack([balances * (unit / size), load[:, None] / size]),
        b_eq=-constant / size,
        bounds=bounds,
    )
    if found.status != 0 or found.x is None:
        return None
    return float(found.x[-1]), found.x[:count] * unit[:count], found.eqlin.marginals


def collapse(
    problem: Problem, free: FloatArray, status: ContactStatus | None = None, allowed: BoolArray | None = None
) -> FloatArray | None:
    """The direction (N,) of the mechanism that shows that no pressures and tractions balance the ``free``
    rows (N,); None if some do."""
    p, load = problem, free[problem.contacts :]
    balances = p.matrix[p.contacts :]
    found = equilibrium(balances, p.nodes, p.friction, np.zeros_like(load), load, status, allowed)
    if found is None or found[0] > 1.0 - BALANCED:
        return None
    # Balances and motions are conjugate in work before they are scaled.
    motion = p.rows[p.contacts :] * found[2] / p.columns[p.contacts :]
    return np.concatenate([np.zeros(p.contacts), motion])


def undetermined(
    problem: Problem, status: ContactStatus, x: FloatArray, drives: FloatArray
) -> FloatArray | None:
    """A motion (k,) that neither the forces of a state with unknowns ``x`` (N,) nor loads with the work
    ``drives`` (L, k) determine, though it moves contacts with friction; None if there is none. It opens or
    closes no pressed node and moves no sticking one; those at their friction limit may slip as it opposes."""
    p, size = problem, GRAZING * problem.size(x)
    if not (p.k and p.n and size):
        return None
    pressure, traction = x[: p.m][p.nodes], x[p.m : p.contacts]
    rubs = p.rubs & status.closed[p.nodes] & (pressure > size)
    limited = rubs & status.stuck & (p.friction * pressure - np.abs(traction) <= size)
    sticks = status.stuck & ~limited
    moved = p.matrix[:, p.contacts :]
    gaps, slips = moved[: p.m], moved[p.m : p.contacts]
    held = np.vstack([gaps[status.closed], slips[sticks], moved[p.contacts :], drives])
    free = null_space(_normalised(held))
    if not free.shape[1]:
        return None
    resting = -np.sign(traction[limited])[:, None] * slips[limited] @ free
    sliding, still = slips[rubs & ~status.stuck] @ free, np.eye(free.shape[1])
    if len(resting):
        from scipy.optimize import linprog  # for few runs

        found = linprog(
            -resting.sum(axis=0), A_ub=-resting, b_ub=np.zeros(len(resting)), bounds=[(-1.0, 1.0)]
        )
        if found.x is not None and (resting @ found.x).max() > GRAZING:
            return np.asarray(p.columns[p.contacts :] * (free @ found.x))
        still = null_space(_normalised(resting))
    seen = np.abs(sliding @ still)
    if not seen.size or seen.max() <= GRAZING:
        return None
    return np.asarray(p.columns[p.contacts :] * (free @ still[:, int(np.argmax(seen.max(axis=0)))]))


def _normalised(rows: FloatArray) -> FloatArray:
    """The rows that are not zero, divided by their largest entries."""
    largest = np.abs(rows).max(axis=1, initial=0.0)
    return np.asarray(rows[largest > 0.0] / largest[largest > 0.0, None])
