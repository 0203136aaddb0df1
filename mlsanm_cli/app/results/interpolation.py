"""Estimated error of interpolation between two stored states."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.app.results.path_lookup import INTERPOLATED, Level
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.run_reader import RunData

MAX_ERROR = 0.25
"""Largest estimated error of interpolated values, relative to the largest of the two states."""

SAME_STAGE = 1e-12
"""Positions within this distance of the end of a stage belong to it."""
EDGE = 0.5
"""Errors shrink like this power of the distance of the states: pressures grow like the root of the distance
from an edge of contact, which moves with the load (Hertz: 0.120 of the peak there, 0.117 estimated)."""


def interpolation_error(position: FloatArray, history: FloatArray, row: int, share: float) -> float:
    """The estimated largest absolute error of the interpolation between two rows of a ``history`` (S+1, ...).

    ``share`` is the weight of ``row``, the rest that of the row before; ``position`` is (S+1,). The estimate
    is the error of adjacent stored rows, interpolated from their neighbours in the same stage, times a power
    of the ratio of distances. Infinite if a stage has fewer than three rows.
    """
    gap = position[row] - position[row - 1]
    found = []
    for middle in (row - 1, row):
        if not 1 <= middle < len(position) - 1:
            continue
        before, after = np.diff(position[middle - 1 : middle + 2])
        of_stage = np.ceil(position[middle : middle + 2] - SAME_STAGE)
        if of_stage[0] == of_stage[1] and before > 0.0 and after > 0.0:
            first, own, last = np.asarray(history[middle - 1 : middle + 2], dtype=np.float64)
            part = before / (before + after)
            missed = np.abs((1.0 - part) * first + part * last - own).max(initial=0.0)
            finer = share * (1.0 - share) * gap**2 / (before * after)
            found.append(float(finer ** (0.5 * EDGE) * missed))
    return max(found, default=np.inf)


def checked_error(run: RunData, level: Level, name: str, *histories: FloatArray) -> float | None:
    """The estimated error of interpolated ``histories`` (S+1, ...), called ``name``, relative to the largest
    value of the first in the adjacent rows; None if the level is not interpolated.

    Raises RunError if the error is too large or unknown.
    """
    if level.how != INTERPOLATED:
        return None
    position = np.asarray(run.path.position)
    before, after = position[level.row - 1 : level.row + 1]
    largest = float(np.abs(np.asarray(histories[0])[level.row - 1 : level.row + 1]).max(initial=0.0))
    missed = max(interpolation_error(position, one, level.row, level.share) for one in histories)
    error = missed / largest if missed else 0.0
    if error > MAX_ERROR:
        raise RunError(
            f"nothing is stored between positions {before:.6g} and {after:.6g}, "
            f"which are too far apart to interpolate {name}",
            f"run again with {level.position:g} in output.at, or with power series (law hyperbolic, method "
            f"anm), which give results everywhere",
        )
    return error
