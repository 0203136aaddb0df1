"""Unknown rigid motions, and their resistance by contacts, supports and springs."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.app.scene.loads import Acting
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.joined import normals_towards
from mlsanm_cli.contact.geometry.facing import turned
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.response.walls import resultant
from mlsanm_cli.mechanics.rigid import ROTATION, rigid_pattern
from mlsanm_cli.mechanics.scene import RigidConstraint, RigidMotion
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

MIN_NORMAL_COMPONENT = 0.2
"""Root mean square component of its normals above which a contact resists a direction. A smaller one is due
to slight curvature of the surface, and too small to distinguish the motion from asymmetry of the
discretisation."""
MIN_EXACT_COMPONENT = 1e-3
"""The same as ``MIN_NORMAL_COMPONENT`` for contacts with exact directions."""
QUADRATURE = 1e-3
"""Error of sums of forces by quadrature, relative to their magnitudes. Forces that all point to a centre, as
a pressure in a bore, have a moment by it only: this part of force times arm counts as terms that cancel."""


@dataclass(frozen=True, eq=False)
class UnknownMotion:
    """One unknown motion: the ``force`` (L,) on it by load at factor 1, the sum ``size`` (L,) of the
    magnitudes of that force's terms, whether something besides contacts resists it (``elastic``), and the
    largest displacement of a contact under unit motion (``lever``)."""

    constraint: RigidConstraint
    motion: RigidMotion
    force: FloatArray
    size: FloatArray
    elastic: bool
    lever: float = 1.0

    @property
    def bodies(self) -> tuple[str, ...]:
        """The bodies that it moves as a whole; none for obstacles."""
        return self.constraint.bodies

    def side(self, pairing: Pairing) -> float:
        """1 if it moves the slave of a contact, -1 for the master, else 0."""
        if not self.bodies:
            return -1.0 if self.constraint.name == pairing.name else 0.0
        if self.elastic:
            return 0.0
        return float(pairing.slave_body in self.bodies) - float(pairing.master_body in self.bodies)

    def at(self, points: FloatArray) -> FloatArray:
        """Displacements (n, 2) of ``points`` (n, 2), at most 1 in contacts."""
        return rigid_pattern(points, self.constraint.center, self.motion.component) / self.lever


def unknown_motion(
    constraint: RigidConstraint,
    motion: RigidMotion,
    clouds: Mapping[str, Cloud],
    pairings: Sequence[Pairing],
    loads: Acting,
) -> UnknownMotion:
    """The motion with its forces: its own, and tractions and body forces on the bodies that move."""
    force, size = motion.force.copy(), np.abs(motion.force)
    elastic = not motion.alone
    if not elastic:
        springs = [k for body in constraint.bodies for k in loads.springs[body].values()]
        elastic = any(any(k) if motion.component == ROTATION else k[motion.component] for k in springs)
        for number, forces, points in [
            term for body in constraint.bodies for term in _forces(loads, clouds, body)
        ]:
            parts = resultant(forces, points, constraint.center)[motion.component]
            force[number] += parts.sum()
            size[number] += np.abs(parts).sum()
            if motion.component == ROTATION:
                arms = np.hypot(*(points - constraint.center).T)
                size[number] += QUADRATURE * np.hypot(*forces.T) @ arms
    unknown = UnknownMotion(constraint, motion, force, size, elastic)
    moved = [unknown.at(clouds[p.slave_body].points[p.node]) for p in pairings if unknown.side(p)]
    lever = max((float(np.hypot(*parts.T).max()) for parts in moved), default=1.0)
    return replace(unknown, lever=lever)


def _forces(
    loads: Acting, clouds: Mapping[str, Cloud], body: str
) -> Iterator[tuple[int, FloatArray, FloatArray]]:
    """Load numbers, forces (n, 2) and points (n, 2) of all tractions and body forces on a body."""
    cloud = clouds[body]
    for load in loads.surface_loads:
        if load.body == body and not load.held:
            assert load.between is not None  # tractions have it
            surface = cloud.surfaces[load.surface]
            halves = Halves.of(surface, FINE)
            points = surface.curve.points(halves.arc)
            yield load.number, (halves.length * cloud.around(points))[:, None] * load.between, points
    for force in loads.body_forces:
        if force.body == body:
            yield force.number, cloud.volumes[:, None] * force.values, cloud.points


def sliding_resistance(
    unknowns: Sequence[UnknownMotion],
    pairings: Sequence[Pairing],
    clouds: Mapping[str, Cloud],
    at_once: bool = False,
) -> FloatArray:
    """Mean squares (k, k) of the motions normal to the surfaces they move; with friction, in all directions.

    If one of two surfaces is straight, bodies may slide along both ``at_once``, as a disk that rotates about
    a point above the plane on which it rests: only the width of the contact resists. Two straight surfaces
    touch along their length or at a corner, which crosses the other unknown.
    """
    total = _elastic(unknowns)
    for pairing in pairings:
        frame = _Frame.of(pairing, clouds)
        sides = [np.linalg.eigh(frame.squares(*side)) for side in frame.sides]
        free = [directions[:, sizes <= COARSE_ROUND_OFF**2] for sizes, directions in sides]
        straight = [bool(null.shape[1] and np.abs(null[2]).max() <= COARSE_ROUND_OFF) for null in free]
        if at_once and sum(straight) == 1 and not pairing.friction:
            along = np.linalg.svd(np.hstack(free))
            crossing = along[0][:, int((along[1] > COARSE_ROUND_OFF).sum()) :]
            relative = crossing.T @ frame.relative(unknowns)
            total += relative.T @ relative
            continue
        for side, (at, normal) in zip((1.0, -1.0), frame.sides, strict=True):
            across = np.zeros((len(at), 2 if pairing.friction else 1, len(unknowns)))
            for column, unknown in enumerate(unknowns):
                if unknown.side(pairing) == side:
                    across[:, 0, column] = (unknown.at(at) * normal).sum(axis=1)
                    if pairing.friction:
                        across[:, 1, column] = (unknown.at(at) * turned(normal)).sum(axis=1)
            total += np.einsum("ndi,ndj->ij", across, across) / len(at)
    return total


def contact_resistance(
    unknowns: Sequence[UnknownMotion],
    pairings: Sequence[Pairing],
    clouds: Mapping[str, Cloud],
    exact: Collection[str],
) -> FloatArray:
    """Mean squares (k, k) of the motions in the directions that contacts resist."""
    total = _elastic(unknowns)
    for pairing in pairings:
        frame = _Frame.of(pairing, clouds)
        sizes, directions = np.linalg.eigh(
            frame.squares(frame.sides[0][0], pairing.normal[pairing.candidate])
        )
        least = MIN_EXACT_COMPONENT if pairing.name in exact else MIN_NORMAL_COMPONENT
        resisted = np.eye(3) if pairing.friction else directions[:, sizes >= least**2].T
        relative = resisted @ frame.relative(unknowns)
        total += relative.T @ relative
    return total


@dataclass(frozen=True, eq=False)
class _Frame:
    """The frame of a contact: its ``middle`` (2,) and ``lever``, the root mean square distance from it. Rigid
    motions (3,) are the translation of the middle and the rotation times the lever. ``share`` (m,) are the
    weights of the points, ``sides`` the points (m, 2) and normals (m, 2) of slave and master."""

    pairing: Pairing
    middle: FloatArray
    lever: float
    share: FloatArray
    sides: tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]

    @classmethod
    def of(cls, pairing: Pairing, clouds: Mapping[str, Cloud]) -> _Frame:
        chosen = pairing.candidate
        points = clouds[pairing.slave_body].points[pairing.node[chosen]]
        share = pairing.weight[chosen] / pairing.weight[chosen].sum()
        middle = share @ points
        lever = float(np.sqrt(share @ ((points - middle) ** 2).sum(axis=1))) or 1.0
        partner, normal = pairing.partner[chosen], pairing.normal[chosen]
        own = points, pairing.slave.normal[pairing.position[chosen]]
        if pairing.master is not None:  # pressures may act along the normals of the slave
            curve = pairing.master.curve
            normal = normals_towards(curve, curve.closest(partner), own[1])
        return cls(pairing, middle, lever, share, (own, (partner, normal)))

    def squares(self, points: FloatArray, normal: FloatArray) -> FloatArray:
        """Mean squares (3, 3) of the component of rigid motions along normals (m, 2) at ``points`` (m, 2)."""
        arm, (n_x, n_y) = points - self.middle, normal.T
        across = np.column_stack([n_x, n_y, (n_y * arm[:, 0] - n_x * arm[:, 1]) / self.lever])
        return np.asarray(across.T @ (self.share[:, None] * across))

    def relative(self, unknowns: Sequence[UnknownMotion]) -> FloatArray:
        """The motion (3, k) of the slave relative to the master per unit of each unknown."""
        found = np.zeros((3, len(unknowns)))
        for column, unknown in enumerate(unknowns):
            turn = self.lever / unknown.lever if unknown.motion.component == ROTATION else 0.0
            motion = np.append(unknown.at(self.middle[None, :])[0], turn)
            found[:, column] = unknown.side(self.pairing) * motion
        return found


def _elastic(unknowns: Sequence[UnknownMotion]) -> FloatArray:
    """The resistance (k, k) by supports and springs."""
    return np.diag([float(unknown.elastic) for unknown in unknowns])
