"""BLAS and LAPACK for kernels: scipy's own, called by address.

The names are symbols that machine code is linked with when it is loaded. Matrices are column-major in flat
arrays; slices of these tell where they begin. Scalars are arrays too.
"""

from __future__ import annotations

import ctypes
import importlib
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class External:
    """A function of one of scipy's modules that only kernels can call.

    Of its ``arguments``, all of them pointers, "c" are letters, "i" integers of 32 bits, "d" floating-point
    numbers.
    """

    module: str
    name: str
    arguments: str

    @property
    def symbol(self) -> str:
        """What machine code calls it."""
        return f"mlsanm_{self.name}"

    def address(self) -> int:
        """Where it is in this process."""
        capsule = importlib.import_module(f"scipy.linalg.{self.module}").__pyx_capi__[self.name]
        python = ctypes.pythonapi
        name = ctypes.PYFUNCTYPE(ctypes.c_char_p, ctypes.py_object)(("PyCapsule_GetName", python))
        pointer = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)(
            ("PyCapsule_GetPointer", python)
        )
        return int(pointer(capsule, name(capsule)))


dgemm: Any = External("cython_blas", "dgemm", "cciiiddididdi")
dsyrk: Any = External("cython_blas", "dsyrk", "cciiddiddi")
dtrsm: Any = External("cython_blas", "dtrsm", "cccciiddidi")
dpotrf: Any = External("cython_lapack", "dpotrf", "cidii")
dgemv: Any = External("cython_blas", "dgemv", "ciiddididdi")
dtrsv: Any = External("cython_blas", "dtrsv", "cccididi")
EXTERNALS: tuple[External, ...] = (dgemm, dgemv, dsyrk, dtrsm, dtrsv, dpotrf)
