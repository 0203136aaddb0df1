"""Machine code on disk: one file for all kernels.

The directory name is a digest of the kernels' sources, the versions of numba, llvmlite, numpy and Python
(whose bytecode numba compiles), and the processor with its features. The file begins with the SHA-256 of its
contents, is written under a temporary name and moved into place; a damaged file is compiled again.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import sys
from pathlib import Path

import numpy as np

from mlsanm_cli.kernels.aot.machine import Code, numba_root
from mlsanm_cli.system import replacing, who_else_may_write

FILE_NAME = "machine-code"
DIGEST = 32
PRIVATE = 0o022
"""Permissions that directories and files of machine code do not have: writing by group and others."""


def directory() -> Path:
    """Directory of this installation's machine code. Raises RuntimeError without a home directory."""
    import llvmlite
    import llvmlite.binding as llvm

    # Read numba's version from its file: importing numba takes longer than all else here.
    numba = (Path(numba_root()) / "_version.py").read_text()
    versions = (numba, llvmlite.__version__, np.__version__, str(sys.implementation.cache_tag))
    processor = (llvm.get_process_triple(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())
    digest = hashlib.sha256("\0".join((*versions, *processor)).encode())
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        digest.update(path.read_bytes())
    named, cache = os.environ.get("MLSANM_CACHE_DIR"), os.environ.get("XDG_CACHE_HOME")
    root = Path(named) if named else Path(cache or Path.home() / ".cache") / "mlsanm"
    return root / "kernels" / digest.hexdigest()[:16]


def read(place: Path) -> Code | None:
    """Machine code of a directory; None if it is missing, damaged or may be another user's."""
    try:
        if who_else_may_write(place / FILE_NAME):
            return None
        data = (place / FILE_NAME).read_bytes()
    except OSError:
        return None
    if hashlib.sha256(data[DIGEST:]).digest() != data[:DIGEST]:
        return None
    code: Code = pickle.loads(data[DIGEST:])
    return code


def write(place: Path, code: Code) -> None:
    """Store machine code atomically, writable by its owner only. Raises OSError."""
    previous = os.umask(PRIVATE)
    try:
        place.mkdir(parents=True, exist_ok=True)
        # Directories of other programs are left alone.
        for ours in (place.parent, place):
            ours.chmod(ours.stat().st_mode & ~PRIVATE)
        reason = who_else_may_write(place)
        if reason:
            raise PermissionError(reason)
        # Not tempfile, whose files other users cannot read: one user may compile for all.
        temporary = place / f"{FILE_NAME}.{os.getpid()}.{os.urandom(8).hex()}"
        with replacing(place / FILE_NAME, temporary):
            data = pickle.dumps(code)
            temporary.write_bytes(hashlib.sha256(data).digest() + data)
    finally:
        os.umask(previous)
