"""Forces of loads, supports and contacts on the bodies, and the balance of platens and bodies."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.response.drivers import Drivers
from mlsanm_cli.contact.response.linear_map import Columns, LinearMap, stack
from mlsanm_cli.mechanics.rigid import ROTATION, motions_of
from mlsanm_cli.mechanics.scene import RigidConstraint, RigidMotion, Scene
from mlsanm_cli.records import dataclass

Held = tuple[str, str]


@dataclass(frozen=True)
class CondensedForces:
    """All forces on bodies, as force x, y and moment (3 rows) in terms of the condensed unknowns.

    ``sources[body]`` (r, drivers) are the bodies' right-hand sides, which contain the loads on their pieces.
    ``measured[body, surface]`` is the result of :func:`reaction_rows`, with moments about the platen's
    centre; ``springs[body, surface]`` the force of soft springs, with moments about the origin.
    """

    scene: Scene
    drivers: Drivers
    sources: Mapping[str, sparse.csc_array]
    measured: Mapping[Held, LinearMap]
    springs: Mapping[Held, LinearMap]

    @property
    def pairings(self) -> tuple[Pairing, ...]:
        """The contacts."""
        return self.drivers.pairings

    @property
    def columns(self) -> Columns:
        """The columns of the unknowns."""
        return self.drivers.unknowns

    def contact(self, pairing: Pairing, body: str, center: tuple[float, float] = (0.0, 0.0)) -> LinearMap:
        """Force of a contact on one of its bodies."""
        drivers = self.drivers
        if pairing.grid is not None:
            result = drivers.unknowns.zeros(3)
            pressure, traction = pairing.grid.resultants(body == pairing.slave_body, center)
            result.pressure[:, drivers.spans[pairing.name]] = pressure
            if pairing.friction:
                result.traction[:, drivers.tangential[pairing.name]] = traction
            return result
        total, resultants = np.zeros((3, drivers.columns.total)), self.scene.bodies[body].resultants(center)
        for places in (drivers.places, drivers.tangential_places):
            if span := places.get(pairing.name):
                total[:, span] = (resultants @ self.sources[body][:, span]).toarray()
        return drivers.by_unknowns(total)

    def mismatch(self, pairing: Pairing) -> LinearMap:
        """Sum of a contact's forces on both bodies (2 rows), zero up to the transfer error; zero for
        obstacles."""
        if pairing.master_body is None:
            return self.columns.zeros(2)
        both = [self.contact(pairing, body) for body in pairing.bodies]
        return (both[0] + both[1]).take(slice(0, 2))

    def applied(self, body: str, center: tuple[float, float] = (0.0, 0.0)) -> LinearMap:
        """Sum of prescribed tractions, body forces and springs on a body."""
        result = self.columns.of_loads(_about(center) @ self.prescribed[body])
        for where, pull in self.springs.items():
            if where[0] == body:
                result = result + pull.combined(_about(center))
        return result

    @cached_property
    def prescribed(self) -> Mapping[str, FloatArray]:
        """Force x, y and moment about the origin (3, loads) of prescribed tractions and body forces on every
        body."""
        found = {name: np.zeros((3, self.columns.loads)) for name in self.scene.bodies}
        for load in self.scene.applied:
            body = self.scene.bodies[load.body]
            found[load.body][:, load.number] += body.resultants() @ load.source(body)
        return found

    def others(self, constraint: RigidConstraint) -> LinearMap:
        """Sum of all forces except those of held surfaces on a constraint's bodies, moments about its
        centre."""
        total = self.columns.zeros(3)
        for body in constraint.bodies:
            total = total + self.applied(body, constraint.center)
            for pairing in self.pairings:
                if body in pairing.bodies:
                    total = total + self.contact(pairing, body, constraint.center)
        return total

    def constraint(self, constraint: RigidConstraint, motion: RigidMotion) -> LinearMap:
        """Force (1 row) that the constraint must exert in the direction of one motion."""
        along = motion.direction[None, :]
        if not constraint.bodies:
            pairing = next(p for p in self.pairings if p.name == constraint.name)
            return self.contact(pairing, pairing.slave_body, constraint.center).combined(along)
        if constraint.floats or motion.alone:
            return -self.others(constraint).combined(along)
        parts = [self.measured[held].combined(along) for held in constraint.held]
        return sum(parts[1:], parts[0])


def balance_of_constraints(forces: CondensedForces) -> LinearMap:
    """One row per unknown motion: force required of the constraint minus the force applied to it. Only
    contacts and tractions act on a floating body, which must balance."""
    rows = []
    for constraint, motion in forces.scene.unknown_motions:
        rows.append(forces.constraint(constraint, motion) + -forces.columns.of_loads(motion.force[None, :]))
    return stack(rows, forces.columns)


def reported_forces(forces: CondensedForces) -> dict[str, LinearMap]:
    """Force x, y (2 rows) of each load and each support on its body, by name."""
    scene, columns = forces.scene, forces.columns
    report: dict[str, LinearMap] = {}

    def of_load(body: str, number: int) -> LinearMap:
        alone = np.arange(columns.loads) == number
        return columns.of_loads(forces.prescribed[body][:2] * alone)

    for load in scene.surface_loads:
        name = scene.loads[load.number]
        if load.held:
            # A load on several surfaces appears once per surface.
            total_force = forces.measured[load.body, load.surface].take(slice(0, 2))
            report[name] = report[name] + total_force if name in report else total_force
        else:
            report[name] = of_load(load.body, load.number)
    for constraint in scene.rigid_constraints:
        for number in constraint.loads:
            total = columns.zeros(2)
            for motion in constraint.motions:
                along = motion.direction[:2, None]
                if motion.prescribed is None:
                    own = np.zeros((1, columns.loads))
                    own[0, number] = motion.force[number]
                    total = total + columns.of_loads(along * own)
                elif number == next(
                    (n for n in constraint.loads if motion.prescribed[n]), constraint.loads[0]
                ):
                    # Several loads may move one platen in this component: report its force once.
                    total = total + forces.constraint(constraint, motion).combined(along)
            report[scene.loads[number]] = total
    for force in scene.body_forces:
        report[scene.loads[force.number]] = of_load(force.body, force.number)
    for heating in scene.heatings:
        report[scene.loads[heating.number]] = columns.zeros(2)
    for name, places in scene.supports.items():
        total = columns.zeros(3)
        for where in places:
            if where in forces.measured:
                total = total + forces.measured[where]
            if where in forces.springs:
                total = total + forces.springs[where]
        report[name] = total.take(slice(0, 2))
        for load in scene.surface_loads:
            if (load.body, load.surface) in places:
                on_springs = np.zeros((2, columns.loads))
                on_springs[:, load.number] = load.on_springs(scene.bodies[load.body])
                carried = columns.of_loads(on_springs)
                report[name] = report[name] + -carried
                report[scene.loads[load.number]] = report[scene.loads[load.number]] + carried
    return report | pin_forces(forces)


def pin_forces(forces: CondensedForces) -> dict[str, LinearMap]:
    """Force x, y (2 rows) of each support of a single node on its body, by name, if statics determine those
    of all single nodes of the body: from its forces, or its forces and moments."""
    scene, report = forces.scene, dict[str, LinearMap]()
    for name, body in scene.bodies.items():
        held = list(dict.fromkeys(body.held_nodes))
        arms = body.model.cloud.points[[node for node, _ in held]]
        axes = np.eye(2)[[axis for _, axis in held]]
        acting = np.vstack([axes.T, arms[:, 0] * axes[:, 1] - arms[:, 1] * axes[:, 0]])
        rows = next((n for n in (2, 3) if held and np.linalg.matrix_rank(acting[:n]) == len(held)), 0)
        if not rows:
            continue
        others = _others(forces, name).take(slice(0, rows))
        each = others.combined(np.asarray(-np.linalg.pinv(acting[:rows])))
        for label, (owner, node) in scene.single_supports.items():
            if owner == name:
                own = np.array([held_node == node for held_node, _ in held], dtype=float)
                report[label] = each.combined(axes.T * own)
    return report


def _others(forces: CondensedForces, name: str) -> LinearMap:
    """Sum of all forces on a body but those of single nodes, as force x, y and moment about the origin."""
    total = forces.applied(name)
    for pairing in forces.pairings:
        if name == pairing.slave_body:
            total = total + forces.contact(pairing, name)
        if name == pairing.master_body:
            total = total + -forces.contact(pairing, pairing.slave_body)
    for surface in forces.scene.bodies[name].restrained:
        about = _about(forces.scene.center(name, surface))
        total = total + forces.measured[name, surface].combined(np.asarray(np.linalg.inv(about)))
    return total


def holding_forces(forces: CondensedForces) -> dict[tuple[str, int], LinearMap]:
    """Reaction (1 row) of a floating body's held motions, by body and component."""
    return {
        (body.name, motion.component): forces.constraint(body, motion)
        for body in forces.scene.rigid_constraints
        if body.floats
        for motion in body.motions
        if motion.prescribed is not None
    }


