"""The contact problem with the bodies' displacements among its unknowns, as usual in the literature.

Every tangent is one large sparse matrix of all bodies and contact rows, factorised in each step. It is the
baseline for condensation, with the same operators and elimination order. The displacements u of all bodies
follow the rigid motions, and the bodies' equations the balances, in the order of
:mod:`mlsanm_cli.contact.laws.coupling`::

    gap      h = h0 + R_n u + beyond_n (p, t)     (R from the response functionals)
    slip     s = F R_t u + beyond_t (p, t)
    balance  0 = forces(f, p, t) + reactions(u)
    bodies   0 = K u - sources(f, q, p, t)

Displacements are scaled by the elastic change of the gaps, a body's equations by the effect of such a
displacement of one node. Normal equations of the least-squares problem are used for the factor only:
residuals are formed from the rows themselves, and every solve is refined with them, or half the digits would
be lost.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.laws.coupling import Coupling, Local, row_scales, slip_places
from mlsanm_cli.contact.laws.scales import Regularization
from mlsanm_cli.contact.monolithic.elimination import Elimination, plan_elimination
from mlsanm_cli.contact.response.balance import CondensedForces, balance_of_constraints
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.drivers import Drivers
from mlsanm_cli.contact.response.functionals import candidate_rows, spring_rows
from mlsanm_cli.contact.response.linear_map import Columns, LinearMap
from mlsanm_cli.contact.response.short_waves import slip_fit
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.operators.refinement import Progress, refine

GAP_RATIO = 10.0
"""Elastic change of the gaps over the law's reference gap."""
UPDATE_TOLERANCE = 1e-11
"""Relative tolerance of the predicted next update in the refinement of tangent solves."""


@dataclass(frozen=True, eq=False)
class SparseCoupling(Coupling):
    """Gaps, slips, balances and residuals of the bodies' equations for y = (p, t, q, u). ``matrix`` (m + n +
    k, r) are the rows of the first three; ``scale`` (2N,) are divisors of the bodies' equations."""

    matrix: sparse.csr_array
    scene: Scene
    scale: FloatArray
    elimination: Elimination

    def with_stick_compliance(self) -> SparseCoupling:
        """The same with the asperities' compliance added to the slips."""
        places, added = slip_places(self.condensed), self.law.stick_compliance / self.law.slip
        matrix = self.matrix + _entries(places, places, added, self.matrix.shape)
        square = _entries(places, places, added, (len(self.constant),) * 2)
        return replace(self, matrix=matrix, elimination=self.elimination.with_added(square))

    def __call__(self, f: FloatArray, y: FloatArray) -> FloatArray:
        """All rows (r,) in one state."""
        top = len(self.matrix.indptr) - 1
        known = self.constant[:top] + self.load[:top] @ f + self.matrix @ y
        return np.concatenate([known, self._excess(f, y)])

    def times(self, y: FloatArray) -> FloatArray:
        """The rows (r,) for y alone, without loads."""
        return np.concatenate([self.matrix @ y, self._excess(np.zeros(self.load.shape[1]), y)])

    def _excess(self, f: FloatArray, y: FloatArray) -> FloatArray:
        """Residuals (2N,) of the bodies' equations."""
        m, n, k = len(self.condensed.weight), len(self.condensed.friction_nodes), len(self.law.motion)
        p, t, q, u = np.split(y, np.cumsum([m, n, k]))
        causes = np.concatenate([f, q, p, t])
        parts = [
            self.scene.bodies[name].system.residual_vector(self.condensed.sources[name] @ causes, u[own])
            for name, own in self.scene.places.items()
        ]
        return np.concatenate(parts) / self.scale

    def tangent(self, local: Local) -> SparseTangent:
        """Factorise; raises numpy's LinAlgError if singular."""
        return SparseTangent(self, local)


