"""Machine code on disk: one file for all kernels, known by all that went into it and by its own digest.

The directory's name is a digest of the kernels' sources, the versions of numba, llvmlite, numpy and Python,
whose bytecode numba compiles, the processor with its features, and numba's settings. The file begins with the
SHA-256 of the rest of it, is written beside its place and then moved there, and is compiled anew where
anything is wrong with it.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np

from mlsanm_cli.kernels.aot.machine import Code, UnloadableError, numba_root
from mlsanm_cli.system import replacing, who_else_may_write

FILE_NAME = "machine-code"
LEFT_TO_NUMBA = "left-to-numba"
"""Says why there is no machine code: numba keeps the kernels beside this file itself."""
SETTINGS = "NUMBA_"
NEUTRAL_SETTINGS = ("NUMBA_CACHE_DIR", "NUMBA_NUM_THREADS")
"""Settings of numba that do not change machine code."""
DIGEST = 64


def cache_root() -> Path:
    """Where mlsanm keeps things between runs: ``MLSANM_CACHE_DIR``, else the user's cache directory."""
    named = os.environ.get("MLSANM_CACHE_DIR")
    if named:
        return Path(named)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "mlsanm"


def circumstances() -> tuple[str, ...]:
    """All but the sources that machine code depends on."""
    import llvmlite
    import llvmlite.binding as llvm

    try:
        # numba's version without numba, whose import takes longer than all else here.
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
    """Where this installation's machine code belongs. Raises RuntimeError where the user has no directory."""
    digest = hashlib.sha256("\0".join(circumstances()).encode())
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        digest.update(path.read_bytes())
    return cache_root() / "kernels" / digest.hexdigest()[:16]


def encoded(code: Code) -> bytes:
    """As written to disk."""
    head = {"entries": dict(code.entries), "symbols": code.symbols, "math": code.math}
    rest = json.dumps(head).encode() + b"\n" + code.object
    return hashlib.sha256(rest).hexdigest().encode() + rest


def decoded(data: bytes) -> Code:
    """What :func:`encoded` wrote. Raises ValueError for anything else."""
    if hashlib.sha256(data[DIGEST:]).hexdigest().encode() != data[:DIGEST]:
        raise ValueError("damaged")
    line, _, machine_code = data[DIGEST:].partition(b"\n")
    head = json.loads(line)
    return Code(machine_code, head["entries"], tuple(head["symbols"]), tuple(head["math"]))


def read(place: Path) -> Code | None:
    """The machine code in a directory; None where there is none, it is damaged, or another user may have put
    it there: it runs as this user, and its digest says nothing of who made it."""
    try:
        if who_else_may_write(place / FILE_NAME):
            return None
        return decoded((place / FILE_NAME).read_bytes())
    except (OSError, ValueError):
        return None


def write(place: Path, code: Code) -> None:
    """Keep machine code; others see all of it or nothing, and may not write it. Raises OSError, also where it
    would not be read again, as others may write to a directory above it."""
    _make(place)
    reason = who_else_may_write(place)
    if reason:
        raise PermissionError(reason)
    # Not by tempfile, whose files no other user may read: one may compile for all.
    temporary = place / f"{FILE_NAME}.{os.getpid()}.{os.urandom(8).hex()}"
    with replacing(place / FILE_NAME, temporary):
        temporary.write_bytes(encoded(code))
        _shut(temporary)


def left_to_numba(place: Path) -> bool:
    """Whether an earlier process found that code cannot be kept but by numba, in a directory that is safe."""
    try:
        # Windows judges no file, and so none that is not there either.
        return (place / LEFT_TO_NUMBA).is_file() and not who_else_may_write(place / LEFT_TO_NUMBA)
    except OSError:
        return False


def leave_to_numba(place: Path, reason: str) -> None:
    """Have numba keep the kernels in a directory from now on. Raises OSError where nothing can be kept there,
    or others may write to it."""
    _make(place)
    found = who_else_may_write(place)
    if found:
        raise PermissionError(found)
    (place / LEFT_TO_NUMBA).write_text(f"{reason}\n", encoding="utf-8")
    _shut(place / LEFT_TO_NUMBA)


def _make(place: Path) -> None:
    """Make a directory and what is missing above it, such that nobody else may write to them."""
    if not place.is_dir():
        _make(place.parent)
        place.mkdir(mode=0o755, exist_ok=True)
    # What an earlier version made with a lenient umask. Others' directories stay as they are.
    if place.name == "kernels" or place.parent.name == "kernels":
        with suppress(OSError):
            _shut(place)


def _shut(path: Path) -> None:
    """Let nobody else write to a path."""
    path.chmod(path.stat().st_mode & ~0o022)
