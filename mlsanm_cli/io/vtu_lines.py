"""Surfaces in contact and rigid obstacles for ParaView, as lines: contacts.pvd and the VTU files it lists."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.io.run_dir import LINES_FILE, lines_name
from mlsanm_cli.io.vtk_xml import LINE, surface, write_grid
from mlsanm_cli.io.vtu import listed, vectors, write_collection

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Lines:
    """A surface at one load level: ``points`` (m, 2) before loading and pairs ``edges`` (e, 2) of neighbours.

    ``displacement`` (m, 2); ``scalars`` (m,) of floats or ints and ``vectors`` (m, 2) by name.
    """

    points: FloatArray
    edges: NDArray[np.int64]
    displacement: FloatArray
    scalars: Mapping[str, NDArray[Any]]
    vectors: Mapping[str, FloatArray]


class LinesWriter:
    """Writes per saved state contacts_0000.vtu and, where there are any, obstacles_0000.vtu, onwards."""

    def __init__(self, directory: Path) -> None:
        """Write into ``directory``, which must exist."""
        self._directory = directory
        self._entries: list[str] = []
        self._states = 0

    def write(self, position: float, contacts: Mapping[str, Lines], obstacles: Mapping[str, Lines]) -> None:
        """Write one state; contacts.pvd then lists it too. Nothing is written of no contacts.

        Raises ValueError for arrays of the wrong shape, RunError if a file cannot be written.
        """
        if not contacts:
            return
        for part, (kind, lines) in enumerate((("contacts", contacts), ("obstacles", obstacles))):
            if lines:
                _write(self._directory / lines_name(kind, self._states), kind[:-1], list(lines.values()))
                self._list(position, part, kind)
        self._states += 1
        write_collection(self._directory / LINES_FILE, self._entries)

    def keep(self, position: float) -> None:
        """Take the files of one state as an earlier process wrote them, if it wrote any."""
        for part, kind in enumerate(("contacts", "obstacles")):
            if (self._directory / lines_name(kind, self._states)).is_file():
                self._list(position, part, kind)
        self._states += 1

    def _list(self, position: float, part: int, kind: str) -> None:
        self._entries.append(listed(position, part, kind, lines_name(kind, self._states)))


def _write(path: Path, number: str, lines: Sequence[Lines]) -> None:
    """Write lines as one grid, whose integers ``number`` count them from 0, with what all of them have."""
    counts = [len(one.points) for one in lines]
    first = np.cumsum([0, *counts[:-1]])
    edges = np.concatenate([one.edges + start for one, start in zip(lines, first, strict=True)])
    points = np.concatenate([one.points for one in lines])
    data: dict[str, NDArray[Any]] = {number: np.repeat(np.arange(len(lines)), counts)}
    moved = np.concatenate([one.displacement for one in lines])
    data["displacement"] = vectors("displacement", moved, len(points))
    for name in lines[0].scalars:
        if all(name in one.scalars for one in lines):
            data[name] = np.concatenate([one.scalars[name] for one in lines])
    for name in lines[0].vectors:
        data[name] = vectors(name, np.concatenate([one.vectors[name] for one in lines]), len(points))
    # A contact of a single place has no length.
    cells = [cell for cell in surface(edges, len(points), LINE) if len(cell[1])]
    write_grid(path, vectors("points", points, len(points)), cells, data)
