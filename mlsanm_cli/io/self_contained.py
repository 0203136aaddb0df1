"""Checks that the file of a body, of which a case stores the digest, is self-contained: no references to
other files, and bounded size, also of what is unpacked."""

from __future__ import annotations

import lzma
import subprocess
import sys
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mlsanm_cli.errors import GeometryError

MAX_BYTES = 2**28
"""Largest size of an unpacked file; that of the file itself is the same."""
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
MAX_SECONDS = 20.0
"""Time in which an HDF5 file must have been read."""
MAX_OBJECTS = 10_000
"""Largest number of groups and datasets of an HDF5 file; programs write far fewer for a mesh."""


def check_self_contained(path: Path) -> None:
    """Raises GeometryError for a mesh that refers to other files or contains more than the limit."""
    name = path.name.lower()
    if name.endswith((".xdmf", ".xmf", ".xml", ".ele", ".node")):
        hint = "write the mesh to a single one, .msh, .inp or .vtu"
        raise GeometryError("files of this format refer to other files", hint)
    if name.endswith(".gz"):
        raise GeometryError("it is compressed", "unpack it first")
    with path.open("rb") as file:
        is_hdf5 = file.read(len(HDF5_SIGNATURE)) == HDF5_SIGNATURE
    if is_hdf5:
        import h5py

        check_readable(path)
        with h5py.File(path, "r") as root:
            check_hdf5(root)


READER = """
import sys, h5py
from mlsanm_cli.io.self_contained import check_hdf5
with h5py.File(sys.argv[1], "r") as root:
    check_hdf5(root)
    root.visititems(lambda name, item: None if hasattr(item, "keys") else item[()])
"""


def check_readable(path: Path) -> None:
    """Raises GeometryError for a damaged HDF5 file; the library may hang, and so has its own process."""
    try:
        command = [sys.executable, "-c", READER, str(path)]
        ended = subprocess.run(command, capture_output=True, timeout=MAX_SECONDS).returncode >= 0
    except subprocess.TimeoutExpired:
        ended = False
    if not ended:
        raise GeometryError("the HDF5 library does not read it: it is damaged", "write the file again")


def check_hdf5(root: Any) -> None:
    """Raises GeometryError for an open HDF5 file with links, data in other files, or too much data."""
    import h5py

    total, seen, waiting = 0, {h5py.h5o.get_info(root.id).addr}, [root]
    while waiting:
        group = waiting.pop()
        for name in group:
            place = f"{group.name.rstrip('/')}/{name}"
            if type(group.get(name, getlink=True)) is not h5py.HardLink:
                raise GeometryError(f"{place} is a link", "data must be in the file itself, without links")
            found = group[name]
            address = h5py.h5o.get_info(found.id).addr
            if len(seen) > MAX_OBJECTS:
                raise GeometryError(f"it has more than {MAX_OBJECTS} groups and datasets")
            if address in seen:
                raise GeometryError(f"{place} appears twice", "data must be in the file once")
            seen.add(address)
            if isinstance(found, h5py.Group):
                waiting.append(found)
            elif isinstance(found, h5py.Dataset):
                if found.is_virtual or found.external:
                    raise GeometryError(f"the data of {place} are in another file")
                total += (found.size or 0) * found.dtype.itemsize
    if total > MAX_BYTES:
        raise GeometryError(f"it holds {total / 2**20:.4g} MB of data", f"at most {MAX_BYTES / 2**20:.4g} MB")


@contextmanager
def bounded_unpacking() -> Iterator[None]:
    """A block in which meshio, by its zlib and lzma, unpacks at most the limit. Raises GeometryError."""
    from meshio.vtu import _vtu

    before = _vtu.zlib, _vtu.lzma
    try:
        _vtu.zlib, _vtu.lzma = _Unpacker(zlib.decompressobj), _Unpacker(lzma.LZMADecompressor)
        yield
    finally:
        _vtu.zlib, _vtu.lzma = before


class _Unpacker:
    """The part of zlib and lzma that meshio uses, for at most ``MAX_BYTES`` in total."""

    def __init__(self, make: Any) -> None:
        self._make = make
        self._left = MAX_BYTES

    def decompress(self, content: bytes) -> bytes:
        """The content unpacked."""
        unpacked: bytes = self._make().decompress(content, self._left + 1)
        self._left -= len(unpacked)
        if self._left < 0:
            raise GeometryError("it is too large when unpacked", f"at most {MAX_BYTES / 2**20:.4g} MB")
        return unpacked
