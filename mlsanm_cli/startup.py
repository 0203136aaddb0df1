"""Lazy imports that shorten the start of a command; the only module with import hooks and private names of
scipy.

Importing any part of scipy imports all of numpy, with f2py and its test tools, and scipy's packages around
its compiled modules take as long again: `scipy.spatial` imports rotations, distances and special functions,
`scipy.optimize` all minimisers. Within :func:`lean_imports` such packages are executed when a name is
accessed that their compiled modules do not have.
"""

from __future__ import annotations

import gc
import importlib
import os
import platform
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.abc import Loader, MetaPathFinder, SourceLoader
from importlib.machinery import ModuleSpec, PathFinder, SourcelessFileLoader
from types import ModuleType
from typing import Any

COMPILED = {
    "scipy.spatial": ("scipy.spatial._ckdtree", "scipy.spatial._qhull"),
    "scipy.sparse.csgraph": ("scipy.sparse.csgraph._traversal",),
    "scipy.linalg.blas": ("scipy.linalg._fblas",),
    "scipy.linalg.lapack": ("scipy.linalg._flapack",),
}
"""Compiled modules whose names are taken without executing the package around them."""
DEFERRED = frozenset(
    {
        *(f"numpy.{name}" for name in ("f2py", "testing", "ma", "ctypeslib", "polynomial")),
        *(*COMPILED, "scipy.linalg", "scipy.optimize"),
        *(f"scipy._lib.{name}" for name in ("array_api_compat.numpy", "array_api_extra")),
        # These only write or read docstrings.
        "numpy._core._add_newdocs",
        "numpy._core._add_newdocs_scalars",
        "pydoc",
        # Imports mail, archives and sockets, to find plugins of pydantic.
        "importlib.metadata",
    }
)
"""Modules whose code runs on first access; their submodules can be imported before."""


@contextmanager
def lean_imports() -> Iterator[None]:
    """A block of imports in which deferred modules are not executed, and the garbage collector is off.
    Imported objects are permanent, so they are excluded from later collections. If numpy has been imported
    already, as in another program, nothing is changed."""
    if "numpy" in sys.modules:
        yield
        return
    # pydantic would read the metadata of all installed packages to look for plugins.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    # h5py calls platform.uname, which would start a process to find the processor.
    vars(platform.uname())["processor"] = platform.machine()
    sys.meta_path.insert(0, _Deferring())
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if collects:
            gc.enable()


class _Deferring(MetaPathFinder, Loader):
    """Finds deferred modules, and creates them such that they load themselves on first access."""

    def __init__(self, loader: Any = None) -> None:
        self.loader = loader

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The spec of a deferred module; None for others, which are left to the next finder."""
        spec = PathFinder.find_spec(name, path, target) if name in DEFERRED else None
        # Compiled modules are created by their loaders and cannot be deferred.
        if spec is not None and isinstance(spec.loader, SourceLoader | SourcelessFileLoader):
            spec.loader = _Deferring(spec.loader)
        return spec

    def create_module(self, spec: ModuleSpec) -> None:
        """Default creation by the import system."""

    def exec_module(self, module: ModuleType) -> None:
        """Does not execute the code yet."""
        assert module.__spec__ is not None
        module.__spec__.loader = module.__loader__ = self.loader
        module.__class__ = _DeferredModule
        if module.__name__ == "numpy.ma":
            # Called by numpy's sets and scipy's triangulation; before numpy.ma has run there are no masked
            # arrays.
            vars(module).update(dict.fromkeys(("isMaskedArray", "is_masked"), lambda array: False))
        if module.__name__ == "importlib.metadata":
            # Imported by pydantic, which does not call it; the call executes the module, which replaces it.
            vars(module)["entry_points"] = lambda **given: (
                module.distribution and module.entry_points(**given)
            )


_loading: set[str] = set()
_lock = threading.RLock()


class _DeferredModule(ModuleType):
    """A module, or a package around others, whose code runs when a name is accessed that it lacks."""

    def __getattr__(self, name: str) -> Any:
        if name == "__path__":
            raise AttributeError(f"module {self.__name__} is no package")
        if self.__name__ not in _loading and not name.startswith("__"):
            if name.startswith("_") and "__path__" in vars(self):
                with suppress(ModuleNotFoundError):
                    return importlib.import_module(f"{self.__name__}.{name}")
            for part in COMPILED.get(self.__name__, ()):
                with suppress(ImportError, AttributeError):
                    return getattr(importlib.import_module(part), name)
        with _lock:
            # Unless another thread was first, or its own code accesses a name that is defined later.
            if type(self) is _DeferredModule and self.__name__ not in _loading:
                _loading.add(self.__name__)
                try:
                    assert self.__spec__ is not None
                    assert self.__spec__.loader is not None
                    self.__spec__.loader.exec_module(self)
                    self.__class__ = ModuleType  # type: ignore[assignment]
                finally:
                    _loading.discard(self.__name__)
        return ModuleType.__getattribute__(self, name)
