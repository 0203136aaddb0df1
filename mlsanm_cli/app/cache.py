"""What runs keep for each other: clouds, and what contacts and loads do to the bodies.

``Shelf`` keeps arrays in a store on disk, and in memory what one process will ask for again. Where the code,
the libraries, the processor's instructions or the number of threads differ, results may differ in their last
bits: each such combination has its own directory.
"""

from __future__ import annotations

import hashlib
import os
import platform
from collections import OrderedDict
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import scipy

from mlsanm_cli import __version__
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.store import Store
from mlsanm_cli.kernels.aot.kept import cache_root
from mlsanm_cli.memo import NO_CACHE, Arrays, Memo, digest

Value = TypeVar("Value")

FOLDER = "operators"
LIMIT_MB = 1000.0
"""Size of the cache unless MLSANM_CACHE_LIMIT_MB says otherwise."""
_CODE = (
    *("arrays.py", "memo.py", "startup.py"),
    *("kernels", "cloud", "operators", "mechanics", "contact"),
)
_PACKAGE = Path(__file__).resolve().parents[1]


class Shelf:
    """A memo on disk, and with ``values`` above 0 in memory too: the latest so many results."""

    def __init__(self, store: Store | None, origin: str, values: int) -> None:
        self._store = store
        self._origin = origin
        self._most = values
        self._values: OrderedDict[tuple[str, str], Any] = OrderedDict()
        self.found = self.made = 0

    def arrays(self, kind: str, key: str, make: Callable[[], Arrays]) -> Arrays:
        """Arrays from memory, from disk, or made and kept in both."""
        return self.value(kind, key, lambda: self._stored(f"{self._origin}/{kind}-{key}", make))

    def value(self, kind: str, key: str, make: Callable[[], Value]) -> Value:
        """A value from memory, or made and kept there."""
        if not self._most:
            return make()
        place = (kind, key)
        if place not in self._values:
            self._values[place] = make()
            while len(self._values) > self._most:
                self._values.popitem(last=False)
        self._values.move_to_end(place)
        found: Value = self._values[place]
        return found

    @property
    def figures(self) -> Mapping[str, int]:
        """How many arrays were found on disk, and how many had to be made."""
        return {"found": self.found, "made": self.made}

    def _stored(self, name: str, make: Callable[[], Arrays]) -> Arrays:
        arrays = self._store.read(name) if self._store is not None else None
        if arrays is not None:
            self.found += 1
            return arrays
        self.made += 1
        arrays = make()
        if self._store is not None:
            self._store.write(name, arrays)
        return arrays


def shelf(threads: int, say: Callable[[str], None], *, on_disk: bool = True, values: int = 0) -> Memo:
    """The memo of a process: on disk, in memory (``values`` results), both or none.

    Raises RunError for a size limit that is no number.
    """
    if not on_disk and not values:
        return NO_CACHE
    return Shelf(operator_store(say) if on_disk else None, origin(threads), values)


def operator_store(say: Callable[[str], None]) -> Store:
    """The store in the user's cache directory."""
    return Store(cache_root() / FOLDER, int(limit_mb() * 1e6), say)


def limit_mb() -> float:
    """Largest size of the store; RunError where the environment names no such number."""
    text = os.environ.get("MLSANM_CACHE_LIMIT_MB", "")
    try:
        limit = float(text) if text else LIMIT_MB
    except ValueError:
        limit = -1.0
    if not 0.0 <= limit < float("inf"):
        raise RunError(f"MLSANM_CACHE_LIMIT_MB is {text!r}", "set it to a number of megabytes, as in 500")
    return limit


def origin(threads: int) -> str:
    """A name for all that decides the last bits of a result beside its inputs."""
    simd: Mapping[str, Any] = np.show_config(mode="dicts")["SIMD Extensions"]
    versions = [__version__, np.__version__, scipy.__version__, platform.python_version()]
    return digest(_code(), versions, platform.machine(), list(simd.get("found", [])), threads)


def _code() -> str:
    """A digest of the sources that results come from."""
    found = hashlib.sha256()
    for name in _CODE:
        place = _PACKAGE / name
        for path in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            found.update(path.read_bytes())
    return found.hexdigest()


def info() -> dict[str, Any]:
    """Where the cache is, how large it is and may become."""
    store = operator_store(lambda text: None)
    usage = store.usage()
    return {
        "directory": str(cache_root() / FOLDER),
        "entries": usage.entries,
        "megabytes": round(usage.bytes / 1e6, 3),
        "limit_megabytes": limit_mb(),
    }


def clear() -> dict[str, Any]:
    """Remove all that is kept; what was removed."""
    gone = operator_store(lambda text: None).clear()
    return {
        "directory": str(cache_root() / FOLDER),
        "removed": gone.entries,
        "megabytes": round(gone.bytes / 1e6, 3),
    }
