"""Functionals of many solutions from an inexact factor, corrected by a low-rank update.

An ill-conditioned factor is inaccurate in a few smooth modes, above all motions of the finest part of the
cloud. The error matrix of all functionals of all solutions therefore has low rank, and is found from its
action on a few random columns (Halko, Martinsson and Tropp 2011, doi:10.1137/090771806). Only that many
solutions are refined.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.operators.system import BLOCK_COLUMNS
from mlsanm_cli.roundoff import ROUND_OFF

RANK = 8
"""Initial number of random columns."""
CHECK_COLUMNS = 4
"""Columns for the error estimate."""
NOISE_RATIO = 5.0
"""Accepted error outside the basis over that inside."""
SEED = 0

Apply = Callable[[FloatArray], FloatArray]


def corrected(start: FloatArray, of_columns: Apply, of_rows: Apply) -> FloatArray:
    """The matrix A (g, c) approximated by ``start``. ``of_columns`` computes A V (g, s) for V (c, s),
    ``of_rows`` U^T A (s, c) for U (g, s), both accurately."""
    column = np.linalg.norm(start, axis=0)
    column[column == 0.0] = 1.0
    row = np.linalg.norm(start / column, axis=1)[:, None]
    row[row == 0.0] = 1.0
    rng = np.random.default_rng(SEED)
    rank, tried, found = RANK, np.zeros((start.shape[1], 0)), np.zeros((start.shape[0], 0))
    while 2 * (rank + CHECK_COLUMNS) < min(start.shape):
        more = rng.normal(size=(len(tried), rank + CHECK_COLUMNS - tried.shape[1])) / column[:, None]
        tried, found = np.hstack([tried, more]), np.hstack([found, of_columns(more) / row])
        basis = np.linalg.qr((found - start @ tried / row)[:, :rank])[0]
        result = start + row * (basis @ (of_rows(basis / row) - (basis / row).T @ start))
        left = (found - result @ tried / row)[:, rank:]
        within = basis.T @ left
        noise = np.linalg.norm(within)
        if np.linalg.norm(left - basis @ within) <= max(
            ROUND_OFF * np.linalg.norm(found[:, rank:]), NOISE_RATIO * noise
        ):
            return np.asarray(result)
        rank *= 2
    unit = np.eye(start.shape[1])
    blocks = [
        of_columns(unit[:, first : first + BLOCK_COLUMNS]) for first in range(0, len(unit), BLOCK_COLUMNS)
    ]
    return np.concatenate([start[:, :0], *blocks], axis=1)
