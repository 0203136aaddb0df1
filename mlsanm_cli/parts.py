"""Neighbour search, triangles, shortest ways and roots of scipy, without the rest of their packages.

`scipy.spatial` brings rotations, distances, special functions and physical constants along,
`scipy.sparse.csgraph` the eigenvalue solvers, and `scipy.optimize` all minimisers; this takes longer than
importing scipy's linear algebra. What is not used by every run is imported where it is used.
"""

from __future__ import annotations

import importlib
import sys
import threading
from types import ModuleType
from typing import TYPE_CHECKING, Any

import scipy

__all__ = ["Delaunay", "brentq", "cKDTree", "dijkstra"]


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
    from scipy.optimize import brentq
    from scipy.sparse.csgraph import dijkstra
    from scipy.spatial import Delaunay, cKDTree


_PARTS = {
    "cKDTree": ("scipy.spatial", "_ckdtree"),
    "Delaunay": ("scipy.spatial", "_qhull"),
    "brentq": ("scipy.optimize", "_zeros_py"),
    "dijkstra": ("scipy.sparse.csgraph", "_shortest_path"),
}


def __getattr__(name: str) -> Any:
    """A part, loaded when it is imported from here."""
    if name not in _PARTS:
        raise AttributeError(f"module {__name__} has no {name}")
    globals()[name] = found = _part(*_PARTS[name], name)
    return found
