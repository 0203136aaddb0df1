"""Free rigid motions of bodies, and the solution of bodies that have some.

The displacement of a body held by contact only is not unique, and a unit load on it is not balanced. Every
load is balanced by linearly varying body forces, like inertia forces (D'Alembert), which vanish in every
state of the contact problem, where the rigid motions are unknowns. Among all displacements the one with
the prescribed mean motion is taken, independent of the pinned nodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sparse
from scipy.linalg.lapack import dgeqp3

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.mechanics.supports import Springs
from mlsanm_cli.operators.system import FULL_TOLERANCE
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF

if TYPE_CHECKING:
    from mlsanm_cli.mechanics.body import ElasticBody

ROTATION = 2
PIN_DIGITS = 9
"""Digits of node positions, relative to the body's size, that decide where it is pinned."""


def rigid_pattern(points: FloatArray, center: tuple[float, float], component: int) -> FloatArray:
    """Displacements (n, 2) of ``points`` under a unit motion: x, y, or rotation about ``center``."""
    if component == ROTATION:
        arm = points - np.array(center)
        return np.stack([-arm[:, 1], arm[:, 0]], axis=1)
    values = np.zeros((len(points), 2))
    values[:, component] = 1.0
    return values


@dataclass(frozen=True)
class RigidBodyModes:
    """Free rigid motions: ``components`` 0 (x), 1 (y), 2 (rotation about ``center``)."""

    center: tuple[float, float]
    components: tuple[int, ...]

    def patterns(self, points: FloatArray) -> FloatArray:
        """Displacements (2n, d) of ``points`` (n, 2) under unit motions, x and y interleaved."""
        columns = [rigid_pattern(points, self.center, component).ravel() for component in self.components]
        return np.stack(columns, axis=1) if columns else np.zeros((2 * len(points), 0))


def freedom(points: FloatArray, areas: FloatArray, held: BoolArray) -> RigidBodyModes:
    """Rigid motions left free by the held components ``held`` (n, 2) of nodes ``points`` (n, 2). A body that
    can rotate does so about its support, else about its centroid, computed with the nodes' ``areas`` (n,)."""
    middle = areas @ points / areas.sum()
    size = float(np.ptp(points, axis=0).max())
    center = (float(middle[0]), float(middle[1]))
    whole = RigidBodyModes(center, (0, 1, ROTATION)).patterns(points)
    whole[:, ROTATION] /= size
    rows = whole[held.ravel()]
    if not len(rows) or not np.abs(rows).max():
        return RigidBodyModes(center, (0, 1, ROTATION))
    _, sizes, motions = np.linalg.svd(np.linalg.qr(rows, mode="r"))
    free = motions[np.append(sizes, np.zeros(3 - len(sizes))) <= ROUND_OFF * sizes[0]]
    along = [axis for axis in (0, 1) if np.abs(rows[:, axis]).max() == 0.0]
    if len(free) == len(along):
        return RigidBodyModes(center, tuple(along))
    # The rotational motion may include translations along free axes, which only shift the centre.
    turning = free.T @ np.linalg.solve(free[:, [*along, ROTATION]].T, np.eye(len(free))[-1])
    x, y, turn = turning[0], turning[1], turning[ROTATION] / size
    return RigidBodyModes((center[0] - float(y / turn), center[1] + float(x / turn)), (*along, ROTATION))


def motions_of(cloud: Cloud) -> tuple[int, ...]:
    """The rigid motions of a body: x, y and rotation, of a body of revolution y."""
    return (1,) if cloud.revolved else (0, 1, ROTATION)


def free_motions(
    cloud: Cloud,
    held: Mapping[str, tuple[bool, bool]],
    held_nodes: Sequence[tuple[int, int]],
    springs: Springs,
) -> RigidBodyModes:
    """Rigid motions of a body that its held surfaces, held nodes and springs leave free."""
    mask = np.zeros((len(cloud.points), 2), dtype=bool)
    # Hoop stresses resist all motions of a body of revolution but that along its axis.
    mask[:, 0] = cloud.revolved
    for name, components in held.items():
        mask[cloud.surfaces[name].index] |= np.array(components)
    for name, stiffness in springs.items():
        mask[cloud.surfaces[name].index] |= np.array(stiffness) > 0.0
    for node, component in held_nodes:
        mask[node, component] = True
    return freedom(cloud.points, cloud.areas, mask)


def independent_rows(columns: FloatArray) -> list[int]:
    """Indices of d well-conditioned rows of ``columns`` (n, d): QR pivots of its transpose."""
    if not columns.size:
        return []
    _, pivots, _, _, _ = dgeqp3(columns.T)
    return [int(pivot) - 1 for pivot in pivots[: columns.shape[1]]]


