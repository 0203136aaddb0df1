"""The exact path of a state with its history of friction.

The rates of a state solve the same problem, with free rows those of the load and only conditions at their
limits; the state follows them to the next limit. Where there are no rates states fold back or jump: the
parametric path leads on, or a finite increment; if neither does, the ray of the rates is a mechanism and its
load the limit load.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.complementarity.basis import Basis, Ray
from mlsanm_cli.contact.complementarity.equilibrium import collapse
from mlsanm_cli.contact.complementarity.problem import (
    BACKWARD,
    CLOSES,
    FEASIBLE,
    FORWARD,
    GRAZING,
    OPENS,
    ContactStatus,
    Problem,
)
from mlsanm_cli.contact.complementarity.solution import Search, State, trace

INCREMENTS = tuple(10.0**power for power in range(-6, 0))
"""Parts of the path tried in turn as finite increments where no rates continue it: the first touch of loose
bodies, and snaps."""
STANDSTILL, EVENTS = 1e-13, 4
"""Part of the path below which it stands still; and largest number of changes of status per node at one
load."""


def unloaded(problem: Problem, free: FloatArray) -> State:
    """The state without pressures and motions."""
    slip = free[problem.m : problem.contacts].copy()
    none = np.zeros(problem.n)
    return State(
        problem.touching(np.zeros(problem.m, dtype=bool)),
        np.zeros(len(free)),
        free,
        reference=slip,
        work=none,
    )


def follow(
    problem: Problem,
    state: State,
    constant: FloatArray,
    load: FloatArray,
    stops: Sequence[float],
    typical: float | None = None,
) -> Iterator[State]:
    """All events of the path from a state, with free rows ``constant + lam load`` (N,), and the states at
    ``stops``, increasing up to the end. Gaps as drawn that are round-off against ``typical`` pressures to
    come are closed. Raises the Ray of a limit load."""
    p, halts, standing, jumps = problem, list(stops), 0, 0
    span = abs(halts[-1] - state.lam)
    if typical is None:
        # The pressure that carries the loads, or undoes the overlaps, if all nodes share in it.
        free, carried = constant + halts[-1] * load, np.abs(p.matrix[p.contacts :, : p.m]).sum(axis=1)
        force = np.abs(free[p.contacts :]) / np.where(carried > 0.0, carried, np.inf)
        overlap = -p.exchange[: p.m] * free[: p.m]
        typical = float(max(force.max(initial=0.0), overlap.max(initial=0.0)))
    if state.status.closed.any():
        typical = 0.0
    while halts:
        allowed = _admissible(p, state, typical)
        try:
            rate = _rates(p, state, load, allowed)
            if standing > EVENTS * p.m + 50:
                raise Ray(rate.x, state.lam)
        except Ray as ray:
            state, standing = _jumped(p, state, constant, load, span, halts[0], ray, jumps), 0
            jumps += 1
            while halts and halts[0] <= state.lam:
                halts.pop(0)
            yield state
            continue
        jumps = 0
        # To the next limit of a condition that is not at it.
        left = p.distances(rate.status, ~allowed, state.x, state.w, state.reference)
        falls = -p.distances(rate.status, ~allowed, rate.x, rate.w, state.reference)
        falling = np.isfinite(left) & (falls > 1e-3 * FEASIBLE * p.size(rate.x))
        step = float((np.maximum(left[falling], 0.0) / falls[falling]).min(initial=np.inf))
        lam = min(state.lam + step, halts[0])
        standing = standing + 1 if lam - state.lam <= STANDSTILL * span else 0
        if halts[0] - lam <= STANDSTILL * span:
            lam = halts.pop(0)
        state = _moved(p, state, rate, constant + lam * load, lam)
        yield state


def _admissible(problem: Problem, state: State, typical: float) -> BoolArray:
    """Changes (5, m) that a state admits to its rates: of nodes at their limits, relative to its own or
    ``typical`` pressures."""
    p, x, w = problem, state.x, state.w
    limit = GRAZING * max(p.size(x), typical) * p.grain[: p.m]
    bare, touches = x[: p.m] <= limit, w[: p.m] <= limit
    found, grazes, sign, traction = (
        p.everything.copy(),
        bare[p.nodes],
        state.status.slip_sign,
        x[p.m : p.contacts],
    )
    left, slack = limit[p.nodes], p.friction * x[p.nodes]
    forward = np.where(sign != 0.0, sign > 0.0, slack - traction <= left)
    backward = np.where(sign != 0.0, sign < 0.0, slack + traction <= left)
    found = p.everything.copy()
    found[OPENS], found[CLOSES] = bare, touches
    found[FORWARD, p.nodes], found[BACKWARD, p.nodes] = grazes | forward, grazes | backward
    return found


def _rates(problem: Problem, state: State, load: FloatArray, allowed: BoolArray) -> State:
    """Status and rates of a state per lam. Raises Ray."""
    search, last = Search(problem, load, np.zeros(problem.n), allowed), state.rates
    if not state.status.closed.any():
        return search.solved(problem.touching(allowed[CLOSES]))
    if last is None:
        return search.solved(state.status)
    return search.solved(search.projected(last.status, last.x, last.w), state.status, basis=last.basis)


def _moved(problem: Problem, state: State, rate: State, free: FloatArray, lam: float) -> State:
    """The state at ``lam`` along its rates, with the conditions of its status satisfied exactly; solved for
    if the accumulated residual is larger than round-off."""
    p, status, step = problem, rate.status, lam - state.lam
    slips = slice(p.m, p.contacts)
    x, w = state.x + step * rate.x, state.w + step * rate.w
    reference = np.where(status.stuck & state.status.stuck, state.reference, state.w[slips])
    along, across = x.copy(), w.copy()
    x[: p.m][~status.closed], w[: p.m][status.closed] = 0.0, 0.0
    x[slips] = np.where(status.stuck, x[slips], status.slip_sign * p.friction * x[p.nodes])
    w[slips][status.stuck] = reference[status.stuck]
    missed = state.missed + step * rate.missed + float(np.abs(across - w).max(initial=0.0))
    missed += float((p.largest / p.grain).max(initial=0.0)) * float(np.abs(along - x).sum())
    search = Search(p, free, reference, p.everything, state.x)
    round_off = FEASIBLE * p.size(x)
    if missed > round_off or search.violated(status, x, w).any():
        # The equations of the status, by updated or new factors, if that is better.
        assert rate.basis is not None
        basis, tries, errors = rate.basis.to(status), [(x, w)], [search.error(status, x, w)]
        while errors[-1] > 1.0 and (len(tries) < 2 or basis.anew()):
            try:
                tries.append(basis.solve(free, reference, x))
            except Ray:
                break
            errors.append(search.error(status, *tries[-1]))
        x, w = tries[int(np.argmin(errors))]
        missed = round_off * min(*errors, 1.0)
    slid = np.where(status.slip_sign != 0.0, w[slips] - state.w[slips], 0.0)
    work = state.work - 0.5 * (state.x[slips] + x[slips]) * slid
    return State(
        *(status, x, w),
        systems=rate.systems,
        missed=missed,
        reference=reference,
        work=work,
        lam=lam,
        rates=rate,
    )


def increment(
    problem: Problem,
    state: State,
    free: FloatArray,
    lam: float,
    *starts: ContactStatus,
    pivoting: bool = True,
) -> State | None:
    """The state with ``free`` rows (N,) at ``lam`` after a jump, with slips opposed from those of a
    ``state``, searched from ``starts`` or its status; None if it is not found."""
    p, before = problem, state.w[problem.m : problem.contacts]
    search = Search(p, free, before, p.everything, state.x)
    try:
        found = search.solved(*(starts or (state.status,)), pivoting=pivoting)
    except Ray:
        return None
    slip, traction = found.w[p.m : p.contacts], found.x[p.m : p.contacts]
    slid = np.where(found.status.slip_sign != 0.0, slip - before, 0.0)
    reference = np.where(found.status.stuck, before, slip)
    work = state.work - traction * slid
    return replace(found, reference=reference, work=work, lam=lam, jumped=True, basis=None, missed=0.0)


def _jumped(
    problem: Problem,
    state: State,
    constant: FloatArray,
    load: FloatArray,
    span: float,
    most: float,
    ray: Ray,
    jumps: int,
) -> State:
    """The state after a fold along which lam turns, or after a finite increment, the larger the more
    ``jumps`` came before. Raises the ray of a limit load."""
    p = problem
    mechanism = collapse(p, constant + (state.lam + INCREMENTS[0] * span) * load) if p.k else None
    if mechanism is not None:
        raise Ray(mechanism, state.lam) from ray
    reference, ahead = state.w[p.m : p.contacts], min(state.lam + GRAZING * span, most)

    def reached(lam: float, *starts: ContactStatus, pivoting: bool = False) -> State | None:
        return increment(p, state, constant + lam * load, lam, *starts, pivoting=pivoting)

    try:
        point, basis = (state.x, state.w), Basis(p, state.status)
        status = trace(basis, point, state.lam, load, reference, p.everything, ahead)[0].status
        found = reached(ahead, status, pivoting=True)
        if found:
            return found
    except Ray:
        pass
    ends = [min(state.lam + part * span, most) for part in INCREMENTS[jumps:]]
    # First touches mostly need no pivots.
    for pivoting in (True,) if state.status.closed.any() else (False, True):
        for number, lam in enumerate(ends):
            found = reached(lam, pivoting=pivoting)
            if found is None:
                continue
            # From a first touch to one at a smaller load.
            for nearer in () if pivoting else reversed(ends[:number]):
                first = reached(nearer, found.status)
                if first is None:
                    break
                found = first
            return found
    raise Ray(ray.direction, state.lam) from ray
