"""The case file as frozen values: one class per table, attributes named like the keys.

Units are the user's own and never assumed: lengths, forces per unit thickness and stresses only have to
agree with each other. Defaults stand here and nowhere else.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError, PydanticKnownError

from mlsanm_cli.case.model.base import (
    FOUNDATION,
    LENGTH,
    NUMBER,
    Amount,
    AutoCount,
    AutoLength,
    Coefficient,
    Name,
    Positive,
    Section,
    Unit,
    Vector,
)
from mlsanm_cli.case.model.files import Mesh, Points
from mlsanm_cli.case.model.loads import Load
from mlsanm_cli.case.model.materials import Material
from mlsanm_cli.case.model.obstacles import Obstacle
from mlsanm_cli.case.model.places import Boundaries, Place, Stretch, listed
from mlsanm_cli.case.model.shapes import Shape
from mlsanm_cli.case.model.stop import Stop
from mlsanm_cli.case.model.units import Units


def _linear_solver(value: Any) -> Any:
    """Refuse by name the solvers of earlier versions."""
    if value in ("pardiso", "mumps"):
        raise PydanticCustomError(
            "linear_solver", '"{name}" is no longer there: write "auto" or "superlu"', {"name": value}
        )
    return value


class Model(Section):
    """The plane problem."""

    plane: Literal["strain", "stress"]
    """Plane strain (nothing moves out of the plane) or plane stress (a thin sheet)."""
    strain: Literal["small", "finite"] = "small"
    """Small strains and rotations (linear elasticity), or finite ones: equilibrium of the deformed body, with
    a material `law`."""


class Refine(Section):
    """Finer nodes near a point or a boundary; of several refinements the smallest spacing holds."""

    at: Annotated[Vector, LENGTH] | None = None
    """The point to refine around; either this or `along`."""
    along: str | None = None
    """The boundary of the body to refine along; either this or `at`."""
    spacing: Annotated[Positive, LENGTH]
    """Node spacing within `radius` of the place, at most the body's."""
    radius: Annotated[float, Field(ge=0.0), LENGTH]
    """Within this distance of the place the spacing is even; outside it grows."""
    growth: Annotated[float, Field(gt=0.0, le=1.0), NUMBER] = 0.12
    """Growth of the spacing per unit length outside `radius`; above 0.3 a run warns."""

    def edge(self, body: str) -> str:
        """The boundary in ``along`` without the name of its body, which may stand in front or not."""
        return (self.along or "").removeprefix(f"{body}.")


