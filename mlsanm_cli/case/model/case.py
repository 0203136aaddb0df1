"""The case file as frozen values: one class per table, attributes named like the keys. Any consistent units
of length, force per unit thickness and stress can be used. All defaults are set here."""

from collections.abc import Collection, Iterator, Sequence
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticKnownError

from mlsanm_cli.case.model.bodies import Body
from mlsanm_cli.case.model.conditions import Stop, Support
from mlsanm_cli.case.model.contacts import Contact
from mlsanm_cli.case.model.materials import Material
from mlsanm_cli.case.model.motions import AnyLoad
from mlsanm_cli.case.model.revolution import refused_of_revolution
from mlsanm_cli.case.model.section import Name, Scope, Section
from mlsanm_cli.case.model.settings import Adapt, Mls, Output, Probe, Reference, Solver, Units, with_defaults
from mlsanm_cli.case.report import suggestion
from mlsanm_cli.errors import Fault


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
        """Whether bodies are those of revolution about x = 0."""
        return self.plane == "axisymmetric"


class Case(Section):
    """A scene. Any consistent units can be used."""

    format: Annotated[Literal[1], BeforeValidator(_no_bool)]
    """Version of the file format."""
    title: str = ""
    """Free text."""
    model: Model
    units: Units = Units()
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
        if not scope.missing("stage"):
            yield from self._stage_faults(known, bool(absent))
        if self.model.revolved:
            yield from refused_of_revolution(self, scope)

    def _stage_faults(self, known: Sequence[str], some_absent: bool) -> Iterator[Fault]:
        """Stages without loads, unless some are absent, or without ``known`` ones, and loads in no stage."""
        for index, stage in enumerate(self.stage):
            if not stage and known and not some_absent:
                yield Fault(("stage", index), "names no load", suggestion("", known, "loads"))
            for name in stage:
                if name not in known:
                    hint = suggestion(name, known, "loads")
                    yield Fault(("stage", index, name), f'there is no load "{name}"', hint)
        used = {name for stage in self.stage for name in stage}
        for index, load in enumerate(self.load):
            if load.name not in used:
                hint = f"write {load.name} = 1.0 in a [[stage]]"
                yield Fault(("load", index), "no stage applies this load", hint)

    _defaults = model_validator(mode="before")(with_defaults)


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
