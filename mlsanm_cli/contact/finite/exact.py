"""Exact contact at finite strain, p >= 0, h >= 0, p h = 0, by Newton's method on body and contact together.

Every iteration factorises the body's derivative, with what turns the tractions, condenses it on the
pressures, and solves the linear complementarity problem there by an active set: du = z + Z dp,
h = h_0 + n . du.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.finite.rigid import RigidContact
from mlsanm_cli.contact.response.coercivity import relative_resistance
from mlsanm_cli.mechanics.finite.body import BodySeries
from mlsanm_cli.mechanics.finite.projector import Projector
from mlsanm_cli.mechanics.finite.tangent import load_columns

PASSES = 60
"""Passes of the active set within an iteration."""
LEAST = 0.05
"""Updates are shortened until det F stays above this everywhere."""


@dataclass(frozen=True)
class Pressed:
    """A state in contact: ``displacement`` (2N,); over the nodes of all contacts nominal ``pressure`` (c,),
    ``gap`` (c,), ``normal`` (c, 2); ``residual`` is the last update over the typical displacement,
    ``stability`` the least resistance of a contact to pressures that change from node to node."""

    displacement: FloatArray
    pressure: FloatArray
    gap: FloatArray
    normal: FloatArray
    residual: float
    iterations: int
    solves: int
    stability: float = np.inf


@dataclass(frozen=True)
class Pressing:
    """Contacts of the body of a ``projector``, whose last 2c loads are unit tractions, x and y of every node
    in turn. ``length`` is the typical displacement; ``stiffness`` turns gaps into pressures, to guess what
    touches."""

    projector: Projector
    contacts: Sequence[RigidContact]
    length: float
    stiffness: float

    @property
    def count(self) -> int:
        """Nodes of all contacts (c)."""
        return sum(one.count for one in self.contacts)

    def geometry(
        self, displacement: FloatArray, factors: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Gaps (c,), normals (c, 2) and what turns them (c,)."""
        found = [one.gaps(displacement, factors) for one in self.contacts]
        bent = [one.bending(displacement, factors) for one in self.contacts]
        return (
            np.concatenate([gap for gap, _ in found]),
            np.concatenate([normal for _, normal in found]),
            np.concatenate(bent),
        )

    def solved(
        self,
        displacement: FloatArray,
        pressure: FloatArray,
        factors: FloatArray,
        tolerance: float,
        most: int,
    ) -> Pressed | None:
        """The state at load ``factors`` (L,), searched from ``displacement`` (2N,) and ``pressure`` (c,);
        None where ``most`` iterations do not settle. Raises LinAlgError or NumericalError for singular
        derivatives."""
        u, p, last = displacement, pressure, np.inf
        active = None
        for count in range(1, most + 1):
            du, dp, found, compliance = self._step(u, p, factors, active)
            part = 1.0
            while part > 1e-3 and not self.projector.body.least_volume(u + part * du) > LEAST:
                part *= 0.5
            u, p = u + part * du, p + part * dp
            settled = active is not None and bool((found == active).all())
            last, active = float(np.abs(du).max()) / self.length, found
            if not np.isfinite(last):
                return None
            if part == 1.0 and settled and last <= tolerance:
                gap, normal, _ = self.geometry(u, factors)
                solves = count * (self.count + 2)
                kept, stable = np.where(active, p, 0.0), self._stability(found, compliance)
                return Pressed(u, kept, gap, normal, last, count, solves, stable)
        return None

    def _step(
        self, u: FloatArray, p: FloatArray, factors: FloatArray, active: BoolArray | None
    ) -> tuple[FloatArray, FloatArray, BoolArray, FloatArray]:
        """Updates of displacement and pressure, which nodes touch, and the compliance (c, c)."""
        gap, normal, bent = self.geometry(u, factors)
        whole = np.concatenate([factors, (p[:, None] * normal).ravel()])
        series = BodySeries(self.projector.body, 0)
        series.put(0, u, whole)
        columns = load_columns(self.projector.body, u, slice(len(factors), None))
        factorised = self.projector.factorised(u, whole, columns @ self._turning(p, normal, bent))
        along = columns @ _directions(normal)
        z = -factorised.solve(self.projector.scaled(series.rows(0)))
        many = -factorised.solve_unrefined(self.projector.scaled_columns(along))
        compliance = self._seen(normal, many)
        free = gap + self._seen(normal, z[:, None])[:, 0]
        first = p > self.stiffness * gap if active is None else active
        dp, found = _complementary(compliance, free, p, np.asarray(first))
        return z + many @ dp, dp, found, compliance

    def _stability(self, closed: BoolArray, compliance: FloatArray) -> float:
        """The least resistance of a contact with closed nodes, on those between two others."""
        least, first = np.inf, 0
        material = self.projector.body.elastic.model.material
        for one in self.contacts:
            own = closed[first : first + one.count]
            inner = own[1:-1] & own[:-2] & own[2:]
            chosen = 1 + np.flatnonzero(inner) if inner.any() else np.flatnonzero(own)
            modulus = 1.0 / material.contact_compliance(one.outward[chosen])
            place = first + chosen
            part = compliance[np.ix_(place, place)]
            least = min(least, relative_resistance(one.weight[chosen], modulus, part))
            first += one.count
        return least

    def _turning(self, p: FloatArray, normal: FloatArray, bent: FloatArray) -> sparse.csr_array:
        """How the tractions (2c,) turn with the nodes: (2c, 2N)."""
        across = np.eye(2) - normal[:, :, None] * normal[:, None, :]
        values = (p * bent)[:, None, None] * across
        nodes = np.concatenate([one.nodes for one in self.contacts])
        number = np.arange(len(p))
        rows = np.repeat(2 * number[:, None] + np.arange(2), 2, axis=1)
        columns = np.tile(2 * nodes[:, None] + np.arange(2), (1, 2))
        size = self.projector.body.unknowns
        entries = (values.reshape(len(p), 4).ravel(), (rows.ravel(), columns.ravel()))
        return sparse.csr_array(entries, shape=(2 * len(p), size))

    def _seen(self, normal: FloatArray, columns: FloatArray) -> FloatArray:
        """n . u at the nodes of ``columns`` (2N, s): (c, s)."""
        nodes = np.concatenate([one.nodes for one in self.contacts])
        return np.asarray(normal[:, :1] * columns[2 * nodes] + normal[:, 1:] * columns[2 * nodes + 1])


def _directions(normal: FloatArray) -> sparse.csr_array:
    """Tractions (2c, c) of unit pressures along ``normal`` (c, 2)."""
    count = len(normal)
    entries = (normal.ravel(), (np.arange(2 * count), np.repeat(np.arange(count), 2)))
    return sparse.csr_array(entries, shape=(2 * count, count))


def _complementary(
    compliance: FloatArray, free: FloatArray, pressure: FloatArray, active: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """Updates dp (c,) with p + dp >= 0, h = ``free`` + A dp >= 0 and one of them 0, from a first guess of
    which nodes are ``active``, and which are."""
    for _ in range(PASSES):
        on, off = np.flatnonzero(active), np.flatnonzero(~active)
        dp = -pressure.copy()
        if len(on):
            known = free[on] + compliance[np.ix_(on, off)] @ dp[off]
            dp[on] = np.linalg.solve(compliance[np.ix_(on, on)], -known)
        gap = free + compliance @ dp
        better = np.where(active, pressure + dp > 0.0, gap < 0.0)
        if (better == active).all():
            break
        active = better
    return dp, active
