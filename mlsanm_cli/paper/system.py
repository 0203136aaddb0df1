"""The equations of this package as one quadratic system, factorised as one sparse matrix."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.response.functionals import candidate_rows
from mlsanm_cli.contact.response.short_waves import slip_fit
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.operators.linear.superlu import THRESHOLD, elimination_order, factor_in_order
from mlsanm_cli.operators.refinement import Progress, refine
from mlsanm_cli.operators.system import LinearSystem
from mlsanm_cli.paper.collocation import Collocation
from mlsanm_cli.paper.law import LENGTH, Law
from mlsanm_cli.solve.condensed_scene import CondensedScene

Matrix: TypeAlias = sparse.csr_array

REFINED = 1e-11
"""Relative size of the predicted next update to which solutions are refined: normal equations lose half the
digits, which residuals of the rows themselves restore."""


@dataclass(frozen=True, eq=False)
class System:
    """R(x, lam) over a stage from load factors ``start`` to ``end`` (L,) with stick ``reference`` (n,).

    ``places`` are the ranges of the unknowns and of their rows, ``scale`` typical values of the unknowns and
    ``divisor`` of the rows, which are divided by these. Q has the products ``factor`` x[``first``]
    x[``second``] in rows ``first``. The ``bodies`` form their residuals themselves; ``matrix`` and ``load``
    make the other rows. ``ordered`` is M in scaled unknowns and in the ``order`` of elimination, with
    ``threshold`` of pivoting.
    """

    built: CondensedScene
    law: Law
    bodies: dict[str, LinearSystem | Collocation]
    places: dict[str, slice]
    scale: FloatArray
    divisor: FloatArray
    matrix: Matrix
    constant: FloatArray
    load: FloatArray
    first: IntArray
    second: IntArray
    factor: FloatArray
    order: IntArray
    ordered: sparse.csc_array
    threshold: float
    start: FloatArray
    end: FloatArray
    reference: FloatArray

    @classmethod
    def of(cls, built: CondensedScene) -> System:
        """The equations of the first stage of a scene. Raises NumericalError if contacts carry nothing."""
        c, scene, law = built.condensed, built.scene, Law.of(built)
        m, n, k, loads = len(c.weight), len(c.friction_nodes), len(scene.unknown_motions), len(scene.loads)
        square = built.case.mls.scheme == "collocation"
        bodies = {name: Collocation.of(one) if square else one.system for name, one in scene.bodies.items()}
        equations = [one.equations(c.sources[name]) for name, one in bodies.items()]
        stiffness = sparse.csr_array(sparse.block_diag([one.matrix for one in equations]))
        caused = -sparse.vstack([one.sources for one in equations], format="csc")
        by_q, by_p, by_t = (
            caused[:, one] for one in np.split(np.arange(loads, loads + k + m + n), [k, k + m])
        )
        normal, tangential = _relative_motions(built)
        cone, one_n = sparse.diags_array(law.mu * law.eta[c.friction_nodes]), sparse.eye_array(n)
        near, along = np.split(c.beyond.toarray(), [m])
        along[:, m:] += np.diag(law.compliance)
        blocks = {
            "u": {"u": stiffness, "p": by_p, "t": by_t, "q": by_q},
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
        # Typical values of unknowns and rows.
        typical = {
            "u": (np.full(len(largest), law.elastic), law.elastic * largest),
            "h": (np.full(m, law.gap), np.full(m, law.gap)),
            "a": (np.full(n, law.slip), law.mu * law.pressure * law.elastic_slip),
            "b": (np.full(n, law.slip), law.mu * law.pressure * law.elastic_slip),
            "p": (np.full(m, law.pressure), np.full(m, law.pressure * law.gap)),
            "t": (law.mu * law.pressure, np.full(n, law.slip)),
            "q": (np.where(motion > 0.0, motion, law.elastic), np.where(force > 0.0, force, 1.0)),
        }
        scale, divisor = map(np.concatenate, zip(*typical.values(), strict=True))
        ends = np.cumsum([0, *(len(values) for values, _ in typical.values())]).tolist()
        places = dict(zip(typical, map(slice, ends[:-1], ends[1:]), strict=True))
        linear = sparse.block_array([[row.get(name) for name in blocks] for row in blocks.values()])
        linear = sparse.csr_array(sparse.diags_array(1.0 / divisor) @ linear)
        known = {"h": -c.gap.constant, "a": -law.eps, "b": -law.eps, "p": -law.eta * law.delta}
        known |= {"u": np.zeros(len(largest)), "t": np.zeros(n), "q": c.balance.constant}
        load = np.zeros((len(scale), loads))
        load[places["q"]] = c.balance.load
        a, b, p, h, t = (np.arange(places[name].start, places[name].stop) for name in "abpht")
        first, pressed = np.concatenate([p, a, a, b, b]), p[c.friction_nodes]
        factor = np.concatenate([np.ones(m), law.mu, -np.ones(n), law.mu, np.ones(n)])
        points = np.concatenate([body.model.nodes for body in scene.bodies.values()])
        # Bodies first, by nested dissection: the Schur complement of the contact is the condensed problem.
        order = elimination_order(sparse.csc_array(abs(stiffness) + abs(stiffness).T), points)
        order = np.concatenate([order, np.arange(len(order), len(scale))])
        return cls(
            built=built,
            law=law,
            bodies=bodies,
            places=places,
            scale=scale,
            divisor=divisor,
            matrix=linear[places["h"].start :],
            constant=np.concatenate([known[name] for name in places]) / divisor,
            load=(load / divisor[:, None])[places["h"].start :],
            first=first,
            second=np.concatenate([h, pressed, t, pressed, t]),
            factor=factor / divisor[first],
            order=order,
            ordered=sparse.csc_array((linear @ sparse.diags_array(scale))[order][:, order]),
            threshold=0.0 if all(one.definite for one in equations) else THRESHOLD,
            start=built.stages[0],
            end=built.stages[1],
            reference=np.zeros(n),
        )

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.scale)

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
        return self.start + lam * (self.end - self.start)

    def linear(self, f: FloatArray, x: FloatArray) -> FloatArray:
        """M x and the part of C that is due to load factors f (L,)."""
        u, *unknowns = self.split(x, "uqpt")
        causes, own = np.concatenate([f, *unknowns]), self.built.scene.places
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
    """M + ``local`` factorised. Raises numpy's LinAlgError if it is singular."""

    def __init__(self, system: System, local: Matrix) -> None:
        self._system, self._local = system, local
        ordered = (local @ sparse.diags_array(system.scale))[system.order][:, system.order]
        whole = sparse.csc_array(system.ordered + ordered)
        try:
            self._factor = factor_in_order(whole, np.arange(system.size), system.threshold)
        except NumericalError as error:
            raise np.linalg.LinAlgError("singular tangent of the contact problem") from error

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution (size,)."""
        system, unloaded = self._system, np.zeros(len(self._system.start))

        def by_factor(rest: FloatArray) -> FloatArray:
            solution = np.empty_like(rest)
            solution[system.order] = self._factor.solve(rest[system.order])
            return (system.scale * solution)[:, None]

        def update(y: FloatArray) -> FloatArray:
            return by_factor(rhs - system.linear(unloaded, y[:, 0]) - self._local @ y[:, 0])

        start = by_factor(rhs)
        return np.asarray(refine(start, update, Progress.of(start, REFINED))[0][:, 0])


def _relative_motions(built: CondensedScene) -> list[Matrix]:
    """N (m, 2N) and T (n, 2N): normal and tangential motions of slaves relative to masters."""
    bodies = built.scene.bodies
    normal, tangential = [], [sparse.csr_array((0, sum(body.model.unknowns for body in bodies.values())))]
    for pairing in built.condensed.pairings:
        both = zip(*(candidate_rows(body, name, pairing) for name, body in bodies.items()), strict=True)
        gap, slip = (sparse.csr_array(sparse.hstack(parts)) for parts in both)
        normal.append(gap)
        tangential += [sparse.csr_array(slip_fit(pairing) @ slip)] if pairing.friction else []
    return [sparse.csr_array(sparse.vstack(rows)) for rows in (normal, tangential)]