class Body(Section):
    """One elastic body and the spacing of its nodes, unless a file brings them."""

    name: Name
    """Name of the body; its boundaries are called `<body>.<boundary>`."""
    material: str
    """Name of its material."""
    spacing: Annotated[AutoLength, LENGTH] = "auto"
    """Node spacing far from refinements. Automatic is a twentieth of the body or a sixth of its mean
    thickness, finer near contacts that are close to another boundary, and along arcs."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    """Seed of the random generator that places the nodes: another seed, another cloud of the same spacing."""
    shape: Shape
    refine: tuple[Refine, ...] = ()

    @property
    def has_nodes(self) -> bool:
        """Whether the nodes come with the shape and are not placed by us."""
        return isinstance(self.shape, Mesh | Points) and self.shape.has_nodes


class Support(Stretch):
    """Holds displacements at zero, of a boundary or of the node of a body nearest to a point; or springs on
    a boundary."""

    boundary: Boundaries | None = None
    """The boundary that is held, or a list of several; either this, or `body` and `near`."""
    body: str | None = None
    """The body of which one node is held."""
    near: Annotated[Vector, LENGTH] | None = None
    """The node nearest to this point is held."""
    ux: Annotated[float, LENGTH] | None = None
    """Displacement in x; a direction that is not named is free."""
    uy: Annotated[float, LENGTH] | None = None
    """Displacement in y; a direction that is not named is free."""
    spring: Annotated[Vector, FOUNDATION] | None = None
    """Springs on the boundary: traction per displacement, x and y."""

    @property
    def place(self) -> Place | None:
        """The boundaries it acts on; None if it holds a single node."""
        return None if self.boundary is None else Place(listed(self.boundary), self.ends)

    @property
    def holds(self) -> tuple[bool, bool]:
        """Whether it resists motion in x and in y."""
        springs = self.spring or (0.0, 0.0)
        return self.ux is not None or springs[0] > 0.0, self.uy is not None or springs[1] > 0.0


class Regularization(Section):
    """The law of contact and friction."""

    law: Literal["hyperbolic", "exact"] = "hyperbolic"
    """Smooth hyperbola, whose path is followed by power series, or exact; the same in all contacts."""
    eta: Annotated[Positive, NUMBER] = 1e-4
    """Smallness of the hyperbolic law, relative to the largest pressure."""
    stick: Annotated[Positive, NUMBER] = 1e-4
    """Under the hyperbolic law, slip of a sticking node at its friction limit, relative to the largest slip
    that friction at its limit everywhere would cause."""
    friction_law: Literal["memory", "holonomic"] = "memory"
    """Friction that remembers, or that knows the total slip only (hyperbolic law, loads that never turn
    back); the same in all contacts."""


class Contact(Stretch):
    """Two boundaries that may touch, or one and a rigid obstacle; with ``interference`` they overlap on
    purpose. With ``from`` and ``to`` it is a part of the slave."""

    name: Name
    """Name of the contact."""
    slave: Boundaries
    """The boundary whose nodes carry the pressures: the one with the finer nodes or the smaller radius; or a
    list of boundaries that join end to end."""
    master: Boundaries | None = None
    """The boundary it may touch, or a list of boundaries that join end to end."""
    obstacle: Obstacle | None = None
    """The rigid obstacle it may touch instead."""
    interference: Annotated[Positive, LENGTH] | None = None
    """By how much the surfaces overlap on purpose where they do so most."""
    gap: Annotated[Amount, LENGTH] = 0.0
    """What is added to the gap between the surfaces as drawn: a number, or an expression in x and y of the
    slave's points. Crowned, wavy and rough profiles need not be drawn."""
    friction: Annotated[Coefficient, NUMBER] = 0.0
    """Coulomb's coefficient, 0 leaves every tangential unknown out; or `"bonded"`: surfaces drawn touching
    are one, and carry tension too."""
    accuracy: Annotated[float, Field(gt=0.0, le=0.1), NUMBER] = 1e-3
    """Error of the pressures that their grid is refined to, relative to the largest."""
    reach: Annotated[AutoLength, LENGTH] = "auto"
    """Nodes with a larger initial gap are left out; a run in which one of them closes fails."""
    regularization: Regularization = Regularization()

    @property
    def bonded(self) -> bool:
        """Whether its surfaces are one."""
        return self.friction == "bonded"

    @property
    def coefficient(self) -> float:
        """Coulomb's coefficient; inf where surfaces are bonded."""
        return math.inf if self.friction == "bonded" else self.friction

    @property
    def boundaries(self) -> tuple[str, ...]:
        """The boundaries of elastic bodies in it: the slave's and, if there is one, the master's."""
        return tuple(name for side in self.sides for name in side.boundaries)

    @property
    def sides(self) -> tuple[Place, ...]:
        """The slave and, if there is one, the master."""
        master = () if self.master is None else (Place(listed(self.master)),)
        return (Place(listed(self.slave), self.ends), *master)

    @property
    def names(self) -> tuple[str, ...]:
        """What the sides are called."""
        return tuple(side.label for side in self.sides)


class Probe(Section):
    """Displacement and stress at a point of a body, recorded at every step."""

    name: Name
    """Name under which the values are stored, as `/probes/<name>` in run.h5."""
    body: str
    """The body that the point belongs to."""
    point: Annotated[Vector, LENGTH]
    """The point, before loading; inside the body or on its boundary."""


class Mls(Section):
    """Moving least squares."""

    degree: Annotated[int, Field(ge=1, le=6)] = 2
    """Degree of the local polynomials."""
    scheme: Literal["least-squares", "collocation", "ghost"] = "least-squares"
    """What becomes of the rows: all of them in the least-squares sense, or one per unknown."""
    neighbors: AutoCount = "auto"
    """Nodes per stencil; automatic is about 2.5 times the number of coefficients."""


class Adapt(Section):
    """Refinement of the clouds by what was found on coarser ones."""

    passes: Annotated[int, Field(ge=0, le=20)] = 0
    """So often the scene is solved, refined where contact begins and ends and where local fits are poor, and
    solved again; it ends earlier when nothing changes any more."""


