"""The quantities of a run: where they are written, dimensions, types and units; one table per file, in
quantities.csv, with a part in braces for each name that the case gives: ``contacts/{contact}/gap``."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import RunError

COMPONENTS: Mapping[str, tuple[str, ...]] = {
    "xy": ("x", "y"),
    "tensor": ("xx", "yy", "xy"),
    "principal": ("1", "2"),
}
"""The components of vectors, symmetric tensors and pairs of principal values, by dimension."""


class Quantity(NamedTuple):
    """A quantity in one of the files: its dataset, column, array or key, the names of its axes, its unit
    (length, stress, force, angle, time or "", products with ``*``, forces and works per unit thickness), what
    labels call it, numpy's type, "text" or "mapping", and its value in the undeformed body."""

    path: str
    dimensions: tuple[str, ...]
    unit: str
    description: str
    dtype: str = "float64"
    rest: float = 0.0

    @property
    def name(self) -> str:
        """The last part of the path."""
        return re.split(r"[/.]", self.path)[-1]

    def shape(self, sizes: Mapping[str, int]) -> tuple[int, ...]:
        """The shape for the ``sizes`` of the dimensions; those of `COMPONENTS` are known."""
        return tuple(sizes[axis] if axis in sizes else len(COMPONENTS[axis]) for axis in self.dimensions)


Table = tuple[Quantity, ...]


class Scalar(NamedTuple):
    """A number per node of a field: a component of a quantity, None for the magnitude of a vector."""

    quantity: str
    component: int | None
    label: str
    unit: str
    rest: float = 0.0


def _tables() -> dict[str, Table]:
    tables: dict[str, Table] = {}
    text = Path(__file__).with_name("quantities.csv").read_text(encoding="utf-8")
    for name, path, axes, unit, description, dtype, rest in list(csv.reader(text.splitlines()))[1:]:
        entry = Quantity(path, tuple(axes.split()), unit, description, dtype, float(rest or 0.0))
        tables[name] = (*tables.get(name, ()), entry)
    return tables


_TABLES = _tables()
FIELDS = _TABLES["fields"]
"""Saved fields; stresses are Cauchy stresses. The hoop stress in bodies of revolution only, stretches and the
volume ratio at finite strain only, the last three in scenes with a yield stress only, 0 in elastic bodies."""
CONTACT_GEOMETRY, CONTACT_HISTORY = _TABLES["contact_geometry"], _TABLES["contact_history"]
"""Tractions act on the slave, slips are those of the slave relative to the master, both along the tangent."""
PROBES, PATH, NAMED_PATH = _TABLES["probes"], _TABLES["path"], _TABLES["named_path"]
BODIES, MAPS = _TABLES["bodies"], _TABLES["maps"]
_OTHER_FILES = ("path_columns", "contact_figures", "summary")
RUN_FILE = tuple(entry for name, table in _TABLES.items() if name not in _OTHER_FILES for entry in table)
"""The datasets of run.h5. Those of a checkpoint belong to the method that wrote it."""
PATH_COLUMNS = _TABLES["path_columns"]
"""The columns of path.csv, one row per step; vectors have two columns that end in _x and _y."""
CONTACT_FIGURES = _TABLES["contact_figures"]
SUMMARY = (*CONTACT_FIGURES, *_TABLES["summary"])
"""The keys of summary.json."""

INTERFACE_COLUMNS = ("x", "y", "arc_length", "gap", "pressure", "traction", "slip", "status")
"""The columns of interface.csv, quantities of the contact in its last row; x and y are its points."""
CONTACT_ARRAYS = (
    *("pressure", "traction", "gap", "status", "arc_length", "slip"),
    *("displacement", "normal", "contact_stress", "contact"),
)
"""The arrays of contacts_0000.vtu, obstacles_0000.vtu and so on, beside `FIELDS` and boundary_tag those of
fields_0000.vtu; contact_stress is pressure and traction on the slave as a vector."""


def scalars(table: Table) -> dict[str, Scalar]:
    """The scalars of fields by name: von_mises, ux, uy and displacement, xx, yy and xy, strain_xx, ...

    >>> scalars(FIELDS)["uy"]
    Scalar(quantity='displacement', component=1, label='displacement in y', unit='length', rest=0.0)
    """
    chosen: dict[str, Scalar] = {}
    for entry in table:
        axis = entry.dimensions[-1]
        word = " in " if axis == "xy" else " "
        for number, part in enumerate(COMPONENTS.get(axis, ())):
            name = {"displacement": "u", "stress": ""}.get(entry.name, f"{entry.name}_") + part
            label = f"{entry.description}{word}{part}"
            chosen[name] = Scalar(entry.name, number, label, entry.unit, entry.rest)
        if axis == "xy" or axis not in COMPONENTS:
            chosen[entry.name] = Scalar(entry.name, None, entry.description, entry.unit, entry.rest)
    return chosen


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
