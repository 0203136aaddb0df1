"""Columns of run.h5 and of path.csv, from the quantities of states."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import RunError

Quantities: TypeAlias = Mapping[str, Mapping[str, Any]]
"""The quantities of a state: by load the "factors", by load or support the "resultants" (2,), by load on a
platen its "displacements" (2,), and by name the quantities of "contacts" and "probes"."""


def place(*names: str) -> str:
    """The path in run.h5 with these parts. Raises RunError for a name that cannot be part of a path."""
    for name in names:
        if not name or name in {".", ".."} or "/" in name or "\0" in name:
            raise RunError(
                f"the name {name!r} cannot be stored", hint='names must not be empty or contain "/"'
            )
    return "/".join(names)


def row(path: Mapping[str, float], quantities: Quantities) -> dict[str, Any]:
    """One step as a value for every column of run.h5: the position and figures of the step, and the
    ``quantities`` of its state."""
    groups = dict(quantities)
    objects = {kind: groups.pop(kind, {}) for kind in ("contacts", "probes")}
    values: dict[str, Any] = {place("path", name): value for name, value in path.items()}
    for group, named in groups.items():
        values |= {place("path", group, name): value for name, value in named.items()}
    for kind, named in objects.items():
        for name, found in named.items():
            values |= {place(kind, name, key): value for key, value in found.items()}
    return values


def path_table(root: Any) -> Mapping[str, NDArray[Any]]:
    """Columns (S+1,) of the path in an open run.h5 ``root``; empty if it has no path. Position and stage,
    load factors, displacements of platens and the work of their forces, forces of loads and supports; for
    every contact the force on the slave, the largest pressure, the closed length and the dissipated work."""
    if "path" not in root:
        return {}
    position = root["path/position"][...]
    columns: dict[str, NDArray[Any]] = {
        "position": position,
        # The end of a stage belongs to it, and the start of the path to the first one.
        "stage": np.maximum(np.ceil(position), 1.0).astype(np.int64),
    }
    columns |= {f"factor.{name}": data[...] for name, data in _items(root, "path/factors")}
    forces = {name: data[...] for name, data in _items(root, "path/resultants")}
    for name, data in _items(root, "path/displacements"):
        moved = data[...]
        columns |= _vector(f"displacement.{name}", moved)
        if name in forces:
            columns[f"work.{name}"] = _work(forces[name], moved)
    for name, force in forces.items():
        columns |= _vector(f"force.{name}", force)
    for name, group in _items(root, "contacts"):
        weight, pressure = group["weight"][...], group["pressure"][...]
        if f"contact {name}" in forces:
            # At finite strain the force is stored, as directions and lengths change.
            force = forces[f"contact {name}"]
        else:
            force = force_on_slave(weight, group["normal"][...], pressure, group["traction"][...])
        columns |= _vector(f"contact.{name}.force", force)
        columns[f"contact.{name}.peak_pressure"] = pressure.max(axis=1, initial=0.0)
        columns[f"contact.{name}.closed_length"] = (group["status"][...] != 0) @ weight
        columns[f"contact.{name}.dissipated_work"] = group["dissipated_work"][...]
    return columns


def force_on_slave(
    weight: FloatArray, normal: FloatArray, pressure: FloatArray, traction: FloatArray | None = None
) -> FloatArray:
    """Force (..., 2) of pressures and tractions (..., m) on a slave with surface lengths (m,) and normals of
    the master (m, 2), at small strain."""
    force = (pressure * weight) @ normal
    if traction is not None:
        force = force + (traction * weight) @ np.stack([normal[:, 1], -normal[:, 0]], axis=1)
    return np.asarray(force, dtype=np.float64)


def _work(force: FloatArray, moved: FloatArray) -> FloatArray:
    """Work (S+1,) of a force (S+1, 2) along displacements (S+1, 2), by the trapezoidal rule."""
    steps = (0.5 * (force[1:] + force[:-1]) * np.diff(moved, axis=0)).sum(axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _vector(name: str, values: FloatArray) -> dict[str, NDArray[Any]]:
    return {f"{name}_x": values[:, 0], f"{name}_y": values[:, 1]}


def _items(root: Any, place: str) -> list[tuple[str, Any]]:
    """The members of a group of an open file, empty if it does not exist."""
    return list(root[place].items()) if place in root else []
