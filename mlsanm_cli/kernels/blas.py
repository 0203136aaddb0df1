"""BLAS and LAPACK for kernels: scipy's own, called by address.

The names are symbols that compiled kernels are linked with, also where they come from the disk cache.
Matrices are column-major in flat arrays; slices of these tell where they begin. Scalars are arrays too.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding as llvm
import numba
from numba.extending import get_cython_function_address


def _function(module: str, name: str, arguments: str) -> Any:
    """A kernel's function; of its ``arguments`` "c" are letters, "i" integers, "d" floating-point numbers."""
    symbol = f"mlsanm_{name}"
    llvm.add_symbol(symbol, get_cython_function_address(f"scipy.linalg.{module}", name))
    pointer: Any = numba.types.CPointer
    pointers = {"c": numba.types.uint8, "i": numba.types.int32, "d": numba.types.float64}
    signature = numba.types.void(*(pointer(pointers[kind]) for kind in arguments))
    return numba.types.ExternalFunction(symbol, signature)


dgemv = _function("cython_blas", "dgemv", "ciiddididdi")
dtrsv = _function("cython_blas", "dtrsv", "cccididi")
dgemm = _function("cython_blas", "dgemm", "cciiiddididdi")
dsyrk = _function("cython_blas", "dsyrk", "cciiddiddi")
dtrsm = _function("cython_blas", "dtrsm", "cccciiddidi")
dpotrf = _function("cython_lapack", "dpotrf", "cidii")
