"""The case file as frozen values: one class per table, attributes named like the keys. Any consistent units
of length, force per unit thickness and stress can be used. All defaults are set here."""

from collections import Counter
from collections.abc import Collection, Iterator
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticKnownError

from mlsanm_cli.case.model.conditions import Stop, Support
from mlsanm_cli.case.model.contacts import Contact
from mlsanm_cli.case.model.materials import Material
from mlsanm_cli.case.model.motions import AnyLoad, ObstacleMotion, Platen
from mlsanm_cli.case.model.section import (
    LENGTH,
    NUMBER,
    AutoCount,
    AutoDegree,
    Name,
    Scope,
    Section,
    Unit,
    Vector,
)
from mlsanm_cli.case.model.shapes import Body
from mlsanm_cli.case.report import KeyPath, suggestion
from mlsanm_cli.errors import Fault
from mlsanm_cli.roundoff import ROUND_OFF

MAX_INCREMENTS = 10_000
"""Largest number of increments of a stage."""
MAX_NEIGHBORS_PER_TERM = 20
"""Largest number of nodes of a stencil per coefficient of its polynomial."""


class Mls(Section):
    """Moving least squares approximation."""

    degree: AutoDegree = "auto"
    """Degree of the local polynomials, 1 to 6; `"auto"` is 4, and 2 for bodies whose contacts have nodal
    pressures at small strain, whose parts are too thin for 4, or that have slits or nodes from a file."""
    scheme: Literal["least-squares", "collocation"] = "least-squares"
    """All equations solved by least squares, or as many as there are unknowns by collocation (hyperbolic law
    only)."""
    neighbors: AutoCount = "auto"
    """Nodes per stencil; `"auto"` is about 2.5 times the number of coefficients."""

    def faults(self, scope: Scope) -> Iterator[Fault]:
        # The lowest degree that "auto" selects.
        degree = 2 if self.degree == "auto" else self.degree
        terms = (degree + 1) * (degree + 2) // 2
        most = MAX_NEIGHBORS_PER_TERM * terms
        if self.neighbors != "auto" and not terms <= self.neighbors <= most:
            few = self.neighbors < terms
            hint = f"at least {terms}, better twice as many" if few else f"at most {most}"
            words = f"{self.neighbors} nodes are too {'few' if few else 'many'}"
            message = f"{words} for the {terms} terms of degree {degree}"
            yield Fault(("neighbors",), message, f'{hint}, or "auto"')
        square = self.scheme != "least-squares"
        yield from scope.refused(square, ("scheme",), f'"{self.scheme}"', '"least-squares"')
        if square and scope.strain == "small" and not scope.case.is_regularized:
            yield Fault(("scheme",), f'"{self.scheme}" needs the hyperbolic contact law', '"least-squares"')
        yield from scope.refused(self.degree == 1, ("degree",), "degree 1", "at least 2")


class Adapt(Section):
    """Adaptive refinement."""

    passes: Annotated[int, Field(ge=0, le=20)] = 0
    """Number of refinement passes: solve, refine at contact edges and where the local error is large, solve
    again. Stops earlier at convergence."""

    def faults(self, scope: Scope) -> Iterator[Fault]:
        if not self.passes:
            return
        case = scope.case
        for body in [body.name for body in case.body if body.has_nodes][:1]:
            message = f'body "{body}" cannot be refined: its nodes come from a file'
            yield Fault(("passes",), message, 'write 0, or take the outline only: use = "outline"')
        if case.contact and not case.touching:
            hint = "write 0, and refine along the bonds and at their ends with [[body.refine]]"
            yield Fault(("passes",), "bonded contacts are not refined automatically", hint)
        yield from scope.refused(self.passes, ("passes",), "refinement", "write 0")


