"""Machine code on disk: one file for all kernels.

The directory name is a digest of the kernels' sources, the versions of numba, llvmlite, numpy and Python
(whose bytecode numba compiles), the processor with its features, and numba's settings. The file begins with
the SHA-256 of its contents, is written under a temporary name and moved into place; a damaged file is
compiled again.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np

from mlsanm_cli.kernels.aot.machine import Code, UnloadableError, numba_root
from mlsanm_cli.system import replacing, who_else_may_write

FILE_NAME = "machine-code"
SETTINGS = "NUMBA_"
NEUTRAL_SETTINGS = ("NUMBA_CACHE_DIR", "NUMBA_NUM_THREADS")
"""Settings of numba that do not affect machine code."""
DIGEST = 32


def cache_root() -> Path:
    """Directory of data kept between runs: ``MLSANM_CACHE_DIR``, else the user's cache directory."""
    named = os.environ.get("MLSANM_CACHE_DIR")
    if named:
        return Path(named)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "mlsanm"


def build_environment() -> tuple[str, ...]:
    """Everything but the sources that machine code depends on."""
    import llvmlite
    import llvmlite.binding as llvm

    try:
        # Read numba's version from its file: importing numba takes longer than all else here.
        version = (Path(numba_root()) / "_version.py").read_text()
    except (OSError, UnloadableError) as error:
        version = str(error)
    names = (name for name in os.environ if name.startswith(SETTINGS) and name not in NEUTRAL_SETTINGS)
    settings = (f"{name}={os.environ[name]}" for name in sorted(names))
    features = llvm.get_host_cpu_features().flatten()
    processor = (llvm.get_process_triple(), llvm.get_host_cpu_name(), features)
    python = str(sys.implementation.cache_tag)
    return (version, llvmlite.__version__, np.__version__, python, *processor, *settings)


def directory() -> Path:
    """Directory of this installation's machine code. Raises RuntimeError if the user has no home
    directory."""
    digest = hashlib.sha256("\0".join(build_environment()).encode())
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        digest.update(path.read_bytes())
    return cache_root() / "kernels" / digest.hexdigest()[:16]


def encoded(content: Code | str) -> bytes:
    """Serialise machine code, or the reason why there is none and numba's own cache is used instead."""
    rest = pickle.dumps(content)
    return hashlib.sha256(rest).digest() + rest


def decoded(data: bytes) -> Code | str:
    """Inverse of :func:`encoded`, for files of this user. Raises ValueError for damaged ones."""
    if hashlib.sha256(data[DIGEST:]).digest() != data[:DIGEST]:
        raise ValueError("damaged")
    content: Code | str = pickle.loads(data[DIGEST:])
    return content


def read(place: Path) -> Code | str | None:
    """The content of a directory; None if it is missing or damaged, or if another user may have written it:
    it runs with this user's rights, and its digest does not prove its origin."""
    try:
        if who_else_may_write(place / FILE_NAME):
            return None
        return decoded((place / FILE_NAME).read_bytes())
    except (OSError, ValueError):
        return None


def write(place: Path, content: Code | str) -> None:
    """Store machine code atomically, writable by its owner only. Raises OSError, also if others may write to
    a parent directory, as it would not be read again."""
    _make_private_directory(place)
    reason = who_else_may_write(place)
    if reason:
        raise PermissionError(reason)
    # Not tempfile, whose files other users cannot read: one user may compile for all.
    temporary = place / f"{FILE_NAME}.{os.getpid()}.{os.urandom(8).hex()}"
    with replacing(place / FILE_NAME, temporary):
        temporary.write_bytes(encoded(content))
        _restrict_writing(temporary)


def _make_private_directory(place: Path) -> None:
    """Create a directory and missing parents, writable by their owner only."""
    if not place.is_dir():
        _make_private_directory(place.parent)
        place.mkdir(mode=0o755, exist_ok=True)
    # Tighten directories of earlier versions; leave those of other programs alone.
    if place.name == "kernels" or place.parent.name == "kernels":
        with suppress(OSError):
            _restrict_writing(place)


def _restrict_writing(path: Path) -> None:
    """Remove write permission for group and others."""
    path.chmod(path.stat().st_mode & ~0o022)
