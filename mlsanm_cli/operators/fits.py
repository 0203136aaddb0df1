"""Derivatives of nodal fields, without the weights that lead to them: a fraction of their work."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray, IndexArray, IntArray
from mlsanm_cli.cloud.sight import VisibilityCriterion
from mlsanm_cli.cloud.tips import Tips
from mlsanm_cli.kernels.fits import fit_derivatives
from mlsanm_cli.operators.cornered import sharp_corners
from mlsanm_cli.operators.neighbors import neighbors_of
from mlsanm_cli.operators.settings import MlsSettings
from mlsanm_cli.operators.stencils import build_stencils, sound_fits
from mlsanm_cli.startup import cKDTree

BLOCK_SIZE = 4096
"""Points whose neighbours are in memory together."""


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
    """Value and derivatives (e, 6, c) of a nodal ``field`` (n, c) at ``targets`` (e, 2), degree 2 at least.

    They are those of :meth:`Stencils.derivatives` with the same settings but for round-off; ``known`` (e, k)
    are the targets' nearest nodes by :func:`nearest_nodes`, if they were looked for already.
    Raises NumericalError where the nodes cannot carry the degree.
    """
    result = np.empty((len(targets), 6, field.shape[1]))
    field = np.ascontiguousarray(field)

    def fit(which: IntArray, size: int) -> tuple[tuple[FloatArray], FloatArray]:
        some = targets[which]
        near = None if known is None else known[which]
        radius, numbers = neighbors_of(points, tree, some, size, sight, near)
        found, ratio = np.empty((len(some), 6, field.shape[1])), np.empty(len(some))
        fit_derivatives(
            points, numbers, some, radius, settings.degree, settings.sharpness, field, found, ratio
        )
        return (found,), ratio

    for first in range(0, len(targets), BLOCK_SIZE):
        some = np.arange(first, min(first + BLOCK_SIZE, len(targets)))
        for which, (found,), _ in sound_fits(len(points), targets, some, settings, fit):
            result[which] = found
    near = np.zeros(len(targets), dtype=bool)
    for corner in sharp_corners(points, tree, settings, sight, tips):
        near |= corner.near(targets)
    if near.any():
        stencils = build_stencils(points, tree, targets[near], 2, settings, sight, tips=tips)
        result[near] = stencils.derivatives(field)
    return result
