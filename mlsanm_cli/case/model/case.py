"""The case file as frozen values: one class per table, attributes named like the keys. Any consistent units
of length, force per unit thickness and stress can be used. All defaults are set here."""

from collections.abc import Collection, Iterator
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticKnownError

from mlsanm_cli.case.model.conditions import Stop, Support
from mlsanm_cli.case.model.contacts import Contact
from mlsanm_cli.case.model.materials import Material
from mlsanm_cli.case.model.motions import AnyLoad, ObstacleMotion, Platen
from mlsanm_cli.case.model.section import Name, Scope, Section
from mlsanm_cli.case.model.settings import Adapt, Mls, Output, Probe, Reference, Solver, Units
from mlsanm_cli.case.model.shapes import Body
from mlsanm_cli.case.report import KeyPath, suggestion
from mlsanm_cli.errors import Fault
from mlsanm_cli.roundoff import ROUND_OFF


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


_LONG_BODIES = 'write plane = "strain" for long bodies, or remove it'


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

    def refused(given: object, key: KeyPath, what: str, hint: str = _LONG_BODIES) -> Iterator[Fault]:
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
        yield from refused(material.yield_stress, (*key, "yield_stress"), "plasticity")
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
