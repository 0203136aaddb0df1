"""Singular functions at reentrant corners, which enrich the local fits around them.

Between free faces displacements grow with powers of the distance from the tip below 1 (Williams 1952,
doi:10.1115/1.4010553), which no polynomial represents. The coefficients of the singular functions v are
found by one fit around the tip, s = S u; all fits around it are then polynomial fits to the regular part u
- s v (singular function method: Fix, Gulati and Wakoff 1973, doi:10.1016/0021-9991(73)90023-5). The
components along and across the axis of an opening and of a shearing mode, 2 functions each, have
independent coefficients. Equation (5) of docs/method.md."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.sight import Tips, VisibilityCriterion
from mlsanm_cli.operators.neighbors import (
    EXTRA_NODES,
    TIE_TOLERANCE,
    WEIGHT_EXPONENT,
    MlsSettings,
    distances,
    neighbors_of,
)
from mlsanm_cli.operators.stencil_weights import Stencils
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF

ENRICHMENT_RADIUS = 2.0
"""Fits with their centre within this many radii of the fit around the tip are enriched."""
MIN_SEPARATION = 3.6
"""Least distance of enriched corners in radii of the fit around them, half of that across the material."""
RANK_TOLERANCE = 1e-3
"""Singular values of the functions' part orthogonal to polynomials are dropped below this fraction."""
PER_COEFFICIENT = 2.5
"""Neighbours per coefficient, as in all fits."""
VOID_ANGLE = 0.2
"""Nodes farther than this angle (radians) beyond a corner's faces lie across a void: no enrichment."""

ComplexArray: TypeAlias = NDArray[np.complex128]


@dataclass(frozen=True)
class SingularCorner:
    """Singular functions of a corner at ``place``, the material on ``half`` an angle on either side of the
    ``axis``; ``modes`` are exponents and kinds, ``kappa`` Muskhelishvili's constant. ``strengths`` (m, k) are
    the coefficients by the values at nodes ``indices`` (k,) of the fit of this ``radius``."""

    place: complex
    axis: complex
    half: float
    modes: tuple[tuple[float, bool], ...]
    kappa: float
    radius: float
    indices: IntArray
    strengths: FloatArray

    def _local(self, where: FloatArray) -> ComplexArray:
        """Local coordinates (...) of points (..., 2): origin at the tip, axis real, unit radius."""
        away = (where[..., 0] + 1j * where[..., 1] - self.place) * np.conj(self.axis)
        return np.asarray(away / self.radius, dtype=np.complex128)

    def near(self, centers: FloatArray) -> BoolArray:
        """Mask (e,) of fits at ``centers`` (e, 2) that are near the corner."""
        return np.asarray(np.abs(self._local(centers)) <= ENRICHMENT_RADIUS)

    def beyond(self, points: FloatArray) -> BoolArray:
        """Mask (n,) of ``points`` (n, 2) beyond the corner's faces."""
        seen = self._local(points)
        return np.asarray((np.abs(np.angle(seen)) > self.half + VOID_ANGLE) & (np.abs(seen) > ROUND_OFF))

    def derivatives(self, where: FloatArray, orders: tuple[int, int]) -> FloatArray:
        """Derivatives (..., kinds, m) of the functions at points (..., 2); 0 at the tip."""
        seen = self._local(where)
        kinds = [(order - dy, dy) for order in range(orders[0], orders[1] + 1) for dy in range(order + 1)]
        found = np.zeros((*seen.shape, len(kinds), 2 * len(self.modes)))
        off = np.abs(seen) > ROUND_OFF
        size, angle = np.abs(seen[off]), np.angle(seen[off])
        for number, (power, opens) in enumerate(self.modes):
            # kappa a z^p - p conj(a) z conj(z)^(p - 1) - c conj(a) conj(z)^p leaves both faces free.
            turn = 2.0 * power * self.half
            c = (-1.0 if opens else 1.0) * math.cos(turn) - power * math.cos(2.0 * self.half)
            a = 1.0 if opens else 1j
            for kind, times in enumerate(kinds):
                first = _derivatives_of_powers(size, angle, (power, 0.0), times, self.axis)
                second = _derivatives_of_powers(size, angle, (1.0, power - 1.0), times, self.axis)
                total = self.kappa * a * first - np.conj(a) * (power * second + c * np.conj(first))
                total *= self.radius ** -sum(times)
                found[off, kind, 2 * number], found[off, kind, 2 * number + 1] = total.real, total.imag
        return found


