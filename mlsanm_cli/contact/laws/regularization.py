"""Scales and parameters of the regularised contact laws.

Equation (12) of docs/method.md.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mlsanm_cli.arrays import FloatArray


@dataclass(frozen=True)
class Regularization:
    """Parameters ``eta`` (m,), pressures, and ``delta`` (m,), lengths, of the hyperbolic law, and reference
    values of pressure, gap, force and motion.

    With friction also a reference ``slip``, the asperities' ``stick_compliance`` (n,), length per traction,
    and the pressures ``threshold`` (n,) above which friction acts.
    """

    eta: FloatArray
    delta: FloatArray
    pressure: float
    gap: float
    force: FloatArray
    motion: FloatArray
    slip: float = 0.0
    stick_compliance: FloatArray = field(default_factory=lambda: np.zeros(0))
    threshold: FloatArray = field(default_factory=lambda: np.zeros(0))