def pins(points: FloatArray, free: RigidBodyModes) -> list[tuple[int, int]]:
    """(node, component) pairs, one per free motion, that together suppress all free motions."""
    patterns = free.patterns(points)
    if not free.components:
        return []
    patterns = patterns / np.maximum(np.abs(patterns).max(axis=0), np.finfo(float).tiny)
    # Many positions tie: their last digits, which differ between units, must not decide.
    patterns = np.round(patterns, PIN_DIGITS)
    return [(place // 2, place % 2) for place in independent_rows(patterns)]


class FreeSystem:
    """The system of a ``body`` with d free rigid motions, without the effect of its ``pinned`` (node,
    component) pairs; the d rows from ``first_pin`` on prescribe the mean motions of the solution."""

    def __init__(self, body: ElasticBody, pinned: Sequence[tuple[int, int]]) -> None:
        cloud, free = body.model.cloud, body.free
        self.system, self.first_pin = body.system, body.first_pin
        # The free motions (n, d), and the matrix (d, n) that extracts their amount from a displacement.
        self.patterns = free.patterns(cloud.points)
        weighted = np.repeat(cloud.volumes, 2)[:, None] * self.patterns
        self.mean = np.linalg.solve(self.patterns.T @ weighted, self.patterns.T * np.repeat(cloud.volumes, 2))
        self.pinned = np.array([2 * node + component for node, component in pinned])
        # The work (d, r) of right-hand sides in the free motions, and the body forces (r, d) of work -1.
        self.work = body.resultants(free.center)[list(free.components)].toarray()
        forces = [body.force_source(motion.reshape(-1, 2)) for motion in self.patterns.T]
        balance = np.stack(forces, axis=1)
        self.balance = -balance @ np.linalg.inv(self.work @ balance)

    @property
    def _pins(self) -> slice:
        return slice(self.first_pin, self.first_pin + len(self.pinned))

    def _wanted(self, sources: sparse.csc_array) -> FloatArray:
        """Prescribed mean motions (d, c) of the solutions for ``sources`` (r, c)."""
        return np.asarray(sparse.csr_array(sources)[self._pins].toarray())

    def _balanced(self, sources: sparse.csc_array) -> sparse.csc_array:
        dense = sources.toarray()
        dense[self._pins] = 0.0
        return sparse.csc_array(dense + self.balance @ (self.work @ dense))

    def solve(self, sources: sparse.csc_array, tolerance: float = FULL_TOLERANCE) -> FloatArray:
        return self._centred(self.system.solve(self._balanced(sources), tolerance), self._wanted(sources))

    def correction(self, sources: sparse.csc_array, solutions: FloatArray | None = None) -> FloatArray:
        wanted = self._wanted(sources)
        if solutions is None:
            return self._centred(self.system.correction(self._balanced(sources)), wanted)
        # With zero displacement at the pins.
        moved = np.linalg.solve(self.patterns[self.pinned], solutions[self.pinned])
        change = self.system.correction(self._balanced(sources), solutions - self.patterns @ moved)
        return self._centred(change, wanted - self.mean @ solutions)

    def _centred(self, solution: FloatArray, wanted: FloatArray) -> FloatArray:
        """``solution`` (n, c) with the mean motions ``wanted`` (d, c)."""
        return np.asarray(solution + self.patterns @ (wanted - self.mean @ solution))

    def functionals(
        self, observed: sparse.csr_array, sources: sparse.csc_array, mixture: FloatArray | None = None
    ) -> FloatArray:
        rows = sparse.csr_array(sparse.vstack([observed, sparse.csr_array(self.mean)], format="csr"))
        wanted, acting = self._wanted(sources), np.ones(sources.shape[0])
        acting[self._pins] = 0.0
        sources = sparse.csc_array(sparse.diags_array(acting) @ sources)
        # Balancing every source separately would fill every row.
        apart = sparse.csc_array(sparse.hstack([sources, sparse.csc_array(self.balance)], format="csc"))
        mixed = np.eye(sources.shape[1]) if mixture is None else mixture
        balanced = np.concatenate([mixed, (self.work @ sources) @ mixed])
        found = self.system.functionals(rows, apart, balanced)
        pinned, mean = np.split(found, [observed.shape[0]])
        return np.asarray(pinned + (observed @ self.patterns) @ (wanted @ mixed - mean))

    @property
    def note(self) -> str:
        return self.system.note

    def inverse_normal(self, vectors: FloatArray) -> FloatArray:
        return self.system.inverse_normal(vectors)

    def scaled(self, sources: sparse.csc_array, strong: bool = True) -> FloatArray:
        return self.system.scaled(self._balanced(sources), strong)
