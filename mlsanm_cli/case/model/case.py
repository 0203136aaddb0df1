"""The case file as frozen values: one class per table, attributes named like the keys. Any consistent units
of length, force per unit thickness and stress can be used. All defaults are set here."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticKnownError

from mlsanm_cli.case.model.base import (
    FOUNDATION,
    LENGTH,
    NUMBER,
    Amount,
    AutoLength,
    Coefficient,
    Name,
    Positive,
    Section,
    Unit,
    Vector,
)
from mlsanm_cli.case.model.loads import Load
from mlsanm_cli.case.model.materials import Material
from mlsanm_cli.case.model.obstacles import Obstacle
from mlsanm_cli.case.model.places import Boundaries, BoundaryPart, Place, listed
from mlsanm_cli.case.model.shapes import Mesh, Points, Shape
from mlsanm_cli.case.model.solver import Adapt, Mls, Solver
from mlsanm_cli.case.model.stop import Stop

Symbol = Annotated[str, Field(max_length=20)]


class Units(Section):
    """Unit symbols shown in pictures and reports. Nothing is converted."""

    length: Symbol = ""
    """Unit of lengths and displacements, as in "mm"."""
    stress: Symbol = ""
    """Unit of stresses and pressures, as in "MPa"."""
    force: Symbol = ""
    """Unit of forces per unit thickness, as in "N/mm"."""

    def label(self, text: str, kind: str) -> str:
        """A label with the unit of a ``kind`` (length, stress or force), if it is given."""
        symbol = getattr(self, kind, "")
        return f"{text} [{symbol}]" if symbol else text


ZERO_ONLY = Field(json_schema_extra={"enum": [0.0]})
"""0.0 is the only value supported; others are reported by the checks."""


class Model(Section):
    """Plane strain or plane stress, small or finite strain."""

    plane: Literal["strain", "stress"]
    """Plane strain (no displacement out of the plane) or plane stress (thin sheet)."""
    strain: Literal["small", "finite"] = "small"
    """Linear elasticity (small strains and rotations), or equilibrium of the deformed body (finite), which
    needs a hyperelastic `law` of the material."""


class Refine(Section):
    """Local refinement near a point or a boundary. Where several overlap, the smallest spacing applies."""

    at: Annotated[Vector, LENGTH] | None = None
    """Point to refine around; give `at` or `along`."""
    along: str | None = None
    """Boundary of the body to refine along; give `at` or `along`."""
    spacing: Annotated[Positive, LENGTH]
    """Node spacing within `radius` of the point or boundary, at most that of the body."""
    radius: Annotated[float, Field(ge=0.0), LENGTH]
    """Distance up to which the spacing is constant; beyond it grows."""
    growth: Annotated[float, Field(gt=0.0, le=1.0), NUMBER] = 0.12
    """Increase of the spacing per unit length outside `radius`; values above 0.3 cause a warning."""

    def edge(self, body: str) -> str:
        """The boundary in ``along`` without the name of its body, which is optional there."""
        return (self.along or "").removeprefix(f"{body}.")


class Body(Section):
    """An elastic body: its material, its shape and the spacing of its nodes."""

    name: Name
    """Name of the body; its boundaries are addressed as `<body>.<boundary>`."""
    material: str
    """Name of its material."""
    spacing: Annotated[AutoLength, LENGTH] = "auto"
    """Node spacing away from refinements. `"auto"` is 1/20 of the body's size or 1/6 of its mean thickness,
    whichever is smaller, less for strongly orthotropic materials, and finer along arcs, in narrow
    parts, at ends of clamped sides, where loads vary or end within a side, near contacts close to another
    boundary, at corners other than right ones that touch an obstacle, and at finite strain along surfaces in
    contact."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    """Seed of the random generator that places the nodes; it changes the cloud, not its spacing."""
    shape: Shape
    refine: tuple[Refine, ...] = ()

    @property
    def has_nodes(self) -> bool:
        """Whether the nodes are read from a file."""
        return isinstance(self.shape, Mesh | Points) and self.shape.has_nodes


class Support(BoundaryPart):
    """Displacements fixed at zero on a boundary or at a point of a body, or elastic
    springs on a boundary."""

    boundary: Boundaries | None = None
    """The supported boundary or boundaries of one body; give `boundary`, or `body` and `near`."""
    body: str | None = None
    """Body of which a single node is supported."""
    near: Annotated[Vector, LENGTH] | None = None
    """A node is placed at this point and supported; in bodies with nodes from a file, the nearest node is."""
    ux: Annotated[float, ZERO_ONLY, LENGTH] | None = None
    """0.0 fixes the displacement in x; without it x is free."""
    uy: Annotated[float, ZERO_ONLY, LENGTH] | None = None
    """0.0 fixes the displacement in y; without it y is free."""
    spring: Annotated[Vector, FOUNDATION] | None = None
    """Stiffness of springs on the boundary (Winkler foundation): traction per displacement in x and y."""

    @property
    def place(self) -> Place | None:
        """The boundaries on which it acts; None if it fixes a single node."""
        return None if self.boundary is None else Place(listed(self.boundary), self.ends)

    @property
    def holds(self) -> tuple[bool, bool]:
        """Whether it resists displacement in x and in y."""
        springs = self.spring or (0.0, 0.0)
        return self.ux is not None or springs[0] > 0.0, self.uy is not None or springs[1] > 0.0


class Regularization(Section):
    """The contact and friction law."""

    law: Literal["exact", "hyperbolic"] = "exact"
    """Exact Signorini and Coulomb conditions, or the regularised contact law (a smooth hyperbola), required
    by power series; the same in all contacts. Hyperbolic by default if another parameter of this table,
    `solver.method` `"anm"` or `"newton"`, the monolithic formulation or `solver.polish = true` requires it;
    always exact at finite strain."""
    eta: Annotated[Positive, NUMBER] = 1e-4
    """Regularisation parameter of the hyperbolic law, relative to the largest pressure."""
    stick: Annotated[Positive, NUMBER] = 1e-4
    """Slip at the onset of sliding, relative to the largest slip at full sliding (hyperbolic law only)."""
    friction_law: Literal["memory", "holonomic"] = "memory"
    """History-dependent friction, or holonomic friction that depends on the total slip only (hyperbolic law,
    monotonic loading); the same in all contacts."""


class Contact(BoundaryPart):
    """A possible contact between two boundaries, or between a boundary and a rigid obstacle. ``from`` and
    ``to`` restrict it to a part of the slave."""

    name: Name
    """Name of the contact."""
    slave: Boundaries
    """Boundary that carries the contact pressures, or a list of boundaries that join end to end. Choose the
    one with the finer nodes or the smaller radius."""
    master: Boundaries | None = None
    """Opposite boundary, or a list of boundaries that join end to end; give `master` or `obstacle`."""
    obstacle: Obstacle | None = None
    """Rigid obstacle instead of a master."""
    interference: Annotated[Positive, LENGTH] | None = None
    """Interference of a press fit: the largest overlap of the undeformed surfaces."""
    gap: Annotated[Amount, LENGTH] = 0.0
    """Initial gap in addition to the drawn one: a number or an expression in the coordinates x, y of the
    slave, for crowned, wavy or rough profiles."""
    friction: Annotated[Coefficient, NUMBER] = 0.0
    """Coulomb's coefficient of friction, or `"bonded"`: touching surfaces are tied together and also carry
    tension."""
    accuracy: Annotated[float, Field(gt=0.0, le=0.1), NUMBER] = 1e-3
    """Tolerance of the contact grid: error of the pressures relative to the largest pressure. At finite
    strain, relative error of the contact force: bodies of automatic spacing are refined for it after a first
    run."""
    reach: Annotated[AutoLength, LENGTH] = "auto"
    """Search distance: nodes with a larger initial gap are ignored; the run fails if one of them closes."""
    regularization: Regularization = Regularization()

    @property
    def bonded(self) -> bool:
        """Whether its surfaces are tied together."""
        return self.friction == "bonded"

    @property
    def coefficient(self) -> float:
        """Coulomb's coefficient; inf for bonded surfaces."""
        return math.inf if self.friction == "bonded" else self.friction

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Its boundaries of elastic bodies: those of the slave and of the master, if there is one."""
        return tuple(name for side in self.sides for name in side.boundaries)

    @property
    def sides(self) -> tuple[Place, ...]:
        """The slave and, if there is one, the master."""
        master = () if self.master is None else (Place(listed(self.master)),)
        return (Place(listed(self.slave), self.ends), *master)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the sides."""
        return tuple(side.label for side in self.sides)


