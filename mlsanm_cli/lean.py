"""A start that loads what a run needs and no more.

Importing any part of scipy brings in all of numpy, its Fortran compiler and its test tools too: scipy copies
numpy's names, and numpy loads a module when its name is asked for. That takes longer than importing numpy.
"""

from __future__ import annotations

import gc
import importlib
import importlib.util
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.machinery import PathFinder

SPARED = ("f2py", "testing", "ma", "ctypeslib", "polynomial")
"""Modules of numpy that are loaded when something in them is used."""


@contextmanager
def lean_imports() -> Iterator[None]:
    """Import within the block: numpy's spared modules wait, and nothing is searched for garbage.

    What was imported stays for good, so the collector need not look at it later either. Where numpy is there
    already, as in another program, nothing is changed.
    """
    if "numpy" in sys.modules:
        yield
        return
    # pydantic would read the metadata of all installed packages to look for plugins.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    collects = gc.isenabled()
    gc.disable()
    try:
        _spare()
        yield
    finally:
        gc.freeze()
        if collects:
            gc.enable()


def _spare() -> None:
    """Put modules that load themselves at their first use in the place of those that are spared."""
    numpy = importlib.import_module("numpy")
    for name in SPARED:
        full = f"numpy.{name}"
        spec = None if full in sys.modules else PathFinder.find_spec(full, numpy.__path__)
        if spec is None or spec.loader is None:
            continue
        spec.loader = importlib.util.LazyLoader(spec.loader)
        module = importlib.util.module_from_spec(spec)
        sys.modules[full] = module
        spec.loader.exec_module(module)
        setattr(numpy, name, module)
