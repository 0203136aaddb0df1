"""Bodies, contact and friction as one quadratic system, factorised as one sparse matrix::

    u  bodies    K u - F(f, q, p, t)                 = 0
    h  gap       h - h0 - N u - A_n (p, t)           = 0
    a  friction  a (mu (p + eta) - t) - eps          = 0
    b            b (mu (p + eta) + t) - eps          = 0
    p  contact   (p + eta) h - eta delta             = 0
    t  slip      T u + A_t (p, t) + c t + a - b - r  = 0
    q  platens   forces(f, q, p, t)                  = 0

with load factors f = f(lam). K is the strong form by moving least squares, solved in the sense of least squares or
by collocation. N u and T u are the motion of the slave's nodes relative to virtual nodes of the master, which move
by its moving least-squares values; A (p, t) corrects waves too short for the clouds. Divided by their scales, the
rows for x = (u, h, a, b, p, t, q) are::

    R(x, lam) = C(lam) + M x + Q(x, x) = 0

so that order k of a power series solves (M + 2 Q(x_0, .)) x_k = -C_k - sum Q(x_j, x_{k-j}) over 0 < j < k, with the
tangent of Newton-Raphson. Equation (16) of docs/method.md.
"""

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

Rows: TypeAlias = sparse.csr_array

REFINED = 1e-11
"""Relative size of the predicted next update to which solutions are refined: normal equations lose half the
digits, which residuals of the rows themselves restore."""


