"""Numbers and expressions of a case, evaluated at points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import ExpressionError, value_at
from mlsanm_cli.errors import CaseError, CaseProblem


@dataclass(frozen=True)
class AmountField:
    """The value of a ``key`` of the case: a number or an expression in x and y."""

    key: str
    amount: float | str

    def at(self, points: FloatArray) -> FloatArray:
        """Values (e,) at ``points`` (e, 2). Raises CaseError if an expression has no value there."""
        try:
            return amounts_at([self.amount], points)[:, 0]
        except ExpressionError as error:
            raise CaseError((CaseProblem(self.key, str(error)),)) from error


def amounts_at(amounts: Sequence[float | str], points: FloatArray) -> FloatArray:
    """Numbers and expressions (c,) at ``points`` (n, 2), as columns (n, c). Raises ExpressionError."""
    columns = [
        np.array([value_at(amount, x, y) for x, y in points.tolist()])
        if isinstance(amount, str)
        else np.full(len(points), amount)
        for amount in amounts
    ]
    return np.stack(columns, axis=1)