class Solver(Section):
    """Path following and linear solver."""

    method: Literal["auto", "anm", "newton", "active-set"] = "auto"
    """Power series (anm) or Newton-Raphson for the hyperbolic law, active-set for the exact law; `"auto"`
    selects by the law."""
    formulation: Literal["condensed", "monolithic"] = "condensed"
    """The exact law is condensed to the contact unknowns; the hyperbolic law has all displacements as
    unknowns, and `"monolithic"` selects it."""
    order: Annotated[int, Field(ge=2, le=40)] = 20
    """Order of the power series."""
    tolerance: Annotated[float, Field(gt=0.0, lt=1.0), NUMBER] = 1e-8
    """Largest allowed scaled residual on the path."""
    pade: bool = True
    """Use Padé approximants where they extend a step."""
    increments: AutoCount = "auto"
    """Least number of increments of every stage, at most 10,000; `"auto"` is 10 for regularised friction,
    whose history is updated at their ends (backward Euler), and otherwise as many as `increment_error` takes.
    """
    max_increment: Annotated[float, Field(gt=0.0, le=1.0), NUMBER] = 1.0
    """Largest increment, as a part of a stage, of plastic flow and of contact at finite strain."""
    increment_error: Annotated[float, Field(gt=0.0, lt=1.0), NUMBER] = 5e-3
    """Largest error by an increment: of strains by plastic flow, relative to the largest strains (root mean
    squares), or of the forces of contacts with friction at finite strain, relative to the largest one;
    increments are chosen by it."""
    max_steps: Annotated[int, Field(ge=1, le=1_000_000)] = 2000
    """Largest number of steps; a path that needs more fails."""
    linear: Literal["auto", "superlu"] = "auto"
    """Direct solver: `"auto"` is the built-in sparse Cholesky factorisation."""

    @property
    def largest_increment(self) -> float:
        return min(self.max_increment, 1.0 if self.increments == "auto" else 1.0 / self.increments)

    def faults(self, scope: Scope) -> Iterator[Fault]:
        if self.increments != "auto" and self.increments > MAX_INCREMENTS:
            message = f"{self.increments} increments are too many"
            yield Fault(("increments",), message, f"at most {MAX_INCREMENTS}")
        if scope.strain == "finite" and self.method == "active-set" and not scope.names("contact"):
            yield Fault(("method",), '"active-set" needs a contact', '"anm" or "newton"')
        law = scope.case.touching[0].regularization.law if scope.case.touching else None
        fitting = {"anm": "hyperbolic", "newton": "hyperbolic", "active-set": "exact"}.get(self.method, law)
        if law not in (None, fitting):
            hint = f'law = "{fitting}" in [contact.regularization], or method = "auto"'
            if scope.strain == "finite":
                hint = 'method = "auto": at finite strain the contact law is always exact'
            yield Fault(("method",), f'"{self.method}" cannot solve the {law} contact law', hint)
        if self.formulation == "monolithic" and law != "hyperbolic":
            message = "the monolithic formulation needs the hyperbolic contact law"
            yield Fault(("formulation",), message, 'formulation = "condensed"')


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


class Probe(Section):
    """Displacement and stress at a point of a body, recorded at every step."""

    name: Name
    """Name; values are stored as `/probes/<name>` in run.h5."""
    body: str
    """Body that contains the point."""
    point: Annotated[Vector, LENGTH]
    """Coordinates in the undeformed body, inside it or on its boundary."""


SavedField = Literal["displacement", "stress", "von_mises", "strain"]


class Output(Section):
    """Output files."""

    at: Annotated[tuple[float, ...], Unit("position on the path")] = ()
    """Path positions (completed stages + fraction of the current one) at which fields are written; the end of
    the path if empty."""
    fields: tuple[SavedField, ...] = ("displacement", "stress", "von_mises")
    """Fields to write; bodies with a yield stress also have plastic_strain, flow_stress and yield_ratio."""
    vtu: bool = True
    """Write VTU files for ParaView."""

    def faults(self, scope: Scope) -> Iterator[Fault]:
        for field, times in Counter(self.fields).items():
            if times > 1:
                yield Fault(("fields",), f'"{field}" is listed {times} times')
        stages = len(scope.case.stage)
        for index, position in enumerate(self.at):
            if not 0.0 <= position <= stages:
                message = f"{position:g} is outside the path, which goes from 0 to {stages}"
                yield Fault(("at", index), message, "a position is the stage index + fraction")


