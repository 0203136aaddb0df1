"""path.csv: the load path as a table, one row per finished step, for spreadsheets and pandas."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import FloatArray


def path_table(root: Any) -> Mapping[str, NDArray[Any]]:
    """Columns (S+1,) of the path in an open run.h5 ``root``; empty if it has no path.

    Position and stage, load factors, displacements of platens and the work of their forces, forces of loads
    and supports; for every contact the force on the slave, the largest pressure, the closed length and the
    dissipated work.
    """
    if "path" not in root:
        return {}
    position = root["path/position"][...]
    columns: dict[str, NDArray[Any]] = {
        "position": position,
        # The end of a stage belongs to it, and the start of the path to the first one.
        "stage": np.maximum(np.ceil(position), 1.0).astype(np.int64),
    }
    columns |= {f"factor.{name}": data[...] for name, data in items_of(root, "path/factors")}
    forces = {name: data[...] for name, data in items_of(root, "path/resultants")}
    for name, data in items_of(root, "path/displacements"):
        moved = data[...]
        columns |= _vector(f"displacement.{name}", moved)
        if name in forces:
            columns[f"work.{name}"] = _work(forces[name], moved)
    for name, force in forces.items():
        columns |= _vector(f"force.{name}", force)
    for name, group in items_of(root, "contacts"):
        columns |= _contact(name, group, forces.get(f"contact {name}"))
    return columns


def _contact(name: str, group: Any, force: FloatArray | None) -> dict[str, NDArray[Any]]:
    weight, normal, pressure = group["weight"][...], group["normal"][...], group["pressure"][...]
    if force is None:
        # At finite strain the force is stored, as directions and lengths change.
        tangent = np.stack([normal[:, 1], -normal[:, 0]], axis=1)
        force = (pressure * weight) @ normal + (group["traction"][...] * weight) @ tangent
    columns = _vector(f"contact.{name}.force", force)
    columns[f"contact.{name}.peak_pressure"] = pressure.max(axis=1, initial=0.0)
    columns[f"contact.{name}.closed_length"] = (group["status"][...] != 0) @ weight
    columns[f"contact.{name}.dissipated_work"] = group["dissipated_work"][...]
    return columns


def _work(force: FloatArray, moved: FloatArray) -> FloatArray:
    """Work (S+1,) of a force (S+1, 2) along displacements (S+1, 2), by the trapezoidal rule."""
    steps = (0.5 * (force[1:] + force[:-1]) * np.diff(moved, axis=0)).sum(axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _vector(name: str, values: FloatArray) -> dict[str, NDArray[Any]]:
    return {f"{name}_x": values[:, 0], f"{name}_y": values[:, 1]}


def items_of(root: Any, place: str) -> list[tuple[str, Any]]:
    """The members of a group of an open file, empty if it does not exist."""
    return list(root[place].items()) if place in root else []
