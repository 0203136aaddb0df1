"""Unilateral contact with Coulomb friction of a condensed scene: states, increments, and the exact path with
its history. Equation (14) of docs/method.md."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.complementarity import history
from mlsanm_cli.contact.complementarity.basis import Ray
from mlsanm_cli.contact.complementarity.problem import GRAZING, ContactStatus, Problem
from mlsanm_cli.contact.complementarity.solution import State, solve
from mlsanm_cli.contact.laws.contact_state import ContactState, NoStateError, SlidingError, residual
from mlsanm_cli.contact.response.compressed import null_space
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.roundoff import ROUND_OFF

FIRST_PATCH = 32
"""Number of nodes of every contact around its closest one from which the search of a first touch starts."""
NEGLIGIBLE = 1e-3
"""Part of typical pressures below which those of overlaps as drawn, as of curves through points, may depend
on how the bodies move apart."""
MIN_SPEED = 0.01
"""Motions slower than this part of the fastest do not count as driven."""
MAX_NORMAL_SHARE = 0.2
"""Motions with a smaller normal part at the contact are resisted by friction only."""
WEDGE_SHARE = 0.02
"""Motions whose mean normal part over a contact is larger close it like a wedge."""
SLIDING_RATIO = 100.0
"""Sliding this many times as fast as everything else is driven by the load."""


def unloaded(condensed: Condensed, factors: FloatArray) -> ContactState:
    """The state before the first load, without pressure and slip, even where surfaces overlap."""
    state = history.unloaded(condensed.problem, condensed.free_rows(factors))
    return _unscaled(condensed, state, factors)


def increment(
    condensed: Condensed, state: ContactState, factors: FloatArray, guess: ContactStatus | None = None
) -> ContactState | None:
    """The state after a finite increment to ``factors`` (L,), with slips opposed from those of the ``state``;
    None if there is none. The search starts from a ``guess``, if given, and from the ``state``."""
    p = condensed.problem
    closed = state.closed | (state.gap <= ROUND_OFF * condensed.weight)
    guesses = [closed]
    if p.k and not state.closed.any():
        # Bodies come to rest on their closest nodes, or on patches around them.
        nearest = [np.sort(state.gap[one])[:FIRST_PATCH].max(initial=0.0) for one in condensed.spans.values()]
        widths = [one.stop - one.start for one in condensed.spans.values()]
        patches = state.gap <= np.repeat(nearest, widths)
        guesses = [closed | condensed.closest(state.gap), closed | patches]
    touching = [replace(state.status, closed=one) for one in guesses]
    starts = list[ContactStatus]()
    for status in touching if guess is None else (guess, *touching):
        # Closed nodes with friction stick if they do not slip.
        rests = p.rubs & (status.stuck | (status.slip_sign == 0.0))
        starts.append(ContactStatus.with_tractions(status.closed, rests, status.slip_sign, p.nodes))
    found = history.increment(p, _scaled(condensed, state), condensed.free_rows(factors), 0.0, *starts)
    return None if found is None else _unscaled(condensed, found, factors)


def start(condensed: Condensed, factors: FloatArray, typical: float = 0.0) -> ContactState:
    """The state before the first stage; initial overlaps push the surfaces apart. Raises NumericalError if
    the result is not unique, unless its pressures are negligible against ``typical`` ones."""
    state = unloaded(condensed, factors)
    if not condensed.overlap(state.gap):
        return state
    floats = len(condensed.balance.constant) > 0
    parted = _parted(condensed, state) if floats else None
    if parted is not None:
        return parted
    found = increment(condensed, state, factors)
    if not floats:
        if found is None:
            raise NoStateError
        return found
    small = found is not None and found.pressure.max() <= NEGLIGIBLE * typical
    if found is not None and small and residual(condensed, found) <= GRAZING:
        return found
    raise NumericalError(
        "surfaces with friction overlap as drawn, and forces alone do not determine how the bodies move "
        "apart",
        "move one body so that the surfaces at most touch, or prescribe its platen's displacement; for a "
        "press fit give contact.NAME.interference",
    )


def _parted(condensed: Condensed, state: ContactState) -> ContactState | None:
    """The pressure-free state in which free bodies have moved by the least distance that resolves their
    overlaps, as if held by unit springs; None if there is none."""
    p, k, m = condensed.problem, condensed.problem.k, condensed.problem.m
    stiff = np.abs(p.matrix[p.contacts :, p.contacts :]).max(axis=0, initial=0.0) > GRAZING
    moved = np.where(stiff, 0.0, p.matrix[:m, p.contacts :])
    gap = (state.gap - ROUND_OFF * condensed.weight) * p.rows[:m]
    springs = Problem.of(
        np.block([[np.zeros((m, m)), moved], [-moved.T, np.eye(k)]]), p.nodes[:0], p.friction[:0], m
    )
    free = springs.rows * np.append(gap, np.zeros(k))
    try:
        found = solve(springs, free, springs.touching(gap < 0.0))
    except Ray:
        return None
    motion = p.columns[p.contacts :] * springs.columns[m:] * found.x[m:]
    gap, slip = state.gap + condensed.gap.motion @ motion, condensed.slip.motion @ motion
    parted = replace(state, motion=motion, gap=gap, slip=slip, reference=slip)
    return parted if residual(condensed, parted) <= GRAZING else None


def event_driven_path(
    condensed: Condensed,
    state: ContactState,
    end: FloatArray,
    stops: Sequence[float],
    begin: FloatArray | None = None,
    fraction: float = 0.0,
    typical: float | None = None,
) -> Iterator[ContactState]:
    """All events of a stage from ``state`` to load factors ``end`` (L,), and the states at ``stops``,
    increasing fractions up to 1. A resumed path gives the load factors ``begin`` (L,) of the stage and the
    ``fraction`` already passed; ``typical`` pressures tell which gaps as drawn are round-off. Raises
    SlidingError if the contact slides as a whole under a force, NoStateError if no state continues it."""
    begin = state.factors if begin is None else begin
    change = end - begin
    constant, load = condensed.free_rows(begin), condensed.free_rows(change, rates=True)
    if not load.any():
        for stop in stops:
            yield replace(state, factors=begin + stop * change, fraction=stop, solves=0, jumped=False)
        return
    p, now, settled = condensed.problem, _scaled(condensed, state, fraction), bool(state.closed.any())
    path = history.follow(p, now, constant, load, stops, typical)
    try:
        for found in path:
            if found.rates is not None and _slides(condensed, now, found, begin, change):
                raise SlidingError(now.lam)
            jumped, settled = found.jumped and settled, settled or not found.jumped
            yield replace(_unscaled(condensed, found, begin + found.lam * change), jumped=jumped)
            now = found
    except Ray as ray:
        # Whether the mechanism moves closed nodes more along their surfaces than off them.
        on, rows = now.status.closed, np.abs(p.product(ray.direction) / p.rows)
        off, along = rows[: p.m][on], rows[p.m : p.contacts][on[p.nodes]]
        slides = along.max(initial=0.0) > off.max(initial=0.0)
        raise SlidingError(now.lam) if slides else NoStateError from ray


def _slides(condensed: Condensed, before: State, after: State, begin: FloatArray, change: FloatArray) -> bool:
    """Whether the rates from one state to the next are a motion of force-controlled constraints along
    slipping contacts only, driven by loads; where these are curved no ray of the contact problem, as such a
    motion opens and closes nodes.

    Any combination of unknown motions counts that moves no sticking node, and closed nodes hardly in normal
    direction, even less in the mean over a contact. It must be by far the fastest.
    """
    assert after.rates is not None
    p, status = condensed.problem, after.status
    moved = np.abs(after.rates.x[p.contacts :])
    size = np.abs(begin + before.lam * change) + np.abs(change)
    load = np.abs(condensed.balance.load) @ size
    if not load[moved > MIN_SPEED * moved.max(initial=0.0)].any():
        return False
    # Others graze.
    pressed = after.x[: p.m] > GRAZING * p.size(after.x)
    free = np.flatnonzero(~condensed.balance.motion.any(axis=1))
    slipping = (status.slip_sign != 0.0) & pressed[p.nodes]
    closed, root = status.closed, np.sqrt(condensed.weight)
    if not slipping.any() or not len(free):
        return False
    across = (root[:, None] * condensed.gap.motion[:, free])[closed]
    tangential = root[condensed.friction_nodes, None] * condensed.slip.motion[:, free]
    largest = np.sqrt((across**2).sum(axis=0) + (tangential**2).sum(axis=0))
    units = np.diag(1.0 / np.where(largest > 0.0, largest, 1.0))
    motions = units @ null_space(tangential[status.stuck] @ units)
    if not motions.size:
        return False
    both = np.vstack([across, tangential[slipping]])
    left, values, modes = np.linalg.svd(both @ motions, full_matrices=False)
    kept = values > ROUND_OFF
    left, modes = left[:, kept], modes[kept].T / values[kept]
    moving = left[: len(across)]
    if not len(moving):
        return bool(moving.shape[1])
    # Eigenvalues: squared normal parts of orthonormal motions.
    parts, directions = np.linalg.eigh(moving.T @ moving)
    little = directions[:, parts < MAX_NORMAL_SHARE**2]
    if not little.size:
        return False
    # Unit rows that average over the closed nodes of each contact.
    mean = np.zeros((len(condensed.spans), len(root)))
    for row, span in zip(mean, condensed.spans.values(), strict=True):
        own = np.where(closed[span], root[span], 0.0)
        row[span] = own / (np.linalg.norm(own) or 1.0)
    _, means, right = np.linalg.svd(mean[:, closed] @ (moving @ little))
    along = little @ right[np.append(means, np.zeros(len(right) - len(means))) < WEDGE_SHARE].T
    if not along.size:
        return False
    whole = both @ (p.columns * after.rates.x)[p.contacts :][free]
    slid = left @ (along @ (along.T @ (left.T @ whole)))
    return bool(np.linalg.norm(slid) > SLIDING_RATIO * np.linalg.norm(whole - slid))


def _unscaled(condensed: Condensed, state: State, factors: FloatArray) -> ContactState:
    p = condensed.problem
    slips = p.rows[p.m : p.contacts]
    history = {"reference": state.reference / slips, "work": state.work / slips, "fraction": state.lam}
    counts = {"solves": state.systems, "jumped": state.jumped}
    return ContactState.unscaled(p, state.status, state.x, state.w, factors=factors, **history, **counts)


def _scaled(condensed: Condensed, state: ContactState, lam: float = 0.0) -> State:
    p = condensed.problem
    x = np.concatenate([state.pressure, state.traction, state.motion]) / p.columns
    w = p.rows * np.concatenate([state.gap, state.slip, np.zeros(p.k)])
    slips = p.rows[p.m : p.contacts]
    return State(state.status, x, w, reference=slips * state.reference, work=slips * state.work, lam=lam)
