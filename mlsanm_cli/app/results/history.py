"""Contact pressures at any position of a stored path, from a row of run.h5 or the series of a step."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.app.results.path_lookup import SERIES, level_at
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.io.run_reader import RunData


def pressures_at(run: RunData, position: float) -> dict[str, FloatArray]:
    """Pressure (m,) of every contact at a path position.

    Raises RunError where the path does not reach the position, or where nothing is stored about it.
    """
    level = level_at(run, position)
    if level.how != SERIES:
        return {name: contact.pressure[level.row] for name, contact in run.contacts.items()}
    ends = np.cumsum([len(run.contacts[name].arc_length) for name in run.unilateral_contacts])
    found = dict(zip(run.unilateral_contacts, np.split(level.pressure, ends[:-1]), strict=True))
    for name, rows in run.maps["bonds"].items():
        found[name] = np.split(rows @ level.unknowns, 2)[0]
    return {name: found[name] for name in run.contacts}