def singular_corners(
    points: FloatArray,
    tree: cKDTree,
    settings: MlsSettings,
    sight: VisibilityCriterion | None,
    tips: Tips | None,
) -> list[SingularCorner]:
    """Singular functions of those ``tips`` that the nodes ``points`` (n, 2) resolve, by fits around them."""
    found: list[SingularCorner] = []
    if tips is None:
        return found
    for number in range(len(tips.place)):
        place, size = tips.place[number : number + 1], _nodes_around(settings, tips, number)
        numbers = neighbors_of(points, tree, place, min(size + EXTRA_NODES, tree.n), sight)[1]
        # With all nodes as far as the last one, mirror images of corners have mirrored fits.
        away = distances(points, place, numbers)[0]
        around = numbers[0][away <= (1.0 + TIE_TOLERANCE) * np.sort(away)[min(size, len(away)) - 1]]
        nodes = points[around]
        away = nodes - place
        radius = float(np.hypot(*away.T).max())
        axis, half, modes = complex(*tips.axis[number]), float(tips.half[number]), tips.modes[number]
        known = (complex(*place[0]), axis, half, modes, tips.kappa, radius, around)
        corner = SingularCorner(*known, np.zeros((0, len(nodes))))
        gauss = np.exp(-WEIGHT_EXPONENT * (away**2).sum(axis=1) / radius**2)[:, None]
        x, y = away.T / radius
        powers = [(total - j, j) for total in range(settings.degree + 1) for j in range(total + 1)]
        q, r = np.linalg.qr(gauss * np.stack([x**i * y**j for i, j in powers], axis=1))
        diagonal = np.abs(np.diagonal(r))
        if corner.beyond(nodes).any() or diagonal.min() < settings.rank_tolerance * diagonal.max():
            continue
        singular = gauss * corner.derivatives(nodes, (0, 0))[:, 0]
        # Part orthogonal to the polynomials, reorthogonalised to round-off.
        rest = singular - q @ (q.T @ singular)
        rest -= q @ (q.T @ rest)
        u, sigma, v = np.linalg.svd(rest, full_matrices=False)
        kept = sigma > RANK_TOLERANCE * np.linalg.norm(singular, axis=0).max()
        strengths = (v[kept].T / sigma[kept]) @ (gauss * u[:, kept]).T
        found.append(replace(corner, strengths=strengths))
    return found


def enriched(
    plain: Stencils,
    corners: Sequence[SingularCorner],
    points: FloatArray,
    centers: FloatArray,
    targets: FloatArray,
    orders: tuple[int, int],
) -> Stencils:
    """The stencils at ``centers`` (e, 2) with those near corners replaced by fits to the regular part."""
    rows, nodes, values = [], [], []
    kinds = plain.weights.shape[1]
    for corner in corners:
        some = np.flatnonzero(corner.near(centers))
        own = plain.take(some)
        across = np.add.reduceat(corner.beyond(points[own.indices]), own.indptr[:-1]) if len(some) else some
        own, some = own.take(np.flatnonzero(across == 0)), some[across == 0]
        if len(some):
            known = corner.derivatives(targets[some], orders).reshape(len(some), kinds, -1)
            less = known - own.derivatives(corner.derivatives(points, (0, 0))[:, 0])
            values.append(np.swapaxes(less @ corner.strengths, 1, 2).reshape(-1, kinds))
            rows.append(np.repeat(some, len(corner.indices)))
            nodes.append(np.tile(corner.indices, len(some)))
    if not rows:
        return plain
    some = np.unique(np.concatenate(rows))
    own = plain.take(some)
    row = np.concatenate([np.repeat(some, np.diff(own.indptr)), *rows])
    node, values = np.concatenate([own.indices, *nodes]), [own.weights, *values]
    key, entry = np.unique(np.searchsorted(some, row) * len(points) + node, return_inverse=True)
    weights = np.zeros((len(key), kinds))
    np.add.at(weights, entry, np.concatenate(values))
    others = np.setdiff1d(np.arange(len(centers)), some)
    rest, start = plain.take(others), np.searchsorted(key, np.arange(1, len(some) + 1) * len(points))
    joined = replace(
        plain,
        indptr=np.concatenate([rest.indptr, rest.indptr[-1] + start]),
        indices=np.concatenate([rest.indices, key % len(points)]),
        weights=np.concatenate([rest.weights, weights]),
    )
    return joined.take(np.argsort(np.concatenate([others, some])))


def _nodes_around(settings: MlsSettings, tips: Tips, number: int) -> int:
    """Number of nodes of the fit around a corner."""
    return math.ceil(PER_COEFFICIENT * (settings.coefficients + 2 * len(tips.modes[number])))


def isolated_tips(settings: MlsSettings, tips: Tips) -> Tips | None:
    """Those of the ``tips`` that are isolated; None without any."""
    count = np.array([_nodes_around(settings, tips, number) for number in range(len(tips.place))])
    # A sector of radius R, in edges, contains half R^2 nodes.
    kept = tips.apart >= MIN_SEPARATION * np.sqrt(count / tips.half)
    if not kept.any():
        return None
    return Tips(tips.place[kept], tips.axis[kept], tips.half[kept], tips.apart[kept], tips.kappa)


def _derivatives_of_powers(
    size: FloatArray, angle: FloatArray, powers: tuple[float, float], times: tuple[int, int], axis: complex
) -> ComplexArray:
    """Derivatives (n,) of z^a conj(z)^b, ``times`` by x and y, at polar coordinates ``size``, ``angle`` (n,)
    relative to ``axis``, using d/dx = d/dz + d/dz*, d/dy = i (d/dz - d/dz*)."""
    (a, b), (dx, dy) = powers, times
    total = np.zeros(len(size), dtype=np.complex128)
    for i in range(dx + 1):
        for j in range(dy + 1):
            up, down = i + j, dx + dy - i - j
            factor = math.comb(dx, i) * math.comb(dy, j) * 1j**dy * (-1.0) ** (dy - j)
            factor *= math.prod(a - s for s in range(up)) * math.prod(b - s for s in range(down))
            if factor:
                p, q = a - up, b - down
                turned = factor * np.conj(axis) ** up * axis**down
                total += turned * size ** (p + q) * np.exp(1j * (p - q) * angle)
    return total
