"""Node clouds in CSV and HDF5 files with the columns x, y, tag, nx, ny."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import GeometryError
from mlsanm_cli.io.self_contained import check_hdf5, check_readable

COLUMNS = ("x", "y", "tag", "nx", "ny")
MAX_NODES = 2_000_000
"""The operators of more nodes would not fit in memory."""
UNIT_LENGTH_TOLERANCE = 1e-3
"""Largest deviation of normals from unit length; they are normalised."""


def read_points(path: Path) -> tuple[FloatArray, tuple[str, ...], FloatArray, tuple[str, ...]]:
    """Points (n, 2), tags (n,) ("": interior), normals (n, 2) (nan: not given) and places (n,) in a ``.csv``
    file or, with any other suffix, an HDF5 file. Raises GeometryError, naming the line or row."""
    table, places = _csv(path) if path.suffix.lower() == ".csv" else _hdf5(path)
    numbers = {name: _numbers(name, table[name], places) for name in table if name != "tag"}
    tags = tuple(text.strip() for text in table["tag"])
    for tag, place in zip(tags, places, strict=True):
        if tag and not tag.replace("-", "_").isidentifier():
            message = f'{place}: the tag "{tag}" is not a valid name'
            raise GeometryError(message, "letters, digits, _ and - only")
    points = np.stack([numbers["x"], numbers["y"]], axis=1)
    missing = np.full(len(points), np.nan)
    normals = np.stack([numbers.get("nx", missing), numbers.get("ny", missing)], axis=1)
    given, length = ~np.isnan(normals), np.hypot(*normals.T)
    whole = given.all(axis=1)
    for wrong, message in (
        (~np.isfinite(points).all(axis=1), "the node has no coordinates"),
        (given.any(axis=1) & ~whole, "a normal needs both nx and ny"),
        (whole & (np.abs(length - 1.0) > UNIT_LENGTH_TOLERANCE), "the normal has length {:.4g}, not 1"),
    ):
        if wrong.any():
            first = int(np.argmax(wrong))
            raise GeometryError(f"{places[first]}: {message.format(length[first])}")
    return points, tags, normals / length[:, None], places


Table = Mapping[str, Sequence[str]]


def _csv(path: Path) -> tuple[Table, tuple[str, ...]]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise GeometryError(f"it is not UTF-8 text (byte {error.start})") from error
    if (count := text.count("\n")) > MAX_NODES:
        raise GeometryError(f"there are {count} nodes", f"{MAX_NODES} at most")
    lines = csv.reader(text.splitlines())
    try:
        header = [name.strip() for name in next(lines, [])]
        rows = {f"line {lines.line_num}": row for row in lines if any(cell.strip() for cell in row)}
    except csv.Error as error:
        raise GeometryError(f"line {lines.line_num}: {error}") from error
    _check_columns(header, "line 1")
    for place, row in rows.items():
        if len(row) != len(header):
            raise GeometryError(f"{place}: {len(row)} values for {len(header)} columns")
    if not rows:
        raise GeometryError("there are no nodes", f"a header {','.join(COLUMNS)} and a line per node")
    return dict(zip(header, zip(*rows.values(), strict=True), strict=True)), tuple(rows)


def _hdf5(path: Path) -> tuple[Table, tuple[str, ...]]:
    import h5py

    check_readable(path)
    try:
        with h5py.File(path, "r") as file:
            check_hdf5(file)
            found = [name for name in COLUMNS if isinstance(file.get(name), h5py.Dataset)]
            _check_columns(found, "the datasets")
            # The size of a dataset without storage is None.
            sizes = {name: file[name].size for name in found}
            for name, size in sizes.items():
                if size is None:
                    raise GeometryError(f"the dataset {name} has no data")
                if size > MAX_NODES:
                    raise GeometryError(f"there are {size} nodes", f"{MAX_NODES} at most")
            table = {name: [*map(_text, np.ravel(file[name][()]))] for name in found}
    except UnicodeDecodeError as error:
        raise GeometryError(f"it contains a text that is not UTF-8 (byte {error.start})") from error
    except (OSError, RuntimeError, TypeError, KeyError) as error:
        message = f"it is not an HDF5 file ({error})"
        raise GeometryError(message, "a cloud is a .csv or an HDF5 file") from error
    counts = {name: len(values) for name, values in table.items()}
    if len(set(counts.values())) != 1:
        lengths = ", ".join(f"{name} {count}" for name, count in counts.items())
        raise GeometryError(f"the datasets differ in length: {lengths}")
    if not counts["x"]:
        raise GeometryError("there are no nodes")
    return table, tuple(f"row {row}" for row in range(counts["x"]))


def _text(value: Any) -> str:
    return value.decode() if isinstance(value, bytes) else str(value) if value == value else ""


def _check_columns(names: Sequence[str], where: str) -> None:
    for name in names:
        if name not in COLUMNS:
            raise GeometryError(f'{where}: unknown column "{name}"', f"columns: {', '.join(COLUMNS)}")
        if names.count(name) > 1:
            raise GeometryError(f'{where}: the column "{name}" appears twice')
    missing = [name for name in COLUMNS[:3] if name not in names]
    if missing:
        raise GeometryError(f"{where}: no column {', '.join(missing)}", "x, y, tag; optionally nx and ny")
    if ("nx" in names) != ("ny" in names):
        raise GeometryError(f"{where}: nx and ny are needed together")


def _numbers(name: str, values: Sequence[str], places: Sequence[str]) -> FloatArray:
    numbers = np.full(len(values), np.nan)
    for row, text in enumerate(values):
        try:
            numbers[row] = float(text.strip() or "nan")
        except ValueError as error:
            raise GeometryError(f"{places[row]}: {name} is not a number: {text.strip()!r}") from error
    return numbers
