"""Loads: each has a name, a boundary, a kind, and a value that a stage scales by the load's factor."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from mlsanm_cli.case.base import BoundaryName, Name, Section, Vector

Control = Literal["force", "displacement"]


class Traction(Section):
    """Force per unit length of boundary and unit thickness, (x, y)."""

    name: Name
    boundary: BoundaryName
    kind: Literal["traction"]
    traction: Vector


class Pressure(Section):
    """Pressure along the inward normal, positive in compression."""

    name: Name
    boundary: BoundaryName
    kind: Literal["pressure"]
    pressure: float


class Displacement(Section):
    """Displacement (x, y) of every point of the boundary."""

    name: Name
    boundary: BoundaryName
    kind: Literal["displacement"]
    displacement: Vector


class Platen(Section):
    """A rigid plate on the boundary, moved by a force or by a displacement in each direction.

    ``force`` or ``displacement`` give both directions; ``ux, uy, fx, fy`` one each. A direction that is
    not mentioned is free: the plate is smooth there. Forces are per unit thickness.
    """

    name: Name
    boundary: BoundaryName
    kind: Literal["platen"]
    force: Vector | None = None
    displacement: Vector | None = None
    ux: float | None = None
    uy: float | None = None
    fx: float | None = None
    fy: float | None = None
    rotation: Literal["fixed", "free"] = "fixed"

    @property
    def control(self) -> dict[str, tuple[Control, float]]:
        """What moves the plate in each direction it holds, at load factor 1.

        >>> Platen(name="p", boundary="a.top", kind="platen", fy=-2.0).control
        {'y': ('force', -2.0)}
        """
        held: dict[str, tuple[Control, float]] = {}
        for axis, direction in enumerate("xy"):
            if self.force is not None:
                held[direction] = ("force", self.force[axis])
            elif self.displacement is not None:
                held[direction] = ("displacement", self.displacement[axis])
            else:
                displacement, force = (self.ux, self.fx) if axis == 0 else (self.uy, self.fy)
                if displacement is not None:
                    held[direction] = ("displacement", displacement)
                elif force is not None:
                    held[direction] = ("force", force)
        return held


Load = Annotated[Traction | Pressure | Displacement | Platen, Field(discriminator="kind")]
LOADS: dict[str, type[Section]] = {
    "platen": Platen,
    "traction": Traction,
    "pressure": Pressure,
    "displacement": Displacement,
}
