"""The direct solver of the linear systems, by ``solver.linear``."""

from __future__ import annotations

from mlsanm_cli.case import Case
from mlsanm_cli.operators.linear.cholesky import CholeskySolver
from mlsanm_cli.operators.linear.interface import DirectSolver
from mlsanm_cli.operators.linear.superlu import SuperLUSolver


def direct_solver(case: Case) -> DirectSolver:
    """The solver selected by a case."""
    return SuperLUSolver() if case.solver.linear == "superlu" else CholeskySolver()
