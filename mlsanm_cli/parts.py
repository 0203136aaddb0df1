"""Neighbour search, triangles, connected parts, roots and LAPACK of scipy without the rest of the packages.

`scipy.spatial` brings rotations, distances, special functions and physical constants along,
`scipy.sparse.csgraph` the eigenvalue solvers, `scipy.optimize` all minimisers, and `scipy.linalg` decorates
each of its functions; this takes longer than importing numpy. Where imports are lean (see
:mod:`mlsanm_cli.lean`) the modules that hold these parts come without their packages, elsewhere with them.
What is not used by every run is imported where it is used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__all__ = [
    "Delaunay",
    "brentq",
    "cKDTree",
    "connected_components",
    "dgecon",
    "dgeqp3",
    "dgetrf",
    "dgetrs",
    "dpotrf",
    "dpotrs",
]

if TYPE_CHECKING:
    from scipy.linalg.lapack import dgecon, dgeqp3, dgetrf, dgetrs, dpotrf, dpotrs
    from scipy.optimize import brentq
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import Delaunay, cKDTree


_LAPACK = ("scipy.linalg._flapack", "scipy.linalg.lapack")
_PARTS = {
    "cKDTree": ("scipy.spatial._ckdtree", "scipy.spatial"),
    "Delaunay": ("scipy.spatial._qhull", "scipy.spatial"),
    "brentq": ("scipy.optimize._zeros_py", "scipy.optimize"),
    "connected_components": ("scipy.sparse.csgraph._traversal", "scipy.sparse.csgraph"),
    **dict.fromkeys(("dgecon", "dgeqp3", "dgetrf", "dgetrs", "dpotrf", "dpotrs"), _LAPACK),
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
