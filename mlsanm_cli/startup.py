"""A start that loads what a run needs and no more: all that knows import hooks and private names of scipy.

Importing any part of scipy brings in all of numpy, its Fortran compiler and its test tools too: scipy copies
numpy's names, and numpy loads a module when its name is asked for. That takes longer than importing numpy.
The packages of scipy around its compiled modules take as long again: `scipy.spatial` brings rotations,
distances, special functions and physical constants along, `scipy.sparse.csgraph` the eigenvalue solvers,
`scipy.optimize` all minimisers, and `scipy.linalg` decorates each of its functions. So within
:func:`lean_imports` such packages wait until something in them is asked for, and neighbour search, triangles,
connected parts and LAPACK are imported from here: where imports are lean the modules that hold these
parts come without their packages, elsewhere with them. What is not used by every run is imported where it is
used.
"""

from __future__ import annotations

import atexit
import gc
import importlib
import importlib.util
import os
import platform
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.abc import Loader, MetaPathFinder, SourceLoader
from importlib.machinery import ModuleSpec, PathFinder, SourcelessFileLoader
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scipy.linalg.lapack import dgecon, dgeqp3, dgetrf, dgetrs, dgtsv, dpotrf, dpotrs
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import Delaunay, cKDTree


__all__ = [
    "Delaunay",
    "cKDTree",
    "connected_components",
    "dgecon",
    "dgeqp3",
    "dgetrf",
    "dgetrs",
    "dgtsv",
    "dpotrf",
    "dpotrs",
    "lean_imports",
]

_LAPACK = ("scipy.linalg._flapack", "scipy.linalg.lapack")
_PARTS = {
    "cKDTree": ("scipy.spatial._ckdtree", "scipy.spatial"),
    "Delaunay": ("scipy.spatial._qhull", "scipy.spatial"),
    "connected_components": ("scipy.sparse.csgraph._traversal", "scipy.sparse.csgraph"),
    **dict.fromkeys(("dgecon", "dgeqp3", "dgetrf", "dgetrs", "dgtsv", "dpotrf", "dpotrs"), _LAPACK),
}
"""Where each part is in the versions of scipy that we know, and where scipy says that it is."""


def __getattr__(name: str) -> Any:
    """A part, loaded when it is imported from here."""
    if name not in _PARTS:
        raise AttributeError(f"module {__name__} has no {name}")
    known, public = _PARTS[name]
    try:
        found = getattr(importlib.import_module(known), name)
    except (ImportError, AttributeError):
        found = getattr(importlib.import_module(public), name)
    globals()[name] = found
    return found


SPARED = frozenset(
    {
        *(f"numpy.{name}" for name in ("f2py", "testing", "ma", "ctypeslib", "polynomial")),
        *(f"scipy.{name}" for name in ("linalg", "optimize", "spatial", "sparse.csgraph")),
        # These only write docstrings, or read them.
        "numpy._core._add_newdocs",
        "numpy._core._add_newdocs_scalars",
        "pydoc",
        # Metadata of packages as mail, which brings sockets along; pydantic and we only look for packages.
        "importlib.metadata._adapters",
    }
)
"""Modules whose code runs when something in them is used; what packages contain can be imported before."""


@contextmanager
def lean_imports() -> Iterator[None]:
    """Import within the block: from here on spared modules wait, and nothing is searched for garbage.

    What was imported stays for good, so the collector need not look at it later either; nor at anything when
    the process ends, which gives all back. Where numpy is there already, as in another program, nothing is
    changed.
    """
    if "numpy" in sys.modules:
        yield
        return
    # pydantic would read the metadata of all installed packages to look for plugins.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    # h5py asks for the machine's name, and is told the processor's too, for which a process would be started.
    vars(platform.uname())["processor"] = platform.machine()
    sys.meta_path.insert(0, _Sparing())
    atexit.register(gc.freeze)
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if collects:
            gc.enable()


class _Sparing(MetaPathFinder):
    """Finds spared modules where they are, and has them wait."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """That of a spared module; None for others, which are left to the next finder."""
        spec = PathFinder.find_spec(name, path, target) if name in SPARED else None
        # Compiled modules are made by their loaders, and cannot be made before they are loaded.
        if spec is not None and isinstance(spec.loader, SourceLoader | SourcelessFileLoader):
            spec.loader = _Patient(spec.loader)
        return spec


class _Patient(Loader):
    """Makes modules that load themselves with another ``loader`` when they are used."""

    def __init__(self, loader: Loader) -> None:
        self.loader = loader

    def create_module(self, spec: ModuleSpec) -> None:
        """Leaves it to the import system, as loaders of Python's own code do."""

    def exec_module(self, module: ModuleType) -> None:
        """Does not run the code yet."""
        assert module.__spec__ is not None
        module.__spec__.loader = module.__loader__ = self.loader
        module.__class__ = _Waiting
        if module.__name__ == "numpy.ma":
            # numpy's sets and scipy's triangles ask; before their module has run there are no masked arrays.
            vars(module).update(dict.fromkeys(("isMaskedArray", "is_masked"), lambda array: False))


_loading: set[str] = set()
_lock = threading.RLock()


class _Waiting(ModuleType):
    """A module whose code runs when a name is asked for that it does not have.

    ``importlib.util.LazyLoader`` makes modules that run it for every name, and so packages that cannot have
    modules imported from them before.
    """

    def __getattr__(self, name: str) -> Any:
        own = f"{self.__name__}.{name}"
        private = name.startswith("_") and not name.startswith("__")
        if private and "__path__" in vars(self) and importlib.util.find_spec(own) is not None:
            return importlib.import_module(own)
        with _lock:
            # Unless another thread was first, or its own code asks for a name that comes later.
            if type(self) is _Waiting and self.__name__ not in _loading:
                _loading.add(self.__name__)
                try:
                    assert self.__spec__ is not None
                    assert self.__spec__.loader is not None
                    self.__spec__.loader.exec_module(self)
                    self.__class__ = ModuleType  # type: ignore[assignment]
                finally:
                    _loading.discard(self.__name__)
        return ModuleType.__getattribute__(self, name)
