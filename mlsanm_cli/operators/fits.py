"""Derivatives of nodal fields without stencil weights, at a fraction of their cost."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray, IndexArray, IntArray
from mlsanm_cli.cloud.sight import VisibilityCriterion
from mlsanm_cli.cloud.tips import Tips
from mlsanm_cli.kernels.fits import fit_derivatives
from mlsanm_cli.operators.neighbors import neighbors_of, weight_radius
from mlsanm_cli.operators.settings import MlsSettings
from mlsanm_cli.operators.singular_functions import singular_corners
from mlsanm_cli.operators.stencils import build_stencils, sound_fits
from mlsanm_cli.startup import cKDTree

BATCH_SIZE = 4096
"""Points processed at once, to limit memory."""


def fitted_derivatives(
    points: FloatArray,
    tree: cKDTree,
    targets: FloatArray,
    settings: MlsSettings,
    field: FloatArray,
    sight: VisibilityCriterion | None = None,
    known: IndexArray | None = None,
    tips: Tips | None = None,
) -> FloatArray:
    """Value and derivatives (e, 6, c) of a nodal ``field`` (n, c) at ``targets`` (e, 2), for degree >= 2.

    Equal to :meth:`Stencils.derivatives` with the same settings up to round-off; ``known`` (e, k) are the
    targets' nearest nodes by :func:`nearest_nodes` if available. Raises NumericalError where the nodes do not
    determine the polynomial.
    """
    result = np.empty((len(targets), 6, field.shape[1]))
    field = np.ascontiguousarray(field)

    def fit(which: IntArray, size: int) -> tuple[tuple[FloatArray], FloatArray]:
        some = targets[which]
        near = None if known is None else known[which]
        radius, numbers = neighbors_of(points, tree, some, size, sight, near)
        radius = weight_radius(points, some, radius, numbers, settings)
        found, ratio = np.empty((len(some), 6, field.shape[1])), np.empty(len(some))
        fit_derivatives(
            points, numbers, some, radius, settings.degree, settings.sharpness, field, found, ratio
        )
        return (found,), ratio

    for first in range(0, len(targets), BATCH_SIZE):
        some = np.arange(first, min(first + BATCH_SIZE, len(targets)))
        for which, (found,), _ in sound_fits(len(points), targets, some, settings, fit):
            result[which] = found
    near = np.zeros(len(targets), dtype=bool)
    for corner in singular_corners(points, tree, settings, sight, tips):
        near |= corner.near(targets)
    if near.any():
        stencils = build_stencils(points, tree, targets[near], 2, settings, sight, tips=tips)
        result[near] = stencils.derivatives(field)
    return result
