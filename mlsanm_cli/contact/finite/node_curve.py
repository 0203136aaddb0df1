"""A curve through the nodes of a deformed side: closest points, and their derivatives by the nodes. Piecewise
cubic with slopes of quartics through five nodes: linear in the nodes' positions, errors of fourth order, and
a node affects its neighbours only."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import FINE_ROUND_OFF, ROUND_OFF

SLOPE_NODES, END_NODES = 5, 3
"""Number of nodes that determine a slope, inside and near the ends."""
MAX_NEWTON_STEPS = 40
"""Largest number of Newton steps to the closest point."""
END_SLACK = 1e-3
"""Points beyond an end by this fraction of the spacing still count as opposite."""
SIMPSON = np.array([1.0, 4.0, 1.0]) / 6.0


def wrapped(apart: FloatArray, around: float | None) -> FloatArray:
    """Differences of arc lengths; the shorter ones on a closed curve of length ``around``."""
    return apart if around is None else np.asarray(apart - around * np.round(apart / around))


def on_polyline(points: FloatArray, corners: FloatArray) -> tuple[IntArray, FloatArray]:
    """Closest segments (e,) of a polyline through ``corners`` to ``points`` (e, 2), and fractions of them."""
    along, away = np.diff(corners, axis=0), points[:, None] - corners[None, :-1]
    part = np.clip((away * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    number = np.argmin(((away - part[:, :, None] * along) ** 2).sum(axis=2), axis=1)
    return number, part[np.arange(len(points)), number]


@dataclass(frozen=True)
class NodeCurve:
    """A curve over the reference arc length: nodes at ``arc`` (m,); ``around`` is the length of a closed one,
    ``corners`` the indices of nodes at which it has a kink."""

    arc: FloatArray
    around: float | None
    corners: tuple[int, ...] = ()

    @cached_property
    def knots(self) -> FloatArray:
        """Arc lengths of the nodes; on a closed curve the first one is repeated at the end."""
        return self.arc if self.around is None else np.append(self.arc, self.arc[0] + self.around)

    @cached_property
    def slopes(self) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Rows (m, m) of the derivatives on the left and right of the nodes, which differ at corners; zero on
        the left of the first and on the right of the last node of an open curve."""
        count, half = len(self.arc), SLOPE_NODES // 2
        # From corner to corner; indices continue beyond the seam of a closed curve.
        ends = [0, *self.corners, count - 1]
        if self.around is not None:
            ends = [*self.corners, self.corners[0] + count] if self.corners else [-half, count - 1 + half]
        smooth = self.around is not None and not self.corners
        sides: tuple[list[sparse.coo_array], ...] = ([], [])
        for begin, end in pairwise(ends):
            nodes = np.arange(begin, end + 1)
            turns, numbers = np.divmod(nodes, count)
            arc = self.arc[numbers] + turns * (self.around or 0.0)
            inner = np.arange(half, len(nodes) - half)
            # Fewer nodes near corners: one-sided slopes of high degree amplify irregularities there.
            outer = np.zeros(0, dtype=np.int64) if smooth else np.setdiff1d(np.arange(len(nodes)), inner)
            for chosen, most in ((inner, SLOPE_NODES), (outer, END_NODES)):
                size = min(most, len(nodes))
                window = np.clip(chosen - size // 2, 0, len(nodes) - size)[:, None] + np.arange(size)
                weights = _slope_weights(arc[window], chosen - window[:, 0])
                for side, excluded in zip(sides, (0, len(nodes) - 1), strict=True):
                    kept = chosen != excluded
                    at = np.repeat(numbers[chosen[kept]], size), numbers[window[kept]].ravel()
                    side.append(sparse.coo_array((weights[kept].ravel(), at), shape=(count, count)))
        left, right = (sparse.csr_array(sum(side[1:], side[0])) for side in sides)
        return left, right

    @cached_property
    def mean_slopes(self) -> sparse.csr_array:
        """Rows (m, m) of the derivatives at the nodes; means of both at corners."""
        half = np.full(len(self.arc), 0.5)
        if self.around is None:
            half[[0, -1]] = 1.0
        return sparse.csr_array(sparse.diags_array(half) @ (self.slopes[0] + self.slopes[1]))

    def interval(self, place: FloatArray) -> IntArray:
        """Index of the knot (c,) at or below each place (c,)."""
        found = np.searchsorted(self.knots, place, side="right") - 1
        return np.asarray(np.clip(found, 0, len(self.knots) - 2))

    def rows(self, place: FloatArray) -> tuple[sparse.csr_array, sparse.csr_array, sparse.csr_array]:
        """Rows (c, m) of value, first and second derivative at ``place`` (c,)."""
        nodes = sparse.csr_array(sparse.eye_array(len(self.arc), format="csr"))
        value, slope, bend = (sparse.csr_array(one) for one in self._seen(place, nodes, self.slopes))
        return value, slope, bend

    def _seen(self, place: FloatArray, nodes: Any, slopes: tuple[Any, Any]) -> list[Any]:
        """Value and derivatives (c, k) at places (c,), for ``nodes`` and left and right ``slopes`` (m, k)."""
        low = self.interval(place)
        step = self.knots[low + 1] - self.knots[low]
        t = (place - self.knots[low]) / step
        # Hermite polynomials of both nodes and their slopes in turn, by order of the derivative.
        values = (1 - 3 * t**2 + 2 * t**3, t - 2 * t**2 + t**3, 3 * t**2 - 2 * t**3, t**3 - t**2)
        rises = (6 * t**2 - 6 * t, 1 - 4 * t + 3 * t**2, 6 * t - 6 * t**2, 3 * t**2 - 2 * t)
        bends = (12 * t - 6, 6 * t - 4, 6 - 12 * t, 6 * t - 2)
        high, (behind, ahead) = (low + 1) % len(self.arc), slopes
        ends = nodes[low], ahead[low] * step[:, None], nodes[high], behind[high] * step[:, None]
        each = [
            [end * (part / step**order)[:, None] for part, end in zip(parts, ends, strict=True)]
            for order, parts in enumerate((values, rises, bends))
        ]
        return [sum(one[1:], one[0]) for one in each]

    def closest(
        self, nodes: FloatArray, points: FloatArray, beyond: FloatArray
    ) -> tuple[FloatArray, BoolArray]:
        """Places (c,) of the points closest to ``points`` (c, 2) on the curve through ``nodes`` (m, 2), which
        continues ``beyond`` its ends by lengths (c,), and a mask (c,) of those that are not at an end."""
        corners = nodes if self.around is None else np.concatenate([nodes, nodes[:1]])
        low, part = on_polyline(points, corners)
        steps = np.diff(self.knots)
        place = self.knots[low] + part * steps[low]
        inside = np.zeros(len(points), dtype=bool)
        slopes = (self.slopes[0] @ nodes, self.slopes[1] @ nodes)
        for _ in range(MAX_NEWTON_STEPS):
            value, first, second = self._seen(place, nodes, slopes)
            apart = points - value
            bent = (first**2).sum(axis=1) - (apart * second).sum(axis=1)
            # Beyond the centre of curvature Newton's step is uphill: use the first-order step.
            bent = np.where(bent > 0.0, bent, (first**2).sum(axis=1))
            largest = steps[self.interval(place)]
            step = np.clip((apart * first).sum(axis=1) / bent, -largest, largest)
            if self.around is None:
                better = np.clip(place + step, self.knots[0] - beyond, self.knots[-1] + beyond)
            else:
                better = self.knots[0] + np.mod(place + step - self.knots[0], self.around)
            moved = np.abs(step)
            inside = (self.around is not None) | (np.abs(better - place - step) <= END_SLACK * largest)
            place = better
            if (moved[inside] <= FINE_ROUND_OFF * self.knots[-1]).all():
                break
        return place, np.asarray(inside & (moved <= END_SLACK * largest))


def integration(
    curve: NodeCurve, place: FloatArray, other: NodeCurve, chosen: IntArray | slice = slice(None)
) -> tuple[sparse.csr_array, sparse.csr_array, sparse.csr_array, FloatArray]:
    """Integration over the ``chosen`` intervals of a curve, the nodes of which are at the ``place`` (c,) of
    another one, by Simpson's rule between the nodes of either: hat functions (q, c) of its nodes, those (q,
    m) of the other ones and their derivatives, and lengths (q,)."""
    first = np.arange(len(curve.knots) - 1)[chosen]
    second, step = (first + 1) % len(curve.arc), np.diff(curve.knots)[chosen]
    start, around, knots = place[first], other.around, other.knots
    way = wrapped(place[second] - start, around)
    if around is not None:
        knots = np.concatenate([other.arc + turn * around for turn in (-1.0, 0.0, 1.0, 2.0)])
    least, most = np.sort([start, start + way], axis=0)
    begin = np.searchsorted(knots, least, "right")
    count = np.maximum(np.searchsorted(knots, most, "left") - begin, 0)
    every = np.arange(len(first))
    number = np.repeat(every, count)
    cut = knots[np.arange(len(number)) + (begin - np.cumsum(count) + count)[number]]
    part = np.concatenate([np.zeros(len(every)), (cut - start[number]) / way[number], np.ones(len(every))])
    owner = np.concatenate([every, number, every])
    order = np.lexsort((part, owner))
    part, owner = part[order], owner[order]
    piece = np.flatnonzero(owner[1:] == owner[:-1])
    low, high, owner = part[piece], part[piece + 1], owner[piece]
    share = np.stack([low, 0.5 * (low + high), high], axis=1)
    at = start[owner, None] + share * way[owner, None]
    if around is not None:
        at -= around * np.floor((at[:, 1:2] - other.arc[0]) / around)
    under = np.repeat(other.interval(at[:, 1]), 3)
    width, above = np.diff(other.knots)[under], (under + 1) % len(other.arc)
    whole = (at.ravel() - other.knots[under]) / width
    # Beyond the ends the last node receives everything.
    inside = np.clip(whole, 0.0, 1.0)
    rise = (np.abs(whole - inside) <= ROUND_OFF) / width
    number, columns = np.tile(np.arange(share.size), 2), np.concatenate([first[owner], second[owner]])
    length, below = ((high - low) * step[owner])[:, None] * SIMPSON, 1.0 - share
    own, hats, slopes = (
        sparse.csr_array((np.concatenate(values, axis=None), (number, nodes)), shape=(share.size, size))
        for values, nodes, size in (
            ((below, share), np.repeat(columns, 3), len(curve.arc)),
            ((1.0 - inside, inside), np.concatenate([under, above]), len(other.arc)),
            ((-rise, rise), np.concatenate([under, above]), len(other.arc)),
        )
    )
    return own, hats, slopes, length.ravel()


def _slope_weights(place: FloatArray, own: IntArray) -> FloatArray:
    """Barycentric weights (e, k) of derivatives at nodes ``own`` (e,) of those at ``place`` (e, k)."""
    number, size = np.arange(len(place)), place.shape[1]
    share = 1.0 / (place[:, :, None] - place[:, None, :] + np.eye(size)).prod(axis=2)
    away = place[number, own][:, None] - place
    away[number, own] = 1.0
    weights = share / share[number, own][:, None] / away
    weights[number, own] = 0.0
    weights[number, own] = -weights.sum(axis=1)
    return np.asarray(weights)
