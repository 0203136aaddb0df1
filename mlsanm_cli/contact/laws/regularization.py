"""The scales and small parameters of the smooth contact laws.

Equation (12) of docs/method.md.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mlsanm_cli.arrays import FloatArray


@dataclass(frozen=True)
class Regularization:
    """``eta`` (m,) pressures, ``delta`` (m,) lengths, and the reference pressure, gap, force and motion that
    scale residuals and unknowns; with friction a reference ``slip`` and the asperities' softness
    ``stick_compliance`` (n,), a length per traction."""

    eta: FloatArray
    delta: FloatArray
    pressure: float
    gap: float
    force: FloatArray
    motion: FloatArray
    slip: float = 0.0
    stick_compliance: FloatArray = field(default_factory=lambda: np.zeros(0))
    threshold: FloatArray = field(default_factory=lambda: np.zeros(0))