class Probe(Section):
    """Displacement and stress at a point of a body, recorded at every step."""

    name: Name
    """Name; values are stored as `/probes/<name>` in run.h5."""
    body: str
    """Body that contains the point."""
    point: Annotated[Vector, LENGTH]
    """Coordinates in the undeformed body, inside it or on its boundary."""


class Output(Section):
    """Output files."""

    at: Annotated[tuple[float, ...], Unit("position on the path")] = ()
    """Path positions (completed stages + fraction of the current one) at which fields are written; the end of
    the path if empty."""
    fields: tuple[Literal["displacement", "stress", "von_mises", "strain"], ...] = (
        "displacement",
        "stress",
        "von_mises",
    )
    """Fields to write."""
    vtu: bool = True
    """Write VTU files for ParaView."""


class Reference(Section):
    """Analytical solution for comparison; its parameters are taken from the case."""

    solution: Literal["hertz-line", "uniform-pressure"]
    """Hertz' line contact or a uniform pressure; a solution that does not match the scene is an error."""


def _no_bool(value: Any) -> Any:
    """The value of ``format``; Python would accept true for 1."""
    if isinstance(value, bool):
        raise PydanticKnownError("literal_error", {"expected": "1"})
    return value


class Case(Section):
    """A scene. Any consistent units can be used."""

    format: Annotated[Literal[1], BeforeValidator(_no_bool)]
    """Version of the file format."""
    title: str = ""
    """Free text."""
    model: Model
    units: Units = Units()
    material: dict[Name, Material]
    # An empty list is reported by the checks: while invalid items are removed it must remain valid.
    body: tuple[Body, ...] = Field(json_schema_extra={"minItems": 1})
    support: tuple[Support, ...] = ()
    load: tuple[Load, ...] = ()
    contact: tuple[Contact, ...] = ()
    stop: tuple[Stop, ...] = ()
    stage: tuple[dict[str, float], ...] = ()
    """Load stages, one after the other: load factors change proportionally from their current values to those
    given. Without stages all factors increase from 0 to 1."""
    mls: Mls = Mls()
    adapt: Adapt = Adapt()
    solver: Solver = Solver()
    output: Output = Output()
    probe: tuple[Probe, ...] = ()
    reference: Reference | None = None

    @property
    def moved(self) -> tuple[str, ...]:
        """Names of load factors: the loads, then the contacts with an interference."""
        return (*(load.name for load in self.load), *(c.name for c in self.contact if c.interference))

    @property
    def touching(self) -> tuple[Contact, ...]:
        """The unilateral contacts, that is, all that are not bonded."""
        return tuple(contact for contact in self.contact if not contact.bonded)

    @property
    def polished(self) -> bool:
        """Whether saved load levels are solved again with the exact laws."""
        if self.solver.polish != "auto":
            return self.solver.polish
        first = self.touching[0].regularization if self.touching else None
        if first is None or first.law == "exact" or self.solver.formulation == "monolithic":
            return False
        return not any(c.friction and c.regularization.friction_law == "memory" for c in self.touching)

    @model_validator(mode="before")
    @classmethod
    def _default_stage(cls, data: Any) -> Any:
        """One stage up to load factor 1; an interference that no stage names is applied in the first one."""
        if not isinstance(data, dict):
            return data
        given = data.get("stage")
        fits = _names(data.get("contact", ()), with_key="interference")
        if given is None:
            return {**data, "stage": (dict.fromkeys([*_names(data.get("load", ())), *fits], 1.0),)}
        if not isinstance(given, tuple) or not all(isinstance(stage, dict) for stage in given) or not given:
            return data
        growing = {name: 1.0 for name in fits if not any(name in stage for stage in given)}
        return {**data, "stage": ({**growing, **given[0]}, *given[1:])}

    @model_validator(mode="before")
    @classmethod
    def _common_plates(cls, data: Any) -> Any:
        """Loads on one plate share its hinge and, unless they set their own, its kind of rotation."""
        if not isinstance(data, dict) or not isinstance(data.get("load"), tuple):
            return data
        return {**data, "load": tuple(_with_common_keys(row, data["load"]) for row in data["load"])}


