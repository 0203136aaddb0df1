"""How kernels are written, compiled and loaded.

A kernel is a function of arrays and numbers decorated with :func:`kernel`. Its annotations, types of
:mod:`.signature`, are the only ones it accepts: ``Float2`` is a C-contiguous read-only array of two
dimensions, ``FloatOut2`` a writable one (numba refuses to compile a kernel that writes to others),
``tuple[Int1, int]`` a result. Functions that only kernels call are decorated with :func:`inner`; they accept
anything numba can type and are plain Python elsewhere. Kernels may call kernels and inner functions of any
module here, and BLAS through :mod:`mlsanm_cli.kernels.blas`. All kernel modules of this package are found
without registration. ``f.__wrapped__`` is the Python function of a kernel f; with ``NUMBA_DISABLE_JIT=1``
every kernel is plain Python, and runs, whose kernels also call BLAS, are refused.

The first process compiles all kernels, proves in another process that the machine code loads without numba,
and stores it; later ones load it and never import numba. This uses private names of numba; where one is
missing, or the proof fails, numba stores the kernels in its own cache, and every process imports numba. Where
nothing can be stored, every process compiles, and :class:`Loaded` gives the reason.
"""

from __future__ import annotations

import importlib
import os
import pkgutil
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, cast

from mlsanm_cli.errors import RunError
from mlsanm_cli.kernels.aot import kept
from mlsanm_cli.kernels.aot.functions import Inner, Kernel
from mlsanm_cli.kernels.aot.machine import Code, Machine, UnloadableError

Function = TypeVar("Function", bound=Callable[..., Any])


DISABLED = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")


KERNELS: dict[str, Kernel] = {}
"""Kernels of all modules imported so far, by name."""


def kernel(function: Function) -> Function:
    """Make ``function`` a kernel; it runs without the GIL and without fast-math."""
    if DISABLED:
        return function
    made: Any = Kernel(function, lambda one: load().function(one))
    KERNELS[made.name] = made
    return cast(Function, made)


def inner(function: Function) -> Function:
    """Make ``function`` callable from kernels."""
    if DISABLED:
        return function
    return cast(Function, Inner(function))


@dataclass(frozen=True)
class Loaded:
    """The kernels of this process: loaded as ``machine``, or through numba without it; stored in ``place``,
    or a ``note`` why they are not."""

    machine: Machine | None
    place: Path | None
    note: str = ""

    def function(self, kernel: Kernel) -> Callable[..., Any]:
        """A kernel as a Python function."""
        if self.machine is not None:
            return self.machine.function(kernel.name, kernel.signature)
        from mlsanm_cli.kernels.aot.compiler import in_process

        return in_process(kernel, self.place)


_lock = threading.RLock()
_loaded: list[Loaded] = []


def is_warm() -> bool:
    """Whether machine code is loaded, or stored by an earlier run and loaded now. Raises RunError if
    NUMBA_DISABLE_JIT is set."""
    if DISABLED:
        raise RunError("NUMBA_DISABLE_JIT is set, and a run needs its kernels compiled", "unset it")
    with _lock:
        if not _loaded:
            _loaded.extend(_from_disk())
        return bool(_loaded)


def load() -> Loaded:
    """The kernels of this process, compiled if necessary."""
    with _lock:
        if not is_warm():
            _loaded.append(_compiled())
        return _loaded[0]


def _from_disk() -> list[Loaded]:
    try:
        place = kept.directory()
        content = kept.read(place)
        if content is None:
            return []
        return [Loaded(Machine(content) if isinstance(content, Code) else None, place)]
    except (ImportError, RuntimeError, UnloadableError):
        return []


def _compiled() -> Loaded:
    from mlsanm_cli.kernels.aot import compiler

    content: Code | str
    machine, note = None, ""
    try:
        content = _compiled_apart(compiler.compiled, every_kernel())
        compiler.prove(content)
        machine = Machine(content)
    except UnloadableError as error:
        content = str(error)
        note = f"numba itself keeps the compiled kernels ({content}); runs start more slowly"
    try:
        place = kept.directory()
        kept.write(place, content)
    except (OSError, RuntimeError) as error:
        note = (
            f"compiled kernels cannot be kept ({error}); every run compiles them again. "
            "Set MLSANM_CACHE_DIR to a directory that only you may write to."
        )
        return Loaded(machine, None, note)
    return Loaded(machine, place, note)


def _compiled_apart(compiled: Callable[[Iterable[Kernel]], Code], kernels: Sequence[Kernel]) -> Code:
    """``compiled(kernels)`` in a thread, which ends before the next kernel when interrupted. An interrupt
    while LLVM calls back into Python would be printed and lost; in this waiting thread it is not."""
    from concurrent.futures import ThreadPoolExecutor

    waited = True

    def wanted() -> Iterator[Kernel]:
        for kernel in kernels:
            if not waited:
                raise KeyboardInterrupt
            yield kernel

    with ThreadPoolExecutor(1) as pool:
        code = pool.submit(compiled, wanted())
        try:
            return code.result()
        finally:
            waited = False


def every_kernel() -> list[Kernel]:
    """Kernels of all modules in this package, in an order independent of imports."""
    package = __name__.rsplit(".", 2)[0]
    for module in pkgutil.iter_modules([str(Path(__file__).parents[1])]):
        importlib.import_module(f"{package}.{module.name}")
    return [KERNELS[name] for name in sorted(KERNELS) if name.startswith(f"{package}.")]