class SparseTangent:
    """LU factors of the tangent for y = (p, t, q, u), with iterative refinement."""

    def __init__(self, coupling: SparseCoupling, local: Local) -> None:
        self._coupling = coupling
        m, size = len(local.gap), len(coupling.constant)
        slips, friction_nodes = slip_places(coupling.condensed), coupling.condensed.friction_nodes
        self._rows = np.ones(size)
        self._rows[:m], self._rows[slips] = local.gap, local.slip
        rows = np.concatenate([np.arange(m), slips, slips])
        columns = np.concatenate([np.arange(m), slips, friction_nodes])
        values = np.concatenate([local.pressure, local.traction, local.friction_slope])
        self._local = _entries(rows, columns, values, (size, size))
        self._factor = coupling.elimination.factor(self._rows, self._local)

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution (r,)."""
        plan = self._coupling.elimination
        scales = plan.scale[: len(rhs)]

        def update(z: FloatArray) -> FloatArray:
            y = scales * z[:, 0]
            rest = rhs - self._rows * self._coupling.times(y) - self._local @ y
            return plan.solve(self._factor, rest)[:, None]

        first = plan.solve(self._factor, rhs)[:, None]
        return np.asarray(scales * refine(first, update, Progress.of(first, UPDATE_TOLERANCE))[0][:, 0])


def sparse_coupling(scene: Scene, condensed: Condensed, law: Regularization) -> SparseCoupling:
    """The linear part of the problem for the candidates, loads and platens of ``condensed``. Of the condensed
    solution only ``beyond`` is used, for friction."""
    m, n, k = len(condensed.weight), len(condensed.friction_nodes), len(law.motion)
    places = scene.places
    total = max(own.stop for own in places.values())
    columns = Columns(len(scene.loads), k + total, m, n)
    equations, loads = {}, np.zeros((total, columns.loads))
    for name, own in places.items():
        # Contact unknowns in the order of their rows.
        q, p, t = np.split(np.arange(columns.loads, columns.loads + k + m + n), [k, k + m])
        caused = condensed.sources[name][:, np.concatenate([p, t, q])]
        system = scene.bodies[name].system
        equations[name] = system.equations(sparse.csc_array(caused))
        for number in range(columns.loads):
            source = condensed.sources[name][:, [number]].toarray()[:, 0]
            loads[own, number] = system.residual_vector(source, np.zeros(own.stop - own.start))
    elastic = GAP_RATIO * law.gap
    largest = [abs(one.matrix).max(axis=1).toarray().ravel() for one in equations.values()]
    scale = elastic * np.concatenate(largest)
    motion = np.concatenate([law.motion, np.full(total, elastic)])
    unknowns = np.concatenate([np.full(m, law.pressure), condensed.friction * law.pressure, motion])
    contact, constant, load = _contact_rows(scene, condensed, law, columns)
    return SparseCoupling(
        condensed=condensed,
        law=law,
        motion=motion,
        constant=np.concatenate([constant, np.zeros(total)]),
        load=np.concatenate([load, loads / scale[:, None]]),
        matrix=contact,
        scene=scene,
        scale=scale,
        elimination=plan_elimination(scene, contact, equations, scale, unknowns),
    )


def _contact_rows(
    scene: Scene, condensed: Condensed, law: Regularization, columns: Columns
) -> tuple[sparse.csr_array, FloatArray, FloatArray]:
    """Rows of gaps, slips and balances (m + n + k, r), their constants and load terms."""
    m, n, k = len(condensed.weight), len(condensed.friction_nodes), len(law.motion)
    frictional = tuple(pairing for pairing in condensed.pairings if pairing.friction)
    seen = {one.name: _of_displacements(scene, one) for one in condensed.pairings}
    beyond, rigid = condensed.beyond, sparse.csr_array((m + n, k))
    rows = [sparse.hstack([beyond[:m], rigid[:m], sparse.vstack([gap for gap, _ in seen.values()])])]
    if n:
        slips = sparse.vstack([slip_fit(pairing) @ seen[pairing.name][1] for pairing in frictional])
        rows.append(sparse.hstack([beyond[m:], rigid[m:], slips]))
    balance = _balance(scene, condensed, columns)
    if k:
        rows.append(sparse.csr_array(np.hstack([balance.pressure, balance.traction, balance.motion])))
    scale = row_scales(condensed, law)
    constant = np.concatenate([condensed.gap.constant, np.zeros(n), balance.constant])
    load = np.concatenate([np.zeros((m + n, columns.loads)), balance.load])
    whole = sparse.csr_array(sparse.vstack(rows, format="csr"))
    return sparse.csr_array(sparse.diags_array(1.0 / scale) @ whole), constant / scale, load / scale[:, None]


def _of_displacements(scene: Scene, pairing: Pairing) -> list[sparse.csr_array]:
    """Changes of a contact's gaps, and its slips (m, 2N), by the displacements of all bodies."""
    rows = [candidate_rows(body, name, pairing) for name, body in scene.bodies.items()]
    return [sparse.hstack(parts, format="csr") for parts in zip(*rows, strict=True)]


def _balance(scene: Scene, condensed: Condensed, columns: Columns) -> LinearMap:
    """Force imbalance of the platens, with the stress behind them from the displacements."""
    first, measured, springs = len(scene.unknown_motions), {}, {}

    def measured_by(body: str, rows: sparse.csr_array) -> LinearMap:
        whole, own = columns.zeros(rows.shape[0]), scene.places[body]
        whole.motion[:, first + own.start : first + own.stop] = rows.toarray()
        return whole

    for platen, motion in scene.unknown_motions:
        for owner in platen.bodies:
            for surface in scene.bodies[owner].soft_springs:
                springs[owner, surface] = measured_by(owner, spring_rows(scene.bodies[owner], surface))
        for held in platen.held:
            (owner, surface), body = held, scene.bodies[held[0]]
            if motion.alone or held in measured:
                continue
            rows = body.reaction_rows(surface, platen.center)
            measured[held] = measured_by(owner, rows)
            # Subtract the free expansion: stresses come from elastic strains.
            for heating in scene.heated(owner):
                expansion = heating.reaction(body, surface, platen.center)
                measured[held].load[:, heating.number] -= expansion
    apart = len(scene.loads) + first
    sources = {
        name: sparse.csc_array(
            sparse.hstack(
                [own[:, :apart], sparse.csc_array((own.shape[0], columns.motions - first)), own[:, apart:]],
                format="csc",
            )
        )
        for name, own in condensed.sources.items()
    }
    drivers = Drivers(len(scene.loads), columns.motions, condensed.pairings)
    return balance_of_constraints(CondensedForces(scene, drivers, sources, measured, springs))


def _entries(
    rows: IntArray, columns: IntArray, values: FloatArray, shape: tuple[int, int]
) -> sparse.csr_array:
    return sparse.csr_array((values, (rows, columns)), shape=shape)
