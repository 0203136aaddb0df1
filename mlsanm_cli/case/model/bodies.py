"""``[[body]]``: bodies and the spacing of their nodes."""

import math
from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from mlsanm_cli.case.model.section import LENGTH, NUMBER, AutoLength, Name, Positive, Scope, Section, Vector
from mlsanm_cli.case.model.shapes import Mesh, Points, Shape
from mlsanm_cli.case.report import KeyPath, suggestion
from mlsanm_cli.errors import Fault
from mlsanm_cli.roundoff import ROUND_OFF


class Refine(Section):
    """Local refinement near a point or a boundary. Where several overlap, the smallest spacing applies."""

    at: Annotated[Vector, LENGTH] | None = None
    """Point to refine around; give `at` or `along`."""
    along: str | None = None
    """Boundary of the body to refine along; give `at` or `along`."""
    spacing: Annotated[Positive, LENGTH]
    """Node spacing within `radius` of the point or boundary, at most that of the body."""
    radius: Annotated[float, Field(ge=0.0), LENGTH]
    """Distance up to which the spacing is constant; beyond it grows."""
    growth: Annotated[float, Field(gt=0.0, le=1.0), NUMBER] = 0.12
    """Increase of the spacing per unit length outside `radius`; values above 0.3 cause a warning."""

    def edge(self, body: str) -> str:
        """The boundary in ``along`` without the name of its body, which is optional there."""
        return (self.along or "").removeprefix(f"{body}.")

    def faults(self, scope: Scope) -> Iterator[Fault]:
        yield from self.exclusive("at", "along")


class Body(Section):
    """An elastic body: its material, its shape and the spacing of its nodes."""

    name: Name
    """Name of the body; its boundaries are addressed as `<body>.<boundary>`."""
    material: str
    """Name of its material."""
    spacing: Annotated[AutoLength, LENGTH] = "auto"
    """Node spacing away from refinements. `"auto"` is 1/20 of the body's size or 1/6 of its mean thickness,
    whichever is smaller, less for strongly orthotropic materials, and finer along arcs, in narrow
    parts, at ends of clamped sides, where loads vary or end within a side, near contacts close to another
    boundary, at corners other than right ones that touch an obstacle, and at finite strain along surfaces in
    contact."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    """Seed of the random generator that places the nodes; it changes the cloud, not its spacing."""
    shape: Shape
    refine: tuple[Refine, ...] = ()

    @property
    def has_nodes(self) -> bool:
        """Whether the nodes are read from a file."""
        return isinstance(self.shape, Mesh | Points) and self.shape.has_nodes

    def faults(self, scope: Scope) -> Iterator[Fault]:
        if not self.has_nodes:
            yield from self._spacing_faults(scope)
            return
        where = "the nodes are those of the file"
        if not isinstance(self.shape, Points):
            where = f'{where} (use = "outline" places new ones)'
        for key, given in (("spacing", self.spacing != "auto"), ("refine", self.refine), ("seed", self.seed)):
            if given:
                yield Fault((key,), f"does not apply: {where}", "remove it")

    def _spacing_faults(self, scope: Scope) -> Iterator[Fault]:
        """Spacings that do not fit the size of the body or each other, and unknown boundaries."""
        given = self.spacing if isinstance(self.spacing, float) else math.inf
        spacings: list[tuple[KeyPath, float]] = [(("spacing",), given)]
        for number, refine in enumerate(self.refine):
            spacings.append((("refine", number, "spacing"), refine.spacing))
            if refine.spacing > given:
                message = f"{refine.spacing:g} is larger than the body's spacing {given:g}"
                yield Fault(("refine", number, "spacing"), message, "a refinement can only reduce it")
        shape = scope.geometries.get(self.name)
        if shape is None:
            return
        far = max(map(abs, shape.centre)) + shape.size
        smallest = ROUND_OFF * far
        for key, spacing in spacings:
            if spacing < smallest:
                message = f"{spacing:g} is below round-off for coordinates up to {far:g}"
                yield Fault(key, message, f"at least {smallest:.2g}")
        if math.inf > given > shape.size > 0.0:
            yield Fault(("spacing",), f"{given:g} is larger than the body ({shape.size:g})")
        for number, refine in enumerate(self.refine):
            edge = refine.edge(self.name)
            if refine.along is not None and edge not in shape.boundaries:
                hint = suggestion(edge, shape.boundaries, "boundaries")
                message = f'body "{self.name}" has no boundary "{refine.along}"'
                yield Fault(("refine", number, "along"), message, hint)
