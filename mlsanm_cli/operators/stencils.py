"""Stencils: the neighbours of a point and the weights of value and derivatives there; those of a symmetric
cloud are built on one side and reflected. Equation (1) of docs/method.md."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import AnyArray, FloatArray, IndexArray, IntArray
from mlsanm_cli.cloud.mirror import Mirror
from mlsanm_cli.cloud.sight import VisibilityCriterion
from mlsanm_cli.cloud.tips import Tips
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.kernels.stencils import mls_weights
from mlsanm_cli.operators.neighbors import neighbors_of, weight_radius
from mlsanm_cli.operators.settings import MlsSettings
from mlsanm_cli.operators.singular_functions import enriched, singular_corners
from mlsanm_cli.operators.stencil_weights import Stencils
from mlsanm_cli.startup import cKDTree

ENLARGEMENT = 1.3
MAX_GROWTH = 3.0
CONDITION_MARGIN, MARGIN_DEGREE, MARGIN_GROWTH = 20.0, 3, 1.9
"""From degree MARGIN_DEGREE on, fits are first sought CONDITION_MARGIN times above the rank tolerance, with
up to MARGIN_GROWTH times the neighbours. On a structured mesh of an eye 15 of 1,362 fits were below, and its
displacement 19 % off at degree 3 and 9 % at degree 4; with more neighbours there 5 and 4 %."""
BLOCK_SIZE = 4096
"""Stencils fitted at once: a tenth of a second at high degrees."""


def build_stencils(
    points: FloatArray,
    tree: cKDTree,
    targets: FloatArray,
    order: int,
    settings: MlsSettings,
    sight: VisibilityCriterion | None = None,
    known: IndexArray | None = None,
    tips: Tips | None = None,
) -> Stencils:
    """Moving least-squares stencils of the nodes ``points`` (n, 2), each centred at its own target (e, 2).

    ``sight`` removes neighbours across slits, ``known`` (e, k) are the targets' nearest nodes by
    :func:`nearest_nodes` if available; near ``tips`` fits are enriched by singular functions
    (:mod:`mlsanm_cli.operators.singular_functions`).

    Lancaster and Salkauskas 1981, doi:10.1090/S0025-5718-1981-0616367-1; derivatives are those of the local
    polynomial ("diffuse", Nayroles, Touzot and Villon 1992, doi:10.1007/BF00364252). A stencil whose weighted
    QR is rank-deficient gets more neighbours. Raises NumericalError, naming the place, where that does not
    help.
    """
    return _built(points, tree, targets, targets[:, None], (0, order), settings, sight, known, tips)


def build_gradients(
    points: FloatArray,
    tree: cKDTree,
    centers: FloatArray,
    targets: FloatArray,
    settings: MlsSettings,
    sight: VisibilityCriterion | None = None,
    values: bool = False,
    tips: Tips | None = None,
) -> Stencils:
    """Stencils at ``centers`` (e, 2) with the weights (nnz, 2 t) of d/dx and d/dy at each of their t
    ``targets`` (e, t, 2), from one polynomial per centre; with ``values`` also of the value, first: (nnz, 3
    t). Their weights are not narrower where they are one-sided."""
    orders, even = (0 if values else 1, 1), replace(settings, narrow=False)
    return _built(points, tree, centers, targets, orders, even, sight, None, tips)


def _built(
    points: FloatArray,
    tree: cKDTree,
    centers: FloatArray,
    targets: FloatArray,
    orders: tuple[int, int],
    settings: MlsSettings,
    sight: VisibilityCriterion | None,
    known: IndexArray | None,
    tips: Tips | None,
) -> Stencils:
    """Stencils at ``centers`` (e, 2) with the derivatives of ``orders[0]`` to ``orders[1]`` at their
    ``targets`` (e, t, 2)."""
    centers, targets = np.ascontiguousarray(centers), np.ascontiguousarray(targets)
    kinds = targets.shape[1] * sum(order + 1 for order in range(orders[0], orders[1] + 1))
    if not len(centers):
        none = np.zeros(0, dtype=np.int64)
        return Stencils(np.zeros(1, dtype=np.int64), none, np.zeros((0, kinds)), len(points), 0, 1.0)

    def fit(which: IntArray, size: int) -> tuple[tuple[IntArray, FloatArray], FloatArray]:
        some = centers[which]
        near = None if known is None else known[which]
        radius, indices = neighbors_of(points, tree, some, size, sight, near)
        radius = weight_radius(points, some, radius, indices, settings)
        weights, ratio = np.empty((len(some) * size, kinds)), np.empty(len(some))
        _fit_in_slices(points, indices, some, targets[which], radius, settings, orders, weights, ratio)
        return (indices, weights.reshape(len(some), size, -1)), ratio

    fits = list(sound_fits(len(points), centers, np.arange(len(centers)), settings, fit))
    worst = min((float(ratio.min(initial=1.0)) for _, _, ratio in fits), default=1.0)
    enlarged = len(centers) - len(fits[0][0]) if fits else 0
    found = _merge(
        [(which, indices, weights) for which, (indices, weights), _ in fits],
        len(centers),
        len(points),
        enlarged,
        worst,
    )
    corners = singular_corners(points, tree, settings, sight, tips)
    return enriched(found, corners, points, centers, targets, orders)


def _fit_in_slices(
    points: FloatArray,
    indices: IntArray,
    centers: FloatArray,
    targets: FloatArray,
    radius: FloatArray,
    settings: MlsSettings,
    orders: tuple[int, int],
    weights: FloatArray,
    ratio: FloatArray,
) -> None:
    """Compute ``weights`` and ``ratio`` in slices of stencils, between which signals are handled."""
    size = indices.shape[1]
    for first in range(0, len(centers), BLOCK_SIZE):
        here = slice(first, min(first + BLOCK_SIZE, len(centers)))
        indptr = np.arange(here.stop - first + 1, dtype=np.int64) * size
        mls_weights(
            *(points, indptr, indices[here].ravel(), centers[here], targets[here].reshape(-1, 2)),
            *(radius[here], settings.degree, settings.sharpness, *orders),
            *(weights[first * size : here.stop * size], ratio[here]),
        )


def sound_fits(
    nodes: int,
    targets: FloatArray,
    which: IntArray,
    settings: MlsSettings,
    fit: Callable[[IntArray, int], tuple[tuple[AnyArray, ...], FloatArray]],
) -> Iterator[tuple[IntArray, tuple[AnyArray, ...], FloatArray]]:
    """Fits at the ``targets`` (e, 2) with numbers ``which``, with more neighbours where the rank is
    deficient.

    ``fit(some, size)`` makes fits with ``size`` neighbours at targets ``some``: arrays with one row each, and
    their ratios of diagonal entries of R. Yields numbers, arrays and ratios of accepted fits. Raises
    NumericalError where no size is enough.
    """
    if nodes < settings.coefficients:
        raise NumericalError(
            f"a body of {nodes} nodes has too few of them for polynomials of degree {settings.degree}",
            "use a smaller spacing or a lower mls.degree",
        )
    size, pending = settings.stencil_size, which
    while len(pending):
        size = min(size, nodes)
        parts, ratio = fit(pending, size)
        # A ratio above one (or nan) means nodes too close together to be separated at this radius.
        patient = settings.degree >= MARGIN_DEGREE and size < min(
            nodes, MARGIN_GROWTH * settings.stencil_size
        )
        margin = CONDITION_MARGIN if patient else 1.0
        sound = (ratio >= margin * settings.rank_tolerance) & (ratio <= 1.0)
        if sound.all():
            yield pending, parts, ratio
            return
        yield pending[sound], tuple(part[sound] for part in parts), ratio[sound]
        pending = pending[~sound]
        if size == nodes or size >= MAX_GROWTH * settings.stencil_size:
            x, y = targets[pending[0]]
            raise NumericalError(
                f"the nodes around ({x:.6g}, {y:.6g}) do not determine polynomials of degree "
                f"{settings.degree}, not even {size} of them",
                "use a smaller spacing there, or a lower mls.degree",
            )
        size = int(np.ceil(ENLARGEMENT * size))


def _merge(
    parts: list[tuple[IntArray, IntArray, FloatArray]], targets: int, nodes: int, enlarged: int, worst: float
) -> Stencils:
    if len(parts) == 1:
        _, indices, weights = parts[0]
        indptr = np.arange(targets + 1, dtype=np.int64) * indices.shape[1]
        return Stencils(
            indptr, indices.ravel(), weights.reshape(-1, weights.shape[2]), nodes, enlarged, worst
        )
    order = np.argsort(np.concatenate([which for which, _, _ in parts]))
    count = np.concatenate([np.full(len(which), indices.shape[1]) for which, indices, _ in parts])
    gathered = Stencils(
        np.concatenate([[0], np.cumsum(count)]),
        np.concatenate([indices.ravel() for _, indices, _ in parts]),
        np.concatenate([weights.reshape(-1, weights.shape[2]) for _, _, weights in parts]),
        nodes,
        enlarged,
        worst,
    )
    return gathered.take(order)


def reflected(stencils: Stencils, mirror: Mirror) -> Stencils:
    """Stencils of all nodes (n) from those of the mirror's own nodes (h). Stencils on the line are averaged
    with their images, as only one of two equidistant nodes may be included."""
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


def reflected_numbers(numbers: IndexArray, mirror: Mirror) -> IndexArray:
    """Node numbers (n, k) for all nodes from those (h, k) of the mirror's own nodes."""
    whole, beyond = numbers[mirror.place], mirror.side < 0
    whole[beyond] = mirror.image[whole[beyond]]
    return whole
