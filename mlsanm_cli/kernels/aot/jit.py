"""How kernels are written, compiled and loaded.

A kernel is a function of arrays and numbers decorated with :func:`kernel`. Its annotations, types of
:mod:`.signature`, are the only ones it accepts: ``Float2`` is a C-contiguous read-only array of two
dimensions, ``FloatOut2`` a writable one (numba refuses to compile a kernel that writes to others),
``tuple[Int1, int]`` a result. Functions that only kernels call are decorated with :func:`inner`; they accept
anything numba can type and are plain Python elsewhere. Kernels may call kernels and inner functions of any
module here, and BLAS through :mod:`mlsanm_cli.kernels.blas`. All kernel modules of this package are found
without registration. ``f.__wrapped__`` is the Python function of a kernel f.

The first process compiles all kernels and stores the machine code; later ones load it and never import numba.
Where nothing can be stored, every process compiles, and :attr:`.Machine.note` gives the reason.
"""

from __future__ import annotations

import importlib
import pkgutil
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

from mlsanm_cli.kernels.aot import kept
from mlsanm_cli.kernels.aot.machine import Machine, UnloadableError
from mlsanm_cli.kernels.aot.signature import Inner, Kernel

Function = TypeVar("Function", bound=Callable[..., Any])


KERNELS: dict[str, Kernel] = {}
"""Kernels of all modules imported so far, by name."""


def kernel(function: Function) -> Function:
    """Make ``function`` a kernel; it runs without the GIL and without fast-math."""
    made = Kernel(function, lambda own: load().function(own))
    KERNELS[made.name] = made
    return cast(Function, made)


def inner(function: Function) -> Function:
    """Make ``function`` callable from kernels."""
    return cast(Function, Inner(function))


_lock = threading.RLock()
_loaded: list[Machine] = []
"""The machine code of this process, once it is loaded."""


def is_warm() -> bool:
    """Whether machine code is loaded, or stored by an earlier run and loaded now."""
    with _lock:
        if not _loaded:
            try:
                place = kept.directory()
                code = kept.read(place)
                if code is not None:
                    _loaded.append(Machine(code, place))
            except (ImportError, RuntimeError, UnloadableError):
                # Code that this process cannot load is compiled anew.
                return False
        return bool(_loaded)


def load() -> Machine:
    """The kernels of this process, compiled if necessary."""
    with _lock:
        if not is_warm():
            from mlsanm_cli.kernels.aot.compiler import compiled

            code, place, note = compiled(every_kernel()), None, ""
            try:
                place = kept.directory()
                kept.write(place, code)
            except (OSError, RuntimeError) as error:
                place = None
                note = f"compiled kernels cannot be kept ({error}); every run compiles them again. "
                note += "Set MLSANM_CACHE_DIR to a directory that only you may write to."
            _loaded.append(Machine(code, place, note))
        return _loaded[0]


def every_kernel() -> list[Kernel]:
    """Kernels of all modules in this package, in an order independent of imports."""
    package = __name__.rsplit(".", 2)[0]
    for module in pkgutil.iter_modules([str(Path(__file__).parents[1])]):
        importlib.import_module(f"{package}.{module.name}")
    return [KERNELS[name] for name in sorted(KERNELS) if name.startswith(f"{package}.")]
