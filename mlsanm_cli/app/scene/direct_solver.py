"""Direct solvers of the bodies' linear systems, by ``solver.linear``."""

from __future__ import annotations

from mlsanm_cli.case import Case
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.operators.linear.cholesky import CholeskySolver
from mlsanm_cli.operators.linear.engine import MissingEngineError
from mlsanm_cli.operators.linear.interface import DirectSolver
from mlsanm_cli.operators.linear.superlu import SuperLUSolver


def direct_solver(case: Case) -> DirectSolver:
    """The case's solver; CaseError, with what to install, where it belongs to a package that is missing."""
    kind = case.solver.linear
    if kind == "auto":
        return CholeskySolver()
    if kind == "superlu":
        return SuperLUSolver()
    try:
        if kind == "pardiso":
            from mlsanm_cli.operators.linear.pardiso import PardisoSolver

            return PardisoSolver()
        from mlsanm_cli.operators.linear.mumps import MumpsSolver

        return MumpsSolver()
    except MissingEngineError as error:
        problem = CaseProblem("solver.linear", f'"{kind}" {error}', hint=error.hint)
        raise CaseError((problem,)) from error
