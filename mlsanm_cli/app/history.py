"""Contact pressures at any position of a stored path, from a row of run.h5 or the series of a step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation import Branch
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.run_reader import RunData
from mlsanm_cli.io.series_reader import read_series


def pressures_at(run: RunData, position: float) -> dict[str, FloatArray]:
    """Pressure (m,) of every contact at a path position.

    Raises RunError where the path does not reach the position, or where nothing is stored about it.
    """
    rows = run.path.position
    same = np.flatnonzero(rows == position)
    if len(same):
        return {name: contact.pressure[same[0]] for name, contact in run.contacts.items()}
    beyond = np.flatnonzero(rows > position)
    if not len(beyond) or not position >= rows[0]:
        raise RunError(f"{run.directory}: the path does not reach position {position:g}")
    arrays, attributes = read_series(run.directory, int(beyond[0]))
    if not arrays:
        raise RunError(
            f"{run.directory}: nothing is stored between positions {rows[beyond[0] - 1]:g} "
            f"and {rows[beyond[0]]:g}"
        )
    return _split(run, _pressure(arrays, attributes, position))


def _pressure(arrays: Mapping[str, FloatArray], attributes: Mapping[str, Any], position: float) -> FloatArray:
    branch = Branch(
        arrays["pressure"], arrays["position"], float(attributes["length"]), arrays.get("denominator")
    )
    pressure, _ = branch.evaluate(branch.parameter_at(position))
    return pressure


def _split(run: RunData, pressure: FloatArray) -> dict[str, FloatArray]:
    ends = np.cumsum([len(contact.arc_length) for contact in run.contacts.values()])
    return dict(zip(run.contacts, np.split(pressure, ends[:-1]), strict=True))
