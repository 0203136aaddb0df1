"""The one decorator through which kernels are compiled, and the place their machine code is kept.

numba's disk cache does not notice that a callee in another file has changed, so kernels that call each
other share a file and the cache directory carries a hash of every kernel source. Where no directory can
be written, kernels are compiled afresh in every process and :data:`CACHE_NOTE` says so.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])


def _source_hash() -> str:
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def cache_root() -> Path:
    """Where mlsanm keeps things between runs: ``MLSANM_CACHE_DIR``, else the user's cache directory."""
    named = os.environ.get("MLSANM_CACHE_DIR")
    if named:
        return Path(named)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "mlsanm"


def _prepare_cache() -> tuple[Path | None, str]:
    try:
        directory = cache_root() / "kernels" / _source_hash()
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            pass
    except (OSError, RuntimeError) as error:
        return None, (
            f"compiled kernels cannot be kept ({error}); every run compiles them again. "
            "Set MLSANM_CACHE_DIR to a directory that can be written."
        )
    return directory, ""


CACHE_DIRECTORY, CACHE_NOTE = _prepare_cache()
if CACHE_DIRECTORY is not None:
    os.environ["NUMBA_CACHE_DIR"] = str(CACHE_DIRECTORY)

import numba  # noqa: E402  (must follow the choice of the cache directory)

if CACHE_DIRECTORY is not None:
    # The variable above comes too late where another package has imported numba before.
    vars(numba.config)["CACHE_DIR"] = str(CACHE_DIRECTORY)


def is_warm() -> bool:
    """Whether machine code from an earlier run is there to be loaded."""
    return CACHE_DIRECTORY is not None and any(CACHE_DIRECTORY.rglob("*.nbc"))


def kernel(function: Function) -> Function:
    """Compile ``function`` at its first call, without the interpreter lock and without fast-math."""
    decorate: Any = numba.njit(cache=CACHE_DIRECTORY is not None, nogil=True, error_model="numpy")
    compiled: Function = decorate(function)
    return compiled
