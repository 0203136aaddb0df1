"""The case file as frozen values: one class per table, attributes named like the keys.

Units are the user's own and never assumed: lengths, forces per unit thickness and stresses only have to
agree with each other. Defaults stand here and nowhere else.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from mlsanm_cli.case.base import (
    AutoCount,
    AutoLength,
    BoundaryName,
    Name,
    Positive,
    Section,
    Vector,
)
from mlsanm_cli.case.files import Mesh, Points
from mlsanm_cli.case.loads import Load
from mlsanm_cli.case.materials import Material
from mlsanm_cli.case.shapes import Shape


class Model(Section):
    """Plane strain or plane stress."""

    plane: Literal["strain", "stress"]


class Refine(Section):
    """Finer nodes within ``radius`` of a point or of a boundary, growing by ``growth`` per unit length."""

    at: Vector | None = None
    along: str | None = None
    spacing: Positive
    radius: Annotated[float, Field(ge=0.0)]
    growth: Annotated[float, Field(gt=0.0, le=1.0)] = 0.12

    def edge(self, body: str) -> str:
        """The boundary in ``along`` without the name of its body, which may stand in front or not."""
        return (self.along or "").removeprefix(f"{body}.")


class Body(Section):
    """One elastic body and the spacing of its nodes; None where a file brings the nodes."""

    name: Name
    material: str
    spacing: Positive | None = None
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    shape: Shape
    refine: tuple[Refine, ...] = ()

    @property
    def brings_nodes(self) -> bool:
        """Whether the nodes come with the shape and are not placed by us."""
        return isinstance(self.shape, Mesh | Points) and self.shape.brings_nodes


class Support(Section):
    """Held displacement components of a boundary, or of the node of a body nearest to a point; or springs on
    a boundary, (x, y) traction per displacement."""

    boundary: BoundaryName | None = None
    body: str | None = None
    near: Vector | None = None
    ux: float | None = None
    uy: float | None = None
    spring: Vector | None = None

    @property
    def holds(self) -> tuple[bool, bool]:
        """Whether it resists motion in x and in y."""
        springs = self.spring or (0.0, 0.0)
        return self.ux is not None or springs[0] > 0.0, self.uy is not None or springs[1] > 0.0


class Regularization(Section):
    """The contact law: hyperbolic with the small pressure ``eta`` and the small slip ``stick`` (relative), or
    exact; friction that remembers, or that knows the total slip only."""

    law: Literal["hyperbolic", "exact"] = "hyperbolic"
    eta: Positive = 1e-4
    stick: Positive = 1e-4
    friction_law: Literal["memory", "holonomic"] = "memory"


class Contact(Section):
    """Two boundaries that may touch."""

    name: Name
    slave: BoundaryName
    master: BoundaryName
    friction: Annotated[float, Field(ge=0.0)] = 0.0
    reach: AutoLength = "auto"
    regularization: Regularization = Regularization()


class Mls(Section):
    """Moving least squares: degree, scheme, nodes per stencil."""

    degree: Annotated[int, Field(ge=1, le=6)] = 2
    scheme: Literal["least-squares", "collocation", "ghost"] = "least-squares"
    neighbors: AutoCount = "auto"


class Adapt(Section):
    """Passes of refinement at the contact edges found."""

    passes: Annotated[int, Field(ge=0)] = 0


class Solver(Section):
    """How the load path is followed."""

    method: Literal["auto", "anm", "newton", "active-set"] = "auto"
    formulation: Literal["condensed", "monolithic"] = "condensed"
    order: Annotated[int, Field(ge=2, le=40)] = 20
    tolerance: Annotated[float, Field(gt=0.0, lt=1.0)] = 1e-8
    pade: bool = True
    polish: bool = False
    max_steps: Annotated[int, Field(ge=1)] = 2000
    linear: Literal["auto", "superlu"] = "auto"


class Output(Section):
    """Path positions (stage index + fraction) at which fields are written, and which."""

    at: tuple[float, ...] = ()
    fields: tuple[Literal["displacement", "stress", "von_mises"], ...] = (
        "displacement",
        "stress",
        "von_mises",
    )
    vtu: bool = True


class Reference(Section):
    """The closed formula that the result can be compared with."""

    solution: Literal["hertz-line", "uniform-pressure"]


class Case(Section):
    """A whole case. ``stage`` defaults to one stage that brings every load to its full value."""

    format: Literal[1]
    title: str = ""
    model: Model
    material: dict[Name, Material]
    body: tuple[Body, ...] = Field(min_length=1)
    support: tuple[Support, ...] = ()
    load: tuple[Load, ...] = Field(min_length=1)
    contact: tuple[Contact, ...] = ()
    stage: tuple[dict[str, float], ...]
    mls: Mls = Mls()
    adapt: Adapt = Adapt()
    solver: Solver = Solver()
    output: Output = Output()
    reference: Reference | None = None

    @model_validator(mode="before")
    @classmethod
    def _default_stage(cls, data: Any) -> Any:
        if not isinstance(data, dict) or "stage" in data or not isinstance(data.get("load"), tuple):
            return data
        names = [load.get("name") for load in data["load"] if isinstance(load, dict)]
        return {**data, "stage": ({name: 1.0 for name in names if isinstance(name, str)},)}
