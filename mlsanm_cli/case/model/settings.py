"""Settings of approximation, refinement, path following and output; probes and reference solutions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

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
from mlsanm_cli.errors import Fault

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
