"""Load factors of the stages of a case."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case


def stage_factors(case: Case) -> FloatArray:
    """Load factors (T + 1, L): zero initially, then the values at the end of every stage; factors not named
    are kept."""
    factors = [np.zeros(len(case.moved))]
    for stage in case.stage:
        factors.append(np.array([stage.get(n, old) for n, old in zip(case.moved, factors[-1], strict=True)]))
    return np.array(factors)


def factors_at(stages: FloatArray, position: float) -> FloatArray:
    """Load factors (L,) at a path position."""
    stage = min(int(position), len(stages) - 2)
    fraction = position - stage
    return np.asarray((1.0 - fraction) * stages[stage] + fraction * stages[stage + 1])
