"""Bodies in files: meshes of other programs, read by meshio, whose import takes as long as that of numpy, and
node clouds in CSV and HDF5 files with the columns x, y, tag, nx, ny."""

from __future__ import annotations

import contextlib
import csv
import io
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.errors import GeometryError
from mlsanm_cli.io.abaqus import Grid, read_abaqus
from mlsanm_cli.io.self_contained import bounded_unpacking, check_hdf5, check_readable, check_self_contained
from mlsanm_cli.roundoff import ROUND_OFF

if TYPE_CHECKING:
    import meshio


PHYSICAL = "gmsh:physical"
_NOT_NAMES = ("gmsh:geometrical", "gmsh:bounding_entities")

# Nodes around each element in meshio's (VTK's) numbering; interior nodes follow them.
_RINGS: Mapping[str, tuple[int, ...]] = {
    "triangle": (0, 1, 2),
    "triangle6": (0, 3, 1, 4, 2, 5),
    "triangle7": (0, 3, 1, 4, 2, 5),
    "quad": (0, 1, 2, 3),
    "quad8": (0, 4, 1, 5, 2, 6, 3, 7),
    "quad9": (0, 4, 1, 5, 2, 6, 3, 7),
}
_LINES: Mapping[str, tuple[int, ...]] = {"line": (0, 1), "line3": (0, 2, 1)}


class MeshFile(NamedTuple):
    """The elements of one body: nodes in use ``points`` (n, 2), ``rings`` (e, m) of nodes around elements,
    edges ``lines`` (l, 2) with the ``names`` (l,) of their groups ("": none), and sets of nodes."""

    points: FloatArray
    rings: tuple[IntArray, ...]
    lines: IntArray
    names: tuple[str, ...]
    node_sets: Mapping[str, IntArray]


def read_mesh(path: Path, group: str | None = None) -> MeshFile:
    """The triangles and quads of a file, or of a ``group``. Raises GeometryError."""
    points, blocks, node_sets = _read(path, with_faces=group is not None)
    if not len(points):
        raise GeometryError("there are no nodes")
    faces, lines, known = [], [], dict[str, None]()
    for kind, cells, groups in blocks:
        if kind not in (*_RINGS, *_LINES, "vertex"):
            hint = f"triangles and quads only: {', '.join(_RINGS)}"
            raise GeometryError(f'there are elements of type "{kind}"', hint)
        if len(cells) and not 0 <= cells.min() <= cells.max() < len(points):
            raise GeometryError("an element refers to a node that is not in the file")
        if kind in _RINGS:
            known |= dict.fromkeys(name for names in groups for name in names)
            chosen = [number for number, names in enumerate(groups) if group in names]
            faces.append((cells if group is None else cells[chosen], _RINGS[kind]))
        elif kind in _LINES:
            lines.append((cells[:, _LINES[kind]], groups))
    rings = tuple(cells[:, ring] for cells, ring in faces if len(cells))
    if not rings:
        if group is None:
            raise GeometryError("there are no triangles or quads")
        hint = f"groups: {', '.join(sorted(known)) or 'none'}"
        raise GeometryError(f'there is no group of elements "{group}"', hint)
    used = np.unique(np.concatenate([cells.ravel() for cells, _ in faces]))
    number_of = np.full(len(points), -1, dtype=np.int64)
    number_of[used] = np.arange(len(used))
    sets = {_name(name): number_of[np.asarray(nodes, dtype=int)] for name, nodes in node_sets.items()}
    if len(sets) < len(node_sets):
        message = "the names of two node sets differ only in characters not allowed in boundary names"
        raise GeometryError(message)
    kept = np.asarray(points, dtype=np.float64)[used]
    finite = np.isfinite(kept).all(axis=1)
    if not finite.all():
        raise GeometryError(f"the coordinates of node {used[np.argmin(finite)] + 1} are not finite")
    extent = np.ptp(kept, axis=0)
    if kept.shape[1] == 3 and extent[2] > ROUND_OFF * extent.max():
        raise GeometryError(f"the nodes are not coplanar: z varies by {extent[2]:g}", "z = 0 for all nodes")
    return MeshFile(
        np.ascontiguousarray(kept[:, :2]),
        tuple(number_of[ring] for ring in rings),
        *_edges([(number_of[chains], groups) for chains, groups in lines], whole=group is None),
        {name: nodes[nodes >= 0] for name, nodes in sets.items()},
    )


