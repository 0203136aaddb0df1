"""VTU and PVD files for ParaView: bodies as triangles, vectors of 3 and tensors of 9 components."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.errors import RunError
from mlsanm_cli.io.atomic import write_text
from mlsanm_cli.io.run_dir import COLLECTION_FILE, fields_name
from mlsanm_cli.io.vtk_xml import escape, surface, vertices, write_grid

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class BodyState:
    """One body at one load level.

    ``points`` (n, 2) in the reference configuration; ``boundary_tag`` (n,) ints, 0 inside, k > 0 on the k-th
    boundary; what is None is left out of the file: ``displacement`` (n, 2), ``stress`` (n, 3) in the order
    xx, yy, xy, ``von_mises`` (n,), ``strain`` (n, 3) in that order too. ``stress_zz`` (n,) is the stress
    across the plane, zero if None; ``more`` are other scalars (n,). ``triangles`` (t, 3) fill the body;
    without them its points are vertices.
    """

    points: FloatArray
    boundary_tag: NDArray[np.integer[Any]]
    displacement: FloatArray | None = None
    stress: FloatArray | None = None
    von_mises: FloatArray | None = None
    stress_zz: FloatArray | None = None
    more: Mapping[str, FloatArray] = field(default_factory=dict)
    strain: FloatArray | None = None
    triangles: NDArray[np.int64] | None = None


@dataclass(frozen=True)
class ModelBody:
    """One body before solving, for a look at the model; n nodes.

    ``points`` (n, 2); ``boundary_tag`` (n,) ints, 0 inside; ``spacing`` (n,); ``normal`` (n, 2) outward unit
    vectors, zero inside; ``partner`` (n, 2) from each contact candidate to its virtual node on the other
    surface, zero elsewhere.
    """

    points: FloatArray
    boundary_tag: NDArray[np.integer[Any]]
    spacing: FloatArray
    normal: FloatArray
    partner: FloatArray


class StateWriter:
    """Writes one VTU per saved state and body, fields_0000.vtu onwards, and fields.pvd that lists them."""

    def __init__(self, directory: Path) -> None:
        """Write into ``directory``, which must exist."""
        self._directory = directory
        self._entries: list[str] = []
        self._listed = 0

    def write(self, position: float, bodies: Mapping[str, BodyState]) -> tuple[Path, ...]:
        """Write one state; fields.pvd then lists it too. Returns the VTU files.

        Raises ValueError for arrays of the wrong shape, RunError if a file cannot be written.
        """
        names = tuple(bodies)
        paths = self._paths(len(names))
        for path, body in zip(paths, bodies.values(), strict=True):
            _write_cloud(path, body.points, _state_data(body), body.triangles)
        self._add(position, names)
        self.finish()
        return paths

    def keep(self, position: float, names: Sequence[str]) -> None:
        """Take the files of one state as an earlier process wrote them; RunError if one is missing."""
        for path in self._paths(len(names)):
            if not path.is_file():
                raise RunError(
                    f"{path} is missing, which the run had written before it stopped",
                    hint="put it back, or run the case again with --force",
                )
        self._add(position, names)

    def finish(self) -> None:
        """Bring fields.pvd up to date. RunError if it cannot be written."""
        if self._listed == len(self._entries):
            return
        write_collection(self._directory / COLLECTION_FILE, self._entries)
        self._listed = len(self._entries)

    def _paths(self, count: int) -> tuple[Path, ...]:
        first = len(self._entries)
        return tuple(self._directory / fields_name(first + part) for part in range(count))

    def _add(self, position: float, names: Sequence[str]) -> None:
        for part, (name, path) in enumerate(zip(names, self._paths(len(names)), strict=True)):
            self._entries.append(listed(position, part, name, path.name))


def listed(position: float, part: int, name: str, file: str) -> str:
    """A line of a PVD file: ``part`` number so and so of the state at ``position``."""
    return (
        f'    <DataSet timestep="{float(position)!r}" group="" part="{part}" '
        f'name="{escape(name)}" file="{file}"/>'
    )


def write_collection(path: Path, entries: Sequence[str]) -> None:
    """Write a PVD file with these lines. RunError if it cannot be written."""
    lines = (
        '<?xml version="1.0"?>',
        '<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">',
        "  <Collection>",
        *entries,
        "  </Collection>",
        "</VTKFile>",
    )
    write_text(path, "\n".join(lines) + "\n")


def write_single(path: Path, bodies: Mapping[str, BodyState]) -> None:
    """Write one state of all bodies to one VTU, with point data "body" counting them from 0.

    A field is written if every body has it. Raises ValueError for arrays of the wrong shape, RunError if the
    file cannot be written.
    """
    states = list(bodies.values())
    tables = [_state_data(body) for body in states]
    _write_merged(path, [body.points for body in states], tables, [body.triangles for body in states])


def write_model(path: Path, bodies: Mapping[str, ModelBody]) -> None:
    """Write the clouds of all bodies to one VTU with body, boundary_tag, spacing, normal and partner.

    Glyphs of "normal" show the outward normals, glyphs of "partner" (unscaled) end on the virtual nodes.
    Raises ValueError for arrays of the wrong shape, RunError if the file cannot be written.
    """
    tables: list[dict[str, NDArray[Any]]] = [
        {
            "boundary_tag": _tags(body.boundary_tag, len(body.points)),
            "spacing": _scalars("spacing", body.spacing, len(body.points)),
            "normal": vectors("normal", body.normal, len(body.points)),
            "partner": vectors("partner", body.partner, len(body.points)),
        }
        for body in bodies.values()
    ]
    _write_merged(path, [body.points for body in bodies.values()], tables, [None])


def _write_merged(
    path: Path,
    points: Sequence[FloatArray],
    tables: Sequence[Mapping[str, NDArray[Any]]],
    triangles: Sequence[NDArray[np.int64] | None],
) -> None:
    """Write several bodies as one, keeping the data that all of them have; filled if all have triangles."""
    if not tables:
        raise ValueError("no body to write")
    counts = [len(cloud) for cloud in points]
    body = np.repeat(np.arange(len(points)), counts)
    shared = [name for name in tables[0] if all(name in table for table in tables)]
    data = {name: np.concatenate([table[name] for table in tables]) for name in shared}
    filled = [own for own in triangles if own is not None]
    joined = None
    if len(filled) == len(points):
        first = np.cumsum([0, *counts[:-1]])
        joined = np.concatenate([own + start for own, start in zip(filled, first, strict=True)])
    _write_cloud(path, np.concatenate(points), {"body": body, **data}, joined)


def _state_data(body: BodyState) -> dict[str, NDArray[Any]]:
    count = len(body.points)
    data: dict[str, NDArray[Any]] = {"boundary_tag": _tags(body.boundary_tag, count)}
    if body.displacement is not None:
        data["displacement"] = vectors("displacement", body.displacement, count)
    if body.stress is not None:
        data["stress"] = _tensors("stress", body.stress, body.stress_zz, count)
    if body.von_mises is not None:
        data["von_mises"] = _scalars("von_mises", body.von_mises, count)
    if body.strain is not None:
        data["strain"] = _tensors("strain", body.strain, None, count)
    return data | {name: _scalars(name, values, count) for name, values in body.more.items()}


def _write_cloud(
    path: Path,
    points: FloatArray,
    data: Mapping[str, NDArray[Any]],
    triangles: NDArray[np.int64] | None,
) -> None:
    """Write a cloud as triangles, or as vertices where there are none, with point data."""
    count = len(points)
    cells = [vertices(count)] if triangles is None else surface(triangles, count)
    write_grid(path, vectors("points", points, count), cells, data)


def vectors(what: str, array: FloatArray, count: int) -> FloatArray:
    """(n, 2) to (n, 3) with z = 0; ValueError for other shapes."""
    _check(what, array, (count, 2))
    padded = np.zeros((count, 3))
    padded[:, :2] = array
    return padded


def _tensors(what: str, plane: FloatArray, across: FloatArray | None, count: int) -> FloatArray:
    """(n, 3) in the order xx, yy, xy, and zz if it is known, to (n, 9), row by row."""
    _check(what, plane, (count, 3))
    tensors = np.zeros((count, 9))
    tensors[:, [0, 4, 1]] = plane
    tensors[:, 3] = plane[:, 2]
    if across is not None:
        tensors[:, 8] = _scalars(f"{what}_zz", across, count)
    return tensors


def _scalars(what: str, array: FloatArray, count: int) -> FloatArray:
    _check(what, array, (count,))
    return np.ascontiguousarray(array, dtype=np.float64)


def _tags(array: NDArray[np.integer[Any]], count: int) -> NDArray[np.int32]:
    _check("boundary_tag", array, (count,))
    return np.ascontiguousarray(array, dtype=np.int32)


def _check(what: str, array: NDArray[Any], shape: tuple[int, ...]) -> None:
    if array.shape != shape:
        raise ValueError(f"{what}: shape {array.shape}, expected {shape}")
