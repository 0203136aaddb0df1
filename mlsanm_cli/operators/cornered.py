"""Fits near sharp inward corners, which know how displacements grow there.

Between free faces displacements are r^power times cosines and sines of power theta and (2 - power) theta,
with powers below 1 (Williams 1952, doi:10.1115/1.4010553). No polynomial follows them: what fits leave out
near a corner would make a whole frame too stiff. So these functions take part in the fits around it as
polynomials do, as far as a stencil's nodes distinguish them from polynomials (as those of a crack's tip in
Fleming, Chu, Moran and Belytschko 1997,
doi:10.1002/(SICI)1097-0207(19970430)40:8<1483::AID-NME123>3.0.CO;2-6).
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.cloud.tips import Tips
from mlsanm_cli.operators.settings import MlsSettings
from mlsanm_cli.startup import cKDTree

REACH = 2.0
"""Fits whose middle is within so many of their radii of a corner know its functions. Anything from 1 to 4 is
as good."""
TOLD = 1e-3
"""What polynomials leave over of the functions counts down to this part of them; 1e-4 is as good, 1e-2 loses
some of what is won at degree 2."""
PER_COEFFICIENT = 2.5
"""Neighbours for each coefficient, as everywhere."""
ASIDE = 0.2
"""Nodes farther than this angle (radian) beyond a corner's faces are across a void: no such fit is made."""
AT = 1e-9
"""Places nearer to a tip than this part of a fit's radius are the tip."""
FAR = 4.0
"""Fits are looked for within so many times the reach at the tip itself."""
TOGETHER = 2048
"""Fits that are in memory together."""

ComplexArray: TypeAlias = NDArray[np.complex128]


def corners_of_fits(
    tree: cKDTree, centers: FloatArray, settings: MlsSettings, tips: Tips
) -> tuple[IntArray, IntArray, int]:
    """Which fits at ``centers`` (e, 2) are near a corner, by number; which corner that is; and how many
    neighbours such fits have."""
    more = 4 * max(len(powers) for powers in tips.powers)
    size = min(math.ceil(PER_COEFFICIENT * (settings.coefficients + more)), tree.n)
    away = np.sqrt(((centers[:, None] - tips.place) ** 2).sum(axis=2))
    tip, closest = away.argmin(axis=1), away.min(axis=1)
    around = np.asarray(nearest(tree, tips.place, np.array([size]))[0])[:, 0]
    which = np.flatnonzero(closest <= FAR * REACH * around[tip])
    if not len(which):
        return which, which, size
    radius = np.asarray(nearest(tree, centers[which], np.array([size]))[0])[:, 0]
    which = which[closest[which] <= REACH * radius]
    return which, tip[which], size


def cornered(
    points: FloatArray,
    indices: IntArray,
    centers: FloatArray,
    targets: FloatArray,
    radius: FloatArray,
    settings: MlsSettings,
    orders: tuple[int, int],
    tips: Tips,
    tip: IntArray,
) -> tuple[FloatArray, BoolArray]:
    """Weights (e, k, kinds) of fits around ``centers`` (e, 2) to the nodes ``indices`` (e, k), as of
    :func:`mlsanm_cli.kernels.stencils.mls_weights` at their ``targets`` (e, t, 2), that know the corners
    ``tip`` (e,); and which of them (e,) are sound.

    At the tip itself, where the functions' derivatives have no bound, those of the polynomials alone count.
    """
    kinds = targets.shape[1] * sum(order + 1 for order in range(orders[0], orders[1] + 1))
    weights = np.zeros((*indices.shape, kinds))
    sound = np.zeros(len(indices), dtype=bool)
    for number in np.unique(tip).tolist():
        all_of = np.flatnonzero(tip == number)
        for first in range(0, len(all_of), TOGETHER):
            some = all_of[first : first + TOGETHER]
            found, good = _fits_at_one_corner(
                points[indices[some]],
                centers[some],
                targets[some],
                radius[some],
                settings,
                orders,
                tips,
                number,
            )
            weights[some], sound[some] = found, good
    return weights, sound


