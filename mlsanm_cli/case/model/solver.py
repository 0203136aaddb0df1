"""Settings of approximation, refinement and path following."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from mlsanm_cli.case.model.base import NUMBER, AutoCount, AutoDegree, Section


class Mls(Section):
    """Moving least squares approximation."""

    degree: AutoDegree = "auto"
    """Degree of the local polynomials, 1 to 6; `"auto"` is 4, and 2 for bodies whose contacts have nodal
    pressures at small strain, whose parts are too thin for 4, or that have slits or nodes from a file."""
    scheme: Literal["least-squares", "collocation", "ghost"] = "least-squares"
    """All equations solved by least squares, or square systems by collocation or with ghost nodes."""
    neighbors: AutoCount = "auto"
    """Nodes per stencil; `"auto"` is about 2.5 times the number of coefficients."""


class Adapt(Section):
    """Adaptive refinement."""

    passes: Annotated[int, Field(ge=0, le=20)] = 0
    """Number of refinement passes: solve, refine at contact edges and where the local error is large, solve
    again. Stops earlier at convergence."""


class Solver(Section):
    """Path following and linear solver."""

    method: Literal["auto", "anm", "newton", "active-set"] = "auto"
    """Power series (anm) or Newton-Raphson for the hyperbolic law, active-set for the exact law; `"auto"`
    selects by the law."""
    formulation: Literal["condensed", "monolithic"] = "condensed"
    """Static condensation to the contact unknowns, or all displacements as unknowns of the path
    (monolithic)."""
    order: Annotated[int, Field(ge=2, le=40)] = 20
    """Order of the power series."""
    tolerance: Annotated[float, Field(gt=0.0, lt=1.0), NUMBER] = 1e-8
    """Largest allowed scaled residual on the path."""
    pade: bool = True
    """Use Padé approximants where they extend a step."""
    polish: bool | Literal["auto"] = "auto"
    """Solve saved load levels again with the exact laws; `"auto"` does so unless friction depends on the
    history."""
    increments: Annotated[int, Field(ge=1, le=10_000)] = 10
    """Parts of every stage at whose ends regularised friction moves its stick references (backward Euler)."""
    max_steps: Annotated[int, Field(ge=1, le=1_000_000)] = 2000
    """Largest number of steps; a path that needs more fails."""
    linear: Literal["auto", "superlu"] = "auto"
    """Direct solver: `"auto"` is the built-in sparse Cholesky factorisation, SuperLU for square schemes."""
