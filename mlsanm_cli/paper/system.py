"""The equations of this package as one quadratic system, factorised as one sparse matrix."""

from __future__ import annotations

from copy import copy
from typing import cast

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.response.nodal import NodalBasis, slip_fit
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.assembly import node_rows
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.supports import FREE, NO_SPRING
from mlsanm_cli.operators.factors import THRESHOLD, elimination_order, factor_in_order
from mlsanm_cli.operators.least_squares import LeastSquares
from mlsanm_cli.operators.system import FULL_TOLERANCE, MAX_UPDATES, Progress
from mlsanm_cli.solve.condensed_scene import CondensedScene

LENGTH = 0.1
"""Reference gap over the elastic change of the gaps."""
LEAST_SHARE = 0.01
"""Least reference value of a contact over the largest one of the scene."""


class Law:
    """Tensions ``eta`` and lengths ``delta`` (m,); friction coefficients ``mu``, ``compliance`` c, its
    ``elastic_slip`` c mu p at the largest pressure, and products ``eps`` (n,). ``pressure``, ``gap``,
    ``elastic`` (of displacements) and ``slip`` are scales."""

    def __init__(self, built: CondensedScene) -> None:
        """The law of a case, relative to the exact states at the ends of its stages. Raises
        NumericalError."""
        c, law = built.condensed, {contact.name: contact.regularization for contact in built.case.touching}
        nodes, pressures = c.friction_nodes, [state.pressure for state in built.ends]
        largest = np.max(pressures, axis=0)
        pressure = float(largest.max(initial=0.0))
        if pressure <= 0.0:
            raise NumericalError(
                "no contact carries any pressure at the end of a stage, so the hyperbolic law has no scale",
                'check the direction of the loads, or use contact.regularization.law = "exact"',
            )
        elastic = max(c.elastic_gap(one) for one in pressures)
        eta, apart, reference = np.empty((3, len(largest)))
        for pairing in c.pairings:
            own, drawn = c.spans[pairing.name], pairing.gap[pairing.candidate]
            eta[own], apart[own] = law[pairing.name].eta, drawn - drawn.min()
            reference[own] = max(largest[own].max(), LEAST_SHARE * pressure)
        cone = c.friction * reference[nodes]
        slips = np.max([np.abs(c.slip.traction @ (c.friction * one[nodes])) for one in pressures], axis=0)
        slip, elastic_slip = float(slips.max(initial=0.0)), np.empty(len(nodes))
        for name, own in c.tangential.items():
            elastic_slip[own] = law[name].stick * max(slips[own].max(), LEAST_SHARE * slip)
        # Far from contact the law pulls with eta: the farther, the less, with the same product.
        self.eta = eta * reference / np.maximum(apart / elastic, 1.0)
        self.delta = np.maximum(apart, LENGTH * elastic)
        self.mu, self.compliance, self.elastic_slip = c.friction, elastic_slip / cone, elastic_slip
        self.eps = eta[nodes] * elastic_slip * cone
        self.pressure, self.gap, self.elastic, self.slip = pressure, LENGTH * elastic, elastic, slip


SINGLE, HELD, TRACTION, EQUILIBRIUM = range(4)


