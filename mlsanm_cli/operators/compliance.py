"""Many functionals of many solutions from an inexact factor, made exact by a correction of low rank.

A factor that loses digits does so in few, smooth shapes: motions of the finest part of the cloud above all.
So the error of all functionals of all solutions is a matrix of low rank, found from what it does to a few
random columns (Halko, Martinsson and Tropp 2011, doi:10.1137/090771806). Only as many solutions are refined.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.operators.refinement import BLOCK

RANK = 8
"""Random columns at first; on published cases 12 leave no smaller error, 6 up to ten times as much."""
PROBES = 4
"""Columns that judge the result."""
ENOUGH = 1e-9
"""Error of the whole that is left alone, relatively."""
NOISE = 5.0
"""Error outside of the shapes found left alone, against the one inside, the refined solutions' own."""
SEED = 0

Apply = Callable[[FloatArray], FloatArray]


def corrected(start: FloatArray, of_columns: Apply, of_rows: Apply) -> FloatArray:
    """The matrix A (g, c) to which ``start`` comes near.

    ``of_columns`` gives A V (g, s) for V (c, s), ``of_rows`` U^T A (s, c) for U (g, s), both precisely.
    """
    column = np.linalg.norm(start, axis=0)
    column[column == 0.0] = 1.0
    row = np.linalg.norm(start / column, axis=1)[:, None]
    row[row == 0.0] = 1.0
    rng = np.random.default_rng(SEED)
    rank, tried, found = RANK, np.zeros((start.shape[1], 0)), np.zeros((start.shape[0], 0))
    while 2 * (rank + PROBES) < min(start.shape):
        more = rng.normal(size=(len(tried), rank + PROBES - tried.shape[1])) / column[:, None]
        tried, found = np.hstack([tried, more]), np.hstack([found, of_columns(more) / row])
        basis = np.linalg.qr((found - start @ tried / row)[:, :rank])[0]
        result = start + row * (basis @ (of_rows(basis / row) - (basis / row).T @ start))
        left = (found - result @ tried / row)[:, rank:]
        within = basis.T @ left
        noise = np.linalg.norm(within)
        if np.linalg.norm(left - basis @ within) <= max(
            ENOUGH * np.linalg.norm(found[:, rank:]), NOISE * noise
        ):
            return np.asarray(result)
        rank *= 2
    unit = np.eye(start.shape[1])
    blocks = [of_columns(unit[:, first : first + BLOCK]) for first in range(0, len(unit), BLOCK)]
    return np.concatenate([start[:, :0], *blocks], axis=1)
