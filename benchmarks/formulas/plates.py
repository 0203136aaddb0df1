"""A cylinder squeezed between rigid plates (Johnson, Contact Mechanics, 1985, chapter 5)."""

from __future__ import annotations

import math

from mlsanm_cli.app.checks.references import HertzLine


def plates_approach(force: float, radius: float, modulus: float) -> float:
    """By how much two rigid plates come closer that squeeze a cylinder between them (Johnson, eq. 5.57).

    ``modulus`` is the cylinder's E/(1 - nu^2) in plane strain; a is the half-width on either side::

        approach = 2 P / (pi modulus) (2 ln(4 R / a) - 1)
    """
    width = HertzLine(force, radius, modulus).half_width
    return 2.0 * force / (math.pi * modulus) * (2.0 * math.log(4.0 * radius / width) - 1.0)
