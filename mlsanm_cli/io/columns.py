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
            hint = 'names must not be empty or contain "/"'
            raise RunError(f"the name {name!r} cannot be stored", hint)
    return "/".join(names)


def row(path: Mapping[str, float], quantities: Quantities) -> dict[str, Any]:
    """One step as a value for every column of run.h5."""
    groups = dict(quantities)
    objects = {kind: groups.pop(kind, {}) for kind in ("contacts", "probes")}
    values: dict[str, Any] = {place("path", name): value for name, value in path.items()}
    for group, named in groups.items():
        values |= {place("path", group, name): value for name, value in named.items()}
    for kind, named in objects.items():
        for name, found in named.items():
            values |= {place(kind, name, key): value for key, value in found.items()}
    return values


def path_table(run: Mapping[str, Any]) -> Mapping[str, NDArray[Any]]:
    """Columns (S+1,) of the path of a run, as `io.schema.PATH_COLUMNS`, given its datasets by path."""
    position = run.get("path/position", ())
    if not len(position):
        return {}
    columns: dict[str, NDArray[Any]] = {
        "position": position,
        # The end of a stage belongs to it, and the start of the path to the first one.
        "stage": np.maximum(np.ceil(position), 1.0).astype(np.int64),
    }

    def below(group: str) -> dict[str, Any]:
        return {path.removeprefix(group): run[path] for path in run if path.startswith(group)}

    def vector(name: str, values: FloatArray) -> dict[str, NDArray[Any]]:
        return {f"{name}_x": values[:, 0], f"{name}_y": values[:, 1]}

    columns |= {f"factor.{name}": values for name, values in below("path/factors/").items()}
    forces = below("path/resultants/")
    for name, moved in below("path/displacements/").items():
        columns |= vector(f"displacement.{name}", moved)
        if name in forces:
            # The work of the force along displacements, by the trapezoidal rule.
            force = forces[name]
            steps = (0.5 * (force[1:] + force[:-1]) * np.diff(moved, axis=0)).sum(axis=1)
            columns[f"work.{name}"] = np.concatenate([[0.0], np.cumsum(steps)])
    for name, force in forces.items():
        columns |= vector(f"force.{name}", force)
    for name in dict.fromkeys(path.split("/")[0] for path in below("contacts/")):
        contact = below(f"contacts/{name}/")
        weight, pressure = contact["weight"], contact["pressure"]
        # At finite strain the force is stored, as directions and lengths change.
        force = forces.get(f"contact {name}")
        if force is None:
            force = force_on_slave(weight, contact["normal"], pressure, contact["traction"])
        columns |= vector(f"contact.{name}.force", force)
        columns[f"contact.{name}.peak_pressure"] = pressure.max(axis=1, initial=0.0)
        columns[f"contact.{name}.closed_length"] = (contact["status"] != 0) @ weight
        columns[f"contact.{name}.dissipated_work"] = contact["dissipated_work"]
    return columns


def force_on_slave(
    weight: FloatArray, normal: FloatArray, pressure: FloatArray, traction: FloatArray | None = None
) -> FloatArray:
    """Force (..., 2) of pressures and tractions (..., m) on lengths (m,) with master normals (m, 2)."""
    force = (pressure * weight) @ normal
    if traction is not None:
        force = force + (traction * weight) @ np.stack([normal[:, 1], -normal[:, 0]], axis=1)
    return np.asarray(force, dtype=np.float64)
