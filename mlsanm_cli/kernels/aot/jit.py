"""How kernels are written, and how they come to run as machine code.

A kernel is a function of arrays and numbers with the decorator :func:`kernel`. Its annotations are types of
:mod:`.signature`, and it can be called for nothing else: ``Float2`` is a C-contiguous array
of two dimensions that it reads, ``FloatOut2`` one that it writes to (numba refuses to compile a kernel that
writes to another), ``tuple[Int1, int]`` a result. Functions that only kernels call are decorated with
:func:`inner`, take anything that numba can type, and are plain Python elsewhere. Kernels may call kernels and
inner functions of any module here, and BLAS as :mod:`mlsanm_cli.kernels.blas` has it. A module of kernels
needs no registration: those of this package are all found. ``f.__wrapped__`` is the Python function of a
kernel f, and with ``NUMBA_DISABLE_JIT=1`` in the environment every kernel is; runs, which also call BLAS from
kernels, are then refused.

The first process compiles all kernels with numba, proves in another process that the machine code can be
loaded without numba, and keeps it; later ones load it and never import numba. All that takes names of
numba's that are not public; where one of them is missing, or the proof fails, numba keeps the kernels in a
cache of its own, and every process imports numba. Where nothing can be kept, every process compiles, and
:class:`Loaded` says why.
"""

from __future__ import annotations

import functools
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
from mlsanm_cli.kernels.aot.machine import Code, Machine, UnloadableError
from mlsanm_cli.kernels.aot.signature import Signature

Function = TypeVar("Function", bound=Callable[..., Any])


DISABLED = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")


class Kernel:
    """A function that is called as machine code."""

    __wrapped__: Callable[..., Any]

    def __init__(self, function: Callable[..., Any]) -> None:
        self.name = f"{function.__module__}.{function.__name__}"
        self.signature = Signature.of(self.name, function)
        self._call: Callable[..., Any] | None = None
        functools.update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        if self._call is None:
            self._call = load().function(self)
        return self._call(*arguments)


class Inner:
    """A function for kernels to call."""

    __wrapped__: Callable[..., Any]

    def __init__(self, function: Callable[..., Any]) -> None:
        functools.update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        return self.__wrapped__(*arguments)


KERNELS: dict[str, Kernel] = {}
"""All kernels of the modules imported so far."""


def kernel(function: Function) -> Function:
    """Make a kernel of ``function``; it runs without the interpreter lock and without fast-math."""
    if DISABLED:
        return function
    made: Any = Kernel(function)
    KERNELS[made.name] = made
    return cast(Function, made)


def inner(function: Function) -> Function:
    """Let kernels call ``function``."""
    if DISABLED:
        return function
    return cast(Function, Inner(function))


@dataclass(frozen=True)
class Loaded:
    """The kernels of this process: kept at a ``place``, by numba itself where there is no ``machine``, or a
    ``note`` why they are not."""

    machine: Machine | None
    place: Path | None
    note: str = ""

    @classmethod
    def unkept(cls, machine: Machine | None, reason: object) -> Loaded:
        """Such as every process has to compile."""
        return cls(
            machine,
            None,
            f"compiled kernels cannot be kept ({reason}); every run compiles them again. "
            "Set MLSANM_CACHE_DIR to a directory that only you may write to.",
        )

    def function(self, kernel: Kernel) -> Callable[..., Any]:
        """A kernel as a Python function."""
        if self.machine is not None:
            return self.machine.function(kernel.name, kernel.signature)
        from mlsanm_cli.kernels.aot.compiler import in_process

        return in_process(kernel, self.place)


_lock = threading.RLock()
_loaded: list[Loaded] = []


def is_warm() -> bool:
    """Whether machine code is loaded, or there from an earlier run and loaded now.

    Raises RunError where the environment forbids it.
    """
    if DISABLED:
        raise RunError("NUMBA_DISABLE_JIT is set, and a run needs its kernels compiled", "unset it")
    with _lock:
        if not _loaded:
            _loaded.extend(_from_disk())
        return bool(_loaded)


def load() -> Loaded:
    """The kernels of this process, compiled if they have to be."""
    with _lock:
        if not is_warm():
            _loaded.append(_compiled())
        return _loaded[0]


def _from_disk() -> list[Loaded]:
    try:
        place = kept.directory()
        if kept.left_to_numba(place):
            return [Loaded(None, place)]
        code = kept.read(place)
        return [] if code is None else [Loaded(Machine(code), place)]
    except (ImportError, RuntimeError, UnloadableError):
        return []


def _compiled() -> Loaded:
    from mlsanm_cli.kernels.aot import compiler

    try:
        place = kept.directory()
    except RuntimeError as error:
        place, missing = None, error
    try:
        code = _compiled_apart(compiler.compiled, every_kernel())
        compiler.prove(code)
        machine = Machine(code)
    except UnloadableError as error:
        return _left_to_numba(place, error)
    if place is None:
        return Loaded.unkept(machine, missing)
    try:
        kept.write(place, code)
    except OSError as error:
        return Loaded.unkept(machine, error)
    return Loaded(machine, place)


def _left_to_numba(place: Path | None, reason: UnloadableError) -> Loaded:
    """Kernels in numba's own cache, if there is a place for it."""
    if place is None:
        return Loaded.unkept(None, reason)
    try:
        kept.leave_to_numba(place, str(reason))
    except OSError as error:
        return Loaded.unkept(None, f"{reason}; {error}")
    return Loaded(None, place, f"numba itself keeps the compiled kernels ({reason}); runs start more slowly")


def _compiled_apart(compiled: Callable[[Iterable[Kernel]], Code], kernels: Sequence[Kernel]) -> Code:
    """``compiled(kernels)`` in a thread of its own, which when interrupted ends before the next kernel.

    An interrupt that comes while LLVM calls Python, as it often does, would be printed and lost; while we
    wait, it is not.
    """
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
    """Those of all modules beside this package, in an order that does not depend on what was imported."""
    package = __name__.rsplit(".", 2)[0]
    for module in pkgutil.iter_modules([str(Path(__file__).parents[1])]):
        importlib.import_module(f"{package}.{module.name}")
    return [KERNELS[name] for name in sorted(KERNELS) if name.startswith(f"{package}.")]