@dataclass(frozen=True, eq=False)
class Quadratic:
    """Q: entry i is ``factor[i]`` x[``first[i]``] x[``second[i]``] in ``row[i]`` of ``size``."""

    size: int
    row: IntArray
    first: IntArray
    second: IntArray
    factor: FloatArray

    def __call__(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Q(x, y), or its sum (size,) over the rows of x and y (k, size)."""
        products = np.atleast_2d(x)[:, self.first] * np.atleast_2d(y)[:, self.second]
        return np.bincount(self.row, self.factor * products.sum(axis=0), self.size)

    def derivative(self, x: FloatArray) -> Rows:
        """Q(x, .) + Q(., x) as a matrix (size, size)."""
        values = np.concatenate([self.factor * x[self.second], self.factor * x[self.first]])
        places = np.tile(self.row, 2), np.concatenate([self.first, self.second])
        return sparse.csr_array((values, places), shape=(self.size, self.size))


@dataclass(frozen=True, eq=False)
class System:
    """The equations of a scene. ``places`` are the ranges of the unknowns, and of the rows written before them
    above; ``scale`` are typical values of the unknowns, ``divisor`` those of the rows. C is ``constant`` plus
    ``load`` f. The rows of M and C from ``places["h"]`` on are explicit, those of the bodies come from the
    ``bodies`` themselves. ``ordered`` is M in the ``order`` of elimination, in scaled unknowns; ``threshold``
    is that of pivoting."""

    built: CondensedScene
    law: Law
    bodies: dict[str, LinearSystem | Collocation]
    places: dict[str, slice]
    scale: FloatArray
    divisor: FloatArray
    explicit: Rows
    constant: FloatArray
    load: FloatArray
    quadratic: Quadratic
    order: IntArray
    ordered: sparse.csc_array
    threshold: float

    @classmethod
    def of(cls, built: CondensedScene) -> System:
        """The equations of a scene. Raises NumericalError if its contacts carry nothing."""
        c, scene, law = built.condensed, built.scene, Law.of(built)
        m, n, k = len(c.weight), len(c.friction_nodes), len(scene.unknown_motions)
        square = built.case.mls.scheme == "collocation"
        bodies = {name: Collocation.of(one) if square else one.system for name, one in scene.bodies.items()}
        equations = {name: one.equations(c.sources[name]) for name, one in bodies.items()}
        stiffness = sparse.block_diag([one.matrix for one in equations.values()], format="csr")
        caused = sparse.vstack([one.sources for one in equations.values()], format="csc")
        q, p, t = np.split(np.arange(k + m + n), [k, k + m])
        first = len(scene.loads)
        normal, tangential = _relative_motions(built)
        unit = {size: sparse.eye_array(size, format="csr") for size in (m, n)}
        cone = sparse.diags_array(law.mu * law.eta[c.friction_nodes])
        beyond, balance = c.beyond, c.balance
        blocks = {
            "u": {"u": stiffness, "p": -caused[:, first + p], "t": -caused[:, first + t], "q": -caused[:, first + q]},
            "h": {"u": -normal, "h": unit[m], "p": -beyond[:m, :m], "t": -beyond[:m, m:]},
            "a": {"a": cone},
            "b": {"b": cone},
            "p": {"h": sparse.diags_array(law.eta)},
            "t": {
                "u": tangential,
                "a": unit[n],
                "b": -unit[n],
                "p": beyond[m:, :m],
                "t": beyond[m:, m:] + sparse.diags_array(law.compliance),
            },
            "q": {"p": balance.pressure, "t": balance.traction, "q": balance.motion},
        }
        elastic = law.gap / LENGTH
        forces = [
            np.abs(balance.pressure) @ np.abs(end.pressure) + np.abs(balance.traction) @ np.abs(end.traction)
            for end in built.ends
        ]
        force = np.max(forces, axis=0)
        motion = np.max([np.abs(end.motion) for end in built.ends], axis=0)
        product = np.full(n, law.pressure * law.slip) * law.mu
        divisor = {
            "u": elastic * abs(stiffness).max(axis=1).toarray().ravel(),
            "h": np.full(m, law.gap),
            "a": product,
            "b": product,
            "p": np.full(m, law.pressure * law.gap),
            "t": np.full(n, law.slip),
            "q": np.where(force > 0.0, force, 1.0),
        }
        scale = {
            "u": np.full(stiffness.shape[0], elastic),
            "h": divisor["h"],
            "a": divisor["t"],
            "b": divisor["t"],
            "p": np.full(m, law.pressure),
            "t": law.mu * law.pressure,
            "q": np.where(motion > 0.0, motion, elastic),
        }
        sizes = {name: len(values) for name, values in scale.items()}
        ends = np.cumsum([0, *sizes.values()])
        places = dict(zip(sizes, map(slice, ends[:-1], ends[1:]), strict=True))
        scales, divisors = (np.concatenate(list(one.values())) for one in (scale, divisor))
        linear = sparse.vstack(
            [
                sparse.hstack([row.get(name, sparse.csr_array((sizes[own], size))) for name, size in sizes.items()])
                for own, row in blocks.items()
            ],
            format="csr",
        )
        linear = sparse.csr_array(sparse.diags_array(1.0 / divisors) @ linear)
        known = {"h": -c.gap.constant, "a": -law.eps, "b": -law.eps, "p": -law.eta * law.delta, "q": balance.constant}
        constant, load = np.zeros(len(scales)), np.zeros((len(scales), first))
        for name, values in known.items():
            constant[places[name]] = values
        load[places["q"]] = balance.load
        order = _elimination_order(built, {name: one.matrix for name, one in equations.items()}, len(scales))
        return cls(
            built=built,
            law=law,
            bodies=bodies,
            places=places,
            scale=scales,
            divisor=divisors,
            explicit=linear[places["h"].start :],
            constant=constant / divisors,
            load=load / divisors[:, None],
            quadratic=_hyperbolas(places, law, c.friction_nodes, divisors),
            order=order,
            ordered=sparse.csc_array((linear @ sparse.diags_array(scales))[order][:, order]),
            threshold=0.0 if all(one.definite for one in equations.values()) else THRESHOLD,
        )

    def split(self, x: FloatArray, names: str = "phqt") -> list[FloatArray]:
        """Unknowns of these names among x (..., size)."""
        return [x[..., self.places[name]] for name in names]

    def drawn(self) -> FloatArray:
        """Unknowns (size,) near the unloaded state: gaps as drawn, closed ones opened slightly, with their
        pressures; no displacement and no traction."""
        law, x = self.law, np.zeros(len(self.scale))
        gap = np.maximum(self.built.condensed.gap.constant, LENGTH * law.gap)
        x[self.places["h"]], x[self.places["p"]] = gap, law.eta * (law.delta / gap - 1.0)
        return self.with_plastic_slips(x)

    def with_plastic_slips(self, x: FloatArray) -> FloatArray:
        """The unknowns with the plastic slips that belong to the pressures and tractions of x (size,)."""
        x, law, nodes = x.copy(), self.law, self.built.condensed.friction_nodes
        p, t = self.split(x, "pt")
        cone = law.mu * (p + law.eta)[nodes]
        x[self.places["a"]], x[self.places["b"]] = law.eps / (cone - t), law.eps / (cone + t)
        return x

    def linear(self, f: FloatArray, x: FloatArray) -> FloatArray:
        """C(lam) + M x (size,) for load factors f (L,), without ``constant``."""
        u, p, t, q = self.split(x, "uptq")
        causes = np.concatenate([f, q, p, t])
        bodies = [
            body.residual_vector(self.built.condensed.sources[name] @ causes, u[self.built.scene.places[name]])
            for name, body in self.bodies.items()
        ]
        rest = self.explicit @ x + self.load[self.places["h"].start :] @ f
        return np.concatenate([np.concatenate(bodies) / self.divisor[self.places["u"]], rest])


def _relative_motions(built: CondensedScene) -> list[Rows]:
    """N (m, 2N) and T (n, 2N): normal and tangential motion of slaves relative to masters."""
    pairings, bodies = built.condensed.pairings, built.scene.bodies
    normal, tangential = [], []
    for pairing in pairings:
        both = zip(*(candidate_rows(body, name, pairing) for name, body in bodies.items()), strict=True)
        gap, slip = (sparse.hstack(parts, format="csr") for parts in both)
        normal.append(gap)
        if pairing.friction:
            tangential.append(slip_fit(pairing) @ slip)
    none = sparse.csr_array((0, normal[0].shape[1]))
    return [sparse.csr_array(sparse.vstack([none, *rows], format="csr")) for rows in (normal, tangential)]


def _hyperbolas(places: dict[str, slice], law: Law, nodes: IntArray, divisor: FloatArray) -> Quadratic:
    """The products of the hyperbolas."""
    a, b, p, h, t = (np.arange(places[name].start, places[name].stop) for name in "abpht")
    one = np.ones(len(t))
    row, first, second, factor = map(
        np.concatenate,
        zip(
            (p, p, h, np.ones(len(p))),
            (a, a, p[nodes], law.mu),
            (a, a, t, -one),
            (b, b, p[nodes], law.mu),
            (b, b, t, one),
            strict=True,
        ),
    )
    return Quadratic(len(divisor), row, first, second, factor / divisor[row])


def _elimination_order(built: CondensedScene, matrices: dict[str, Rows], size: int) -> IntArray:
    """Bodies first, each by nested dissection, then the contact: its Schur complement is the condensed problem."""
    parts, first = [], 0
    for name, matrix in matrices.items():
        pattern = sparse.csc_array(abs(matrix) + abs(matrix).T)
        parts.append(first + elimination_order(pattern, built.scene.bodies[name].model.nodes))
        first += matrix.shape[0]
    return np.concatenate([*parts, np.arange(first, size)])


class Tangent:
    """Factorised derivative of the equations at x (size,). Raises numpy's LinAlgError if it is singular."""

    def __init__(self, system: System, x: FloatArray) -> None:
        self._system, self._local = system, system.quadratic.derivative(x)
        own, still = system.order, np.arange(len(system.order))
        local = (self._local @ sparse.diags_array(system.scale))[own][:, own]
        try:
            self._factor = factor_in_order(sparse.csc_array(system.ordered + local), still, system.threshold)
        except NumericalError as error:
            raise np.linalg.LinAlgError("singular tangent of the contact problem") from error

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution (size,)."""
        system, none = self._system, np.zeros(self._system.load.shape[1])

        def by_factor(rest: FloatArray) -> FloatArray:
            solution = np.empty_like(rest)
            solution[system.order] = self._factor.solve(rest[system.order])
            return (system.scale * solution)[:, None]

        def update(y: FloatArray) -> FloatArray:
            return by_factor(rhs - system.linear(none, y[:, 0]) - self._local @ y[:, 0])

        start = by_factor(rhs)
        return np.asarray(refine(start, update, Progress.of(start, REFINED))[0][:, 0])


@dataclass(frozen=True, eq=False)
class Increment:
    """The equations over a stage from load factors ``start`` to ``end`` (L,), for a stick ``reference`` (n,)."""

    system: System
    start: FloatArray
    end: FloatArray
    reference: FloatArray

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.system.scale)

    @property
    def scale(self) -> FloatArray:
        """Typical values (size,) of the unknowns."""
        return self.system.scale

    def factors(self, lam: float) -> FloatArray:
        """Load factors (L,) at the fraction ``lam`` of the stage."""
        return self.start + lam * (self.end - self.start)

    def residual(self, x: FloatArray, lam: float) -> FloatArray:
        """R(x, lam) (size,)."""
        system = self.system
        rows = system.linear(self.factors(lam), x) + system.constant + system.quadratic(x, x)
        slip = system.places["t"]
        rows[slip] -= self.reference / system.divisor[slip]
        return rows

    def tangent(self, x: FloatArray, lam: float) -> Tangent:
        """The factorised derivative by x."""
        return Tangent(self.system, x)

    def load_derivative(self, x: FloatArray, lam: float) -> FloatArray:
        """The derivative by lam (size,)."""
        return self.system.linear(self.end - self.start, np.zeros(self.size))

    def series_rhs(self, x: FloatArray, lam: FloatArray) -> FloatArray:
        """Minus the sum of Q(x_j, x_{k-j}) over 0 < j < k, from the lower orders x (k, size)."""
        return -self.system.quadratic(x[1:], x[:0:-1])

    def admissible(self, x: FloatArray, lam: float) -> bool:
        """Whether x is on the branches of the hyperbolas where gaps and plastic slips are positive."""
        h, a, b = self.system.split(x, "hab")
        p = self.system.split(x, "p")[0] + self.system.law.eta
        return bool(min(one.min(initial=np.inf) for one in (h, a, b, p)) > 0.0)

    def slip(self, x: FloatArray, lam: float) -> FloatArray:
        """Slips (n,) T u + A_t (p, t) of the surfaces, without the asperities'."""
        a, b, t = self.system.split(x, "abt")
        return np.asarray(self.reference - self.system.law.compliance * t - a + b)
