"""Machine code of all kernels in one object file, loaded by LLVM alone and called as C functions.

It follows numba's calling convention: pointers to the result and to the exception, then the arguments with
arrays unpacked; the return value is a status. It allocates through numba's runtime, a small extension module
loaded by path, since importing numba takes longer than most runs.
"""

from __future__ import annotations

import ctypes
import importlib.util
import os
import pickle
import struct
import sys
from collections.abc import Callable, Mapping
from importlib.machinery import PathFinder
from itertools import accumulate
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from mlsanm_cli.kernels.aot.signature import Kernel, Value
from mlsanm_cli.kernels.blas import EXTERNALS
from mlsanm_cli.records import dataclass

WORDS = {"p": ctypes.c_void_p, "i": ctypes.c_int64, "d": ctypes.c_double}
DONE = (0, -2)
"""Status codes of success: with a result, and with None."""


@dataclass(frozen=True)
class Code:
    """An ``object`` file and its ``entries``: symbol names by kernel names. ``symbols`` are the external
    functions it calls, ``math`` those of them that numba binds to mathematical functions."""

    object: bytes
    entries: Mapping[str, str]
    symbols: tuple[str, ...]
    math: tuple[str, ...]


class UnloadableError(Exception):
    """Machine code that this process cannot link."""


class _Owner:
    """Memory of an array returned by a kernel, released with the last view of it."""

    def __init__(self, interface: Mapping[str, Any], owner: int, release: Callable[[int], None]) -> None:
        self.__array_interface__ = interface
        self._owner, self._release = owner, release

    def __del__(self) -> None:
        self._release(self._owner)


def numba_root() -> str:
    """Installation directory of numba, without importing it. Raises UnloadableError if there is none."""
    spec = importlib.util.find_spec("numba")
    if spec is None or not spec.submodule_search_locations:
        raise UnloadableError("numba is not installed")
    return str(spec.submodule_search_locations[0])


def _extension(name: str) -> ModuleType:
    """An extension module of numba, loaded without numba."""
    if f"numba.{name}" in sys.modules:
        return sys.modules[f"numba.{name}"]
    parent, _, own = name.rpartition(".")
    spec = PathFinder.find_spec(own, [os.path.join(numba_root(), *parent.split("."))])
    if spec is None or spec.loader is None:
        raise UnloadableError(f"numba has no {name}")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Machine:
    """Loaded machine ``code``, stored in ``place``, or a ``note`` why it is not. Raises UnloadableError if an
    external function is missing."""

    def __init__(self, code: Code, place: Path | None = None, note: str = "") -> None:
        import llvmlite.binding as llvm

        self.place, self.note, self._entries = place, note, code.entries
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        runtime = _extension("core.runtime._nrt_python").c_helpers
        helpers = _extension("_helperlib").c_helpers
        known = {f"NRT_{name}": address for name, address in runtime.items()}
        known |= {f"numba_{name}": address for name, address in helpers.items()}
        known |= {one.symbol: one.address() for one in EXTERNALS if one.symbol in code.symbols}
        target = llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine()
        # First: LLVM knows the functions of the process only after this.
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target)
        for name in code.symbols:
            if name in known:
                llvm.add_symbol(name, known[name])
            elif llvm.address_of_symbol(name) is None:
                raise UnloadableError(f"there is no function {name}")
        for name in code.math:
            llvm.add_symbol(name, helpers[name])
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(code.object))
        self._engine.finalize_object()
        release = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
        self._release: Callable[[int], None] = release(runtime["MemInfo_release"])

    def function(self, kernel: Kernel) -> Callable[..., Any]:
        """A kernel as a Python function that checks its arguments and releases the GIL."""
        kinds = "".join(argument.kinds for argument in kernel.arguments)
        prototype = ctypes.CFUNCTYPE(ctypes.c_int32, *(WORDS[kind] for kind in "pp" + kinds))
        address = self._engine.get_function_address(self._entries[kernel.name])
        sizes = [len(one.kinds) for one in kernel.results]
        call, room = prototype(address), ctypes.c_int64 * max(1, sum(sizes))
        results = list(zip(kernel.results, accumulate(sizes, initial=0), strict=False))

        def called(*values: Any) -> Any:
            result, raised = room(), ctypes.c_void_p()
            status = call(ctypes.addressof(result), ctypes.addressof(raised), *kernel.words(values))
            if status not in DONE:
                raise _exception(kernel.name, status, raised.value)
            found = [self._result(value, result, at) for value, at in results]
            return tuple(found) if not kernel.single else found[0] if found else None

        return called

    def _result(self, result: Value, words: Any, at: int) -> Any:
        if result.ndim == 0:
            return ctypes.c_double.from_buffer(words, 8 * at).value if result.kinds == "d" else words[at]
        owner, ends = words[at], at + 5 + result.ndim
        interface = {
            "version": 3,
            "typestr": result.dtype.str,
            "data": (words[at + 4], False),
            "shape": tuple(words[at + 5 : ends]),
        }
        if not owner:
            # A view of an argument: copied, as the argument may be freed before it.
            return np.array(_Owner(interface, owner, lambda _: None))
        return np.asarray(_Owner(interface, owner, self._release))


def _exception(name: str, status: int, address: int | None) -> Exception:
    """The exception raised by a kernel, from numba's description: address and size of its pickled class,
    arguments and location, then addresses of arguments that are known at run time only."""
    if status < 1 or address is None:
        return SystemError(f"{name} ended with status {status}")
    pickled, size, _, _, dynamic = struct.unpack("PiPPi", ctypes.string_at(address, struct.calcsize("PiPPi")))
    kind, arguments, _ = pickle.loads(ctypes.string_at(pickled, size))
    return RuntimeError(f"{name}: {kind.__name__}") if dynamic else kind(*arguments)
