"""BLAS and LAPACK for kernels: scipy's own functions, called by address. Machine code is linked to the
symbols when it is loaded. Matrices are column-major parts of flat arrays, passed as slices that begin at
their first entry. Scalars are passed as arrays."""

from __future__ import annotations

import ctypes
import importlib
import re
from typing import Any

from mlsanm_cli.errors import RunError
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class External:
    """A function of a scipy module that only kernels can call. ``arguments`` has one letter per pointer: "c"
    characters, "i" 32-bit integers, "d" doubles."""

    module: str
    name: str
    arguments: str

    @property
    def symbol(self) -> str:
        """Symbol name in machine code."""
        return f"mlsanm_{self.name}"

    def address(self) -> int:
        """Address in this process. Raises RunError if the argument types differ, for instance with 64-bit
        integers: calls through pointers would not detect that."""
        capsule = importlib.import_module(f"scipy.linalg.{self.module}").__pyx_capi__[self.name]
        python = ctypes.pythonapi
        name = ctypes.PYFUNCTYPE(ctypes.c_char_p, ctypes.py_object)(("PyCapsule_GetName", python))
        pointer = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)(
            ("PyCapsule_GetPointer", python)
        )
        declared = name(capsule)
        if _kinds(declared.decode()) != self.arguments:
            version = importlib.import_module("scipy").__version__
            message = f"scipy {version} has a {self.name} that kernels cannot call: {declared.decode()}"
            raise RunError(message, "install another version of scipy")
        return int(pointer(capsule, declared))


def _kinds(declared: str) -> str:
    """Argument letters of a Cython declaration; "?" for anything but pointers to the three known types."""
    result, _, arguments = declared.removesuffix(")").partition(" (")
    kinds = {"char *": "c", "int *": "i", "double *": "d"}
    found = (kinds.get(re.sub(r"__pyx_t_\w+_d\b", "double", one), "?") for one in arguments.split(", "))
    return "".join(found) if result == "void" else "?"


dgemm: Any = External("cython_blas", "dgemm", "cciiiddididdi")
dsyrk: Any = External("cython_blas", "dsyrk", "cciiddiddi")
dtrsm: Any = External("cython_blas", "dtrsm", "cccciiddidi")
dpotrf: Any = External("cython_lapack", "dpotrf", "cidii")
dgetrf: Any = External("cython_lapack", "dgetrf", "iidiii")
dgemv: Any = External("cython_blas", "dgemv", "ciiddididdi")
dtrsv: Any = External("cython_blas", "dtrsv", "cccididi")
EXTERNALS: tuple[External, ...] = (dgemm, dgemv, dsyrk, dtrsm, dtrsv, dpotrf, dgetrf)