class Reference(Section):
    """Analytical solution for comparison; its parameters are taken from the case."""

    solution: Literal["hertz-line", "uniform-pressure"]
    """Hertz' line contact or a uniform pressure; a solution that does not match the scene is an error."""

    def faults(self, scope: Scope) -> Iterator[Fault]:
        yield from scope.refused(True, (), "an analytical solution", "remove the table")


def _no_bool(value: Any) -> Any:
    """The value of ``format``; Python would accept true for 1."""
    if isinstance(value, bool):
        raise PydanticKnownError("literal_error", {"expected": "1"})
    return value


class Model(Section):
    """Plane strain, plane stress or bodies of revolution; small or finite strain."""

    plane: Literal["strain", "stress", "axisymmetric"]
    """Plane strain (no displacement out of the plane), plane stress (thin sheet), or bodies of revolution
    about the line x = 0, drawn in the half-plane x >= 0 (axisymmetric): x is the radius, y the height, and
    forces are those of the full turn."""
    strain: Literal["small", "finite"] = "small"
    """Linear elasticity (small strains and rotations), or equilibrium of the deformed body (finite), which
    needs a hyperelastic `law` of the material."""

    @property
    def confined(self) -> bool:
        """Whether strains out of the plane are prescribed, so that constants in that direction count."""
        return self.plane != "stress"

    @property
    def revolved(self) -> bool:
        return self.plane == "axisymmetric"


class Case(Section):
    """A scene. Any consistent units can be used."""

    format: Annotated[Literal[1], BeforeValidator(_no_bool)]
    """Version of the file format."""
    title: str = ""
    """Free text."""
    model: Model
    units: Units = Units.model_construct()
    material: dict[Name, Material]
    # An empty list is a fault of the case: pydantic would find one wherever a body is invalid.
    body: tuple[Body, ...] = Field(json_schema_extra={"minItems": 1})
    support: tuple[Support, ...] = ()
    load: tuple[Annotated[AnyLoad, Field(discriminator="kind")], ...] = ()
    contact: tuple[Contact, ...] = ()
    stop: tuple[Stop, ...] = ()
    stage: tuple[dict[str, float], ...] = ()
    """Load stages, one after the other: load factors change proportionally from their current values to those
    given. Without stages all factors increase from 0 to 1."""
    mls: Mls = Mls.model_construct()
    adapt: Adapt = Adapt.model_construct()
    solver: Solver = Solver.model_construct()
    output: Output = Output.model_construct()
    probe: tuple[Probe, ...] = ()
    reference: Reference | None = None

    @property
    def moved(self) -> tuple[str, ...]:
        """Names of load factors: the loads, then the contacts with an interference."""
        return (*(load.name for load in self.load), *(c.name for c in self.contact if c.interference))

    @property
    def touching(self) -> tuple[Contact, ...]:
        """The contacts that are not bonded."""
        return tuple(contact for contact in self.contact if not contact.bonded)

    @property
    def is_regularized(self) -> bool:
        """Whether the contacts have the regularised law."""
        return any(contact.regularization.law != "exact" for contact in self.touching)

    def faults(self, scope: Scope) -> Iterator[Fault]:
        absent = [*scope.missing("load"), *scope.missing("contact")]
        known = [*self.moved, *absent]
        if not scope.names("body"):
            yield Fault(("body",), "the list is empty, at least one item is required", "add [[body]]")
        if not known:
            yield Fault(("load",), "no loads", "add [[load]], or interference in a contact")
        if self.model.revolved:
            yield from _refused_of_revolution(self, scope)
        if scope.missing("stage"):
            return
        for index, stage in enumerate(self.stage):
            if not stage and known and not absent:
                yield Fault(("stage", index), "names no load", suggestion("", known, "loads"))
            for name in stage:
                if name not in known:
                    hint = suggestion(name, known, "loads")
                    yield Fault(("stage", index, name), f'there is no load "{name}"', hint)
        for index, load in enumerate(self.load):
            if not any(load.name in stage for stage in self.stage):
                hint = f"write {load.name} = 1.0 in a [[stage]]"
                yield Fault(("load", index), "no stage applies this load", hint)