def finer_nodes(case: Case, names: Collection[str], key: str = "spacing") -> str:
    """Hint to use finer nodes in the bodies of these names, by a ``key`` of theirs or in their files."""
    keys = [f"body.{b.name}.{'shape.file' if b.has_nodes else key}" for b in case.body if b.name in names]
    return f"use finer nodes ({', '.join(keys)})"


def _with_common_keys(row: Any, rows: tuple[Any, ...]) -> Any:
    """A raw load, with missing hinge and rotation from other loads on the same plate."""
    if not isinstance(row, dict) or row.get("kind") != "platen":
        return row
    keys = ("kind", "boundary", "from", "to")
    others = [one for one in rows if isinstance(one, dict) and all(one.get(k) == row.get(k) for k in keys)]
    hinges = [one["hinge"] for one in others if "hinge" in one]
    common: dict[str, Any] = {"hinge": hinges[0]} if hinges else {}
    turning = [one.get("rotation", "free") for one in others if one.keys() & {"rotation", "hinge", "moment"}]
    if turning and not row.keys() & {"rotation", "hinge", "moment"}:
        common["rotation"] = 0.0 if isinstance(turning[0], float) else turning[0]
    return common | row


def _names(items: Any, with_key: str = "name") -> list[str]:
    """Names of the items of a raw list that have a key."""
    rows = [item for item in items if isinstance(item, dict)] if isinstance(items, tuple) else []
    return [row["name"] for row in rows if isinstance(row.get("name"), str) and with_key in row]
