"""The parametric path of the problem: states along one load, from one change of status to the next.

With free rows ``free + lam load`` and slips opposed from fixed references the path is piecewise linear. A
status does not recur, and lam may turn where states fold back (Lemke 1965, doi:10.1287/mnsc.11.7.681;
parametric problems: Cottle, Pang and Stone 1992, doi:10.1137/1.9780898719000, section 4.5). Where the new
basis is singular lam stands still and a mechanism develops until a condition stops it. A direction that
nothing stops is a ray.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.complementarity.basis import Basis, Ray, SingularError
from mlsanm_cli.contact.complementarity.problem import (
    BACKWARD,
    CLOSES,
    FEASIBLE,
    FORWARD,
    OPENS,
    RESTS,
    WEAK,
    ContactStatus,
    Problem,
)

PIVOTS = 10
"""Largest number of pivots per condition; paths that end take about one."""
TIED = 1e-13
"""Relative distance between changes of status that occur at once."""
BACK = {OPENS: CLOSES, CLOSES: OPENS, FORWARD: RESTS, BACKWARD: RESTS}
"""The opposite of a change; of coming to rest it is slipping as before."""

Condition: TypeAlias = tuple[int, int]
"""Kind and node of a change of status."""
Pair: TypeAlias = tuple[FloatArray, FloatArray]
"""Unknowns and rows (N,), or their rates."""


def trace(
    basis: Basis,
    point: Pair,
    lam: float,
    load: FloatArray,
    reference: FloatArray,
    allowed: BoolArray,
    target: float,
) -> tuple[Basis, FloatArray, int]:
    """The basis and unknowns (N,) with which the path first passes lam = ``target`` in the direction from a
    ``point`` at ``lam`` with its ``basis``, and the number of pivots. Slips are opposed from their
    ``reference`` (n,). Raises Ray."""
    p, status, way = basis.problem, basis.status, 1.0 if target > lam else -1.0
    x, w = point
    last, still = None, np.zeros(p.n)
    for pivots in range(PIVOTS * (p.m + 2 * p.n + 5)):
        dx, dw = basis.solve(load, still)
        sense = way
        if last is not None:
            # The node that has changed departs from its limit.
            sense = 1.0 if p.distances(status, p.everything, dx, dw, still)[last] > 0.0 else -1.0
        dx, dw, dlam = sense * dx, sense * dw, sense
        for mechanism in (False, True):
            step, change = _next(p, status, allowed, (x, w), (dx, dw), reference, last)
            left = (target - lam) / dlam if dlam * way > 0.0 else np.inf
            if left <= step and np.isfinite(left):
                return basis, x + left * dx, pivots
            if change is None:
                raise Ray(dx, lam)
            x, w, lam = x + step * dx, w + step * dw, lam + step * dlam
            kind, node = change
            slid = FORWARD if kind == RESTS and status.slip_sign[p.owner[node]] > 0.0 else BACKWARD
            last = BACK.get(kind, slid), node
            status = p.changed(status, kind, node, w[p.m : p.contacts] - reference)
            if mechanism:
                basis = basis.to(status)
            elif basis.pivot(status):
                break
            else:
                (dx, dw), dlam = basis.mechanism(status), 0.0
                motions = np.abs(dx[p.contacts :]).max(initial=0.0)
                if np.abs(dx[: p.contacts]).max(initial=0.0) > FEASIBLE * motions:
                    continue
                # A body that comes loose is held unless the load drives it.
                try:
                    loose = Basis(p, status)
                    loose.solve(load, still)
                except SingularError:
                    continue
                basis = loose
                break
    raise Ray(dx, lam)


def _next(
    problem: Problem,
    status: ContactStatus,
    allowed: BoolArray,
    now: Pair,
    rates: Pair,
    reference: FloatArray,
    last: Condition | None,
) -> tuple[float, Condition | None]:
    """Distance along ``rates`` to the next limit of a condition but the ``last``, and the change there, of
    simultaneous ones the fastest; None if there is none."""
    p, (dx, dw) = problem, rates
    left = p.distances(status, allowed, *now, reference)
    falls = -p.distances(status, allowed, dx, dw, np.zeros(p.n))
    if last is not None:
        left[last] = np.inf
    moved = float(np.abs(dw[: p.contacts]).max(initial=0.0))
    falling = np.isfinite(left) & (falls > FEASIBLE * max(p.size(dx), WEAK * moved))
    if not falling.any():
        return np.inf, None
    steps = np.full(left.shape, np.inf)
    steps[falling] = np.maximum(left[falling], 0.0) / falls[falling]
    step = float(steps.min())
    tied = falling & (steps <= step + TIED * abs(step))
    change, at = np.unravel_index(int(np.argmax(np.where(tied, falls, -1.0))), steps.shape)
    return step, (int(change), int(at))
