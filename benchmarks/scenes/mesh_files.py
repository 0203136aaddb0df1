"""Mesh files of scenes."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
from matplotlib.path import Path as PathInside
from scipy.spatial import Delaunay, cKDTree

from benchmarks.scenes.scene import Array, Move


def write_mesh(path: Path, places: np.ndarray, cells: np.ndarray, lines: dict[str, np.ndarray]) -> None:
    """Gmsh's format 2.2, with a physical group for every set of lines."""
    kind = "quad" if cells.shape[1] == 4 else "triangle"
    blocks = [(kind, cells), *(("line", each) for each in lines.values())]
    tags = [np.full(len(each), number) for number, (_, each) in enumerate(blocks, 1)]
    meshio.write(
        path,
        meshio.Mesh(
            np.column_stack([places, np.zeros(len(places))]),
            blocks,
            cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
            field_data={name: np.array([number, 1]) for number, name in enumerate(lines, 2)},
        ),
        file_format="gmsh22",
        binary=False,
    )


def filled_mesh(
    path: Path, move: Move, outline: Array, groups: dict[str, tuple[int, int]], step: float
) -> None:
    """Triangles inside an outline (n, 2), with inner nodes on a grid; groups are ranges of its sides."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    rows = np.arange(low[1] + 0.37 * step, high[1], 0.87 * step)
    grid = np.vstack(
        [
            np.column_stack(
                [
                    np.arange(low[0] + 0.5 * step * (i % 2) + 0.21 * step, high[0], step),
                ]
                * 2
            )
            * [1.0, 0.0]
            + [0.0, y]
            for i, y in enumerate(rows)
        ]
    )
    side = PathInside(np.vstack([outline, outline[:1]]))
    far = cKDTree(outline).query(grid)[0] > 0.6 * step
    places = np.vstack([outline, grid[far & side.contains_points(grid)]])
    cells = Delaunay(places).simplices
    corners = places[cells]
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    thick = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) > 1e-4 * step**2
    cells = cells[side.contains_points(corners.mean(axis=1)) & thick]
    count = len(outline)
    lines = {
        name: np.column_stack([np.arange(a, b), np.arange(a + 1, b + 1) % count])
        for name, (a, b) in groups.items()
    }
    write_mesh(path, move(places), cells, lines)
