"""Contact values in the units of a condensed scene, and their linear response at a fixed status."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.complementarity.basis import Basis
from mlsanm_cli.contact.complementarity.problem import ContactStatus, Problem
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.records import dataclass


@dataclass(frozen=True, eq=False)
class ContactSolution:
    """Pressures (m,), tractions (n,), motions (k,), gaps (m,) and slips (n,), or their rates."""

    pressure: FloatArray
    traction: FloatArray
    motion: FloatArray
    gap: FloatArray
    slip: FloatArray

    @classmethod
    def unscaled(cls, problem: Problem, x: FloatArray, w: FloatArray) -> ContactSolution:
        """Values for scaled unknowns and rows of a problem."""
        unknowns, rows = problem.columns * x, w / problem.rows
        m, count = problem.m, problem.contacts
        return cls(unknowns[:m], unknowns[m:count], unknowns[count:], rows[:m], rows[m:count])


class Linearised:
    """The linear equations of a ``status``. Motions that it does not resist are held. Raises
    SingularError."""

    def __init__(self, condensed: Condensed, status: ContactStatus) -> None:
        self._problem = condensed.problem
        self._basis = Basis(condensed.problem, status)

    @property
    def holds(self) -> bool:
        """Whether some motions are not resisted."""
        return bool(self._basis.held.size)

    def response(self, gap: FloatArray, slip: FloatArray, imbalance: FloatArray) -> ContactSolution:
        """Response to imposed gaps (m,), slips (n,) and force imbalance (k,) without that on held motions."""
        p = self._problem
        free = self._basis.undriven(p.rows * np.concatenate([gap, slip, imbalance]))
        return ContactSolution.unscaled(p, *self._basis.solve(free, np.zeros(len(free))))
