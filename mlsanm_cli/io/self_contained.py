"""Files of bodies stand by themselves: nothing in them leads to another file or to more data than a limit.

A case stores the digest of a body's file. What the file includes would not be part of it, could be any file
of the user, and one that never ends; and a small compressed file can hold more than memory has room for.
"""

from __future__ import annotations

import lzma
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mlsanm_cli.errors import GeometryError

LARGEST = 2**28
"""Bytes that a file may hold when unpacked; the limit on the file itself is the same."""
HDF5 = b"\x89HDF\r\n\x1a\n"
SCATTERED = (".xdmf", ".xmf", ".xml", ".ele", ".node")
"""Formats whose readers open other files next to the one named."""
OBJECTS = 10_000
"""Groups and datasets of an HDF5 file: no program writes more for one mesh."""


def check_self_contained(path: Path) -> None:
    """Raise GeometryError for a mesh that leads to other files, or holds more than the limit."""
    name = path.name.lower()
    if name.endswith(SCATTERED):
        raise GeometryError(
            "files of this format refer to other files", "write the mesh to a single one, .msh, .inp or .vtu"
        )
    if name.endswith(".gz"):
        raise GeometryError("it is compressed", "unpack it first")
    if name.endswith(".inp"):
        _refuse_includes(path)
    with path.open("rb") as file:
        is_hdf5 = file.read(len(HDF5)) == HDF5
    if is_hdf5:
        import h5py

        with h5py.File(path, "r") as root:
            check_hdf5(root)


def _refuse_includes(path: Path) -> None:
    """GeometryError for an Abaqus file with a line that includes another one, however it is written."""
    with path.open(encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, start=1):
            # As meshio reads keywords: stars anywhere in them count for nothing.
            keyword = line.partition(",")[0].replace("*", "").strip().upper()
            if keyword.startswith("INCLUDE") and "*" in line:
                raise GeometryError(
                    f"line {number} includes another file", "put its lines in the place of *INCLUDE"
                )


def check_hdf5(root: Any) -> None:
    """Raise GeometryError for soft, external and circular links, for data in other files, and for more data
    than the limit in an open HDF5 file ``root``."""
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
            if len(seen) > OBJECTS:
                raise GeometryError(f"it has more than {OBJECTS} groups and datasets")
            if address in seen:
                raise GeometryError(f"{place} appears twice", "data must be in the file once")
            seen.add(address)
            if isinstance(found, h5py.Group):
                waiting.append(found)
            elif isinstance(found, h5py.Dataset):
                if found.is_virtual or found.external:
                    raise GeometryError(f"the data of {place} are in another file")
                total += (found.size or 0) * found.dtype.itemsize
    if total > LARGEST:
        raise GeometryError(f"it holds {total / 2**20:.4g} MB of data", f"{LARGEST / 2**20:.4g} MB at most")


@contextmanager
def bounded_unpacking() -> Iterator[None]:
    """Have meshio unpack no more of a VTU file than the limit; GeometryError where there is more.

    meshio asks the modules zlib and lzma by name, and has no limit of its own.
    """
    from meshio.vtu import _vtu

    names = {"zlib": zlib.decompressobj, "lzma": lzma.LZMADecompressor}
    before = {name: getattr(_vtu, name) for name in names}
    try:
        for name, make in names.items():
            setattr(_vtu, name, _Unpacker(make))
        yield
    finally:
        for name, module in before.items():
            setattr(_vtu, name, module)


class _Unpacker:
    """What meshio uses of zlib and lzma, for ``LARGEST`` bytes altogether."""

    def __init__(self, make: Any) -> None:
        self._make = make
        self._left = LARGEST

    def decompress(self, content: bytes) -> bytes:
        """The content unpacked."""
        unpacked: bytes = self._make().decompress(content, self._left + 1)
        self._left -= len(unpacked)
        if self._left < 0:
            raise GeometryError("it is too large when unpacked", f"{LARGEST / 2**20:.4g} MB at most")
        return unpacked