def _read(path: Path, with_faces: bool) -> Grid:
    """The mesh of a file; ``with_faces`` also the groups of faces, else those of lines only."""
    if path.suffix.lower() == ".inp":
        points, given, node_sets = read_abaqus(path.read_text(encoding="utf-8", errors="replace"))
        blocks = [(kind, cells, [[*map(_name, one)] for one in names]) for kind, cells, names in given]
        return points, blocks, node_sets
    import meshio

    output = io.StringIO()
    try:
        check_self_contained(path)
        with contextlib.ExitStack() as stack:
            # meshio prints its errors and calls sys.exit.
            stack.enter_context(contextlib.redirect_stdout(output))
            stack.enter_context(contextlib.redirect_stderr(output))
            stack.enter_context(warnings.catch_warnings())
            stack.enter_context(bounded_unpacking())
            stack.enter_context(unnamed_groups())
            warnings.simplefilter("ignore")
            # numpy only warns about truncated data.
            warnings.filterwarnings("error", message="string or file could not be read")
            mesh = meshio.read(path)
    except GeometryError:
        raise
    except (Exception, SystemExit) as error:
        reason = " ".join(output.getvalue().split()) or str(error) or type(error).__name__
        hint = "Gmsh .msh 2.2 and 4.1, Abaqus .inp and VTU are known to work"
        raise GeometryError(f"meshio cannot read it: {reason}", hint) from error
    blocks = []
    for number, block in enumerate(mesh.cells):
        kind, cells = block.type, np.asarray(block.data, dtype=np.int64)
        named = kind in _LINES or (with_faces and kind in _RINGS)
        blocks.append((kind, cells, _groups(mesh, number, 1 if kind in _LINES else 2) if named else []))
    return mesh.points, blocks, mesh.point_sets


@contextlib.contextmanager
def unnamed_groups() -> Iterator[None]:
    """A block in which meshio reads elements of Gmsh's format 4.1 in no group, or in unnamed ones."""
    from meshio.gmsh import _gmsh41

    read = _gmsh41._read_elements

    def read_elements(f: Any, points: Any, physical: Any, bounding: Any, *formats: Any) -> Any:
        *flags, names = formats
        for dimension, entities in enumerate(physical or ()):
            for tag in {int(tag) for tags in entities.values() for tag in tags}:
                if [tag, dimension] not in [list(map(int, known)) for known in names.values()]:
                    names.setdefault(f"physical{tag}", np.array([tag, dimension]))
            if any(any(map(len, parts.values())) for parts in physical):
                # 0 is no group.
                entities.update({number: tags or [0] for number, tags in entities.items()})
        return read(f, points, physical, bounding, *flags, names)

    _gmsh41._read_elements = read_elements
    try:
        yield
    finally:
        _gmsh41._read_elements = read


def _edges(
    lines: Sequence[tuple[IntArray, list[list[str]]]], whole: bool
) -> tuple[IntArray, tuple[str, ...]]:
    """Edges (l, 2) and names of line elements; nodes of no face are -1, an error in a ``whole`` file."""
    edges, names = [np.zeros((0, 2), dtype=np.int64)], []
    for chains, groups in lines:
        own = (chains >= 0).all(axis=1)
        if whole and not own.all():
            raise GeometryError("a line element has a node that belongs to no triangle or quad")
        for line, found in ((chains[k], groups[k]) for k in np.flatnonzero(own)):
            if len(found) > 1:
                raise GeometryError(f"a line element is in several groups: {', '.join(found)}", "use one")
            edges.append(np.stack([line[:-1], line[1:]], axis=1))
            names += [found[0] if found else ""] * len(edges[-1])
    return np.concatenate(edges), tuple(names)


def _groups(mesh: meshio.Mesh, block: int, dimension: int) -> list[list[str]]:
    """Groups of each cell of a block: Gmsh's physical groups, sets, or, where there are neither, integers."""
    count = len(mesh.cells[block].data)
    groups: list[list[str]] = [[] for _ in range(count)]
    sets = {
        name: cells[block]
        for name, cells in mesh.cell_sets.items()
        if name not in _NOT_NAMES and len(cells) == len(mesh.cells) and cells[block] is not None
    }
    # The integers that identify groups: Gmsh's physical groups, else the only integer cell data.
    arrays = {PHYSICAL: mesh.cell_data[PHYSICAL]} if PHYSICAL in mesh.cell_data else {}
    for name, values in mesh.cell_data.items() if not (arrays or mesh.cell_sets) else ():
        whole = all(one.ndim == 1 and one.dtype.kind in "iu" for one in map(np.asarray, values))
        arrays |= {name: values} if whole and name not in _NOT_NAMES else {}
    if len(arrays) > 1:
        message = f"several cell data could name the boundaries: {', '.join(arrays)}"
        raise GeometryError(message, "leave one integer array")
    for array, tags in arrays.items():
        known = {int(tag): name for name, (tag, d) in mesh.field_data.items() if d == dimension}
        prefix = array.rpartition(":")[2]
        for cell, tag in enumerate(map(int, tags[block])):
            groups[cell] = [_name(known.get(tag, f"{prefix}{tag}"))] if tag else []
    # Of a cell in several physical groups meshio has one as its tag and all as sets.
    for name, cells in sets.items():
        for cell in map(int, cells):
            if not 0 <= cell < count:
                raise GeometryError(f'the set "{name}" has an element that is not in the file')
            if _name(name) not in groups[cell]:
                groups[cell].append(_name(name))
    return groups


def _name(name: str) -> str:
    plain = re.sub(r"[^A-Za-z0-9_-]+", "_", name.strip())
    return f"group{plain}" if plain.isdecimal() else plain


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


def _csv(path: Path) -> tuple[Mapping[str, Sequence[str]], tuple[str, ...]]:
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


def _hdf5(path: Path) -> tuple[Mapping[str, Sequence[str]], tuple[str, ...]]:
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
