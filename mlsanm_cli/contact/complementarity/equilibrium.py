"""Static equilibrium of the motions: limit analysis by linear programming.

Pressures and tractions within their limits that balance the loads exist, or a combination of the balances, a
mechanism, shows that there are none (Farkas' lemma; Livesley 1978, doi:10.1002/nme.1620121207, for masonry).
Compliances do not matter: without equilibrium a problem has no state. With it there may be none either, as
slip is not associated with Coulomb's cone.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.complementarity.problem import Changes, ContactStatus, Problem
from mlsanm_cli.records import dataclass

BALANCED = 1e-8
"""Part of a load up to which it counts as balanced: the accuracy of the linear program."""


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """The largest ``part`` up to 1 of a load that can be balanced, pressures and tractions ``forces``
    (m + n,) that balance it, and the ``mechanism`` (k,) of the balances that stops a larger one."""

    part: float
    forces: FloatArray
    mechanism: FloatArray


def equilibrium(
    balances: FloatArray,
    nodes: IntArray,
    friction: FloatArray,
    constant: FloatArray,
    load: FloatArray,
    status: ContactStatus | None = None,
    allowed: Changes | None = None,
) -> Equilibrium | None:
    """Equilibrium of ``balances`` (k, N) under the rows ``constant`` (k,) and part of ``load`` (k,), with
    friction at ``nodes`` (n,); None if not even ``constant`` is balanced. For rates the conditions are those
    of a ``status`` and its ``allowed`` changes."""
    from scipy.optimize import linprog  # for few runs

    k, count, n = len(balances), balances.shape[1] - len(balances), len(nodes)
    m, size = count - n, max(np.abs(constant).max(initial=0.0), np.abs(load).max(initial=0.0))
    if not size:
        return Equilibrium(1.0, np.zeros(count), np.zeros(k))
    held = apart = np.zeros(m, dtype=bool)
    may = np.ones(2 * n, dtype=bool)
    if status is not None and allowed is not None:
        held, apart = status.closed & ~allowed.opens, ~status.closed & ~allowed.closes
        may = np.concatenate([allowed.forward, allowed.backward])
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
    return Equilibrium(float(found.x[-1]), found.x[:count] * unit[:count], found.eqlin.marginals)


def collapse(
    problem: Problem, free: FloatArray, status: ContactStatus | None = None, allowed: Changes | None = None
) -> FloatArray | None:
    """The direction (N,) of the mechanism that shows that no pressures and tractions balance the ``free``
    rows (N,); None if some do."""
    p, load = problem, free[problem.contacts :]
    balances = p.matrix[p.contacts :]
    found = equilibrium(balances, p.nodes, p.friction, np.zeros_like(load), load, status, allowed)
    if found is None or found.part > 1.0 - BALANCED:
        return None
    # Balances and motions are conjugate in work before they are scaled.
    motion = p.rows[p.contacts :] * found.mechanism / p.columns[p.contacts :]
    return np.concatenate([np.zeros(p.contacts), motion])
