"""States of the problem: semismooth Newton steps on the status, and complementary pivoting where these recur.

A node is closed if its pressure minus its gap over a compliance is positive, and slips if traction minus slip
exceeds friction (Alart and Curnier 1991, doi:10.1016/0045-7825(91)90022-X; Hintermueller, Ito and Kunisch
2002, doi:10.1137/S1052623401383558). Each step solves the equations of closed nodes only. Where statuses
recur, a load is added that makes one of them feasible, and removed along the parametric path (Lemke 1965,
doi:10.1287/mnsc.11.7.681; parametric problems: Cottle, Pang and Stone 1992, doi:10.1137/1.9780898719000).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace
from typing import TypeAlias

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.complementarity.basis import NULL, Basis, Ray, SingularError, null_space
from mlsanm_cli.contact.complementarity.equilibrium import collapse
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
from mlsanm_cli.records import dataclass

PASSES, HELD_PASSES, BEST = 8, 30, 2
"""Newton steps without fewer violated conditions than before that end a search, as it wanders; and with
springs on all motions; and number of the statuses with the fewest violations from which pivoting starts."""
GOLDEN, COVER = 0.5 * (np.sqrt(5.0) - 1.0), 1e-2
"""Multiples of the first, modulo 1, are evenly spread irregular numbers; and least covering gaps and
pressures over the largest: any positive number does."""
RESISTED = NULL**0.5
"""Part of a row that remaining motions change, above which its node holds them: far above what is zero."""
SPRINGS = (1e6 * FEASIBLE, 1e4 * FEASIBLE, 1e2 * FEASIBLE)
"""Stiffness of springs over that of the contacts, one after the other, down to where they are round-off."""
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


@dataclass(frozen=True, eq=False)
class State:
    """Unknowns ``x`` and rows ``w`` (N,) that satisfy all conditions, or rates; their ``status`` and
    ``basis``, the number of ``systems``, and the residual ``missed`` over ``grain``.

    With a history at ``lam``: slips ``reference`` (n,) at which nodes stick, of others those before, and the
    ``work`` (n,) of friction so far per unit of scaled tractions and slips; it has ``jumped`` from another
    state, or ``rates`` led to it.
    """

    status: ContactStatus
    x: FloatArray
    w: FloatArray
    basis: Basis | None = None
    systems: int = 0
    missed: float = 0.0
    reference: FloatArray = field(default_factory=lambda: np.zeros(0))
    work: FloatArray = field(default_factory=lambda: np.zeros(0))
    lam: float = 0.0
    jumped: bool = False
    rates: State | None = None


@dataclass(frozen=True, eq=False)
class Search:
    """A search for the state with ``free`` rows (N,), slips opposed from their ``reference`` (n,), and the
    ``allowed`` changes (5, m); motions that nothing resists or drives stay as in the unknowns ``near`` (N,),
    or all are held there by ``springs`` (k, k)."""

    problem: Problem
    free: FloatArray
    reference: FloatArray
    allowed: BoolArray
    near: FloatArray | None = None
    springs: FloatArray | None = None

    def solved(
        self,
        *starts: ContactStatus,
        basis: Basis | None = None,
        thorough: bool = False,
        pivoting: bool = True,
    ) -> State:
        """The state by Newton steps from the statuses ``starts`` and one that holds all bodies, or, if there
        is equilibrium, by ``pivoting`` from the best statuses met; if ``thorough`` from more. Raises Ray."""
        p, seen, systems, best = self.problem, set[bytes](), 0, list[ContactStatus]()
        ray = Ray(np.zeros(len(self.free)))

        def newton(start: ContactStatus) -> State | None:
            nonlocal systems
            found, closest, count = self._newton(start, basis, seen)
            best.extend(closest)
            systems += count
            return found and replace(found, systems=systems)

        def pivoted(starts: Sequence[ContactStatus]) -> State | None:
            nonlocal ray
            # Also from these sticking and slipping to the other side.
            for one in starts if thorough else ():
                other = replace(one, slip_sign=-one.slip_sign)
                starts = [*starts, p.touching(one.closed), other]
            for start in {one.key: one for one in starts}.values():
                try:
                    return self._pivoted(start, systems)
                except Ray as error:
                    ray = error
            return None

        for start in starts:
            if found := newton(start):
                return found
        if self.allowed is not p.everything and (found := pivoted(best)):
            return found
        direction = collapse(p, self.free, starts[0], self.allowed) if p.k and pivoting else None
        if direction is not None:  # no pressures and tractions balance the loads
            raise Ray(direction)
        if found := newton(self._softly_held(starts[-1])):
            return found
        if pivoting and (found := pivoted([*best, self.supported(starts[-1], alone=True)])):
            return found
        raise ray

    def _newton(
        self, status: ContactStatus, basis: Basis | None, seen: set[bytes], passes: int = PASSES
    ) -> tuple[State | None, list[ContactStatus], int]:
        """The state, or statuses with the fewest violations; and the number of systems solved."""
        p, tried, systems, least = self.problem, list[tuple[int, ContactStatus]](), 0, (np.inf, 0)
        while status.key not in seen and systems < least[1] + passes:
            seen.add(status.key)
            systems += 1
            try:
                basis = Basis(p, status, self.springs) if basis is None else basis.to(status)
                x, w = basis.solve(self.free, self.reference, self.near)
            except SingularError:
                # Contacts that slide as a whole may come to rest.
                basis, status = None, p.touching(status.closed)
                continue
            wrong = int(self.violated(status, x, w).sum())
            if not wrong:
                return State(status, x, w, basis, systems, missed=basis.missed), [], systems
            tried.append((wrong, status))
            least = min(least, (wrong, systems))
            status = self.projected(status, x, w)
        return None, [one for _, one in sorted(tried, key=lambda item: item[0])[:BEST]], systems

    def _softly_held(self, start: ContactStatus) -> ContactStatus:
        """The status with springs on all motions, which make every status solvable: softer ones each time,
        from where the bodies came to (proximal point method: Rockafellar 1976, doi:10.1137/0314056)."""
        p, count, status = self.problem, self.problem.contacts, self.supported(start)
        # Springs act against the motions that forces on them cause.
        u, _, v = np.linalg.svd(-p.matrix[count:, :count] @ p.matrix[:count, count:])
        near = np.zeros(len(self.free)) if self.near is None else self.near
        for stiffness in SPRINGS if p.k else ():
            search = replace(self, springs=stiffness * (u @ v), near=near)
            found, best, _ = search._newton(status, None, set(), HELD_PASSES)
            if found is None:
                return best[0] if best else status
            status, near = found.status, found.x
        return status

    def violated(self, status: ContactStatus, x: FloatArray, w: FloatArray) -> BoolArray:
        """Mask (5, m) of conditions violated by more than round-off."""
        p = self.problem
        left = p.distances(status, self.allowed, x, w, self.reference)
        return np.asarray(left < -FEASIBLE * p.size(x) * p.grain[: p.m])

    def error(self, status: ContactStatus, x: FloatArray, w: FloatArray) -> float:
        """Largest error of rows and violation of conditions over round-off."""
        p, size = self.problem, FEASIBLE * self.problem.size(x)
        missed = np.abs(self.free + p.product(x) - w) / p.grain
        left = p.distances(status, self.allowed, x, w, self.reference) / p.grain[: p.m]
        worst = max(float(missed.max(initial=0.0)), -float(left.min(initial=0.0)))
        return worst / size if size else 0.0

    def projected(self, status: ContactStatus, x: FloatArray, w: FloatArray) -> ContactStatus:
        """The status of a semismooth Newton step: that of nodes without a violated condition is kept."""
        p, allowed, slip = self.problem, self.allowed, w[self.problem.m : self.problem.contacts]
        wrong: BoolArray = np.asarray(self.violated(status, x, w).any(axis=0))
        push = x[: p.m] - p.exchange[: p.m] * w[: p.m]
        closed = np.where(status.closed, ~allowed[OPENS] | (push > 0.0), allowed[CLOSES] & (push > 0.0))
        pull = x[p.m : p.contacts] - p.exchange[p.m :] * (slip - self.reference)
        limit = p.friction * push[p.nodes]
        may = allowed[:, p.nodes]
        forward, backward = may[FORWARD] & (pull > limit), may[BACKWARD] & (-pull > limit)
        slides = ~p.rubs | forward | backward
        side = np.where(backward & ~(forward & (pull > 0.0)), -1.0, 1.0)
        closed = np.where(wrong, closed, status.closed)
        on, rubbing = closed[p.nodes], wrong[p.nodes]
        stuck = np.where(rubbing, on & ~slides, status.stuck)
        return ContactStatus(
            closed, stuck, np.where(rubbing, np.where(on & slides, side, 0.0), status.slip_sign)
        )

    def supported(self, start: ContactStatus, alone: bool = False) -> ContactStatus:
        """The status ``start`` with the fewest and closest further nodes closed, and stuck, that determine
        all motions; or these nodes ``alone``, so that rigid bodies are not held twice."""
        p, allowed, count = self.problem, self.allowed, self.problem.contacts
        kept = ~allowed[OPENS] | (not alone)
        closed, stuck = start.closed & kept, start.stuck & kept[p.nodes]
        moved = p.matrix[:, count:]
        left = null_space(np.vstack([moved[count:], moved[: p.m][closed], moved[p.m : count][stuck]]))
        for node in np.argsort(self.free[: p.m], kind="stable"):
            if not left.shape[1]:
                break
            own = int(p.owner[node])
            for marks, at, row in ((closed, node, node), (stuck, own, p.m + own)):
                if (
                    at < 0
                    or marks[at]
                    or not (closed[node] or allowed[CLOSES, node])
                    or (marks is stuck and not p.rubs[own])
                ):
                    continue
                seen = moved[row] @ left
                if np.abs(seen).max(initial=0.0) > RESISTED * np.abs(moved[row]).max():
                    closed[node] = marks[at] = True
                    left = left @ null_space(seen[None, :])
        return ContactStatus.with_tractions(closed, stuck, start.slip_sign, p.nodes)

    def _pivoted(self, status: ContactStatus, systems: int) -> State:
        """The state at the end of the path of one artificial load from a status. Raises Ray."""
        p, allowed, count = self.problem, self.allowed, self.problem.contacts
        basis = Basis(p, status)
        if basis.held.shape[1]:  # the added load would drive loose bodies
            status = self.supported(status)
            basis = Basis(p, status)
        x, w = basis.solve(self.free, self.reference, self.near)
        if not self.violated(status, x, w).any():
            return State(status, x, w, basis, systems + 1, missed=basis.missed)
        # Unknowns y and rows v nearby that satisfy the conditions by irregular amounts, so that no two change
        # at once.
        uneven = 1.0 + np.mod(GOLDEN * np.arange(1, p.m + 1), 1.0)
        size = max(np.abs(x[:count]).max(initial=0.0), np.abs(w[:count]).max(initial=0.0)) or 1.0
        y, v, least = x.copy(), w.copy(), COVER * size * uneven
        closed, apart = status.closed & allowed[OPENS], ~status.closed & allowed[CLOSES]
        y[: p.m][closed] = np.maximum(np.abs(y[: p.m]), least)[closed]
        v[: p.m][apart] = np.maximum(np.abs(v[: p.m]), least)[apart]
        t, slides = y[p.m : count], status.slip_sign != 0.0
        may = np.where(t > 0.0, allowed[FORWARD, p.nodes], allowed[BACKWARD, p.nodes])
        inside = p.friction * np.maximum(y[p.nodes], 0.0) / uneven[p.nodes]
        t = np.where(may & status.stuck & (np.abs(t) > inside), np.sign(t) * inside, t)
        limit = status.slip_sign * p.friction * y[p.nodes]
        y[p.m : count] = np.where(slides, limit, np.where(status.stuck, t, 0.0))
        slip = v[p.m : count] - self.reference
        opposed = -status.slip_sign * np.maximum(np.abs(slip), least[p.nodes])
        v[p.m : count] = self.reference + np.where(slides, opposed, slip)
        # Bodies that still are loose must not be driven by the added load.
        load = basis.undriven(v - p.product(y) - self.free)
        basis, x = trace(basis, (y, v), 1.0, load, self.reference, allowed, 0.0)
        # Round-off of many pivots may have misled the last ones.
        found, _, solved = self._newton(basis.status, basis, set())
        if found is None:
            raise Ray(x)
        return replace(found, systems=systems + solved)


def solve(
    problem: Problem, free: FloatArray, *starts: ContactStatus, near: FloatArray | None = None
) -> State:
    """The state with ``free`` rows (N,), searched thoroughly from the statuses ``starts``. Raises Ray if
    there is none."""
    search = Search(problem, free, np.zeros(problem.n), problem.everything, near)
    return search.solved(*starts, thorough=True)


def trace(
    basis: Basis,
    point: Pair,
    lam: float,
    load: FloatArray,
    reference: FloatArray,
    allowed: BoolArray,
    target: float,
) -> tuple[Basis, FloatArray]:
    """The basis and unknowns (N,) with which the parametric path with rows free + lam ``load`` first passes
    lam = ``target``, in the direction from a ``point`` at ``lam`` with its ``basis``. A status does not
    recur; lam may turn where states fold back, or stand still, where a mechanism develops until a condition
    stops it. Slips are opposed from their ``reference`` (n,). Raises the Ray of a direction that nothing
    stops."""
    p, status, way = basis.problem, basis.status, 1.0 if target > lam else -1.0
    x, w = point
    last, still = None, np.zeros(p.n)
    for _ in range(PIVOTS * (p.m + 2 * p.n + 5)):
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
                return basis, x + left * dx
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
