"""Settings of approximation, refinement and path following."""

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from mlsanm_cli.case.model.fields import NUMBER, AutoCount, AutoDegree
from mlsanm_cli.case.model.model import UNSUPPORTED
from mlsanm_cli.case.model.section import Scope, Section
from mlsanm_cli.errors import Fault

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
        if self.neighbors != "auto":
            # The lowest degree that "auto" selects.
            degree = 2 if self.degree == "auto" else self.degree
            terms = (degree + 1) * (degree + 2) // 2
            most = MAX_NEIGHBORS_PER_TERM * terms
            of = f"for the {terms} terms of degree {degree}"
            if self.neighbors < terms:
                hint = f'at least {terms}, better twice as many, or "auto"'
                yield Fault(("neighbors",), f"{self.neighbors} nodes are too few {of}", hint)
            elif self.neighbors > most:
                hint = f'at most {most}, or "auto"'
                yield Fault(("neighbors",), f"{self.neighbors} nodes are too many {of}", hint)
        if scope.strain == "finite" and self.scheme != "least-squares":
            yield Fault(("scheme",), f'"{self.scheme}" {UNSUPPORTED}', '"least-squares"')
        elif self.scheme != "least-squares" and scope.complete("contact") and not scope.case.is_regularized:
            yield Fault(("scheme",), f'"{self.scheme}" needs the hyperbolic contact law', '"least-squares"')
        if scope.strain == "finite" and self.degree == 1:
            yield Fault(("degree",), f"degree 1 {UNSUPPORTED}", "at least 2")


class Adapt(Section):
    """Adaptive refinement."""

    passes: Annotated[int, Field(ge=0, le=20)] = 0
    """Number of refinement passes: solve, refine at contact edges and where the local error is large, solve
    again. Stops earlier at convergence."""

    def faults(self, scope: Scope) -> Iterator[Fault]:
        if not self.passes:
            return
        case = scope.case
        fixed = [body.name for body in case.body if body.has_nodes]
        if fixed:
            message = f'body "{fixed[0]}" cannot be refined: its nodes come from a file'
            yield Fault(("passes",), message, 'write 0, or take the outline only: use = "outline"')
        if case.contact and not case.touching:
            hint = "write 0, and refine along the bonds and at their ends with [[body.refine]]"
            yield Fault(("passes",), "bonded contacts are not refined automatically", hint)
        if scope.strain == "finite":
            yield Fault(("passes",), f"refinement {UNSUPPORTED}", "write 0")


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
    increments: Annotated[int, Field(ge=1, le=10_000)] = 10
    """Parts of every stage, at whose ends regularised friction updates its history (backward Euler)."""
    max_steps: Annotated[int, Field(ge=1, le=1_000_000)] = 2000
    """Largest number of steps; a path that needs more fails."""
    linear: Literal["auto", "superlu"] = "auto"
    """Direct solver: `"auto"` is the built-in sparse Cholesky factorisation."""

    def faults(self, scope: Scope) -> Iterator[Fault]:
        if scope.strain == "finite" and self.method == "active-set" and not scope.names["contact"]:
            yield Fault(("method",), '"active-set" needs a contact', '"anm" or "newton"')
        law = scope.case.touching[0].regularization.law if scope.case.touching else None
        if law is None and not scope.complete("contact"):
            return
        fitting = {"anm": "hyperbolic", "newton": "hyperbolic", "active-set": "exact"}.get(self.method, law)
        if law not in (None, fitting):
            hint = f'law = "{fitting}" in [contact.regularization], or method = "auto"'
            yield Fault(("method",), f'"{self.method}" cannot solve the {law} contact law', hint)
        if self.formulation == "monolithic" and law != "hyperbolic":
            hint = 'formulation = "condensed"'
            yield Fault(("formulation",), "the monolithic formulation needs the hyperbolic contact law", hint)
