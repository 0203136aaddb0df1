"""The parametric path of the problem: states along one load, from one change of status to the next.

With free rows ``free + lam load`` and slips opposed from fixed references the path is piecewise linear. A
status does not recur, and lam may turn where states fold back (Lemke 1965, doi:10.1287/mnsc.11.7.681;
parametric problems: Cottle, Pang and Stone 1992, doi:10.1137/1.9780898719000, section 4.5). Where the new
basis is singular lam stands still and a mechanism develops until a condition stops it. A direction that
nothing stops is a ray.
"""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.complementarity.basis import MAX_BORDERS, Basis, Ray, SingularError
from mlsanm_cli.contact.complementarity.problem import (
    BACKWARD,
    CLOSES,
    FEASIBLE,
    FORWARD,
    OPENS,
    RESTS,
    WEAK,
    Changes,
    ContactStatus,
    Problem,
)
from mlsanm_cli.records import dataclass

PIVOTS = 10
"""Largest number of pivots per condition; paths that end take about one."""
TIED = 1e-13
"""Relative distance between changes of status that occur at once."""
BACK = {OPENS: CLOSES, CLOSES: OPENS, FORWARD: RESTS, BACKWARD: RESTS}
"""The opposite of a change."""


@dataclass(frozen=True, eq=False)
class Point:
    """A ``status`` with its ``basis``, unknowns ``x`` (N,) and rows ``w`` (N,) at load ``lam``, reached in so
    many ``pivots``."""

    status: ContactStatus
    x: FloatArray
    w: FloatArray
    lam: float
    basis: Basis
    pivots: int = 0


@dataclass(frozen=True, eq=False)
class _Change:
    """A change of status of a ``node``, with the status ``before``."""

    kind: int
    node: int
    before: ContactStatus

    def back(self, own: int) -> int:
        """The change that would undo it."""
        if self.kind != RESTS:
            return BACK[self.kind]
        return FORWARD if self.before.slip_sign[own] > 0.0 else BACKWARD


def trace(
    problem: Problem,
    point: Point,
    load: FloatArray,
    reference: FloatArray,
    allowed: Changes,
    target: float,
) -> Point:
    """The point at which the path first passes lam = ``target`` in the direction from ``point``. Slips are
    opposed from their ``reference`` (n,). Raises Ray."""
    p, way = problem, 1.0 if target > point.lam else -1.0
    status, basis, x, w, lam = point.status, point.basis, point.x.copy(), point.w.copy(), point.lam
    last: _Change | None = None
    still = p.aim(np.zeros(p.n))
    for pivots in range(PIVOTS * (p.m + 2 * p.n + 5)):
        dx, dw = basis.solve(load, still)
        sense = way
        if last is not None:
            sense = 1.0 if _departure(p, last, status, dx, dw) > 0.0 else -1.0
        dx, dw, dlam = sense * dx, sense * dw, sense
        for mechanism in (False, True):
            step, change = _next(p, status, allowed, (x, w), (dx, dw), reference, last)
            left = (target - lam) / dlam if dlam * way > 0.0 else np.inf
            if left <= step and np.isfinite(left):
                return Point(status, x + left * dx, w + left * dw, target, basis, pivots)
            if change is None:
                raise Ray(dx, lam)
            x, w, lam, last = x + step * dx, w + step * dw, lam + step * dlam, change
            status = p.changed(status, change.kind, change.node, w[p.m : p.contacts] - reference)
            if mechanism:
                basis = basis.to(status)
            else:
                found = _pivoted(basis, change, status)
                if found is None:
                    break
                (dx, dw), dlam = found, 0.0
                loose = _let_go(p, status, dx, load)
                if loose is not None:
                    basis = loose
                    break
        if basis.updates > MAX_BORDERS:
            basis.anew()
    raise Ray(dx, lam)


def _let_go(problem: Problem, status: ContactStatus, mechanism: FloatArray, load: FloatArray) -> Basis | None:
    """The basis of a status with a ``mechanism`` (N,) held: of a body that comes loose and that the load does
    not drive. None if the mechanism changes forces, or is driven."""
    count = problem.contacts
    if np.abs(mechanism[:count]).max(initial=0.0) > FEASIBLE * np.abs(mechanism[count:]).max(initial=0.0):
        return None
    try:
        basis = Basis(problem, status)
        basis.solve(load, problem.aim(np.zeros(problem.n)))
    except SingularError:
        return None
    return basis


def _departure(
    problem: Problem, change: _Change, status: ContactStatus, dx: FloatArray, dw: FloatArray
) -> float:
    """Rate, with lam, at which a node leaves the limit of its last condition: its gap if it has opened, its
    pressure if it has closed, its slip if it slips, its remaining friction if it has come to rest."""
    if change.kind == OPENS:
        return float(dw[change.node])
    if change.kind == CLOSES:
        return float(dx[change.node])
    own = int(problem.owner[change.node])
    if change.kind == RESTS:
        limit = problem.friction[own] * dx[change.node]
        return float(limit - change.before.slip_sign[own] * dx[problem.m + own])
    return float(-status.slip_sign[own] * dw[problem.m + own])


def _next(
    problem: Problem,
    status: ContactStatus,
    allowed: Changes,
    now: tuple[FloatArray, FloatArray],
    rates: tuple[FloatArray, FloatArray],
    reference: FloatArray,
    last: _Change | None,
) -> tuple[float, _Change | None]:
    """Distance along ``rates`` to the next limit of a condition, and the change there, of simultaneous ones
    the fastest; None if there is none."""
    p, (dx, dw) = problem, rates
    left = p.distances(status, allowed, *now, reference)
    falls = -p.distances(status, allowed, dx, dw, np.zeros(p.n))
    if last is not None:
        left[last.back(int(p.owner[last.node])), last.node] = np.inf
    moved = float(np.abs(dw[: p.contacts]).max(initial=0.0))
    size = max(p.size(dx), WEAK * moved)
    falling = np.isfinite(left) & (falls > FEASIBLE * size)
    if not falling.any():
        return np.inf, None
    steps = np.full(left.shape, np.inf)
    steps[falling] = np.maximum(left[falling], 0.0) / falls[falling]
    step = float(steps.min())
    tied = falling & (steps <= step + TIED * abs(step))
    kind, node = np.unravel_index(int(np.argmax(np.where(tied, falls, -1.0))), steps.shape)
    return step, _Change(int(kind), int(node), status)


def _pivoted(basis: Basis, change: _Change, after: ContactStatus) -> tuple[FloatArray, FloatArray] | None:
    """Update the basis by a change of status; if the new one is singular, the mechanism (dx, dw), in which
    the new variable of the node increases, and the basis is that before."""
    p = basis.problem
    if basis.pivot(after):
        return None
    x, w = basis.mechanism(after)
    old, new = change.before.active(p.k), after.active(p.k)
    index, enters = int(np.flatnonzero(old != new)[0]), bool((new & ~old).any())
    own = index - p.m
    if own >= 0 and (change.before if enters else after).slip_sign[own] > 0.0:
        # Friction falls below its limit mu p; slip opposes friction.
        x, w = -x, -w
    return x, w
