"""Compilation of kernels with numba; the only module that imports numba, see :mod:`.jit`."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from typing import Any

import llvmlite.binding as llvm
import numba
from numba.extending import typeof_impl

from mlsanm_cli.errors import RunError
from mlsanm_cli.kernels.aot.machine import Code
from mlsanm_cli.kernels.aot.signature import Inner, Kernel, Value
from mlsanm_cli.kernels.blas import EXTERNALS, External

LETTERS = {"c": numba.uint8, "i": numba.int32, "d": numba.float64}
OPTIONS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
}


@functools.cache
def _dispatcher(function: Callable[..., Any]) -> Any:
    """Numba dispatcher of a function without wrapper and specialisation for literal arguments."""
    made: Any = numba.njit(**OPTIONS)(function)
    specialised = made.get_call_template

    def plain(arguments: Any, keywords: Any) -> Any:
        return specialised(tuple(map(numba.types.unliteral, arguments)), keywords)

    made.get_call_template = plain
    return made


@typeof_impl.register(Inner)
def _typeof_function(value: Inner, context: object) -> Any:
    return numba.types.Dispatcher(_dispatcher(value.__wrapped__))


@typeof_impl.register(External)
def _typeof_external(value: External, context: object) -> Any:
    pointer: Any = numba.types.CPointer
    pointers = (pointer(LETTERS[letter]) for letter in value.arguments)
    return numba.types.ExternalFunction(value.symbol, numba.types.void(*pointers))


def _type(value: Value) -> Any:
    scalar = numba.from_dtype(value.dtype)
    if value.ndim == 0:
        return scalar
    return numba.types.Array(scalar, value.ndim, "C", readonly=not value.written)


def compiled(kernels: Iterable[Kernel]) -> Code:
    """Compile ``kernels`` to one object file."""
    for external in EXTERNALS:
        llvm.add_symbol(external.symbol, external.address())
    try:
        from numba.core import intrinsics

        results = {kernel.name: _result(kernel) for kernel in kernels}
        whole = llvm.parse_assembly("")
        for result in results.values():
            whole.link_in(result.library._final_module.clone())
        machine_code = next(iter(results.values())).library.codegen._tm.emit_object(whole)
        math = tuple(intrinsics.INTR_MATH)
    except (AttributeError, ImportError) as error:
        message = f"numba {numba.__version__} does not expose its machine code: {error}"
        raise RunError(message, "install another version of numba") from error
    symbols = [used.name for used in whole.functions if used.is_declaration]
    entries = {name: result.fndesc.llvm_func_name for name, result in results.items()}
    external_symbols = tuple(name for name in symbols if not name.startswith("llvm."))
    return Code(machine_code, entries, external_symbols, math)


def _result(kernel: Kernel) -> Any:
    """Numba's compilation result of a kernel. Raises TypeError if it returns another type than declared."""
    dispatcher = _dispatcher(kernel.__wrapped__)
    types = tuple(map(_type, kernel.arguments))
    dispatcher.compile(types)
    result = dispatcher.overloads[types]
    returned = result.signature.return_type
    parts = getattr(returned, "types", (returned,))
    layout = [(getattr(part, "dtype", part), getattr(part, "ndim", 0)) for part in parts]
    declared = [(numba.from_dtype(value.dtype), value.ndim) for value in kernel.results]
    if layout != (declared or [(numba.types.none, 0)]):
        raise TypeError(f"{kernel.name} returns {returned}")
    return result
