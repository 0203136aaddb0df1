"""Transfer of the slave's tractions to the master's nodes, without loss of force.

A master's node receives the slave's traction weighted with its hat function N_i, over its length::

    T_i w_i = - int N_i(xi(S)) T(S) dS,        xi linear in S between the slave's nodes

so that the forces on both sides agree to round-off, and a constant traction is reproduced. The integral is
exact: between the nodes of either side the integrand is quadratic.

Equation (27) of docs/method.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.finite.node_curve import NodeCurve
from mlsanm_cli.contact.finite.sides import ContactSide

SIMPSON = np.array([1.0, 4.0, 1.0]) / 6.0


@dataclass(frozen=True)
class Transfer:
    """At the quadrature points (g): weights ``length`` (g,), hat functions ``slave`` (g, c) and ``master``
    (g, m) of both sides, derivatives ``moved`` (g, m) of the latter along the master; ``weight`` (m,) are the
    lengths of the master's nodes."""

    length: FloatArray
    slave: sparse.csr_array
    master: sparse.csr_array
    moved: sparse.csr_array
    weight: FloatArray

    @classmethod
    def of(
        cls, slave: ContactSide, master: ContactSide, curve: NodeCurve, place: FloatArray, facing: BoolArray
    ) -> Transfer:
        """Transfer for the places (c,) of the slave's nodes on the master; only intervals next to ``facing``
        (c,) nodes count."""
        first, second, step = _stretches(slave)
        chosen = np.flatnonzero(facing[first] | facing[second])
        first, second, step = first[chosen], second[chosen], step[chosen]
        start, end = place[first], place[second]
        if curve.around is not None:
            half = 0.5 * curve.around
            end = start + np.mod(end - start + half, curve.around) - half
        stretch, low, high = _pieces(curve, start, end)
        # The three points of Simpson's rule on every piece.
        part = np.stack([low, 0.5 * (low + high), high], axis=1)
        at = start[stretch, None] + part * (end - start)[stretch, None]
        length = ((high - low) * step[stretch])[:, None] * SIMPSON
        count, number = part.size, np.arange(part.size)
        columns = np.repeat(np.concatenate([first[stretch], second[stretch]]), 3)
        share = np.concatenate([(1.0 - part).ravel(), part.ravel()])
        hats = sparse.csr_array((share, (np.tile(number, 2), columns)), shape=(count, slave.count))
        own, moved = _hats(curve, at, master.count)
        return cls(length.ravel(), hats, own, moved, master.weight)

    @property
    def carried(self) -> sparse.csr_array:
        """Matrix (m, c) from tractions at the slave's nodes to those at the master's."""
        onto = sparse.diags_array(1.0 / self.weight) @ self.master.T @ sparse.diags_array(self.length)
        return sparse.csr_array(onto @ self.slave)

    def carried_moved(self, traction: FloatArray, d_place: sparse.csr_array) -> sparse.csr_array:
        """Derivative (2m, s) of the transferred ``traction`` (c, 2), given that of the places (c, s)."""
        onto = sparse.diags_array(1.0 / self.weight) @ self.moved.T @ sparse.diags_array(self.length)
        parts = [
            onto @ sparse.diags_array(self.slave @ traction[:, component]) @ self.slave @ d_place
            for component in (0, 1)
        ]
        count = len(self.weight)
        both = sparse.vstack(parts, format="csr")
        return sparse.csr_array(both[np.arange(2 * count).reshape(2, count).T.ravel()])


def _stretches(side: ContactSide) -> tuple[IntArray, IntArray, FloatArray]:
    """First and second node and length of the intervals between neighbours."""
    first = np.arange(side.count)
    if side.around is None:
        return first[:-1], first[1:], np.diff(side.arc)
    return first, np.roll(first, -1), np.diff(np.append(side.arc, side.arc[0] + side.around))


def _pieces(curve: NodeCurve, start: FloatArray, end: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Intervals split at knots: for every piece the interval and the fractions of it, from 0 to 1, at its
    ends."""
    knots = curve.knots
    if curve.around is not None:
        knots = np.concatenate([curve.arc + turn * curve.around for turn in (-1.0, 0.0, 1.0, 2.0)])
    number, low, high = [], [], []
    for k, (a, b) in enumerate(zip(start, end, strict=True)):
        between = knots[
            np.searchsorted(knots, min(a, b), "right") : np.searchsorted(knots, max(a, b), "left")
        ]
        cuts = np.sort((between - a) / (b - a)) if len(between) else between
        ends = np.concatenate([[0.0], cuts, [1.0]])
        number.append(np.full(len(ends) - 1, k))
        low.append(ends[:-1])
        high.append(ends[1:])
    if not number:
        return np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0)
    return np.concatenate(number), np.concatenate(low), np.concatenate(high)


def _hats(curve: NodeCurve, at: FloatArray, count: int) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Hat functions of the nodes (3g, m) at the points ``at`` (g, 3) of pieces, and their derivatives."""
    knots = curve.knots
    if curve.around is not None:
        at = knots[0] + np.mod(at - knots[0], curve.around)
    low = np.repeat(curve.interval(at[:, 1]), 3)
    step = knots[low + 1] - knots[low]
    place = at.ravel()
    if curve.around is not None:
        # Ends of a piece at the seam may have been wrapped to the other side.
        place = place + curve.around * np.round((knots[low] + 0.5 * step - place) / curve.around)
    whole = (place - knots[low]) / step
    part = np.clip(whole, 0.0, 1.0)
    # Beyond the ends the last node receives everything.
    inner = np.abs(whole - part) <= 1e-9
    number, high = np.arange(len(place)), (low + 1) % count
    at_both = (np.tile(number, 2), np.concatenate([low, high]))
    values = sparse.csr_array((np.concatenate([1.0 - part, part]), at_both), shape=(len(place), count))
    rise = inner / step
    slopes = sparse.csr_array((np.concatenate([-rise, rise]), at_both), shape=(len(place), count))
    return values, slopes
