"""Analytical reference solution named by a case, and Hertz' line contact (Johnson, Contact Mechanics, 1985,
doi:10.1017/CBO9781139171731, chapter 4)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mlsanm_cli.app.scene.materials import materials
from mlsanm_cli.app.scene.outlines import drawn, geometry_of
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, Contact, DiskObstacle, LoadedCase, Mesh, Points, load_case, split_boundary
from mlsanm_cli.cloud.curves import Arc, Curve, Segment
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.records import dataclass

if TYPE_CHECKING:
    from mlsanm_cli.solve.condensed_scene import CondensedScene
    from mlsanm_cli.solve.state import State


@dataclass(frozen=True)
class HertzLine:
    """Two cylinders of relative ``radius`` (1/R = 1/R1 + 1/R2) under a ``force`` per unit thickness;
    ``modulus`` is E* with 1/E* = 1/E1' + 1/E2', E' = E/(1 - nu^2) in plane strain and E in plane stress."""

    force: float
    radius: float
    modulus: float

    @property
    def half_width(self) -> float:
        """a = 2 sqrt(P R / (pi E*))."""
        return 2.0 * math.sqrt(self.force * self.radius / (math.pi * self.modulus))

    @property
    def peak_pressure(self) -> float:
        """p0 = 2 P / (pi a)."""
        return 2.0 * self.force / (math.pi * self.half_width)

    def pressure(self, x: FloatArray) -> FloatArray:
        """p0 sqrt(1 - (x/a)^2), zero outside."""
        result: FloatArray = self.peak_pressure * np.sqrt(np.maximum(0.0, 1.0 - (x / self.half_width) ** 2))
        return result


class ReferenceProfile(NamedTuple):
    """Analytical pressure along a contact over the ``coordinate`` (m,) of its nodes from its middle, and the
    relative L2 error of the interpolated nodal pressures."""

    label: str
    coordinate: FloatArray
    curve: Callable[[FloatArray], FloatArray]
    peak: float
    half_width: float
    error_l2: float


def read_case(path: Path, overrides: tuple[str, ...] = ()) -> LoadedCase:
    """A validated case with checked geometry and reference solution. Raises RunError and CaseError."""
    loaded = load_case(path, overrides, geometry_of)
    case = loaded.case
    if case.reference is None:
        return loaded
    solution = case.reference.solution
    problems = [] if case.contact else ["needs a [[contact]]"]
    for contact in case.contact:
        # Radii are known for single arcs and segments only.
        unknown = [b for b in contact.boundaries if not isinstance(_curve(case, b), Arc | Segment)]
        if unknown:
            problems.append(f"needs radii, and the case gives none for {unknown[0]}")
            continue
        curved = _curvature(contact, _arcs(case, contact)) > 0.0
        if curved != (solution == "hertz-line"):
            surfaces = f"its surfaces are {'' if curved else 'not '}curved"
            problems.append(f"does not fit contact {contact.name}: {surfaces}")
    if problems:
        raise loaded.located(
            CaseError(tuple(CaseProblem("reference.solution", f'"{solution}" {text}') for text in problems))
        )
    return loaded


def reference_profile(built: CondensedScene, pairing: Pairing, state: State) -> ReferenceProfile | None:
    """Reference pressure of a contact in a state; None without a reference or a contact force."""
    case = built.case
    force = float(np.hypot(*built.condensed.quantities["contact"][pairing.name](*state.unknowns)))
    if case.reference is None or force == 0.0:
        return None
    contact = next(c for c in case.contact if c.name == pairing.name)
    points, normal = pairing.points[pairing.candidate], pairing.normal[pairing.candidate]
    pressure = built.condensed.contact_values(pairing, state.unknowns)[0]
    return profile_on(case, contact, points, normal, pressure, force)


def profile_on(
    case: Case, contact: Contact, points: FloatArray, normal: FloatArray, pressure: FloatArray, force: float
) -> ReferenceProfile:
    """Reference for nodes ``points`` (m, 2) with master normals ``normal`` (m, 2) and ``pressure`` (m,)."""
    arcs, obstacle = _arcs(case, contact), contact.obstacle
    centers = [np.array(arc.center) for arc in arcs]
    centers += [np.array(obstacle.center)] if isinstance(obstacle, DiskObstacle) else []
    # The normal in the middle: along the line of centres, or else the resultant of the pressures.
    apart = np.hypot(*np.diff(points, axis=0).T)
    length = 0.5 * (np.append(apart, 0.0) + np.append(0.0, apart))
    axis = centers[0] - centers[1] if len(centers) == 2 else (length * pressure) @ normal
    axis = axis / np.hypot(*axis)
    middle = centers[0] if centers else 0.5 * (points[0] + points[-1])
    coordinate = (points - middle) @ np.array([axis[1], -axis[0]])
    if coordinate[-1] < coordinate[0]:
        coordinate = -coordinate
    if (curvature := _curvature(contact, arcs)) > 0.0:
        stiffness, used = materials(case), {body.name: body.material for body in case.body}
        sides = [stiffness[used[split_boundary(boundary)[0]]] for boundary in contact.boundaries]
        modulus = 1.0 / sum(float(side.contact_compliance(axis[None, :])[0]) for side in sides)
        hertz = HertzLine(force, 1.0 / curvature, modulus)
        label, curve, peak, width = "Hertz", hertz.pressure, hertz.peak_pressure, hertz.half_width
    else:
        even = force / float(np.ptp(coordinate))
        label, peak, width = "uniform", even, 0.5 * float(np.ptp(coordinate))

        def curve(x: FloatArray) -> FloatArray:
            return np.full(len(x), even)

    x = np.linspace(coordinate[0], coordinate[-1], 4001)
    expected = curve(x)
    difference = np.interp(x, coordinate, pressure) - expected
    error = float(np.sqrt((difference**2).sum() / (expected**2).sum()))
    return ReferenceProfile(label, coordinate, curve, peak, width, error)


def _curve(case: Case, boundary: str) -> Curve | None:
    """Curve of a boundary of one piece; None for others and for shapes in files."""
    body, edge = split_boundary(boundary)
    shape = next(b.shape for b in case.body if b.name == body)
    if isinstance(shape, Mesh | Points):
        return None
    outline = drawn(shape)
    numbers = outline.numbers(edge)
    return outline.curves[numbers[0]] if len(numbers) == 1 else None


def _arcs(case: Case, contact: Contact) -> list[Arc]:
    return [curve for one in contact.boundaries if isinstance(curve := _curve(case, one), Arc)]


def _curvature(contact: Contact, arcs: Sequence[Arc]) -> float:
    """Sum of the curvatures 1/R of both sides, positive for convex ones."""
    obstacle = contact.obstacle.curvature if contact.obstacle is not None else 0.0
    return obstacle + sum(math.copysign(1.0 / arc.radius, arc.sweep) for arc in arcs)
