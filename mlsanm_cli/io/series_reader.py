"""Reader of one step's series in run.h5."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.errors import RunError
from mlsanm_cli.io.run_dir import RUN_FILE


def read_series(rundir: Path, step: int) -> tuple[Mapping[str, NDArray[np.float64]], Mapping[str, Any]]:
    """Arrays and attributes stored for ``step``; both empty for a step without a series.

    Raises RunError if run.h5 cannot be read.
    """
    file = rundir if rundir.is_file() else rundir / RUN_FILE
    try:
        with h5py.File(file, "r", locking=False) as root:
            path = f"series/{step}"
            if path not in root:
                return {}, {}
            group = root[path]
            return {name: data[...] for name, data in group.items()}, dict(group.attrs)
    except (OSError, KeyError, RuntimeError) as error:
        raise RunError(f"{file}: the series of step {step} cannot be read ({error})") from error
