"""One step as run.h5 stores it, and the columns that writer and reader share."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Mapping

FORMAT = 1
PATH_COLUMNS: Mapping[str, type[np.generic]] = {
    "position": np.float64,
    "step_length": np.float64,
    "residual": np.float64,
    "order": np.int64,
    "factorizations": np.int64,
    "solves": np.int64,
    "seconds": np.float64,
}
CONTACT_COLUMNS: Mapping[str, type[np.generic]] = {
    "pressure": np.float64,
    "traction": np.float64,
    "gap": np.float64,
    "slip": np.float64,
    "status": np.int8,
}
PROBE_COLUMNS: Mapping[str, tuple[int, ...]] = {"displacement": (2,), "stress": (3,), "von_mises": ()}
CONTACT_TOTALS: Mapping[str, type[np.generic]] = {"dissipated_work": np.float64}

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class ContactRecord:
    """State of one contact at a step; every array is (m,) in the order of the slave nodes.

    ``pressure`` > 0 in compression; ``traction`` acts on the slave and ``slip`` is the slave's relative to
    the master, both along the tangent; ``status`` is int8: 0 open, 1 stick, 2 slip. ``dissipated_work`` is
    what friction has dissipated so far.
    """

    pressure: FloatArray
    traction: FloatArray
    gap: FloatArray
    slip: FloatArray
    status: NDArray[np.int8]
    dissipated_work: float = 0.0


@dataclass(frozen=True)
class ProbeRecord:
    """Displacement (2,), stress xx, yy, xy (3,) and von Mises stress at a probe."""

    displacement: FloatArray
    stress: FloatArray
    von_mises: float


@dataclass(frozen=True)
class StepRecord:
    """One row of /path and of every contact history; ``position`` is stage index + fraction.

    ``factors`` maps each load to its factor, ``resultants`` each load or support to the force (2,) that it
    exerts on its body, ``displacements`` each load that moves a platen to the platen's displacement (2,).
    """

    position: float
    step_length: float
    residual: float
    order: int
    factorizations: int
    solves: int
    seconds: float
    factors: Mapping[str, float]
    resultants: Mapping[str, FloatArray]
    contacts: Mapping[str, ContactRecord]
    displacements: Mapping[str, FloatArray] = field(default_factory=dict)
    probes: Mapping[str, ProbeRecord] = field(default_factory=dict)