class Collocation:
    """Equations ``matrix`` (2N, 2N) u = ``choice`` (2N, r) times the right-hand sides of a body's rows."""

    def __init__(self, body: ElasticBody) -> None:
        """For every unknown the row with the highest rank at its node: a displacement, else a traction, else
        equilibrium. At free corners both tractions are added: separately they would impose the shear stress
        twice. Scales: displacement 1, traction h/E, equilibrium h^2/E."""
        rows, h, modulus = node_rows(body), body.model.cloud.spacing, body.model.material.modulus
        nodes, inside = np.arange(len(h)), np.full(len(h), EQUILIBRIUM)
        parts = [(2 * nodes + axis, inside, h**2 / modulus) for axis in (0, 1)]
        for name, surface in body.model.cloud.surfaces.items():
            for axis in (0, 1):
                index, held = surface.index, body.held.get(name, FREE)[axis]
                stiffness = modulus + body.springs.get(name, NO_SPRING)[axis] * h[index]
                scale = np.ones(len(index)) if held else h[index] / stiffness
                parts.append((2 * index + axis, np.full(len(index), HELD if held else TRACTION), scale))
        single = np.array([2 * node + axis for node, axis in body.held_nodes], dtype=np.int64)
        parts.append((single, np.full(len(single), SINGLE), np.ones(len(single))))
        unknown, rank, scale = (np.concatenate(column) for column in zip(*parts, strict=True))
        highest = np.full(2 * len(h), EQUILIBRIUM)
        np.minimum.at(highest, unknown, rank)
        row = np.flatnonzero(rank == highest[unknown])
        self.choice = sparse.csr_array((scale[row], (unknown[row], row)), shape=(2 * len(h), body.rows))
        self.matrix = sparse.csr_array(self.choice[:, : rows.shape[0]] @ rows)

    def equations(self, sources: sparse.csc_array) -> tuple[sparse.csr_array, sparse.csr_array]:
        """The equations for right-hand sides ``sources`` (r, c) of the rows."""
        return self.matrix, sparse.csr_array(self.choice @ sources)

    def residual_vector(self, source: FloatArray, solution: FloatArray) -> FloatArray:
        """Left-hand side minus right-hand side (2N,)."""
        return np.asarray(self.matrix @ solution - self.choice @ source)


