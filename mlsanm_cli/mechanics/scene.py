"""Bodies and everything that acts on them: scaled loads, rigid platens, supports. Load factors form one
vector f (L,), in the order in which the case names the loads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, fields
from functools import cached_property

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.eigenstress import Heating
from mlsanm_cli.mechanics.elasticity import traction_of
from mlsanm_cli.mechanics.rigid import ROTATION, RigidBodyModes, rigid_pattern
from mlsanm_cli.mechanics.supports import FREE
from mlsanm_cli.memo import digest
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class SurfaceLoad:
    """``values`` (b, 2) on a surface at factor 1: displacements if ``held``, else tractions, which may also
    be given ``between`` (g, 2) the nodes, at the FINE quadrature points."""

    number: int
    body: str
    surface: str
    values: FloatArray
    held: bool
    between: FloatArray | None = None

    def source(self, body: ElasticBody) -> FloatArray:
        """Right-hand side (r,) of its ``body``."""
        return body.source(self.surface, self.values, self.held, self.between)

    def on_springs(self, body: ElasticBody) -> FloatArray:
        """The force (2,) of a traction on springs so stiff that they hold its surface."""
        stiff = np.array(body.restrained.get(self.surface, FREE)) & ~np.array(
            body.held.get(self.surface, FREE)
        )
        if self.held or self.between is None or not stiff.any():
            return np.zeros(2)
        surface = body.model.cloud.surfaces[self.surface]
        halves = Halves.of(surface, FINE)
        around = body.model.cloud.around(surface.curve.points(halves.arc))
        return np.asarray((halves.length * around) @ self.between * stiff)


@dataclass(frozen=True)
class BodyForce:
    """``values`` (n, 2) at a body's points at factor 1: force per volume."""

    number: int
    body: str
    values: FloatArray

    def source(self, body: ElasticBody) -> FloatArray:
        """Right-hand side (r,) of its ``body``."""
        return body.force_source(self.values)


@dataclass(frozen=True)
class RigidMotion:
    """A rigid motion of a platen, an obstacle or a floating body: ``component`` 0 (x), 1 (y) or 2 (rotation
    about its centre); an ``axis`` replaces x or y as the unit vector of a translation. ``prescribed`` (L,) is
    the motion per load factor, or None if it is unknown and balanced by ``force`` (L,). ``alone``: nothing
    else holds a platen's body in this component, so that its force is the resultant of the others."""

    component: int
    prescribed: FloatArray | None
    force: FloatArray
    alone: bool = True
    axis: tuple[float, float] | None = None

    @property
    def direction(self) -> FloatArray:
        """Velocity (3,) of the centre in x and y, and rotation, under a unit motion."""
        return np.eye(3)[self.component] if self.axis is None else np.array([*self.axis, 0.0])

    def pattern(self, points: FloatArray, center: tuple[float, float]) -> FloatArray:
        """Displacements (n, 2) of ``points`` (n, 2) under a unit motion; it rotates about ``center``."""
        if self.axis is None:
            return rigid_pattern(points, center, self.component)
        return np.tile(np.array(self.axis), (len(points), 1))


@dataclass(frozen=True)
class RigidConstraint:
    """Rigid ``motions`` about a ``center`` that ``loads`` may cause. A platen of that ``name`` is bonded to
    the ``held`` surfaces, each a body and a name; in a component without a motion these are free of traction.
    An obstacle, named like its contact, has no ``bodies`` and is fixed in other components. A floating body
    is held by contact only in its motions, unknowns with its equilibrium as equations; one without resistance
    or force is prescribed as zero."""

    name: str
    bodies: tuple[str, ...]
    center: tuple[float, float]
    motions: tuple[RigidMotion, ...]
    loads: tuple[int, ...] = ()
    held: tuple[tuple[str, str], ...] = ()

    @property
    def floats(self) -> bool:
        """Whether it is a floating body."""
        return bool(self.bodies) and not self.held

    def surfaces_of(self, body: str) -> tuple[str, ...]:
        """Surfaces of a body bonded to it."""
        return tuple(surface for owner, surface in self.held if owner == body)


@dataclass(frozen=True)
class Probe:
    """A named point (1, 2) of a body, in the reference configuration."""

    name: str
    body: str
    point: FloatArray


