"""A curve through the nodes of a deformed side: closest points, and their derivatives by the nodes. Piecewise
cubic with slopes of quartics through five nodes: linear in the nodes' positions, errors of fourth order, and
a node affects its neighbours only."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise

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
        count = len(self.arc)
        if self.around is not None and not self.corners:
            both = _slopes(self.arc, self.around, np.arange(count), min(SLOPE_NODES, count))
            return both, both
        # From corner to corner; indices continue beyond the seam of a closed curve.
        ends = [0, *self.corners, count - 1]
        if self.around is not None:
            ends = [*self.corners, self.corners[0] + count]
        stretches = [np.arange(first, last + 1) for first, last in pairwise(ends)]
        rows = sparse.csr_array(sparse.vstack([self._open(nodes) for nodes in stretches], format="csr"))
        number, first = np.arange(rows.shape[0]), np.cumsum([0, *(len(nodes) for nodes in stretches)])
        nodes, found = np.concatenate(stretches) % count, []
        for end in (first[:-1], first[1:] - 1):
            kept = np.setdiff1d(number, end)
            entries = (np.ones(len(kept)), (nodes[kept], kept))
            found.append(sparse.csr_array(sparse.csr_array(entries, shape=(count, len(number))) @ rows))
        return found[0], found[1]

    @cached_property
    def mean_slopes(self) -> sparse.csr_array:
        """Rows (m, m) of the derivatives at the nodes; means of both at corners."""
        half = np.full(len(self.arc), 0.5)
        if self.around is None:
            half[[0, -1]] = 1.0
        return sparse.csr_array(sparse.diags_array(half) @ (self.slopes[0] + self.slopes[1]))

    def _open(self, nodes: IntArray) -> sparse.csr_array:
        """Rows (k, m) of the derivatives at ``nodes`` (k,) between two corners, with fewer nodes near these:
        one-sided slopes of high degree amplify irregularities of the last nodes."""
        own, (turns, numbers) = len(nodes), np.divmod(nodes, len(self.arc))
        arc = self.arc[numbers] + turns * (self.around or 0.0)
        inner = np.arange(SLOPE_NODES // 2, own - SLOPE_NODES // 2)
        rows = _slopes(arc, None, np.setdiff1d(np.arange(own), inner), min(END_NODES, own))
        if len(inner):
            rows = sparse.csr_array(rows + _slopes(arc, None, inner, SLOPE_NODES))
        entries = (np.ones(own), (np.arange(own), numbers))
        return sparse.csr_array(rows @ sparse.csr_array(entries, shape=(own, len(self.arc))))

    def interval(self, place: FloatArray) -> IntArray:
        """Index of the knot (c,) at or below each place (c,)."""
        found = np.searchsorted(self.knots, place, side="right") - 1
        return np.asarray(np.clip(found, 0, len(self.knots) - 2))

    def hats(self, place: FloatArray, low: IntArray) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Hat functions of the nodes (e, m) at ``place`` (e,) above the knots ``low`` (e,), and their
        derivatives. Beyond the ends the last node receives everything."""
        step, count = self.knots[low + 1] - self.knots[low], len(self.arc)
        whole = (place - self.knots[low]) / step
        part = np.clip(whole, 0.0, 1.0)
        rise = (np.abs(whole - part) <= ROUND_OFF) / step
        at = (np.tile(np.arange(len(place)), 2), np.concatenate([low, (low + 1) % count]))
        values, slopes = (
            sparse.csr_array((np.concatenate(both), at), shape=(len(place), count))
            for both in ((1.0 - part, part), (-rise, rise))
        )
        return values, slopes

    def rows(self, place: FloatArray) -> tuple[sparse.csr_array, sparse.csr_array, sparse.csr_array]:
        """Rows (c, m) of value, first and second derivative at ``place`` (c,)."""
        low, step, values = self._shapes(place)
        number, count = np.arange(len(place)), len(self.arc)
        columns = np.concatenate([low, (low + 1) % count])
        found = []
        shape, (behind, ahead) = (len(place), count), self.slopes
        for order, (one, slope, other, other_slope) in enumerate(values):
            scale = step**-order
            at = (np.tile(number, 2), columns)
            direct = sparse.csr_array((np.concatenate([one, other]) * np.tile(scale, 2), at), shape=shape)
            low_rows, high_rows = (
                sparse.csr_array((part * scale * step, (number, nodes)), shape=shape)
                for part, nodes in zip((slope, other_slope), np.split(columns, 2), strict=True)
            )
            found.append(sparse.csr_array(direct + low_rows @ ahead + high_rows @ behind))
        return found[0], found[1], found[2]

    def _shapes(self, place: FloatArray) -> tuple[IntArray, FloatArray, tuple[tuple[FloatArray, ...], ...]]:
        """Lower knots, lengths, and by order Hermite coefficients of both nodes and their slopes in turn."""
        low = self.interval(place)
        step = self.knots[low + 1] - self.knots[low]
        t = (place - self.knots[low]) / step
        values = (1 - 3 * t**2 + 2 * t**3, t - 2 * t**2 + t**3, 3 * t**2 - 2 * t**3, t**3 - t**2)
        slopes = (6 * t**2 - 6 * t, 1 - 4 * t + 3 * t**2, 6 * t - 6 * t**2, 3 * t**2 - 2 * t)
        return low, step, (values, slopes, (12 * t - 6, 6 * t - 4, 6 - 12 * t, 6 * t - 2))

    def _seen(
        self, place: FloatArray, nodes: FloatArray, slopes: tuple[FloatArray, FloatArray]
    ) -> list[FloatArray]:
        """Value and derivatives (c, 2) at places (c,), for ``nodes`` and left and right ``slopes`` (m, 2)."""
        low, step, values = self._shapes(place)
        high, (behind, ahead) = (low + 1) % len(self.arc), slopes
        ends = nodes[low], step[:, None] * ahead[low], nodes[high], step[:, None] * behind[high]
        return [
            sum(part[:, None] * end for part, end in zip(parts, ends, strict=True)) / step[:, None] ** order
            for order, parts in enumerate(values)
        ]

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


def _slopes(arc: FloatArray, around: float | None, chosen: IntArray, size: int) -> sparse.csr_array:
    """Rows (m, m) of the derivatives at ``chosen`` nodes of polynomials through ``size`` nodes, else zero."""
    count, number = len(arc), np.arange(len(chosen))
    first = chosen - size // 2
    if around is None:
        first = np.clip(first, 0, count - size)
    turns, nodes = np.divmod(first[:, None] + np.arange(size), count)
    place = arc[nodes] + turns * (around or 0.0)
    apart = place[:, :, None] - place[:, None, :] + np.eye(size)
    share = 1.0 / apart.prod(axis=2)
    own = chosen - first
    away = arc[chosen][:, None] - place
    away[number, own] = 1.0
    weights = share / share[number, own][:, None] / away
    weights[number, own] = 0.0
    weights[number, own] = -weights.sum(axis=1)
    entries = (weights.ravel(), (np.repeat(chosen, size), nodes.ravel()))
    return sparse.csr_array(entries, shape=(count, count))