def moments_of_plates(forces: CondensedForces) -> dict[str, LinearMap]:
    """Moment (1 row) about the hinge of each rotating plate on its bodies, by its name."""
    return {
        platen.name: forces.constraint(platen, motion)
        for platen in forces.scene.platens
        for motion in platen.motions
        if motion.component == ROTATION
    }


def body_imbalance(forces: CondensedForces) -> LinearMap:
    """Sum of all forces on each body (2 rows per body), with those of held surfaces from the stress there,
    and those on masters from the slaves; components held at single nodes are zero. Least squares keep it at
    round-off."""
    rows, sums = [], body_sums(forces)
    for number, (name, body) in enumerate(forces.scene.bodies.items()):
        for component in (0, 1):
            # Hoop stresses balance radial forces.
            hidden = component not in motions_of(body.model.cloud)
            hidden |= forces.scene.held_nodes.get(name, (False, False))[component]
            row = slice(2 * number + component, 2 * number + component + 1)
            rows.append(forces.columns.zeros(1) if hidden else sums.take(row))
    return stack(rows, forces.columns)


def body_sums(forces: CondensedForces) -> LinearMap:
    """The same (2 rows per body) for all components: minus the forces of single nodes that hold a body."""
    rows = [_others(forces, name).take(slice(0, 2)) for name in forces.scene.bodies]
    return stack(rows, forces.columns)


def _about(center: tuple[float, float]) -> FloatArray:
    """Matrix (3, 3) that moves the reference of the moment from the origin to ``center``."""
    return np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [center[1], -center[0], 1.0]])