@dataclass(frozen=True)
class Scene:
    """Factorised bodies with everything that acts on them except contact. ``supports`` maps a support's name
    to bodies and surfaces, ``single_supports`` that of a single node to its body and node; ``held_nodes``
    tells for each body whether single nodes hold it in x and y. ``held_motions`` are motions of floating
    bodies fixed for lack of resistance, as velocities (3,) of each body: x, y and rotation about the origin.
    ``loose_motions`` are those of them in which floating bodies only move."""

    bodies: Mapping[str, ElasticBody]
    loads: tuple[str, ...]
    surface_loads: tuple[SurfaceLoad, ...]
    rigid_constraints: tuple[RigidConstraint, ...]
    supports: Mapping[str, tuple[tuple[str, str], ...]]
    held_nodes: Mapping[str, tuple[bool, bool]]
    body_forces: tuple[BodyForce, ...] = ()
    heatings: tuple[Heating, ...] = ()
    probes: tuple[Probe, ...] = ()
    held_motions: tuple[Mapping[str, FloatArray], ...] = ()
    loose_motions: tuple[Mapping[str, FloatArray], ...] = ()
    single_supports: Mapping[str, tuple[str, int]] = field(default_factory=dict)

    @cached_property
    def content(self) -> str:
        """Digest of everything: condensations for all contact grids depend on it."""
        return digest(*(getattr(self, one.name) for one in fields(self)))

    @property
    def places(self) -> dict[str, slice]:
        """Range of every body's unknowns in the concatenation of all."""
        ends = np.cumsum([0, *(body.model.unknowns for body in self.bodies.values())]).tolist()
        return {name: slice(a, b) for name, a, b in zip(self.bodies, ends[:-1], ends[1:], strict=True)}

    @property
    def applied(self) -> list[SurfaceLoad | BodyForce]:
        """Prescribed tractions and body forces."""
        return [*(load for load in self.surface_loads if not load.held), *self.body_forces]

    @cached_property
    def sizes(self) -> Mapping[str, list[tuple[int, float]]]:
        """For each body the load number and the sum of the magnitudes, at factor 1, of everything applied."""
        found: dict[str, list[tuple[int, float]]] = {name: [] for name in self.bodies}
        for load in self.applied:
            body = self.bodies[load.body]
            size = abs(body.resultants())[:2] @ np.abs(load.source(body))
            found[load.body].append((load.number, float(np.hypot(*size))))
        return found

    def center(self, body: str, surface: str) -> tuple[float, float]:
        """Reference point for moments on a held surface: its platen's centre, else the origin."""
        for platen in self.platens:
            if (body, surface) in platen.held:
                return platen.center
        return (0.0, 0.0)

    def heated(self, body: str) -> list[Heating]:
        """Temperature changes of a body."""
        return [heating for heating in self.heatings if heating.body == body]

    def degrees(self, body: str, factors: FloatArray, points: FloatArray | None = None) -> FloatArray:
        """Temperature change at load ``factors`` (L,), at a body's nodes (n,) or at ``points`` (e, 2)."""
        total = np.zeros(len(self.bodies[body].model.cloud.points if points is None else points))
        for heating in self.heated(body):
            if factors[heating.number]:
                values = heating.values if points is None else heating.field.at(points)
                total += factors[heating.number] * values
        return total

    def heat_force(self, body: str, factors: FloatArray) -> float:
        """Largest resultant (force per thickness) that suppresses thermal expansion on a surface or a cut."""
        if not self.heated(body):
            return 0.0
        model, degrees = self.bodies[body].model, np.abs(self.degrees(body, factors))
        even = model.material.stress_of_expansion
        area = model.cloud.areas
        forces = [np.abs(even).max() * (model.cloud.volumes @ degrees) / np.sqrt(area.sum())]
        for surface in model.cloud.surfaces.values():
            traction = np.hypot(*traction_of(even, surface.normal).T)
            length = surface.weight * model.cloud.around(model.cloud.points[surface.index])
            forces.append((length * degrees[surface.index]) @ traction)
        return float(max(forces))

    @property
    def platens(self) -> list[RigidConstraint]:
        """The rigid plates."""
        return [one for one in self.rigid_constraints if one.held]

    @cached_property
    def unknown_motions(self) -> list[tuple[RigidConstraint, RigidMotion]]:
        """Unknown motions, in the order of the unknowns q."""
        return [(constraint, motion) for constraint, motion, _ in self.motions if motion.prescribed is None]

    @cached_property
    def motions(self) -> list[tuple[RigidConstraint, RigidMotion, FloatArray]]:
        """All rigid motions, and their coefficients (L + k,) of the load factors and of the unknowns q."""
        every = [
            (constraint, motion) for constraint in self.rigid_constraints for motion in constraint.motions
        ]
        unknown = np.cumsum([motion.prescribed is None for _, motion in every])
        loads, count = len(self.loads), int(unknown[-1]) if every else 0
        by = np.zeros((len(every), loads + count))
        for row, (_, motion) in enumerate(every):
            if motion.prescribed is None:
                by[row, loads + unknown[row] - 1] = 1.0
            else:
                by[row, :loads] = motion.prescribed
        return [(*each, row) for each, row in zip(every, by, strict=True)]

    def floating_patterns(self, body: str) -> FloatArray:
        """Displacements (2N, k) of a body under the unknown motions q, less their mean in motions without
        resistance: independent of the choice of the unknowns that are fixed."""
        patterns = self._patterns(body)
        if not self.loose_motions:
            return patterns
        names = sorted({name for motion in self.loose_motions for name in motion})
        free = {name: self._loose_patterns(name) for name in names}
        weighted = {}
        for name in names:
            model = self.bodies[name].model
            weighted[name] = np.repeat(model.cloud.volumes, 2)[:, None] * free[name]
        gram = sum(weighted[name].T @ free[name] for name in names)
        mean = sum(weighted[name].T @ self._patterns(name) for name in names)
        return patterns - self._loose_patterns(body) @ np.linalg.solve(gram, mean)

    def _patterns(self, body: str) -> FloatArray:
        """Displacements (2N, k) under unit motions of the unknowns."""
        nodes = self.bodies[body].model.cloud.points
        patterns = np.zeros((2 * len(nodes), len(self.unknown_motions)))
        for column, (constraint, motion) in enumerate(self.unknown_motions):
            if constraint.floats and body in constraint.bodies:
                patterns[:, column] = motion.pattern(nodes, constraint.center).ravel()
        return patterns

    def _loose_patterns(self, body: str) -> FloatArray:
        """Displacements (2N, d) of a body in the ``loose_motions``."""
        motions = np.stack([motion.get(body, np.zeros(3)) for motion in self.loose_motions], axis=1)
        modes = RigidBodyModes((0.0, 0.0), (0, 1, ROTATION))
        return np.asarray(modes.patterns(self.bodies[body].model.cloud.points) @ motions)