class Solver(Section):
    """How the load path is followed."""

    method: Literal["auto", "anm", "newton", "active-set"] = "auto"
    """Power series (anm) or Newton-Raphson steps for the hyperbolic law, active-set for the exact one; auto
    takes what fits."""
    formulation: Literal["condensed", "monolithic"] = "condensed"
    """Unknowns of the path: condensed leaves the contact's own, monolithic takes the bodies' displacements
    too."""
    order: Annotated[int, Field(ge=2, le=40)] = 20
    """Order of the power series."""
    tolerance: Annotated[float, Field(gt=0.0, lt=1.0), NUMBER] = 1e-8
    """Largest scaled residual anywhere on the path."""
    pade: bool = True
    """Use Padé approximants where they lengthen a step."""
    polish: bool | Literal["auto"] = "auto"
    """End every saved level with the exact laws; auto does where these need no history: not with friction
    that remembers."""
    max_steps: Annotated[int, Field(ge=1, le=1_000_000)] = 2000
    """A path that needs more steps fails."""
    linear: Annotated[Literal["auto", "superlu"], BeforeValidator(_linear_solver)] = "auto"
    """Direct solver of the bodies' linear systems: auto is our own, with SuperLU for square schemes."""


class Output(Section):
    """What is written, and where on the path."""

    at: Annotated[tuple[float, ...], Unit("position on the path")] = ()
    """Positions (finished stages + fraction of the current one) at which fields are written; the end of the
    path when empty."""
    fields: tuple[Literal["displacement", "stress", "von_mises", "strain"], ...] = (
        "displacement",
        "stress",
        "von_mises",
    )
    """Which fields are written."""
    vtu: bool = True
    """Write VTU files for ParaView."""


class Reference(Section):
    """The closed formula that the result is compared with; its parameters come from the case."""

    solution: Literal["hertz-line", "uniform-pressure"]
    """Hertz' line contact, or the same pressure everywhere; one that does not fit the scene is an error."""


def _no_bool(value: Any) -> Any:
    """The value of ``format``; true, which Python takes for 1, is none."""
    if isinstance(value, bool):
        raise PydanticKnownError("literal_error", {"expected": "1"})
    return value


class Case(Section):
    """A scene for mlsanm. No units are assumed: lengths, stresses and forces only have to agree."""

    format: Annotated[Literal[1], BeforeValidator(_no_bool)]
    """Version of the file format."""
    title: str = ""
    """Free text."""
    model: Model
    units: Units = Units()
    material: dict[Name, Material]
    """Materials by name."""
    body: tuple[Body, ...] = Field(min_length=1)
    support: tuple[Support, ...] = ()
    load: tuple[Load, ...] = ()
    contact: tuple[Contact, ...] = ()
    stop: tuple[Stop, ...] = ()
    stage: tuple[dict[str, float], ...] = ()
    """Stages follow each other. In each the loads named move together from where they are to these factors;
    without any there is one stage that brings every load to 1."""
    mls: Mls = Mls()
    adapt: Adapt = Adapt()
    solver: Solver = Solver()
    output: Output = Output()
    probe: tuple[Probe, ...] = ()
    reference: Reference | None = None

    @property
    def moved(self) -> tuple[str, ...]:
        """What has a load factor: the loads, then the contacts with an interference."""
        return (*(load.name for load in self.load), *(c.name for c in self.contact if c.interference))

    @property
    def touching(self) -> tuple[Contact, ...]:
        """The contacts whose surfaces may come apart: all but bonded ones."""
        return tuple(contact for contact in self.contact if not contact.bonded)

    @property
    def polished(self) -> bool:
        """Whether saved levels end with the exact laws."""
        if self.solver.polish != "auto":
            return self.solver.polish
        first = self.touching[0].regularization if self.touching else None
        if first is None or first.law == "exact" or self.solver.formulation == "monolithic":
            return False
        return not any(c.friction and c.regularization.friction_law == "memory" for c in self.touching)

    @model_validator(mode="before")
    @classmethod
    def _default_stage(cls, data: Any) -> Any:
        """One stage that brings all to 1; an interference that no stage names grows in the first one."""
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


def _names(items: Any, with_key: str = "name") -> list[str]:
    """Names of the items of a raw list that have a key."""
    rows = [item for item in items if isinstance(item, dict)] if isinstance(items, tuple) else []
    return [row["name"] for row in rows if isinstance(row.get("name"), str) and with_key in row]
