"""Forces: what loads, supports and contacts exert on the bodies, and the balance of platens and bodies."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.linear_map import Columns, LinearMap, stack
from mlsanm_cli.contact.observers import cut_off, nodal_resultant, resultant
from mlsanm_cli.contact.pairing import Pairing, transfer, turned
from mlsanm_cli.mechanics.scene import LooseBody, Mover, Obstacle, Platen, RigidMotion, Scene
from mlsanm_cli.values import dataclass

Held = tuple[str, str]


@dataclass(frozen=True)
class Forces:
    """Everything that pushes on a body, as force x, y and moment (3 rows) in the condensed unknowns.

    ``measured[body, surface]`` is what :func:`reaction_rows` finds, moments about that platen's centre;
    ``springs[body, surface]`` the forces on the nodes of surfaces with soft springs (:func:`spring_rows`).
    """

    scene: Scene
    pairings: tuple[Pairing, ...]
    spans: Mapping[str, slice]
    tangential: Mapping[str, slice]
    columns: Columns
    measured: Mapping[Held, LinearMap]
    springs: Mapping[Held, LinearMap]

    def contact(
        self, pairing: Pairing, center: tuple[float, float] = (0.0, 0.0), factor: FloatArray | None = None
    ) -> LinearMap:
        """What a contact exerts on its slave; ``factor`` (n, 2) scales the nodes' forces."""
        nodes = pairing.node[pairing.candidate]
        points = self._points(pairing.slave_body)[nodes]

        def per_node(direction: FloatArray) -> FloatArray:
            forces = (pairing.weight[:, None] * direction)[pairing.candidate]
            return resultant(forces if factor is None else forces * factor[nodes], points, center)

        return self._of_contact(pairing, per_node(pairing.normal), per_node(pairing.tangent))

    def _of_contact(self, pairing: Pairing, normal: FloatArray, tangential: FloatArray) -> LinearMap:
        """A map (r, m) of one contact's pressures, and of its tractions where it has friction."""
        total = self.columns.of_pressures(self.spans[pairing.name], normal)
        if pairing.name in self.tangential:
            total = total + self.columns.of_tractions(self.tangential[pairing.name], tangential)
        return total

    def transferred(
        self, pairing: Pairing, center: tuple[float, float] = (0.0, 0.0), factor: FloatArray | None = None
    ) -> LinearMap:
        """What the master's own nodes receive of it: minus :meth:`contact` up to the discretisation error."""
        surface = pairing.master
        assert surface is not None
        assert pairing.master_body is not None
        cloud = self.scene.bodies[pairing.master_body].model.cloud
        carried = self._transfers[pairing.name]

        def per_node(direction: FloatArray) -> FloatArray:
            forces = -surface.weight[:, None] * direction
            forces = forces if factor is None else forces * factor[surface.index]
            return resultant(forces, cloud.points[surface.index], center) @ carried

        return self._of_contact(pairing, per_node(surface.normal), per_node(turned(surface.normal)))

    def applied(self, body: str, center: tuple[float, float], factor: FloatArray | None = None) -> LinearMap:
        """What prescribed tractions and body forces, and the springs, add up to on a body."""
        total = np.zeros((3, self.columns.loads))
        points = self._points(body)
        scale = np.ones_like(points) if factor is None else factor
        for load in self.scene.surface_loads:
            if load.body == body and not load.held:
                surface = self.scene.surface(body, load.surface)
                forces = surface.weight[:, None] * load.values * scale[surface.index]
                total[:, load.number] += resultant(forces, points[surface.index], center).sum(axis=1)
        for force in self.scene.body_forces:
            if force.body == body:
                forces = self.scene.bodies[body].model.cloud.areas[:, None] * force.values * scale
                total[:, force.number] += resultant(forces, points, center).sum(axis=1)
        result = self.columns.of_loads(total)
        for owner, name in self.springs:
            if owner == body:
                result = result + self.spring((owner, name), center, scale)
        return result

    def spring(self, where: Held, center: tuple[float, float], factor: FloatArray) -> LinearMap:
        """What the springs of one surface exert; ``factor`` (n, 2) scales the nodes' forces."""
        index = self.scene.surface(*where).index
        points = self._points(where[0])
        return self.springs[where].combined(nodal_resultant(points[index], center, factor[index]))

    @cached_property
    def reactions(self) -> dict[Held, LinearMap]:
        """The force of every held surface on its body, from the stress inside the body."""
        return {(body, surface): self._reaction(body, surface) for body, surface in self.measured}

    @cached_property
    def _transfers(self) -> dict[str, sparse.csr_array]:
        bodies = self.scene.bodies
        return {
            p.name: transfer(p, bodies[p.master_body].model.cloud)
            for p in self.pairings
            if p.master_body is not None
        }

    def _reaction(self, body: str, surface: str) -> LinearMap:
        elastic = self.scene.bodies[body]
        center = self.scene.center(body, surface)
        factor = np.outer(cut_off(elastic, surface), elastic.gripped[surface])
        known = self.applied(body, center, factor)
        for pairing in self.pairings:
            if pairing.slave_body == body:
                known = known + self.contact(pairing, center, factor)
            if pairing.master_body == body:
                known = known + self.transferred(pairing, center, factor)
        return self.measured[body, surface] + -known

    def _points(self, body: str) -> FloatArray:
        return self.scene.bodies[body].model.cloud.points

    def others(self, mover: Platen | LooseBody) -> LinearMap:
        """All but held surfaces on a mover's body, moments about the mover's centre."""
        total = self.applied(mover.body, mover.center)
        for pairing in self.pairings:
            if pairing.slave_body == mover.body:
                total = total + self.contact(pairing, mover.center)
            if pairing.master_body == mover.body:
                total = total + -self.contact(pairing, mover.center)
        return total

    def mover(self, mover: Mover, motion: RigidMotion) -> LinearMap:
        """The force (1 row) that the mover must exert on what it moves in one component."""
        row = slice(motion.component, motion.component + 1)
        if isinstance(mover, Obstacle):
            pairing = next(p for p in self.pairings if p.name == mover.contact)
            return self.contact(pairing, mover.center).take(row)
        if isinstance(mover, LooseBody) or motion.alone:
            return -self.others(mover).take(row)
        return self.reactions[mover.body, mover.surface].take(row)


