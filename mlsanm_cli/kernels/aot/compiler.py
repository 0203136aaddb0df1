"""Compilation of kernels with numba; the only module that imports numba, see :mod:`.jit`."""

from __future__ import annotations

import functools
import os
import subprocess
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numba
from llvmlite import ir
from numba.extending import typeof_impl

from mlsanm_cli.kernels.aot import kept
from mlsanm_cli.kernels.aot.functions import Inner, Kernel
from mlsanm_cli.kernels.aot.machine import Code, UnloadableError
from mlsanm_cli.kernels.aot.signature import Value
from mlsanm_cli.kernels.blas import EXTERNALS, External

LETTERS = {"c": numba.uint8, "i": numba.int32, "d": numba.float64}
OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
NATIVE: dict[str, Any] = {**OPTIONS, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
PROOF = """
import sys
from mlsanm_cli.kernels.aot import kept, machine
machine.Machine(kept.decoded(sys.stdin.buffer.read()))
"""


@functools.cache
def _dispatcher(function: Callable[..., Any]) -> Any:
    """Numba dispatcher of a function without Python wrapper, and without specialisation for literal
    arguments."""
    dispatcher: Any = numba.njit(**NATIVE)(function)
    template: Any = getattr(dispatcher, "get_call_template", None)
    plain: Any = numba.types.unliteral
    if template is None:
        return dispatcher

    def get_call_template(args: tuple[Any, ...], kws: dict[str, Any]) -> Any:
        return template(tuple(map(plain, args)), {name: plain(one) for name, one in kws.items()})

    dispatcher.get_call_template = get_call_template
    return dispatcher


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


def _bind() -> None:
    for external in EXTERNALS:
        llvm.add_symbol(external.symbol, external.address())


def compiled(kernels: Iterable[Kernel]) -> Code:
    """Compile all ``kernels`` to one object file. Raises UnloadableError if this numba version does not
    expose it."""
    _bind()
    try:
        from numba.core import intrinsics

        results = {kernel.name: _compiled(kernel) for kernel in kernels}
        whole = llvm.parse_assembly("")
        for result in results.values():
            whole.link_in(result.library._final_module.clone())
        machine_code = next(iter(results.values())).library.codegen._tm.emit_object(whole)
        math = tuple(intrinsics.INTR_MATH)
    except (AttributeError, ImportError) as error:
        raise UnloadableError(
            f"numba {numba.__version__} does not expose its machine code: {error}"
        ) from error
    symbols = [one.name for one in whole.functions if one.is_declaration and not one.name.startswith("llvm.")]
    entries = {name: result.fndesc.llvm_func_name for name, result in results.items()}
    return Code(machine_code, entries, tuple(symbols), math)


def _compiled(kernel: Kernel) -> Any:
    """Numba's compilation result of a kernel."""
    dispatcher = _dispatcher(kernel.__wrapped__)
    types = tuple(_type(argument) for argument in kernel.signature.arguments)
    dispatcher.compile(types)
    result = dispatcher.overloads[types]
    _check_layout(kernel, types, result.signature.return_type)
    return result


def _check_layout(kernel: Kernel, types: tuple[Any, ...], result: Any) -> None:
    """Raise TypeError if a kernel returns another type than declared. Raises UnloadableError if numba's
    calling convention differs from ours."""
    from numba.core import registry

    parts = getattr(result, "types", (result,))
    found = [(getattr(part, "dtype", part), getattr(part, "ndim", 0)) for part in parts]
    declared = [(numba.from_dtype(value.dtype), value.ndim) for value in kernel.signature.results]
    if found != (declared or [(numba.types.none, 0)]):
        raise TypeError(f"{kernel.name} returns {result}")
    models = registry.cpu_target.target_context.data_model_manager
    passed = "".join(_kinds(models[one].get_argument_type()) for one in types)
    back = _kinds(models[result].get_return_type()) if declared else ""
    for kinds, values in ((passed, kernel.signature.arguments), (back, kernel.signature.results)):
        if kinds != "".join(value.kinds for value in values):
            raise UnloadableError(f"numba {numba.__version__} passes values as {kinds} to {kernel.name}")


def prove(code: Code) -> None:
    """Load the machine code in a new process, as LLVM aborts on failure; raises UnloadableError then."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", PROOF]
    data = kept.encoded(code)
    done = subprocess.run(command, input=data, env=environment, capture_output=True, check=False)
    if done.returncode != 0:
        reason = done.stderr.decode(errors="replace").strip().rpartition("\n")[2]
        raise UnloadableError(f"another process could not load them: {reason or done.returncode}")


def _kinds(layout: Any) -> str:
    """Kinds of the words that make up a value, in order."""
    if isinstance(layout, (tuple, list)):
        return "".join(_kinds(part) for part in layout)
    if isinstance(layout, ir.LiteralStructType):
        return _kinds(layout.elements)
    if isinstance(layout, ir.ArrayType):
        return "".join(layout.count * [_kinds(layout.element)])
    if isinstance(layout, ir.PointerType):
        return "p"
    return {"i64": "i", "double": "d"}.get(str(layout), "?")


def in_process(kernel: Kernel, place: Path | None = None) -> Callable[..., Any]:
    """A kernel called through numba, compiled for this process or cached by numba in ``place``. ``place``
    must depend on all sources: numba checks a function's own file only, not those it calls."""
    _bind()
    types = tuple(_type(one) for one in kernel.signature.arguments)
    dispatcher: Any = numba.njit(**OPTIONS)(kernel.__wrapped__)
    if place is not None:
        settings: Any = numba.config
        settings.CACHE_DIR = str(place)
        # Numba cannot cache functions without a file.
        with suppress(RuntimeError):
            dispatcher = numba.njit(**OPTIONS, cache=True)(kernel.__wrapped__)
    dispatcher.compile(types)
    # Otherwise numba would recompile a kernel that only reads an array for writable arguments.
    dispatcher.disable_compile()

    def call(*values: Any) -> Any:
        # Check arguments for the error message.
        list(kernel.signature.words(kernel.name, values))
        return dispatcher(*values)

    return call
