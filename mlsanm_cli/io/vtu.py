"""VTU and PVD files for ParaView: VTK's XML format with inline arrays in base64, each preceded by its length,
not compressed, which would make files a third smaller and take ten times as long."""

from __future__ import annotations

import struct
import sys
from binascii import b2a_base64
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.files import replacing, write_text
from mlsanm_cli.io.run_dir import COLLECTION_FILE, LINES_FILE, vtu_name


class VtuPart(NamedTuple):
    """A body, surface or obstacle at one load level: undeformed points (n, 2), lines (c, 2) or triangles (c,
    3), and scalars (n,), vectors (n, 2), tensors xx, yy, xy (n, 3) or xx, yy, xy, zz (n, 4) by name."""

    points: FloatArray
    cells: NDArray[np.int64]
    data: Mapping[str, NDArray[Any]]


Parts = Mapping[str, VtuPart]


class StateWriter:
    """Writes saved states: a VTU file per state and body, contacts and obstacles of every state, and lists of
    them in fields.pvd and contacts.pvd."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._listed: dict[str, list[str]] = {COLLECTION_FILE: [], LINES_FILE: []}
        self._states = 0

    def write(self, position: float, bodies: Parts, contacts: Parts, obstacles: Parts) -> None:
        """Writes a state and lists it. Raises RunError if a file cannot be written."""
        for name, file in self._files(list(bodies)).items():
            write_parts(self._directory / file, "", [bodies[name]])
        for kind, lines in (("contacts", contacts), ("obstacles", obstacles if contacts else {})):
            if lines:
                write_parts(self._directory / vtu_name(kind, self._states), kind[:-1], list(lines.values()))
        self.keep(position, list(bodies))

    def keep(self, position: float, names: Sequence[str]) -> None:
        """Lists a state with these bodies, also an earlier one. Raises RunError if a file is missing."""
        files = self._files(names)
        for path in (self._directory / file for file in files.values()):
            if not path.is_file():
                hint = "restore it, or run the case again with --force"
                raise RunError(f"{path} is missing (written before the run stopped)", hint)
        self._list(COLLECTION_FILE, position, files)
        lines = {kind: vtu_name(kind, self._states) for kind in ("contacts", "obstacles")}
        there = {kind: file for kind, file in lines.items() if (self._directory / file).is_file()}
        if there:
            self._list(LINES_FILE, position, there)
        self._states += 1

    def _files(self, names: Sequence[str]) -> dict[str, str]:
        first = len(self._listed[COLLECTION_FILE])
        return {name: vtu_name("fields", number) for number, name in enumerate(names, first)}

    def _list(self, file: str, position: float, parts: Mapping[str, str]) -> None:
        """Adds the files of a state's parts by name to a PVD file. Raises RunError."""
        self._listed[file] += [
            f'    <DataSet timestep="{float(position)!r}" group="" part="{number}" '
            f'name="{escape(name)}" file="{part}"/>'
            for number, (name, part) in enumerate(parts.items())
        ]
        head = '<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n  <Collection>'
        lines = ['<?xml version="1.0"?>', head, *self._listed[file], "  </Collection>\n</VTKFile>\n"]
        write_text(self._directory / file, "\n".join(lines))


VERTEX, LINE, TRIANGLE = 1, 3, 5
"""VTK's cell types."""
_TYPES = {"f8": "Float64", "i8": "Int64", "i4": "Int32", "u1": "UInt8"}
_ORDER = {"little": "LittleEndian", "big": "BigEndian"}[sys.byteorder]


def write_parts(path: Path, number: str, parts: Sequence[VtuPart]) -> None:
    """Writes parts as one grid with common data and, named ``number``, their numbers. Raises RunError."""
    counts = [len(part.points) for part in parts]
    total, first = sum(counts), np.cumsum([0, *counts[:-1]])
    shared = [name for name in parts[0].data if all(name in part.data for part in parts)]
    data = {name: _components(np.concatenate([part.data[name] for part in parts])) for name in shared}
    if number:
        data[number] = np.repeat(np.arange(len(parts)), counts)
    cells = np.concatenate([part.cells + start for part, start in zip(parts, first, strict=True)])
    alone = np.ones(total, dtype=bool)
    alone[cells] = False
    blocks = [(LINE if cells.shape[1] == 2 else TRIANGLE, cells), (VERTEX, np.flatnonzero(alone)[:, None])]
    kinds = np.concatenate([np.full(len(block), kind, dtype=np.uint8) for kind, block in blocks])
    widths = np.concatenate([np.full(len(block), block.shape[1]) for _, block in blocks])
    described: dict[str, NDArray[Any]] = {
        "connectivity": np.concatenate([block.ravel() for _, block in blocks]).astype(np.int64),
        "offsets": np.cumsum(widths, dtype=np.int64),
        "types": kinds,
    }
    points = {"Points": _components(np.concatenate([part.points for part in parts]))}
    with replacing(path) as temporary, temporary.open("wb") as stream:
        stream.write(
            f'<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" byte_order="{_ORDER}" '
            'header_type="UInt64">\n<UnstructuredGrid>\n'
            f'<Piece NumberOfPoints="{total}" NumberOfCells="{len(kinds)}">\n'.encode()
        )
        for section, arrays in (("Points", points), ("Cells", described), ("PointData", data)):
            stream.write(f"<{section}>\n".encode())
            for name, values in arrays.items():
                array = np.ascontiguousarray(values, values.dtype.newbyteorder("="))
                width = f' NumberOfComponents="{array.shape[1]}"' if array.ndim == 2 else ""
                kind = _TYPES[array.dtype.str[1:]]
                head = f'<DataArray type="{kind}" Name="{escape(name)}"{width} format="binary">\n'
                # Length and array are encoded together: separately only in compressed files.
                content = b2a_base64(struct.pack("=Q", array.nbytes) + array.tobytes())
                stream.write(head.encode() + content + b"</DataArray>\n")
            stream.write(f"</{section}>\n".encode())
        stream.write(b"</Piece>\n</UnstructuredGrid>\n</VTKFile>\n")


def _components(values: NDArray[Any]) -> NDArray[Any]:
    """Vectors (n, 2) as (n, 3) with z = 0, and tensors (n, 3) or (n, 4) row by row (n, 9)."""
    if values.ndim == 1:
        return values
    if values.shape[1] == 2:
        return np.column_stack([values, np.zeros(len(values))])
    tensors = np.zeros((len(values), 9))
    tensors[:, [0, 4, 1, 3]] = values[:, [0, 1, 2, 2]]
    tensors[:, 8 : 5 + values.shape[1]] = values[:, 3:]
    return tensors
