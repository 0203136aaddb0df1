"""VTK's XML format for unstructured grids: points with data, and cells of vertices, lines or triangles.

Arrays are inline in base64, each preceded by its length in bytes. They are not compressed: that would make
files a third smaller and take ten times as long.
"""

from __future__ import annotations

import struct
import sys
from binascii import b2a_base64
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.io.atomic import replacing

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

VERTEX, LINE, TRIANGLE = 1, 3, 5
"""VTK's cell types."""
_TYPES = {"f8": "Float64", "i8": "Int64", "i4": "Int32", "u1": "UInt8"}
_ORDER = {"little": "LittleEndian", "big": "BigEndian"}[sys.byteorder]


def write_grid(
    path: Path,
    points: NDArray[np.float64],
    cells: Sequence[tuple[int, NDArray[np.integer[Any]]]],
    data: Mapping[str, NDArray[Any]],
) -> None:
    """Writes ``points`` (n, 3) as a VTU file with ``data`` (n,) or (n, c) and blocks of ``cells``.

    A block is a cell type and the point numbers (c, k) of its cells. Raises RunError if the file cannot be
    written.
    """
    count = len(points)
    widths = np.concatenate([np.full(len(block), block.shape[1]) for _, block in cells])
    kinds = np.concatenate([np.full(len(block), kind, dtype=np.uint8) for kind, block in cells])
    described: dict[str, NDArray[Any]] = {
        "connectivity": np.concatenate([block.ravel() for _, block in cells]).astype(np.int64),
        "offsets": np.cumsum(widths, dtype=np.int64),
        "types": kinds,
    }
    sections: tuple[tuple[str, Mapping[str, NDArray[Any]]], ...] = (
        ("Points", {"Points": points}),
        ("Cells", described),
        ("PointData", data),
    )
    with replacing(path) as temporary, temporary.open("wb") as stream:
        _put(
            stream,
            '<?xml version="1.0"?>',
            f'<VTKFile type="UnstructuredGrid" version="1.0" byte_order="{_ORDER}" header_type="UInt64">',
            "<UnstructuredGrid>",
            f'<Piece NumberOfPoints="{count}" NumberOfCells="{len(kinds)}">',
        )
        for section, arrays in sections:
            _put(stream, f"<{section}>")
            for name, array in arrays.items():
                _array(stream, name, array)
            _put(stream, f"</{section}>")
        _put(stream, "</Piece>", "</UnstructuredGrid>", "</VTKFile>")


def _array(stream: BinaryIO, name: str, array: NDArray[Any]) -> None:
    array = np.ascontiguousarray(array, array.dtype.newbyteorder("="))
    width = f' NumberOfComponents="{array.shape[1]}"' if array.ndim == 2 else ""
    kind = _TYPES[array.dtype.str[1:]]
    _put(stream, f'<DataArray type="{kind}" Name="{escape(name)}"{width} format="binary">')
    # Length and array are encoded together: separately only in compressed files.
    stream.write(b2a_base64(struct.pack("=Q", array.nbytes) + array.tobytes()))
    _put(stream, "</DataArray>")


def _put(stream: BinaryIO, *lines: str) -> None:
    stream.write("".join(f"{line}\n" for line in lines).encode())


def escape(text: str) -> str:
    """``text`` as the value of an XML attribute."""
    # Importing xml.sax takes longer than writing a file.
    for char, code in (("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ('"', "&quot;"), ("'", "&#x27;")):
        text = text.replace(char, code)
    return text