def _fits_at_one_corner(
    nodes: FloatArray,
    centers: FloatArray,
    targets: FloatArray,
    radius: FloatArray,
    settings: MlsSettings,
    orders: tuple[int, int],
    tips: Tips,
    number: int,
) -> tuple[FloatArray, BoolArray]:
    """The same for fits to ``nodes`` (e, k, 2) that all know one corner."""
    place, axis, powers = complex(*tips.place[number]), complex(*tips.axis[number]), tips.powers[number]

    def seen(where: FloatArray) -> ComplexArray:
        """Places (e, m, 2) from the tip, the axis real, in units of the radius."""
        away = (where[..., 0] + 1j * where[..., 1] - place) * np.conj(axis)
        return np.asarray(away / radius[:, None], dtype=np.complex128)

    own, at = seen(nodes), seen(targets)
    beyond = (np.abs(np.angle(own)) > tips.half[number] + ASIDE) & (np.abs(own) > AT)
    local = (nodes - centers[:, None]) / radius[:, None, None]
    gauss = np.exp(-settings.sharpness * (local**2).sum(axis=2))[..., None]
    q, r = np.linalg.qr(gauss * _monomials(local, settings.degree, (0, 0))[:, :, 0])
    diagonal = np.abs(np.diagonal(r, axis1=1, axis2=2))
    sound = ~beyond.any(axis=1) & (diagonal.min(axis=1) >= settings.rank_tolerance * diagonal.max(axis=1))
    r[~sound] = np.eye(r.shape[1])
    moved = (targets - centers[:, None]) / radius[:, None, None]
    wanted = _monomials(moved, settings.degree, orders).reshape(len(nodes), -1, r.shape[2])
    more = _singular(at, powers, orders, axis).reshape(len(nodes), wanted.shape[1], -1)
    singular = gauss * _singular(own, powers, (0, 0), axis)[:, :, 0]
    # Of the singular functions what polynomials leave over, orthogonal to them to round-off.
    turned = np.swapaxes(q, 1, 2)
    part = turned @ singular
    rest = singular - q @ part
    rest -= q @ (turned @ rest)
    more -= wanted @ np.linalg.solve(r, part)
    u, sigma, v = np.linalg.svd(rest, full_matrices=False)
    kept = sigma > TOLD * np.linalg.norm(singular, axis=1).max(axis=1)[:, None]
    inverse = np.where(kept, 1.0 / np.where(kept, sigma, 1.0), 0.0)[..., None]
    rows = q @ np.linalg.solve(np.swapaxes(r, 1, 2), np.swapaxes(wanted, 1, 2))
    rows += u @ (inverse * (v @ np.swapaxes(more, 1, 2)))
    scale = [radius**-order for order in range(orders[0], orders[1] + 1) for _ in range(order + 1)]
    return gauss * rows * np.tile(np.stack(scale, axis=1), targets.shape[1])[:, None], sound


def _kinds(orders: tuple[int, int]) -> list[tuple[int, int]]:
    """The derivatives of the least to the highest of ``orders``, each as how often by x and by y."""
    return [(order - dy, dy) for order in range(orders[0], orders[1] + 1) for dy in range(order + 1)]


def _monomials(x: FloatArray, degree: int, orders: tuple[int, int]) -> FloatArray:
    """Derivatives (e, m, kinds, c) at places ``x`` (e, m, 2) of all x^i y^j up to ``degree``, ordered by
    degree, then by the power of y."""
    powers = [(total - j, j) for total in range(degree + 1) for j in range(total + 1)]
    found = np.zeros((*x.shape[:2], len(_kinds(orders)), len(powers)))
    for kind, (dx, dy) in enumerate(_kinds(orders)):
        for column, (i, j) in enumerate(powers):
            if i >= dx and j >= dy:
                factor = math.perm(i, dx) * math.perm(j, dy)
                found[:, :, kind, column] = factor * x[..., 0] ** (i - dx) * x[..., 1] ** (j - dy)
    return found


def _singular(w: ComplexArray, powers: FloatArray, orders: tuple[int, int], axis: complex) -> FloatArray:
    """Derivatives (e, m, kinds, 4p) by x and y of a corner's functions at ``w`` (e, m), places seen from its
    tip with the ``axis`` as the real line; 0 at the tip."""
    found = np.zeros((*w.shape, len(_kinds(orders)), 4 * len(powers)))
    off = np.abs(w) > AT
    size, angle = np.abs(w[off]), np.angle(w[off])
    for number, power in enumerate(powers.tolist()):
        # z^a conj(z)^b, whose real and imaginary parts they are.
        for part, (a, b) in enumerate(((power, 0.0), (1.0, power - 1.0))):
            for kind, (dx, dy) in enumerate(_kinds(orders)):
                total = _differentiated(size, angle, (a, b), (dx, dy), axis)
                column = 4 * number + 2 * part
                found[off, kind, column], found[off, kind, column + 1] = total.real, total.imag
    return found


def _differentiated(
    size: FloatArray, angle: FloatArray, powers: tuple[float, float], times: tuple[int, int], axis: complex
) -> ComplexArray:
    """Derivatives (n,) of z^a conj(z)^b, so many times by x and by y, at places given by ``size`` and
    ``angle`` (n,) to the ``axis``: d/dx = d/dz + d/dz*, d/dy = i (d/dz - d/dz*)."""
    (a, b), (dx, dy) = powers, times
    total = np.zeros(len(size), dtype=np.complex128)
    for i in range(dx + 1):
        for j in range(dy + 1):
            up, down = i + j, dx + dy - i - j
            factor = math.comb(dx, i) * math.comb(dy, j) * 1j**dy * (-1.0) ** (dy - j)
            factor *= math.prod(a - s for s in range(up)) * math.prod(b - s for s in range(down))
            if factor:
                p, q = a - up, b - down
                total += (
                    factor * np.conj(axis) ** up * axis**down * size ** (p + q) * np.exp(1j * (p - q) * angle)
                )
    return total