class System:
    """R(x, lam) over a stage between load factors (L,), a problem for the continuation: ``places`` are the
    ranges of the ``size`` unknowns and of their rows, ``scale`` typical values of the unknowns and
    ``divisor`` of the rows, which are divided by these. Q has the products ``factor`` x[``first``]
    x[``second``] in rows ``first``. The ``bodies`` form their residuals themselves; ``matrix`` and ``load``
    make the other rows. ``ordered`` is M in scaled unknowns and in the ``order`` of elimination, with
    ``threshold`` of pivoting."""

    def __init__(self, built: CondensedScene) -> None:
        """The equations of a scene in its first stage. Raises NumericalError if contacts carry nothing."""
        c, scene, law = built.condensed, built.scene, Law(built)
        m, n, k, loads = len(c.weight), len(c.friction_nodes), len(scene.unknown_motions), len(scene.loads)
        square = built.case.mls.scheme == "collocation"
        self.built, self.law = built, law
        # All bodies are held: others need the exact law.
        self.bodies = {
            name: Collocation(body) if square else cast(LeastSquares, body.system)
            for name, body in scene.bodies.items()
        }
        equations = [
            body.equations(sparse.csc_array(c.sources[name] @ c.drivers.matrix))
            for name, body in self.bodies.items()
        ]
        stiffness = sparse.csr_array(sparse.block_diag([matrix for matrix, _ in equations]))
        caused = -sparse.vstack([sources for _, sources in equations], format="csc")[:, loads:]
        normal, tangential = _relative_motions(built)
        cone, one_n = sparse.diags_array(law.mu * law.eta[c.friction_nodes]), sparse.eye_array(n)
        near, along = np.split(c.beyond.toarray(), [m])
        along[:, m:] += np.diag(law.compliance)
        blocks = {
            "u": {"u": stiffness, "q": caused[:, :k], "p": caused[:, k : k + m], "t": caused[:, k + m :]},
            "h": {"u": -normal, "h": sparse.eye_array(m), "p": -near[:, :m], "t": -near[:, m:]},
            "a": {"a": cone},
            "b": {"b": cone},
            "p": {"h": sparse.diags_array(law.eta)},
            "t": {"u": tangential, "a": one_n, "b": -one_n, "p": along[:, :m], "t": along[:, m:]},
            "q": {"p": c.balance.pressure, "t": c.balance.traction, "q": c.balance.motion},
        }
        largest = np.asarray(abs(stiffness).max(axis=1).toarray()).ravel()
        force = np.abs(c.balance.pressure) @ np.full(m, law.pressure)
        motion = np.max([np.abs(end.motion) for end in built.ends], axis=0)
        force, motion = np.where(force > 0.0, force, 1.0), np.where(motion > 0.0, motion, law.elastic)
        slip_work = law.mu * law.pressure * law.elastic_slip
        # Typical values of unknowns and rows, and the constant part of the rows.
        typical = {
            "u": (np.full(len(largest), law.elastic), law.elastic * largest, 0.0 * largest),
            "h": (np.full(m, law.gap), np.full(m, law.gap), -c.gap.constant),
            "a": (np.full(n, law.slip), slip_work, -law.eps),
            "b": (np.full(n, law.slip), slip_work, -law.eps),
            "p": (np.full(m, law.pressure), np.full(m, law.pressure * law.gap), -law.eta * law.delta),
            "t": (law.mu * law.pressure, np.full(n, law.slip), np.zeros(n)),
            "q": (motion, force, c.balance.constant),
        }
        self.scale: FloatArray
        self.divisor: FloatArray
        self.scale, self.divisor, constant = map(np.concatenate, zip(*typical.values(), strict=True))
        self.size, self.constant = len(self.scale), constant / self.divisor
        ends = np.cumsum([0, *(len(values[0]) for values in typical.values())]).tolist()
        self.places = dict(zip(typical, map(slice, ends[:-1], ends[1:]), strict=True))
        linear = sparse.block_array([[row.get(name) for name in blocks] for row in blocks.values()])
        linear = sparse.csr_array(sparse.diags_array(1.0 / self.divisor) @ linear)
        self.matrix = linear[self.places["h"].start :]
        load = np.zeros((self.size, loads))
        load[self.places["q"]] = c.balance.load
        self.load: FloatArray = (load / self.divisor[:, None])[self.places["h"].start :]
        a, b, p, h, t = (np.arange(self.places[name].start, self.places[name].stop) for name in "abpht")
        pressed = p[c.friction_nodes]
        self.first, self.second = np.concatenate([p, a, a, b, b]), np.concatenate([h, pressed, t, pressed, t])
        factor = np.concatenate([np.ones(m), law.mu, -np.ones(n), law.mu, np.ones(n)])
        self.factor: FloatArray = factor / self.divisor[self.first]
        # Bodies first, by nested dissection: the Schur complement of the contact is the condensed problem.
        points = np.concatenate([body.model.cloud.points for body in scene.bodies.values()])
        order = elimination_order(sparse.csc_array(abs(stiffness) + abs(stiffness).T), points)
        self.order = np.concatenate([order, np.arange(len(order), self.size)])
        ordered = (linear @ sparse.diags_array(self.scale))[self.order][:, self.order]
        self.ordered = sparse.csc_array(ordered)
        self.threshold = THRESHOLD if square else 0.0
        self.reference: FloatArray = np.zeros(n)
        self.start, self.end = built.stages[:2]

    def changed(self, **values: FloatArray) -> System:
        """The equations with another ``start``, ``end`` (L,) or ``reference`` (n,)."""
        other = copy(self)
        vars(other).update(values)
        return other

    def split(self, x: FloatArray, names: str) -> list[FloatArray]:
        """The unknowns of these names among x (..., size)."""
        return [x[..., self.places[name]] for name in names]

    def drawn(self) -> FloatArray:
        """Unknowns (size,) near the unloaded state: gaps as drawn, closed ones opened slightly, with their
        pressures; no displacements, no tractions."""
        law, x = self.law, np.zeros(self.size)
        gap = np.maximum(self.built.condensed.gap.constant, LENGTH * law.gap)
        x[self.places["h"]], x[self.places["p"]] = gap, law.eta * (law.delta / gap - 1.0)
        return self.with_plastic_slips(x)

    def with_plastic_slips(self, x: FloatArray) -> FloatArray:
        """The unknowns x (size,) with the plastic slips of their pressures and tractions."""
        x, law, (p, t) = x.copy(), self.law, self.split(x, "pt")
        cone = law.mu * (p + law.eta)[self.built.condensed.friction_nodes]
        x[self.places["a"]], x[self.places["b"]] = law.eps / (cone - t), law.eps / (cone + t)
        return x

    def factors(self, lam: float) -> FloatArray:
        """Load factors (L,) at the fraction ``lam`` of the stage."""
        return np.asarray(self.start + lam * (self.end - self.start))

    def linear(self, f: FloatArray, x: FloatArray) -> FloatArray:
        """M x and the part of C that is due to load factors f (L,)."""
        u, *unknowns = self.split(x, "uqpt")
        causes, own = self.built.condensed.drive((f, *unknowns)), self.built.scene.places
        bodies = [
            body.residual_vector(self.built.condensed.sources[name] @ causes, u[own[name]])
            for name, body in self.bodies.items()
        ]
        excess = np.concatenate(bodies) / self.divisor[self.places["u"]]
        return np.concatenate([excess, self.matrix @ x + self.load @ f])

    def quadratic(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Q(x, y) (size,), summed over pairs of x and y (k, size)."""
        products = (x[:, self.first] * y[:, self.second]).sum(axis=0)
        return np.bincount(self.first, self.factor * products, self.size).astype(np.float64)

    def residual(self, x: FloatArray, lam: float) -> FloatArray:
        """R(x, lam) (size,)."""
        rows = self.constant + self.linear(self.factors(lam), x) + self.quadratic(x[None], x[None])
        rows[self.places["t"]] -= self.reference / self.law.slip
        return rows

    def load_derivative(self, x: FloatArray, lam: float) -> FloatArray:
        """dR/dlam (size,)."""
        return self.linear(self.end - self.start, np.zeros(self.size))

    def series_rhs(self, x: FloatArray, lam: FloatArray) -> FloatArray:
        """Minus the sum of Q(x_j, x_{k-j}) over 0 < j < k, from the lower orders x (k, size)."""
        return -self.quadratic(x[1:], x[:0:-1])

    def admissible(self, x: FloatArray, lam: float) -> bool:
        """Whether x is on the branches of the hyperbolas where gaps and plastic slips are positive."""
        h, a, b, p = self.split(x, "habp")
        return all((one > 0.0).all() for one in (h, a, b, p + self.law.eta))

    def tangent(self, x: FloatArray, lam: float) -> Tangent:
        """The factorised derivative dR/dx."""
        values = np.concatenate([self.factor * x[self.second], self.factor * x[self.first]])
        places = np.tile(self.first, 2), np.concatenate([self.first, self.second])
        return Tangent(self, sparse.csr_array((values, places), shape=(self.size, self.size)))


class Tangent:
    """M + ``local`` factorised. Raises NumericalError if it is singular."""

    def __init__(self, system: System, local: sparse.csr_array) -> None:
        self._system, self._local = system, local
        ordered = (local @ sparse.diags_array(system.scale))[system.order][:, system.order]
        whole = sparse.csc_array(system.ordered + ordered)
        self._factor = factor_in_order(whole, np.arange(system.size), system.threshold)

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution (size,). Normal equations lose half the digits, which residuals of the rows restore."""
        system, unloaded = self._system, np.zeros(len(self._system.start))

        def by_factor(rest: FloatArray) -> FloatArray:
            solution = np.empty_like(rest)
            solution[system.order] = self._factor.solve(rest[system.order])
            return (system.scale * solution)[:, None]

        found = by_factor(rhs)
        progress = Progress(found, FULL_TOLERANCE)
        for _ in range(MAX_UPDATES):
            step = by_factor(rhs - system.linear(unloaded, found[:, 0]) - self._local @ found[:, 0])
            found = found + step
            progress.advance(step, found)
            if progress.done.all():
                break
        return np.asarray(found[:, 0])


def _relative_motions(built: CondensedScene) -> list[sparse.csr_array]:
    """N (m, 2N) and T (n, 2N): normal and tangential motions of slaves relative to masters."""
    bodies = built.scene.bodies
    normal, tangential = [], [sparse.csr_array((0, sum(body.model.unknowns for body in bodies.values())))]
    for pairing in built.condensed.pairings:
        rows = NodalBasis(pairing).both_rows
        both = zip(*(rows(body, name) for name, body in bodies.items()), strict=True)
        gap, slip = (sparse.csr_array(sparse.hstack(parts)) for parts in both)
        normal.append(gap)
        tangential += [sparse.csr_array(slip_fit(pairing) @ slip)] if pairing.friction else []
    return [sparse.csr_array(sparse.vstack(rows)) for rows in (normal, tangential)]
