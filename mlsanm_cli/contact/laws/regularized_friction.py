"""Regularised contact with Coulomb friction and history, smooth between changes of status.

The hyperbola (p + eta) h = eta delta replaces the normal contact law. Friction acts where p exceeds a small
threshold p_0. A sticking node is held at its stick reference by an asperity of compliance c, s + c t = s0; a
slipping one carries t = d mu (p - p_0) with the slip sign d = +-1; an open one nothing. Tractions thus stay
in Coulomb's cone for any history, and do not jump where nodes open or close. The sets change where p_0 or a
friction limit is reached, or where a slipping node comes to rest; between these events the equations are
smooth, and linear but for the hyperbola. Unknowns x = (p, h, q, t)::

    r1 = (p + eta) h - eta delta
    r2 = h - gap(f, q, p, t)
    r3 = balance(f, q, p, t)
    r4 = s(f, q, p, t) + c t - s0  |  t - d mu (p - p_0)  |  t

Without friction t and r4 are empty and the hyperbola remains (Elhage-Hussein, Potier-Ferry and Damil, Int. J.
Solids Structures 37, 2000, 6981): the gap under a pressure p is about eta delta / p, the spurious tension of
an open node is below eta, and the branch h < 0 is meaningless.

Equation (15) of docs/method.md.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.laws.contact_status import ContactSolution, ContactStatus, SetSystem
from mlsanm_cli.contact.laws.coupling import Coupling, DenseCoupling, RegularizedContact
from mlsanm_cli.contact.laws.friction_tangents import CoupledFrictionTangent, FrictionTangent
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.dense import SingularSystemError

MAX_RATE = 1e8
"""Rates above this times the reference pressure or slip per stage indicate a singular system."""


TANGENT_TOLERANCE = 1e-7
"""Tangents are shared by points whose unknowns differ by less than this fraction of their scale."""


@dataclass
class FactorisationCount:
    """Number of tangents factorised since the last query."""

    count: int = 0

    def reset(self) -> int:
        """Return the count and reset it."""
        count, self.count = self.count, 0
        return count


class RegularizedFriction(RegularizedContact):
    """The problem over one stage with given ``sets``, for the continuation driver. The slips of the
    ``coupling`` include the asperities' compliance; ``stick_reference`` (n,) are the values of s + c t at
    which nodes stick. ``tally`` counts the tangents of a whole path."""

    def __init__(
        self,
        coupling: Coupling,
        start: FloatArray,
        end: FloatArray,
        sets: ContactStatus,
        stick_reference: FloatArray,
        tally: FactorisationCount | None = None,
    ) -> None:
        super().__init__(coupling, start, end)
        self.sets, self.stick_reference, self.tally = sets, stick_reference, tally or FactorisationCount()
        self.size = 2 * self.m + self.k + self.n
        self.stuck = np.flatnonzero(sets.stuck)
        self.friction_slope = sets.slip_sign * self.condensed.friction
        self._moved = coupling.load @ self.change
        slip_change = np.where(sets.stuck, self._moved[self.m : self.m + self.n], 0.0)
        self._load_derivative = np.concatenate(
            [np.zeros(self.m), -self._moved[: self.m], self._moved[self.m + self.n :], slip_change]
        )
        self._ready: tuple[FloatArray, FrictionTangent | CoupledFrictionTangent] | None = None

    @classmethod
    def frictionless(cls, coupling: Coupling, start: FloatArray, end: FloatArray) -> RegularizedFriction:
        """The problem without friction, whose sets never change."""
        nowhere = np.zeros(len(coupling.condensed.weight), dtype=bool)
        return cls(
            coupling, start, end, ContactStatus(nowhere, np.zeros(0, dtype=bool), np.zeros(0)), np.zeros(0)
        )

    def changed(self, **changes: Any) -> RegularizedFriction:
        """The same problem with some arguments changed."""
        names = ("coupling", "start", "end", "sets", "stick_reference", "tally")
        return RegularizedFriction(**({name: getattr(self, name) for name in names} | changes))

    def over(self, start: FloatArray, end: FloatArray) -> RegularizedFriction:
        """The same problem between other load factors (L,)."""
        return self.changed(start=start, end=end)

    @cached_property
    def reduced(self) -> FloatArray:
        """Rows of gaps, sticking nodes' slips and balances over pressures, sticking tractions and motions.
        Tractions of slipping nodes are eliminated by their pressures. Dense couplings only."""
        assert isinstance(self.coupling, DenseCoupling)
        m, n = self.m, self.n
        # LAPACK is column-major: columns are rows of the transposed matrices.
        columns = self.coupling.matrix.T
        kept = np.concatenate([np.arange(m), m + self.stuck, np.arange(m + n, len(columns))])
        reduced = columns.take(kept, axis=0).take(kept, axis=1)
        friction_nodes = np.flatnonzero(self.friction_slope)
        dragged = columns.take(m + friction_nodes, axis=0).take(kept, axis=1)
        reduced[self.condensed.friction_nodes[friction_nodes]] += (
            dragged * self.friction_slope[friction_nodes, None]
        )
        return reduced.T

    def pressed(self, p: FloatArray) -> FloatArray:
        """Pressures (n,) that friction is proportional to: those above the law's threshold."""
        return p[self.condensed.friction_nodes] - self.law.threshold

    def residual(self, x: FloatArray, lam: float) -> FloatArray:
        """Dimensionless residual (2m + k + n,)."""
        p, h, q, t = self.split(x)
        m, n, law = self.m, self.n, self.law
        linear = self.coupling(self.factors(lam), np.concatenate([p, t, q]))
        hyperbola = ((p + law.eta) * h - law.eta * law.delta) / (law.pressure * law.gap)
        friction_rows = (t - self.friction_slope * self.pressed(p)) / self.limit
        friction_rows[self.stuck] = linear[m + self.stuck] - self.stick_reference[self.stuck] / law.slip
        return np.concatenate([hyperbola, h / law.gap - linear[:m], linear[m + n :], friction_rows])

    def tangent(self, x: FloatArray, lam: float) -> FrictionTangent | CoupledFrictionTangent:
        """Factorised derivative by x; raises numpy's LinAlgError if singular. Points that differ by no more
        than a correction at an event share their tangent; the residuals of the series show the error of that.
        Without friction there are no events."""
        if (
            not self.n
            or self._ready is None
            or not np.abs((x - self._ready[0]) / self.scale).max() <= TANGENT_TOLERANCE
        ):
            self._ready = (x.copy(), self._factorised(x))
        return self._ready[1]

    def _factorised(self, x: FloatArray) -> FrictionTangent | CoupledFrictionTangent:
        self.tally.count += 1
        if isinstance(self.coupling, DenseCoupling):
            return FrictionTangent(self, self.coupling, x)
        return CoupledFrictionTangent(self, x)

    def load_derivative(self, x: FloatArray, lam: float) -> FloatArray:
        """Derivative by the path parameter (2m + k + n,)."""
        return self._load_derivative

    def series_rhs(self, x: FloatArray, lam: FloatArray) -> FloatArray:
        """Right-hand side of order k from the coefficients (k, 2m + k + n) of lower orders."""
        rhs = np.zeros(self.size)
        if len(x) > 1:
            p, h, _, _ = self.split(x[1:])
            rhs[: self.m] = np.einsum("ij,ij->j", p, h[::-1]) / (-self.law.pressure * self.law.gap)
        return rhs

    def admissible(self, x: FloatArray, lam: float) -> bool:
        """Whether the state is on the meaningful branch: all gaps are positive."""
        p, h, _, _ = self.split(x)
        return bool((h > 0.0).all() and (p > -self.law.eta).all())

    def slip_rate(self, x: FloatArray, lam: float) -> FloatArray:
        """Approximate slip rates (n,) at x, with the last tangent available."""
        tangent = self.tangent(x, lam) if self._ready is None else self._ready[1]
        return self.slips_of(self._moved, -tangent.solve(self._load_derivative))

    def slope(self, x: FloatArray, lam: float) -> ContactSolution:
        """:meth:`rates` of the current sets, from the tangent used for continuation. Raises
        SingularSystemError."""
        try:
            slope = -self.tangent(x, lam).solve(self._load_derivative)
        except np.linalg.LinAlgError as error:
            raise SingularSystemError from error
        p, _, q, t = self.split(slope)
        motion = self.coupling.split_motions(q)[0]
        return self._expected(self.sets, ContactSolution(p, t, motion, p, self.slips_of(self._moved, slope)))

    def _expected(self, sets: ContactStatus, rates: ContactSolution) -> ContactSolution:
        """Rates as :func:`admissible_sets` expects them. An open node closes where its pressure grows; that
        pressure is expressed as the gap its own compliance would need. Raises SingularSystemError if nothing
        resists the load."""
        p = rates.pressure
        if not max(np.abs(p).max() / self.law.pressure, np.abs(rates.slip).max() / self.law.slip) <= MAX_RATE:
            raise SingularSystemError
        gap = np.where(sets.closed, 0.0, -p * self.condensed.own[0])
        return replace(rates, pressure=np.where(sets.closed, p, 0.0), gap=gap)

    def softened(self, x: FloatArray) -> Condensed:
        """Compliance for rates at x, with those of hyperbola and asperities added."""
        c, law = self.condensed, self.law
        p, h, _, _ = self.split(x)
        gap = replace(c.gap, pressure=c.gap.pressure + np.diag(h / (p + law.eta)))
        slip = replace(c.slip, traction=c.slip.traction + np.diag(law.stick_compliance))
        return replace(c, gap=gap, slip=slip)

    def rates(
        self, softened: Condensed, sets: ContactStatus, near: SetSystem | None = None
    ) -> tuple[SetSystem, ContactSolution]:
        """The system of some ``sets``, and the rates of the state and of s + c t. Raises
        SingularSystemError."""
        system = SetSystem(softened, replace(sets, closed=np.ones_like(sets.closed)), near)
        return system, self._expected(sets, system.rate(self.change))

    def within_cone(self, x: FloatArray) -> FloatArray:
        """The unknowns with sticking tractions clipped to their limits, which round-off and the residual of
        an event may exceed: negligibly against the reference pressure, but perhaps not against their own."""
        x = x.copy()
        p, _, _, t = self.split(x)
        limit = self.condensed.friction * np.maximum(self.pressed(p), 0.0)
        t[self.stuck] = np.clip(t, -limit, limit)[self.stuck]
        return x

    def at_limits(self, x: FloatArray) -> RegularizedFriction:
        """The same problem with sticking nodes beyond their limits slipping; itself if there are none."""
        traction = self.split(x)[3]
        beyond = self.split(self.within_cone(x))[3] != traction
        if not beyond.any():
            return self
        sets = ContactStatus(
            self.sets.closed,
            self.sets.stuck & ~beyond,
            np.where(beyond, np.sign(traction), self.sets.slip_sign),
        )
        return self.changed(sets=sets)

    def by_pressure_alone(self, x: FloatArray) -> RegularizedFriction:
        """The same problem with negative thresholds (friction without pressure) reset to zero at nodes that
        are pressed by now; itself if there are none."""
        law, nodes = self.law, self.condensed.friction_nodes
        ends = (law.threshold < 0.0) & (self.split(x)[0][nodes] > law.eta[nodes])
        if not ends.any():
            return self
        return self.changed(coupling=self.coupling.with_thresholds(np.where(ends, 0.0, law.threshold)))

    def on_limits(self, x: FloatArray) -> FloatArray:
        """The unknowns with tractions of slipping and open nodes set exactly."""
        x = x.copy()
        p, _, _, t = self.split(x)
        free = ~self.sets.stuck
        t[free] = (self.friction_slope * self.pressed(p))[free]
        return x

    def rested(self, x: FloatArray, lam: float) -> RegularizedFriction:
        """The same problem with its nodes sticking where they are in x."""
        problem = copy(self)
        problem.stick_reference = np.where(
            self.sets.stuck, self.stick_coordinate(x, lam), self.stick_reference
        )
        return problem

    def slip(self, x: FloatArray, lam: float) -> FloatArray:
        """Slips (n,)."""
        return self.stick_coordinate(x, lam) - self.law.stick_compliance * self.split(x)[3]

    def sticking(self, x: FloatArray, lam: float) -> BoolArray:
        """Mask (n,) of sticking nodes."""
        return self.sets.stuck

    def stick_coordinate(self, x: FloatArray, lam: float) -> FloatArray:
        """Slip plus the asperities' compliance times traction, s + c t (n,)."""
        return super().slip(x, lam)
