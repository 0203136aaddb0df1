"""The quantities of a run: where they are written, their dimensions, types and units.

One table per file. A path has a part in braces for each name that the case gives: ``contacts/{contact}/gap``.
The pages of the documentation and the files of the published cases are tested against these tables.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

COMPONENTS: Mapping[str, tuple[str, ...]] = {
    "xy": ("x", "y"),
    "tensor": ("xx", "yy", "xy"),
    "principal": ("1", "2"),
}
"""The components of vectors, symmetric tensors and pairs of principal values, by dimension."""


class Quantity(NamedTuple):
    """A quantity in one of the files.

    ``path`` is its dataset, column, array or key; ``dimensions`` name its axes, in order; ``unit`` is length,
    stress, force, angle, time or "" for numbers, products with ``*``; forces and works are per unit
    thickness. ``description`` is what labels call it, ``dtype`` that of numpy, "text" or "mapping"; ``rest``
    is the value in the undeformed body.
    """

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


def _table(prefix: str, *rows: tuple[Any, ...]) -> Table:
    """Quantities below a prefix, from path, dimensions separated by spaces, unit, description and what
    follows."""
    return tuple(Quantity(prefix + path, tuple(axes.split()), *rest) for path, axes, *rest in rows)


FIELDS: Table = _table(
    "fields/{number}/{body}/",
    ("displacement", "node xy", "length", "displacement"),
    ("stress", "node tensor", "stress", "stress"),
    ("von_mises", "node", "stress", "von Mises stress"),
    ("stress_zz", "node", "stress", "hoop stress"),
    ("strain", "node tensor", "", "strain"),
    ("stretch", "node principal", "", "principal stretch", "float64", 1.0),
    ("volume_ratio", "node", "", "volume ratio", "float64", 1.0),
    ("plastic_strain", "node", "", "accumulated plastic strain"),
    ("flow_stress", "node", "stress", "flow stress"),
    ("yield_ratio", "node", "", "equivalent stress over the flow stress"),
)
"""Saved fields; stresses are Cauchy stresses. The hoop stress in bodies of revolution only, stretches and the
volume ratio at finite strain only, the last three in scenes with a yield stress only, 0 in elastic bodies."""

CONTACT_GEOMETRY: Table = _table(
    "contacts/{contact}/",
    ("points", "contact_node xy", "length", "slave nodes in order along the surface"),
    ("normal", "contact_node xy", "", "outward normal of the master"),
    ("arc_length", "contact_node", "length", "arc length"),
    ("weight", "contact_node", "length", "length of a node"),
)
CONTACT_HISTORY: Table = _table(
    "contacts/{contact}/",
    ("pressure", "step contact_node", "stress", "pressure"),
    ("traction", "step contact_node", "stress", "traction"),
    ("gap", "step contact_node", "length", "gap"),
    ("slip", "step contact_node", "length", "slip"),
    ("status", "step contact_node", "", "status: 0 open, 1 stick, 2 slip", "int8"),
    ("dissipated_work", "step", "force*length", "dissipated work"),
)
"""Tractions act on the slave, slips are those of the slave relative to the master, both along the tangent."""

PROBES: Table = _table(
    "probes/{probe}/",
    ("displacement", "step xy", "length", "displacement"),
    ("stress", "step tensor", "stress", "stress"),
    ("von_mises", "step", "stress", "von Mises stress"),
)
HOOP_PROBES: Table = _table("probes/{probe}/", ("stress_zz", "step", "stress", "hoop stress"))
"""In bodies of revolution only."""

PATH: Table = _table(
    "path/",
    ("position", "step", "", "position on the path: completed stages + fraction"),
    ("step_length", "step", "", "length of the step"),
    ("residual", "step", "", "residual of the contact problem"),
    ("order", "step", "", "order of the series, 0 without", "int64"),
    ("factorizations", "step", "", "factorizations of the contact problem", "int64"),
    ("solves", "step", "", "solves of the contact problem", "int64"),
    ("seconds", "step", "time", "seconds since the start"),
)
NAMED_PATH: Table = _table(
    "path/",
    ("factors/{load}", "step", "", "load factor"),
    ("resultants/{force}", "step xy", "force", "force of a load or support on its body"),
    ("displacements/{load}", "step xy", "length", "displacement of the platen of a load"),
)

BODIES: Table = _table(
    "bodies/{body}/",
    ("points", "node xy", "length", "nodes of the undeformed body"),
    ("boundary/index", "boundary_node", "", "boundary nodes, surface by surface", "int64"),
    ("boundary/normal", "boundary_node xy", "", "outward normal"),
    ("boundary/name", "boundary_node", "", "name of the surface", "text"),
)

SERIES: Table = _table(
    "series/{step}/",
    ("position", "order", "", "coefficients of the position"),
    ("pressure", "order unknown", "stress", "coefficients of the pressures"),
    ("gap", "order unknown", "length", "coefficients of the gaps"),
    ("motion", "order motion", "length", "coefficients of the unknown motions of platens"),
    ("traction", "order unknown", "stress", "coefficients of the tractions"),
    ("denominator", "degree", "", "coefficients of the denominator of Pade approximants"),
)
MAPS: Table = _table(
    "maps/",
    ("forces/{force}", "value input", "", "force of a load or support from 1 and the unknowns"),
    ("slip/{contact}", "value input", "", "slips of a contact from 1 and the unknowns"),
    ("probes/{probe}", "value input", "", "displacement and stress of a probe from 1 and the unknowns"),
    ("bonds/{contact}", "value input", "", "pressures, then tractions of bonds from 1 and the unknowns"),
)

RUN_FILE: Table = (
    *_table(
        "case/",
        ("raw", "", "", "the case as given", "text"),
        ("resolved", "", "", "the case with all defaults", "text"),
    ),
    *_table("bodies/{body}/", ("degree", "", "", "degree of the local polynomials", "int64")),
    *(*BODIES, *PATH, *NAMED_PATH, *CONTACT_GEOMETRY, *CONTACT_HISTORY, *PROBES, *HOOP_PROBES),
    *(*SERIES, *MAPS),
    *_table("", ("fields/position", "state", "", "positions of the saved states")),
    *FIELDS,
    *_table(
        "checkpoint/",
        ("last/{name}", "any", "", "state of the last row"),
        ("path/{name}", "any", "", "state from which the path continues"),
        ("figures", "", "", "totals so far, as JSON", "text"),
        ("refinement", "", "", "zones and passes that reproduce the clouds, as JSON", "text"),
    ),
)
"""The datasets of run.h5. Those of a checkpoint belong to the method that wrote it."""

PATH_COLUMNS: Table = _table(
    "",
    ("position", "", "", "position on the path"),
    ("stage", "", "", "number of the stage", "int64"),
    ("factor.{load}", "", "", "load factor"),
    ("displacement.{load}", "xy", "length", "displacement of a platen"),
    ("work.{load}", "", "force*length", "work of the force of a platen"),
    ("force.{force}", "xy", "force", "force of a load or support"),
    ("contact.{contact}.force", "xy", "force", "force on the slave"),
    ("contact.{contact}.peak_pressure", "", "stress", "peak pressure"),
    ("contact.{contact}.closed_length", "", "length", "closed length"),
    ("contact.{contact}.dissipated_work", "", "force*length", "dissipated work"),
)
"""The columns of path.csv, one row per step; vectors have two columns that end in _x and _y."""

INTERFACE_COLUMNS = ("x", "y", "arc_length", "gap", "pressure", "traction", "slip", "status")
"""The columns of interface.csv, quantities of the contact in its last row; x and y are its points."""
BODY_ARRAYS = (
    *("displacement", "stress", "von_mises", "strain", "stress_zz", "stretch_1", "stretch_2", "volume_ratio"),
    *("plastic_strain", "flow_stress", "yield_ratio"),
    "boundary_tag",
)
CONTACT_ARRAYS = (
    *("pressure", "traction", "gap", "status", "arc_length", "slip"),
    "displacement",
    "normal",
    "contact_stress",
    "contact",
)
"""The arrays of fields_0000.vtu, contacts_0000.vtu, obstacles_0000.vtu and so on, quantities of the same
names; boundary_tag, contact and obstacle are numbers, contact_stress is pressure and traction on the slave as
a vector."""

CONTACT_FIGURES: Table = _table(
    "contacts.{contact}.",
    ("peak_pressure", "", "stress", "peak pressure"),
    ("half_width", "", "length", "half-width at 1 % of the peak"),
    ("singular_ends", "", "", "whether the peak is at a sharp end of the contact", "bool"),
    ("force", "xy", "force", "force on the slave"),
    ("force_master", "xy", "force", "force on the master, at finite strain"),
    ("force_mismatch", "", "", "difference of the forces on slave and master, relative"),
    ("moment", "", "force*length", "moment of a rotating obstacle"),
    ("min_gap", "", "length", "smallest gap"),
    ("closed_nodes", "", "", "closed nodes", "int64"),
    ("stick_nodes", "", "", "sticking nodes", "int64"),
    ("slip_nodes", "", "", "slipping nodes", "int64"),
    ("max_cone_ratio", "", "", "largest ratio of traction to friction limit"),
    ("dissipated_work", "", "force*length", "dissipated work"),
    ("peak_tension", "", "stress", "peak tension of a bond"),
    ("peak_traction", "", "stress", "peak traction of a bond"),
    ("reference.solution", "", "", "closed formula", "text"),
    ("reference.peak_pressure", "", "stress", "its peak pressure"),
    ("reference.half_width", "", "length", "its half-width"),
    ("reference.pressure_error_l2", "", "", "relative error of pressures"),
)
SUMMARY: Table = (
    *_table(
        "",
        ("status", "", "", "status", "text"),
        ("stop_reason", "", "", "reason", "text"),
        ("hint", "", "", "hint", "text"),
        ("stopped_by", "", "", "condition that ended the path", "text"),
        ("stopped_at", "", "", "position at which it did"),
        ("factors.{load}", "", "", "load factors at which it did"),
        ("failure", "", "", "position and worst nodes of a failed run", "mapping"),
        ("position", "", "", "position"),
        ("steps", "", "", "steps", "int64"),
        ("iterations", "", "", "iterations", "int64"),
        ("factorizations", "", "", "factorizations", "int64"),
        ("solves", "", "", "solves", "int64"),
        ("nodes", "", "", "nodes", "int64"),
        ("unknowns", "", "", "unknowns", "int64"),
        ("contact_unknowns", "", "", "contact unknowns", "int64"),
        ("symmetry", "", "", "line of symmetry of the nodes", "text"),
        ("elastic_factorizations", "", "", "factorizations of the bodies", "int64"),
        ("condensation_solves", "", "", "right-hand sides condensed", "int64"),
        ("enlarged_stencils", "", "", "enlarged stencils", "int64"),
    ),
    *CONTACT_FIGURES,
    *_table(
        "",
        ("plates.{plate}.rotation", "", "angle", "rotation of a platen"),
        ("plates.{plate}.moment", "", "force*length", "moment on the bodies about its hinge"),
        ("probes.{probe}.displacement", "xy", "length", "displacement"),
        ("probes.{probe}.stress", "tensor", "stress", "stress"),
        ("probes.{probe}.von_mises", "", "stress", "von Mises stress"),
        ("probes.{probe}.stress_zz", "", "stress", "hoop stress"),
        ("forces.{force}", "xy", "force", "final force of a load or support"),
        ("residual", "", "", "residual"),
        ("linear_residual", "", "", "linear residual"),
        ("force_balance", "", "", "force balance"),
        ("force_balance_bodies.{body}", "", "", "force balance of a body"),
        ("energy_error", "", "", "energy error"),
        ("energy_error_bodies.{body}", "", "", "energy error of a body"),
        ("error_estimate", "", "", "estimated relative errors", "mapping"),
        ("peak_stress.{body}.stress", "", "stress", "largest von Mises stress on the boundary"),
        ("peak_stress.{body}.place", "xy", "length", "its place"),
        ("peak_stress.{body}.error", "", "", "its estimated relative error"),
        ("peak_stress.{body}.at_contact", "", "stress", "largest von Mises stress at contacts, if larger"),
        ("finite_strain.law", "", "", "law", "text"),
        ("finite_strain.least_stretch", "", "", "least stretch"),
        ("finite_strain.largest_stretch", "", "", "largest stretch"),
        ("finite_strain.least_volume_ratio", "", "", "least volume ratio"),
        ("finite_strain.ellipticity", "", "", "ellipticity"),
        ("finite_strain.equations_renewed", "", "", "times that the equations were renewed", "int64"),
        ("finite_strain.limit_points", "", "", "limit points on the path", "mapping"),
        ("flow.increment_error", "", "", "estimated error of displacements by increments"),
        ("flow.bodies.{body}.plastic_strain", "", "", "largest accumulated plastic strain"),
        ("flow.bodies.{body}.plastic_area", "", "", "part of the area with plastic strain"),
        ("flow.bodies.{body}.plastic_work", "", "force*length", "work of plastic strains"),
        ("flow.bodies.{body}.stored_energy", "", "force*length", "elastic energy, and that of back stresses"),
        ("stability", "", "", "stability"),
        ("quality", "", "", "quality of clouds", "mapping"),
        ("adapt", "", "", "passes of the refinement", "mapping"),
        ("cache", "", "", "clouds and columns kept between runs", "mapping"),
        ("limits", "", "", "limits at which a run fails or warns", "mapping"),
        ("seconds", "", "time", "CPU seconds by phase", "mapping"),
        ("wall_seconds", "", "time", "wall time"),
        ("peak_memory_mb", "", "", "peak memory in MB"),
        ("warnings", "", "", "warnings", "text"),
        ("checks", "", "", "values and limits of all checks", "mapping"),
    ),
)
"""The keys of summary.json."""


PREFIXES: Mapping[str, str] = {"displacement": "u", "stress": ""}
"""What precedes a component in the name of a scalar; otherwise the name of the quantity and an underscore."""


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
            name = PREFIXES.get(entry.name, f"{entry.name}_") + part
            chosen[name] = Scalar(
                entry.name, number, f"{entry.description}{word}{part}", entry.unit, entry.rest
            )
        if axis == "xy" or axis not in COMPONENTS:
            chosen[entry.name] = Scalar(entry.name, None, entry.description, entry.unit, entry.rest)
    return chosen


def members(table: Table) -> dict[str, Quantity]:
    """The quantities of a table by name."""
    return {entry.name: entry for entry in table}


def quantity(table: Table, path: str) -> Quantity | None:
    """The quantity of a table that is written at a ``path`` with names for the parts in braces.

    >>> quantity(RUN_FILE, "contacts/left rail/gap").description
    'gap'
    """
    for entry in table:
        parts = re.split(r"\{\w+\}", entry.path)
        # Names in a path of HDF5 contain no slash; checkpoints are nested further.
        name = ".+" if "/" not in entry.path or entry.path.startswith("checkpoint/") else "[^/]+"
        if re.fullmatch(name.join(map(re.escape, parts)), path):
            return entry
    return None