def balance_of_movers(forces: Forces) -> LinearMap:
    """One row per unknown motion: the force the mover must exert less the force applied to it.

    Nothing exerts a force on a loose body but its contacts and tractions, which must so balance.
    """
    rows = []
    for mover, motion in forces.scene.unknown_motions:
        rows.append(forces.mover(mover, motion) + -forces.columns.of_loads(motion.force[None, :]))
    return stack(rows, forces.columns)


def reported_forces(forces: Forces) -> dict[str, LinearMap]:
    """Force x, y (2 rows) that each load and each support exerts on its body, by name."""
    scene, columns = forces.scene, forces.columns
    report = {}
    for load in scene.surface_loads:
        if load.held:
            total = forces.reactions[load.body, load.surface]
        else:
            surface = scene.surface(load.body, load.surface)
            sums = np.zeros((3, columns.loads))
            sums[:2, load.number] = (surface.weight[:, None] * load.values).sum(axis=0)
            total = columns.of_loads(sums)
        report[scene.loads[load.number]] = total.take(slice(0, 2))
    for mover in scene.movers:
        for number in mover.loads:
            rows = [columns.zeros(1), columns.zeros(1)]
            for motion in mover.motions:
                if motion.component > 1:
                    continue
                if motion.prescribed is None:
                    own = np.zeros((1, columns.loads))
                    own[0, number] = motion.force[number]
                    rows[motion.component] = columns.of_loads(own)
                elif number == next((n for n in mover.loads if motion.prescribed[n]), mover.loads[0]):
                    # Several loads may move one platen in this component: its force is told once.
                    rows[motion.component] = forces.mover(mover, motion)
            report[scene.loads[number]] = stack(rows, columns)
    for force in scene.body_forces:
        sums = np.zeros((2, columns.loads))
        sums[:, force.number] = scene.bodies[force.body].model.cloud.areas @ force.values
        report[scene.loads[force.number]] = columns.of_loads(sums)
    for heating in scene.heatings:
        report[scene.loads[heating.number]] = columns.zeros(2)
    for name, where in scene.supports.items():
        total = columns.zeros(3)
        if where in forces.reactions:
            total = total + forces.reactions[where]
        if where in forces.springs:
            everything = np.ones_like(scene.bodies[where[0]].model.cloud.points)
            total = total + forces.spring(where, (0.0, 0.0), everything)
        report[name] = total.take(slice(0, 2))
    return report


def body_imbalance(forces: Forces) -> LinearMap:
    """Sum of all forces on each body (2 rows per body), those of held surfaces from the stress field.

    It vanishes with the discretisation error. Components held at single nodes are left out.
    """
    rows = []
    for name in forces.scene.bodies:
        total = forces.applied(name, (0.0, 0.0))
        for pairing in forces.pairings:
            if pairing.slave_body == name:
                total = total + forces.contact(pairing)
            if pairing.master_body == name:
                total = total + forces.transferred(pairing)
        for surface in forces.scene.bodies[name].gripped:
            total = total + forces.reactions[name, surface]
        for component in (0, 1):
            hidden = forces.scene.held_nodes.get(name, (False, False))[component]
            row = slice(component, component + 1)
            rows.append(forces.columns.zeros(1) if hidden else total.take(row))
    return stack(rows, forces.columns)
