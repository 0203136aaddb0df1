"""Bodies and contacts linearised in a state, condensed to the contacts, and their softest motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.complementarity.problem import OPEN, SLIP, STICK
from mlsanm_cli.contact.finite.side_response import SideResponse
from mlsanm_cli.contact.finite.update import ContactSystem, Responses
from mlsanm_cli.mechanics.finite.stability import SoftMotion, Stressed, rows_of_force, softest_motion
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class Balance:
    """Forces (d,) missing on unknown motions, ``missing``, and their derivatives by displacements (d, 2N) and
    by touched tractions and motions (d, t + d). Floating bodies, by name, add the imbalance of their pieces
    by ``sums`` (k, 3p) to their motions numbered (k,)."""

    missing: FloatArray
    by_displacement: FloatArray
    by_acting: FloatArray
    sums: Mapping[str, tuple[IntArray, sparse.csr_array]]


@dataclass(frozen=True)
class Linearised:
    """A state of a ``system`` at load ``factors`` (L + d,), linearised: gaps, slips and the ``balance``
    change by ``matrix`` (2k + d, 2k + d) times the changes of pressures and friction at the ``chosen`` knots
    (k,) and of motions (d,).

    Pressures ``push`` and friction ``pull`` (t, k) on the touched tractions, which displace all sides by
    ``seen`` (2s, t) and turn with these by ``turning`` (t, 2s); ``inverse`` (t, t) of 1 - ``turning seen``
    sums that up, so that all unknowns change them by ``loads`` (t, 2k + d). Gaps and slips follow the sides
    by ``d_gap`` and ``d_slip`` (k, 2s)."""

    system: ContactSystem
    factors: FloatArray
    response: SideResponse
    responses: Responses
    balance: Balance
    chosen: IntArray
    matrix: FloatArray
    loads: FloatArray
    push: FloatArray
    pull: FloatArray
    seen: FloatArray
    turning: sparse.csr_array
    inverse: FloatArray
    d_gap: sparse.csr_array
    d_slip: sparse.csr_array

    def followed(self, z: FloatArray, jump: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """What displacements ``z`` (2N,) of the clouds and a ``jump`` (2s,) of all tractions change: the
        touched tractions (t,); and gaps, slips and the balance (2k + d,)."""
        surface = self.response.changed(z)
        if jump is not None:
            surface = surface + self.response.by_traction @ jump
        turned = self.inverse @ (self.turning @ surface)
        surface = surface + self.seen @ turned
        balance = self.balance.by_displacement @ z + self.balance.by_acting[:, : len(turned)] @ turned
        return turned, np.concatenate([self.d_gap @ surface, self.d_slip @ surface, balance])

    def moved(self, turned: FloatArray, change: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Changes of the touched tractions (t,), with those ``turned`` (t,), and of the displacements (2N,)
        by them, for a ``change`` (2k + d,) of the unknowns."""
        tractions = turned + self.loads @ change
        acting = np.append(tractions, change[2 * len(self.chosen) :])
        found = np.zeros(self.system.unknowns)
        for name, columns in self.responses.columns.items():
            found[self.system.bodies[name]] = self.responses.moved[name] @ acting[columns]
        return tractions, found

    def held(
        self, pressure: FloatArray, shear: FloatArray, status: NDArray[np.int8]
    ) -> Callable[[FloatArray, FloatArray], FloatArray]:
        """With the ``pressure``, ``shear`` and ``status`` of all knots (c,): the displacements (2N,) that
        follow those (2N,) of the clouds, and forces missing (d,) on motions. Gaps of closed knots, and slips
        of sticking ones, do not change; friction of slipping ones changes with the pressure."""
        count, chosen = len(self.chosen), self.chosen
        p, q, status = pressure[chosen], shear[chosen], status[chosen]
        closed = (status != OPEN) & (p > self.system.nothing)
        stuck = closed & (status == STICK) & (self.system.contacts.friction[chosen] > 0.0)
        kept = np.concatenate([closed, stuck, np.ones(len(self.matrix) - 2 * count, dtype=bool)])
        whole = np.where(kept[:, None], self.matrix, np.eye(len(kept)))
        slips = np.flatnonzero(closed & (status == SLIP))
        whole[count + slips, slips] -= q[slips] / p[slips]
        inverse = np.linalg.inv(whole)

        def displaced(z: FloatArray, missing: FloatArray) -> FloatArray:
            turned, left = self.followed(z)
            left[2 * count :] += missing
            return z + self.moved(turned, -inverse @ np.where(kept, left, 0.0))[1]

        return displaced

    def softest(
        self, u: FloatArray, pressure: FloatArray, shear: FloatArray, status: NDArray[np.int8]
    ) -> SoftMotion:
        """The softest motion, with displacements ``u`` (2N,) and the contacts as for :meth:`held`."""
        system = self.system
        follow = self.held(pressure, shear, status)
        bodies = {name: one.body for name, one in system.projectors.items()}
        stressed = [Stressed(body, u[system.bodies[name]], self.factors) for name, body in bodies.items()]

        def displaced(force: FloatArray) -> FloatArray:
            z, missing = np.zeros(len(force)), np.zeros(len(self.balance.missing))
            for name, body in bodies.items():
                here = system.bodies[name]
                rows = rows_of_force(body, force[here])
                scaled = system.projectors[name].scaled(rows)
                z[here] = -self.responses.factorised[name].solve_unrefined(scaled)
                if name in self.balance.sums:
                    numbers, sums = self.balance.sums[name]
                    missing[numbers] += sums @ rows[body.node_rows :]
            return follow(z, missing)

        return softest_motion(displaced, stressed)