def completed(case: Case) -> Case:
    """The case with the defaults that depend on other tables."""
    contacts, solver = case.contact, case.solver
    given = [contact.regularization.model_fields_set for contact in contacts]
    regularized = solver.method in ("anm", "newton") or solver.formulation == "monolithic"
    for contact, keys in zip(contacts, given, strict=True):
        # Parameters of the regularised law name it.
        named = contact.regularization.law == "hyperbolic" if "law" in keys else bool(keys)
        regularized = regularized or named
    if regularized and case.model.strain == "small":
        contacts = tuple(
            contact if contact.bonded or "law" in keys else contact.regularized()
            for contact, keys in zip(contacts, given, strict=True)
        )
    platens = [load for load in case.load if isinstance(load, Platen)]
    loads = tuple(load.beside(platens) if isinstance(load, Platen) else load for load in case.load)
    stages = case.stage if "stage" in case.model_fields_set else (dict.fromkeys(case.moved, 1.0),)
    # An interference that no stage names is applied in the first one.
    fits = (contact.name for contact in contacts if contact.interference is not None)
    growing = {name: 1.0 for name in fits if not any(name in stage for stage in stages)}
    stages = tuple({**growing, **stage} if number == 0 else stage for number, stage in enumerate(stages))
    return case.model_copy(update={"contact": contacts, "load": loads, "stage": stages})


def _refused_of_revolution(case: Case, scope: Scope) -> Iterator[Fault]:
    def refused(given: object, key: KeyPath, what: str, hint: str = "") -> Iterator[Fault]:
        hint = hint or 'write plane = "strain" for long bodies, or remove it'
        if given:
            yield Fault(key, f'{what} with plane = "axisymmetric" is not supported yet', hint)

    finite = case.model.strain == "finite"
    yield from refused(finite, ("model", "strain"), "finite strain", 'strain = "small"')
    yield from refused(case.reference, ("reference",), "an analytical solution", "remove the table")
    for number, body in enumerate(case.body):
        shape = scope.geometries.get(body.name)
        if shape is not None and shape.left < -ROUND_OFF * shape.size:
            message = f"extends to x = {shape.left:g}, beyond the axis of revolution"
            yield Fault(("body", number, "shape"), message, "draw the half with x >= 0")
    for name, material in case.material.items():
        hint = "give the constants of an isotropic or orthotropic material"
        key = ("material", name)
        yield from refused(material.stiffness, (*key, "stiffness"), "a plane stiffness", hint)
        yield from refused(material.flows, (*key, "yield_stress"), "plasticity", "leave yield_stress out")
        yield from refused(material.angle, (*key, "angle"), "a turned orthotropic material", "angle = 0.0")
    for number, support in enumerate(case.support):
        hint = "give boundary, and from and to for a part of it"
        yield from refused(support.near, ("support", number, "near"), "a support of a point", hint)
    for number, load in enumerate(case.load):
        if isinstance(load, Platen | ObstacleMotion) and (
            "x" in load.control or load.rotation not in (0.0, "fixed")
        ):
            message = "rigid bodies of revolution move along the axis only"
            yield Fault(("load", number), message, "give uy or fy")
    for number, contact in enumerate(case.contact):
        law = ("contact", number, "regularization", "law")
        yield from refused(contact.regularization.law != "exact", law, "the regularised law", 'law = "exact"')


def rounded(case: Case, body: str) -> str:
    """Hint to round a corner of the body of this name."""
    shape = next(one.shape for one in case.body if one.name == body)
    if shape.kind == "polygon":
        return f"give it a radius in body.{body}.shape.rounding"
    return f"draw an arc there in body.{body}.shape"


def finer_nodes(case: Case, names: Collection[str], key: str = "spacing") -> str:
    """Hint to use finer nodes in the bodies of these names, by a ``key`` of theirs or in their files."""
    keys = [f"body.{b.name}.{'shape.file' if b.has_nodes else key}" for b in case.body if b.name in names]
    return f"use finer nodes ({', '.join(keys)})"
