"""Forces of loads, supports and contacts on the bodies, and the balance of platens and bodies."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.membership import cross
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.response.basis import Drivers
from mlsanm_cli.contact.response.compressed import LinearMap, stack
from mlsanm_cli.mechanics.near_field import as_real
from mlsanm_cli.mechanics.rigid import ROTATION, motions_of
from mlsanm_cli.mechanics.scene import RigidConstraint, RigidMotion, Scene
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

Held = tuple[str, str]


@dataclass(frozen=True)
class ForceSums:
    """All forces on bodies, as force x, y and moment (3 rows) in terms of the unknowns.

    ``sources[body]`` (r, drivers) are the bodies' right-hand sides, which contain the loads on their pieces.
    ``measured[body, surface]`` are the forces of held surfaces, with moments about the platen's centre;
    ``springs[body, surface]`` the force of soft springs, with moments about the origin.
    """

    scene: Scene
    drivers: Drivers
    sources: Mapping[str, sparse.csc_array]
    measured: Mapping[Held, LinearMap]
    springs: Mapping[Held, LinearMap]

    def quantities(self) -> dict[str, dict[Any, LinearMap]]:
        """By kind and subject: "force" (2,) of each load and support on its body; "contact" the force (2,)
        on the slave, "mismatch" the sum (2,) of a contact's forces on both bodies; "moment" (1,) of each
        rotating plate on its bodies about the hinge; by body "sum" of all forces (2,), minus those of single
        nodes that hold it, and "imbalance", the same without components held there."""
        pairings = self.drivers.pairings
        found: dict[str, dict[Any, LinearMap]] = {
            "force": self._reported() | self._at_single_nodes(),
            "contact": {one.name: self._contact(one, one.slave_body).take(slice(0, 2)) for one in pairings},
            "mismatch": {},
            "moment": {
                platen.name: self._constraint(platen, motion)
                for platen in self.scene.platens
                for motion in platen.motions
                if motion.component == ROTATION
            },
            "sum": {},
            "imbalance": {},
        }
        for one in pairings:
            both = [self._contact(one, body).take(slice(0, 2)) for body in one.bodies]
            found["mismatch"][one.name] = both[0] + both[1] if len(both) == 2 else self._zeros(2)
        for name, body in self.scene.bodies.items():
            held = self.scene.held_nodes.get(name, (False, False))
            total = self._others(name).take(slice(0, 2))
            # Hoop stresses balance radial forces.
            shown = [axis in motions_of(body.model.cloud) and not held[axis] for axis in (0, 1)]
            found["sum"][name] = total
            found["imbalance"][name] = total.combined(np.diag(np.array(shown, dtype=float)))
        return found

    def balance(self) -> LinearMap:
        """One row per unknown motion: force required of the constraint minus the force applied to it. Only
        contacts and tractions act on a floating body, which must balance."""
        rows = [
            self._constraint(constraint, motion) + -self._of_loads(motion.force[None, :])
            for constraint, motion in self.scene.unknown_motions
        ]
        return stack(rows, self.drivers.counts)

    def _zeros(self, rows: int) -> LinearMap:
        return LinearMap.zeros(rows, self.drivers.counts)

    def _of_loads(self, load: FloatArray) -> LinearMap:
        return LinearMap.of_loads(load, self.drivers.counts)

    def _contact(self, pairing: Pairing, body: str) -> LinearMap:
        """Force x, y and moment about the origin of a contact on one of its bodies."""
        drivers, result = self.drivers, self._zeros(3)
        basis, own = drivers.bases[pairing.name], self.sources[body][:, drivers.places[pairing.name]]
        sums = basis.resultants(self.scene.bodies[body], body, own)
        for part, values in zip(drivers.columns(result, pairing.name), sums, strict=False):
            part[:] = values
        return result

    def _acting(self, body: str) -> LinearMap:
        """The same of prescribed tractions, body forces, springs and contacts on a body."""
        parts = [pull for (name, _), pull in self.springs.items() if name == body]
        parts += [self._contact(one, body) for one in self.drivers.pairings if body in one.bodies]
        return sum(parts, self._of_loads(self._prescribed[body]))

    @cached_property
    def _prescribed(self) -> Mapping[str, FloatArray]:
        """Force x, y and moment (3, loads) of prescribed tractions and body forces on every body."""
        found = {name: np.zeros((3, self.drivers.loads)) for name in self.scene.bodies}
        for load in self.scene.applied:
            body = self.scene.bodies[load.body]
            found[load.body][:, load.number] += body.resultants() @ load.source(body)
        return found

    def _constraint(self, constraint: RigidConstraint, motion: RigidMotion) -> LinearMap:
        """Force (1 row) that the constraint must exert in the direction of one motion."""
        along = motion.direction[None, :]
        about = along @ _about(constraint.center)
        if not constraint.bodies:
            pairing = next(p for p in self.drivers.pairings if p.name == constraint.name)
            return self._contact(pairing, pairing.slave_body).combined(about)
        if constraint.floats or motion.alone:
            # The opposite of all forces except those of held surfaces.
            return -sum(map(self._acting, constraint.bodies), self._zeros(3)).combined(about)
        return sum((self.measured[held].combined(along) for held in constraint.held), self._zeros(1))

    def _reported(self) -> dict[str, LinearMap]:
        """Force x, y (2 rows) of each load and each support on its body, by name."""
        scene = self.scene
        report: dict[str, LinearMap] = defaultdict(lambda: self._zeros(2))

        def of_load(body: str, number: int) -> LinearMap:
            return self._of_loads(self._prescribed[body][:2] * (np.arange(self.drivers.loads) == number))

        for load in scene.surface_loads:
            name = scene.loads[load.number]
            if load.held:
                # A load on several surfaces appears once per surface.
                report[name] += self.measured[load.body, load.surface].take(slice(0, 2))
            else:
                report[name] = of_load(load.body, load.number)
        for constraint in scene.rigid_constraints:
            for number in constraint.loads:
                total = self._zeros(2)
                for motion in constraint.motions:
                    along, given = motion.direction[:2, None], motion.prescribed
                    if given is None:
                        own = motion.force * (np.arange(self.drivers.loads) == number)
                        total += self._of_loads(along * own)
                    elif number == next((n for n in constraint.loads if given[n]), constraint.loads[0]):
                        # Several loads may move one platen in this component: report its force once.
                        total += self._constraint(constraint, motion).combined(along)
                report[scene.loads[number]] = total
        for force in scene.body_forces:
            report[scene.loads[force.number]] = of_load(force.body, force.number)
        for heating in scene.heatings:
            report[scene.loads[heating.number]] = self._zeros(2)
        for name, places in scene.supports.items():
            seen = (forces[at] for at in places for forces in (self.measured, self.springs) if at in forces)
            report[name] = sum((one.take(slice(0, 2)) for one in seen), self._zeros(2))
            for load in scene.surface_loads:
                if (load.body, load.surface) in places:
                    on_springs = np.zeros((2, self.drivers.loads))
                    on_springs[:, load.number] = load.on_springs(scene.bodies[load.body])
                    carried = self._of_loads(on_springs)
                    report[name] += -carried
                    report[scene.loads[load.number]] += carried
        return dict(report)

    def _at_single_nodes(self) -> dict[str, LinearMap]:
        """Force x, y (2 rows) of each support of a single node on its body, by name, if statics determine
        those of all single nodes of the body: from its forces, or its forces and moments."""
        report = dict[str, LinearMap]()
        for name, body in self.scene.bodies.items():
            held = list(dict.fromkeys(body.held_nodes))
            arms = body.model.cloud.points[[node for node, _ in held]]
            axes = np.eye(2)[[axis for _, axis in held]]
            acting = np.vstack([axes.T, arms[:, 0] * axes[:, 1] - arms[:, 1] * axes[:, 0]])
            rows = next((n for n in (2, 3) if held and np.linalg.matrix_rank(acting[:n]) == len(held)), 0)
            if not rows:
                continue
            others = self._others(name).take(slice(0, rows))
            each = others.combined(np.asarray(-np.linalg.pinv(acting[:rows])))
            for label, (owner, node) in self.scene.single_supports.items():
                if owner == name:
                    own = np.array([held_node == node for held_node, _ in held], dtype=float)
                    report[label] = each.combined(axes.T * own)
        return report

    def _others(self, name: str) -> LinearMap:
        """Force x, y and moment of all forces on a body but those of single nodes."""
        total = self._acting(name)
        for surface in self.scene.bodies[name].restrained:
            about = _about(self.scene.center(name, surface))
            total += self.measured[name, surface].combined(np.asarray(np.linalg.inv(about)))
        return total


def _about(center: tuple[float, float]) -> FloatArray:
    """Matrix (3, 3) that moves the reference of the moment from the origin to ``center``."""
    return np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [center[1], -center[0], 1.0]])


def wall_forces(scene: Scene, drivers: Drivers, seen: Mapping[Held, FloatArray]) -> dict[Held, LinearMap]:
    """Force x, y and moment (3 rows) of held surfaces, by body and name, from the functionals ``seen`` (3,
    drivers) of the drivers.

    A force at s' that pushes across a plane of symmetry at which the contact ends is the more carried by it
    the nearer it is, and at the plane wholly. As a function of s' this has a step there, which samples of
    given parity do not represent: with J = 1, or between two planes a linear J that is 1 at the plane and 0
    at the other, minus J times the component across is integrated over the hats, and the rest is sampled.
    """
    rows = {where: one.copy() for where, one in seen.items()}
    steps = {where: LinearMap.zeros(3, drivers.counts) for where in rows}

    def add(pairing: Pairing, slave: bool, sign: float, end: float, normal: FloatArray, where: Held) -> None:
        grid, samples, center = pairing.grid, drivers.of_samples(pairing), scene.center(*where)

        def carried(s: FloatArray, force: FloatArray) -> FloatArray:
            share = 1.0 - np.abs(s - end) / (grid.last - grid.first) * (None not in grid.mirrors)
            across = (share * (force @ normal))[:, None] * (sign * normal)
            arm = as_real(grid.facing.side(s, slave)[0]) - np.array(center)
            return -np.stack([*across.T, cross(arm, across)])

        rows[where][:, samples] -= carried(np.tile(grid.samples, 2), np.repeat(np.eye(2), grid.count, axis=0))
        for which, part in enumerate(drivers.columns(steps[where], pairing.name)):
            by = carried(grid.hats.points, grid.directions[which])
            deviation = grid.deviation(np.eye(pairing.count), which)
            part += (grid.hats.integrals @ by.T).T @ deviation

    for pairing in drivers.on_grids:
        grid = pairing.grid
        for body, slave, sign in pairing.sides:
            for end, plane in zip((grid.first, grid.last), grid.mirrors, strict=True):
                if plane is None:
                    continue
                tip = as_real(grid.facing.side(np.array([end]), slave)[0])
                for name in scene.bodies[body].held:
                    curve = scene.bodies[body].model.cloud.surfaces[name].curve
                    away = np.abs(curve.points(np.array([0.0, curve.length])) - tip).max(axis=1).min()
                    if away <= COARSE_ROUND_OFF * curve.length:
                        normal = np.array([-plane.along.imag, plane.along.real])
                        add(pairing, slave, sign, end, normal, (body, name))
    return {where: drivers.by_unknowns(one) + steps[where] for where, one in rows.items()}
