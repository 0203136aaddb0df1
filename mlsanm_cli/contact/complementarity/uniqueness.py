"""Motions that a state leaves undetermined: they change no force and keep all conditions.

Such a motion opens or closes no pressed node and moves no sticking one; nodes that rest at their friction
limit may slip in the direction that friction opposes, and slipping ones may slip faster or slower. Of a plate
dragged between two contacts of equal friction either one may slip.
"""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.complementarity.basis import null_space
from mlsanm_cli.contact.complementarity.problem import GRAZING, ContactStatus, Problem


def undetermined(
    problem: Problem, status: ContactStatus, x: FloatArray, drives: FloatArray
) -> FloatArray | None:
    """A motion (k,) that neither the forces of a state with unknowns ``x`` (N,) nor loads with the work
    ``drives`` (L, k) determine, though it moves contacts with friction; None if there is none."""
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
    sliding = slips[rubs & ~status.stuck] @ free
    found = _opposed(resting, sliding)
    return None if found is None else np.asarray(p.columns[p.contacts :] * (free @ found))


def _opposed(resting: FloatArray, sliding: FloatArray) -> FloatArray | None:
    """A combination (d,) with non-negative slips ``resting`` (r, d) that are not all zero, or zero ones and
    slips ``sliding`` (s, d) that are not; None without any."""
    if len(resting):
        from scipy.optimize import linprog  # for few runs

        found = linprog(
            -resting.sum(axis=0), A_ub=-resting, b_ub=np.zeros(len(resting)), bounds=[(-1.0, 1.0)]
        )
        if found.x is not None and (resting @ found.x).max() > GRAZING:
            return np.asarray(found.x)
    still = null_space(_normalised(resting)) if len(resting) else np.eye(sliding.shape[1])
    seen = np.abs(sliding @ still)
    if not seen.size or seen.max() <= GRAZING:
        return None
    return np.asarray(still[:, int(np.argmax(seen.max(axis=0)))])


def _normalised(rows: FloatArray) -> FloatArray:
    """The rows that are not zero, divided by their largest entries."""
    largest = np.abs(rows).max(axis=1, initial=0.0)
    return np.asarray(rows[largest > 0.0] / largest[largest > 0.0, None])
