"""The quantities of a run: where they are written, dimensions, types and units; one table per file, in
quantities.csv, with a part in braces for each name that the case gives: ``contacts/{contact}/gap``."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

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
