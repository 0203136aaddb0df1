"""Stencils: the neighbours of a point and the weights of value and derivatives there; those of a symmetric
cloud are built on one side and reflected. Equation (1) of docs/method.md."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray, IndexArray, IntArray
from mlsanm_cli.cloud.cloud import Mirror, radius_of
from mlsanm_cli.cloud.sight import Tips, VisibilityCriterion
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.kernels.stencils import mls_weights
from mlsanm_cli.operators.neighbors import ONE_SIDED_RADIUS, WEIGHT_EXPONENT, MlsSettings, neighbors_of
from mlsanm_cli.operators.singular_functions import enriched, singular_corners
from mlsanm_cli.operators.stencil_weights import Stencils

ENLARGEMENT = 1.3
MAX_GROWTH = 3.0
CONDITION_MARGIN, MARGIN_DEGREE, MARGIN_GROWTH = 20.0, 3, 1.9
"""From degree MARGIN_DEGREE on, fits are first sought this far above the rank tolerance, with up to
MARGIN_GROWTH times the neighbours."""
CENTERED, HALF_DISK = 0.25, 4.0 / (3.0 * np.pi)
"""Distance of a stencil's mean node from its target, in radii: inside, and at a straight boundary."""
BLOCK_SIZE = 4096
"""Stencils fitted at once: a tenth of a second at high degrees."""


def build_stencils(
    points: FloatArray,
    tree: cKDTree,
    targets: FloatArray,
    order: int,
    settings: MlsSettings,
    sight: VisibilityCriterion | None = None,
    tips: Tips | None = None,
    own: IntArray | None = None,
    centers: FloatArray | None = None,
    least: int = 0,
) -> Stencils:
    """Moving least-squares stencils of the nodes ``points`` (n, 2), each centred at its own target (e, 2),
    with derivatives of orders ``least`` to ``order``; or at t ``targets`` (e, t, 2) of one polynomial per
    centre (e, 2), target by target, whose weights are not narrower where it is one-sided. ``sight`` removes
    neighbours across slits, near ``tips`` fits are enriched by singular functions. In bodies of revolution
    the last ``points`` are images of the nodes ``own`` (g,). Derivatives are those of the local polynomial
    (Lancaster and Salkauskas 1981, doi:10.1090/S0025-5718-1981-0616367-1; "diffuse", Nayroles, Touzot and
    Villon 1992, doi:10.1007/BF00364252). A stencil whose weighted QR is rank-deficient gets more neighbours.
    Raises NumericalError, naming the place, where that does not help."""
    if centers is None:
        centers, targets = targets, targets[:, None]
    else:
        settings = replace(settings, narrow=False)
    centers, targets = np.ascontiguousarray(centers), np.ascontiguousarray(targets)
    kinds = targets.shape[1] * sum(range(least + 1, order + 2))
    if not len(centers):
        none = np.zeros(0, dtype=np.int64)
        empty = Stencils(np.zeros(1, dtype=np.int64), none, np.zeros((0, kinds)), len(points), 0, 1.0)
        return empty if own is None else empty.of_revolution(own, np.zeros(0))
    if len(points) < settings.coefficients:
        raise NumericalError(
            f"a body of {len(points)} nodes has too few of them for polynomials of degree {settings.degree}",
            "use a smaller spacing or a lower mls.degree",
        )
    size, pending = settings.stencil_size, np.arange(len(centers))
    numbers: list[IndexArray | IntArray] = []
    parts: list[tuple[IntArray, IntArray, FloatArray]] = []
    enlarged, worst = 0, 1.0
    while len(pending):
        size = min(size, len(points))
        some = centers[pending]
        radius, indices = neighbors_of(points, tree, some, size, sight)
        if settings.narrows:
            # Of the weights: smaller where stencils are one-sided, as at the boundary.
            away = points[indices].mean(axis=1) - some
            offset = np.hypot(away[:, 0], away[:, 1]) / radius
            share = np.clip((offset - CENTERED) / (HALF_DISK - CENTERED), 0.0, 1.0)
            radius = radius * (1.0 - (1.0 - ONE_SIDED_RADIUS) * share)
        weights, ratio, aims = np.empty((len(some), size, kinds)), np.empty(len(some)), targets[pending]
        # In slices, between which signals are handled.
        for first in range(0, len(some), BLOCK_SIZE):
            here = slice(first, min(first + BLOCK_SIZE, len(some)))
            indptr = np.arange(here.stop - first + 1, dtype=np.int64) * size
            mls_weights(
                *(points, indptr, indices[here].ravel(), some[here], aims[here].reshape(-1, 2)),
                *(radius[here], settings.degree, WEIGHT_EXPONENT, least, order),
                *(weights[here].reshape(-1, kinds), ratio[here]),
            )
        patient = settings.degree >= MARGIN_DEGREE
        patient &= size < min(len(points), MARGIN_GROWTH * settings.stencil_size)
        margin = CONDITION_MARGIN if patient else 1.0
        # A ratio above one (or nan) means nodes too close together to be separated at this radius.
        sound = (ratio >= margin * settings.rank_tolerance) & (ratio <= 1.0)
        # Without a copy where all are sound: weights take much memory.
        kept = slice(None) if sound.all() else sound
        enlarged += len(pending[kept]) if parts else 0
        worst = min(worst, float(ratio[kept].min(initial=1.0)))
        numbers.append(pending[kept])
        counts = np.full(len(numbers[-1]), size)
        parts.append((counts, indices[kept].ravel(), weights[kept].reshape(-1, kinds)))
        pending = pending[~sound]
        if len(pending) and (size == len(points) or size >= MAX_GROWTH * settings.stencil_size):
            x, y = centers[pending[0]]
            raise NumericalError(
                f"the nodes around ({x:.6g}, {y:.6g}) do not determine polynomials of degree "
                f"{settings.degree}, not even {size} of them",
                "use a smaller spacing there, or a lower mls.degree",
            )
        size = int(np.ceil(ENLARGEMENT * size))
    counts, indices, weights = parts[0] if len(parts) == 1 else map(np.concatenate, zip(*parts, strict=True))
    indptr = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(counts)])
    whole = Stencils(indptr, indices, weights, len(points), enlarged, worst)
    if len(parts) > 1:
        whole = whole.take(np.argsort(np.concatenate(numbers)))
    corners = singular_corners(points, tree, settings, sight, tips)
    whole = enriched(whole, corners, points, centers, targets, (least, order))
    return whole if own is None else whole.of_revolution(own, radius_of(targets.reshape(-1, 2), points))


def reflected(stencils: Stencils, mirror: Mirror) -> Stencils:
    """Stencils of all nodes (n) from those of the mirror's own nodes (h); those on the line are averaged with
    their images, as only one of two equidistant nodes may be included."""
    times = np.where(mirror.side == 0, 2, 1)
    whole = stencils.take(np.repeat(mirror.place, times))
    first = np.concatenate([[0], np.cumsum(times)])
    imaged = np.repeat(mirror.side < 0, times)
    imaged[first[1:][mirror.side == 0] - 1] = True
    length = np.diff(whole.indptr)
    beyond = np.repeat(imaged, length)
    # In place, kind by kind, to save memory.
    share = np.repeat(np.repeat(1.0 / times, times), length)
    for kind, sign in enumerate(mirror.derivative_signs(whole.weights.shape[1])):
        whole.weights[:, kind] *= np.where(beyond, sign, 1.0) * share
    indices = np.where(beyond, mirror.image[whole.indices], whole.indices)
    return replace(whole, indptr=whole.indptr[first], indices=indices)
