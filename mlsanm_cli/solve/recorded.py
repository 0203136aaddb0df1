"""What a run keeps of its steps to go on from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.solve.checkpoint import Start
from mlsanm_cli.solve.state import Polish, State

PATH, CLOUDS = "path", "clouds"
"""Names of what a run goes on from, in run.h5."""


@dataclass(frozen=True)
class Recorded:
    """What a run knows of its steps so far, the last state included, and the ``mark`` of its path, packed.

    With the clouds, packed too where they were refined, it is the checkpoint that `mlsanm resume` goes on
    from. Nothing in it varies from run to run.
    """

    last: State
    length: float
    rows: int
    saved: int
    iterations: int
    factorizations: int
    solves: int
    residual: float
    linear_residual: float | None
    cone: Mapping[str, float]
    polished: tuple[Polish, ...]
    warnings: tuple[str, ...]
    mark: NDArray[np.uint8]

    @property
    def start(self) -> Start:
        """Where the path goes on."""
        return Start(self.rows, self.mark.tobytes())


@dataclass(frozen=True)
class Earlier:
    """What an earlier process left of a run: its steps, if there are any, and the seconds they took."""

    recorded: Recorded | None
    seconds: float
