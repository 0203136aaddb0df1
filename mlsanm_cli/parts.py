"""Neighbour search, triangles and shortest ways of scipy, without the rest of their packages.

`scipy.spatial` brings rotations, distances, special functions and physical constants along, and
`scipy.sparse.csgraph` the eigenvalue solvers; this takes longer than importing scipy's linear algebra.
"""

from __future__ import annotations

import importlib
import sys
import threading
from types import ModuleType
from typing import TYPE_CHECKING, Any

import scipy

__all__ = ["Delaunay", "cKDTree", "dijkstra"]


def _part(package: str, module: str, name: str) -> Any:
    """``name`` from ``package.module`` before ``package`` itself is loaded; else, as scipy means it, from
    ``package``: also where other threads could see the package half-made, or where scipy has moved it."""
    if package not in sys.modules and threading.active_count() == 1:
        stand_in = ModuleType(package)
        stand_in.__path__ = [f"{scipy.__path__[0]}/{package.removeprefix('scipy.').replace('.', '/')}"]
        sys.modules[package] = stand_in
        try:
            return getattr(importlib.import_module(f"{package}.{module}"), name)
        except (ImportError, AttributeError):
            pass
        finally:
            del sys.modules[package]
    return getattr(importlib.import_module(package), name)


if TYPE_CHECKING:
    from scipy.sparse.csgraph import dijkstra
    from scipy.spatial import Delaunay, cKDTree


_PARTS = {
    "cKDTree": ("scipy.spatial", "_ckdtree"),
    "Delaunay": ("scipy.spatial", "_qhull"),
    "dijkstra": ("scipy.sparse.csgraph", "_shortest_path"),
}


def __getattr__(name: str) -> Any:
    """A part, loaded when it is imported from here."""
    if name not in _PARTS:
        raise AttributeError(f"module {__name__} has no {name}")
    globals()[name] = found = _part(*_PARTS[name], name)
    return found
