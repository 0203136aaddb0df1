"""Round-off: relative differences below which computed numbers are equal, or zero.

Doubles have a relative precision of 2.2e-16. What a computation leaves of it depends on the condition of
its steps only, so that a few kinds are enough; each is applied relative to the size of what is compared.
"""

from __future__ import annotations

import sys

LAST_DIGITS = 4.0 * sys.float_info.epsilon
"""Of roots of functions of one variable."""

FINE_ROUND_OFF = 1e-12
"""Of sums, products and roots of up to some thousand numbers: parameters of paths, directions, integrals."""

ROUND_OFF = 1e-9
"""Of places on curves, and of solutions of equations with condition numbers up to 1e6: forces, gaps."""

COARSE_ROUND_OFF = 1e-6
"""Of data with six digits, such as coordinates in files, and of solutions of equations of thin bodies."""
