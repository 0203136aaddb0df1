"""MUMPS (Amestoy et al. 2001, doi:10.1137/S0895479899358194) with its factor on disk.

For bodies whose factor is too large for memory: it is written while it is made, and read once for every block
of right-hand sides. Its directory is made where temporary files belong (TMPDIR), and goes with the factor.
"""

from __future__ import annotations

import os
import shutil
import tempfile
import weakref
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.operators.linear.engine import MissingEngineError, installed, upper_triangle
from mlsanm_cli.operators.linear.fallback import verified_or_superlu
from mlsanm_cli.operators.linear.interface import BLOCK, Factor, Matrix, products_of_solutions
from mlsanm_cli.operators.linear.superlu import SuperLUSolver
from mlsanm_cli.values import dataclass

if TYPE_CHECKING:
    from mumps import Context

PACKAGE = ("python-mumps", "mumps", "MUMPS's own libraries, as in Debian's libmumps-seq-dev")
"""The package, the extra of ours that names it, and what its installation wants."""
DIRECTORY = "MUMPS_OOC_TMPDIR"
"""Where MUMPS writes, read when it begins to."""
ORDERING = "auto"
"""By its size. PORD alone would be 3 % better on clouds, but ends the process for a single node."""
COLUMNS, SINGULAR = 27, (-6, -10)
"""MUMPS's numbers: the control of how many columns are solved together, and errors of singular matrices."""


@dataclass(frozen=True, eq=False)
class MumpsFactor:
    """A factor on disk, in ``directory``; ``size`` n."""

    context: Context
    directory: str
    size: int
    note: str = ""

    def solve(self, rhs: FloatArray, transposed: bool = False) -> FloatArray:
        """Solution for (n,) or (n, c) right-hand sides; the matrix is its own transpose.

        Raises ValueError for another n, and NumericalError where MUMPS fails.
        """
        if len(rhs) != self.size:
            raise ValueError(f"{len(rhs)} rows for {self.size} unknowns")
        if not rhs.size:
            return np.zeros(rhs.shape)
        try:
            solution = self.context.solve(np.array(rhs, dtype=float, order="F"), overwrite_b=True)
        except RuntimeError as error:
            raise _failure(error, self.directory) from error
        return np.ascontiguousarray(solution)

    def products(self, left: sparse.csr_array, right: sparse.csc_array) -> FloatArray:
        """``left`` (g, n) times the solutions for ``right`` (n, c), whole ones: MUMPS has no halves."""
        return products_of_solutions(self, left, right)


class MumpsSolver(SuperLUSolver):
    """MUMPS for definite and quasi-definite matrices, SuperLU for all others.

    Raises MissingEngineError where it is not installed.
    """

    def __init__(self) -> None:
        self.name = f"mumps {installed(*PACKAGE).version}"
        try:
            import mumps  # noqa: F401
        except ImportError as error:
            raise MissingEngineError(*PACKAGE) from error

    def factor_definite(self, matrix: Matrix, points: FloatArray, negative: int = 0) -> Factor:
        """Factorise; SuperLU does it, with a note, if a pivot has the wrong sign or the factor is useless.

        Raises NumericalError where neither has a factor that solves, or memory or disk are not enough.
        """
        if matrix.shape[0] != 2 * len(points):
            raise ValueError(f"a graph of {matrix.shape[0] // 2} vertices for {len(points)} points")
        return verified_or_superlu(_factor(matrix, 2 * negative), matrix, points)


def _factor(matrix: Matrix, negative: int) -> MumpsFactor | None:
    """The factor, none of a matrix that is singular or has not as many ``negative`` pivots."""
    from mumps import Context

    directory = tempfile.mkdtemp(prefix="mlsanm-mumps-")
    context = Context()
    weakref.finalize(context, shutil.rmtree, directory, ignore_errors=True)
    before = os.environ.get(DIRECTORY)
    os.environ[DIRECTORY] = directory
    try:
        context.set_matrix(upper_triangle(matrix), overwrite_a=True, symmetric=True)
        context.mumps_instance.icntl[COLUMNS] = BLOCK
        # No pivoting, which a quasi-definite matrix does not need.
        context.factor(ordering=ORDERING, ooc=True, pivot_tol=0.0)
    except RuntimeError as error:
        if getattr(error, "error", 0) in SINGULAR:
            return None
        raise _failure(error, directory) from error
    finally:
        if before is None:
            del os.environ[DIRECTORY]
        else:
            os.environ[DIRECTORY] = before
    found = context.mumps_instance.infog[12]
    return MumpsFactor(context, directory, matrix.shape[0]) if found == negative else None


def _failure(error: RuntimeError, directory: str) -> NumericalError:
    return NumericalError(
        f"MUMPS failed: {error}",
        f"its files are in {directory}; TMPDIR names another place for them, if there is no room",
    )
