"""PARDISO of Intel's MKL (Schenk and Gärtner 2004, doi:10.1016/j.future.2003.07.011), under our dissection.

Called as the one function of MKL that it is: what wraps it on PyPI keeps copies of the matrix.
"""

from __future__ import annotations

import ctypes
import weakref
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IndexArray, IntArray
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.operators.linear.dissection import nested_dissection
from mlsanm_cli.operators.linear.engine import MissingEngineError, installed, upper_triangle
from mlsanm_cli.operators.linear.fallback import verified_or_superlu
from mlsanm_cli.operators.linear.interface import Factor, Matrix, products_of_solutions
from mlsanm_cli.operators.linear.superlu import SuperLUSolver
from mlsanm_cli.values import dataclass

PACKAGE, EXTRA = "mkl", "mkl"
DEFINITE = 2
"""MKL's number for real symmetric positive definite matrices; its negative is for indefinite ones."""
ANALYSE, FACTORISE, SOLVE, RELEASE = 11, 22, 33, -1
NOT_DEFINITE = -4
Kept: TypeAlias = "tuple[IntArray, int, int, FloatArray, IndexArray, IndexArray, IndexArray, IndexArray]"
"""PARDISO's own, kind, n, entries, where rows begin, their columns, the order, options: what it must find
again."""
TROUBLES = {
    -2: "not enough memory",
    -3: "the order of elimination was refused",
    -8: "more entries than 32 bits count",
}


@lru_cache
def _library() -> tuple[Any, str]:
    """MKL and its version."""
    package = installed(PACKAGE, EXTRA)
    for file in package.files or ():
        if "mkl_rt." in file.name and file.suffix != ".lib":
            try:
                return ctypes.CDLL(str(package.locate_file(file))), package.version
            except OSError as error:
                raise MissingEngineError(PACKAGE, EXTRA) from error
    raise MissingEngineError(PACKAGE, EXTRA)


class Handle:
    """What PARDISO keeps of a matrix ``upper`` (n, n), of which the upper triangle is given, in sorted rows.

    It is released with this object. ``order`` (n,) tells which unknown is eliminated when.
    """

    def __init__(self, upper: sparse.csr_array, order: IntArray, kind: int = DEFINITE) -> None:
        options = np.zeros(64, dtype=np.int32)
        options[0] = 1  # these are no defaults
        options[4] = 1  # the order is given
        options[34] = 1  # counted from 0
        entries: FloatArray = np.ascontiguousarray(upper.data)
        pieces = (upper.indptr, upper.indices, order)
        begin, columns, turn = (np.ascontiguousarray(piece, dtype=np.int32) for piece in pieces)
        own = np.zeros(64, dtype=np.int64)
        self._matrix: Kept = (own, kind, upper.shape[0], entries, begin, columns, turn, options)
        self._nothing = np.zeros(1)
        self.size = upper.shape[0]
        weakref.finalize(self, _call, self._matrix, RELEASE, self._nothing, self._nothing, 1)

    def call(self, phase: int, rhs: FloatArray | None = None, solution: FloatArray | None = None) -> int:
        """Do one ``phase``, with a right-hand side and room for its solution, both (n, c) in columns, where
        it solves; PARDISO's number of what went wrong, 0 for nothing."""
        if rhs is None or solution is None:
            return _call(self._matrix, phase, self._nothing, self._nothing, 1)
        return _call(self._matrix, phase, rhs, solution, rhs.size // self.size)


def _call(matrix: Kept, phase: int, rhs: FloatArray, solution: FloatArray, columns: int) -> int:
    """MKL's own function."""
    kept, kind, size, values, indptr, indices, order, options = matrix
    error = ctypes.c_int32(0)
    _library()[0].pardiso(
        *(_at(kept), _number(1), _number(1), _number(kind), _number(phase), _number(size)),
        *(_at(values), _at(indptr), _at(indices), _at(order), _number(columns), _at(options)),
        *(_number(0), _at(rhs), _at(solution), ctypes.byref(error)),
    )
    return error.value


def _at(array: FloatArray | IntArray | IndexArray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _number(value: int) -> Any:
    return ctypes.byref(ctypes.c_int32(value))


@dataclass(frozen=True, eq=False)
class PardisoFactor:
    """A factor that PARDISO keeps."""

    handle: Handle
    note: str = ""

    def solve(self, rhs: FloatArray, transposed: bool = False) -> FloatArray:
        """Solution for (n,) or (n, c) right-hand sides; the matrix is its own transpose.

        Raises ValueError for another n, and NumericalError where memory is not enough.
        """
        if len(rhs) != self.handle.size:
            raise ValueError(f"{len(rhs)} rows for {self.handle.size} unknowns")
        if not rhs.size:
            return np.zeros(rhs.shape)
        columns = np.asfortranarray(rhs, dtype=float)
        solution = np.empty(rhs.shape, order="F")
        _refuse(self.handle.call(SOLVE, columns, solution))
        return np.ascontiguousarray(solution)

    def products(self, left: sparse.csr_array, right: sparse.csc_array) -> FloatArray:
        """``left`` (g, n) times the solutions for ``right`` (n, c).

        PARDISO has half solutions, but dense ones only: two of them are as much work as a whole one.
        """
        return products_of_solutions(self, left, right)


class PardisoSolver(SuperLUSolver):
    """PARDISO for definite and quasi-definite matrices, SuperLU for all others.

    Raises MissingEngineError where MKL is not installed.
    """

    def __init__(self) -> None:
        self.name = f"pardiso {_library()[1]}"

    def factor_definite(self, matrix: Matrix, points: FloatArray, negative: int = 0) -> Factor:
        """Factorise; SuperLU does it, with a note, if a pivot has the wrong sign or the factor is useless.

        Raises NumericalError where neither has a factor that solves, or memory is not enough.
        """
        nodes = nested_dissection(points, sparse.bsr_array(matrix, blocksize=(2, 2))).order
        upper = sparse.csr_array(upper_triangle(matrix))
        upper.sum_duplicates()
        kind = -DEFINITE if negative else DEFINITE
        handle = Handle(upper, np.stack([2 * nodes, 2 * nodes + 1], axis=1).ravel(), kind)
        _refuse(handle.call(ANALYSE))
        failed = handle.call(FACTORISE)
        if failed != NOT_DEFINITE:
            _refuse(failed)
        return verified_or_superlu(None if failed else PardisoFactor(handle), matrix, points)


def _refuse(error: int) -> None:
    if error:
        raise NumericalError(
            f"PARDISO failed: {TROUBLES.get(error, f'its error {error}')}", 'try solver.linear = "auto"'
        )
