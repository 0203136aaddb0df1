"""Stresses below a Hertz line contact (McEwen 1949, as given by Johnson, Contact Mechanics, 1985, chapter 4,
doi:10.1017/CBO9781139171731)."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.reference.hertz import HertzLine


def stress_below(hertz: HertzLine, x: FloatArray, z: FloatArray) -> FloatArray:
    """Stresses (n, 3) in the order xx, zz, xz at depth z > 0."""
    a, p0 = hertz.half_width, hertz.peak_pressure
    s = a**2 - x**2 + z**2
    root = np.sqrt(s**2 + 4.0 * x**2 * z**2)
    m = np.sqrt(0.5 * (root + s))
    n = np.copysign(np.sqrt(np.maximum(0.5 * (root - s), 0.0)), x)
    ratio = (z**2 + n**2) / (m**2 + n**2)
    xx = -(p0 / a) * (m * (1.0 + ratio) - 2.0 * z)
    zz = -(p0 / a) * m * (1.0 - ratio)
    xz = -(p0 / a) * n * (m**2 - z**2) / (m**2 + n**2)
    return np.stack([xx, zz, xz], axis=1)
