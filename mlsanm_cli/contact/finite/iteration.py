"""One step of Newton's method for bodies and contacts. The bodies' derivatives are condensed to the tractions
T at the knots that may touch: U = U_0 + z + C dT, with C by near fields where clouds do not resolve
tractions. Tractions depend on pressures and friction and rotate with the displacements, dT = B (dp, dq) + K
dU, so that dT = (1 - K C)^-1 (B (dp, dq) + K z); the complementarity problem of the contacts determines dp
and dq. Equations (22) and (26) of docs/method.md."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.complementarity.basis import Ray
from mlsanm_cli.contact.complementarity.problem import ContactStatus, Problem
from mlsanm_cli.contact.complementarity.solution import solve
from mlsanm_cli.contact.finite.contacts import ContactSystem
from mlsanm_cli.contact.finite.pair import Meeting
from mlsanm_cli.contact.finite.side_response import SideResponse
from mlsanm_cli.contact.response.coercivity import relative_resistance
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.finite.body_series import BodySeries
from mlsanm_cli.mechanics.finite.projector import Factorised
from mlsanm_cli.mechanics.finite.stability import Loaded, SoftMotion, rows_of_force, softest_motion
from mlsanm_cli.mechanics.finite.tangent import load_columns, tangent_rows
from mlsanm_cli.mechanics.rigid import ROTATION
from mlsanm_cli.records import dataclass

ADJACENT_NODES = 3
"""Number of knots next to those in contact that may come into contact within an iteration."""
REACH_WITH_MOTIONS = 0.1
"""With free motions, so may nodes with gaps up to this fraction of the typical displacement."""
NO_TRACTION = 1e-4
"""Nodal tractions up to this per unit traction at a knot are left out of derivatives."""
DAMPING = 1e-9
"""Damping of free motions within an iteration, as a fraction of the stiffness, for while nothing touches."""


@dataclass(frozen=True)
class Responses:
    """Derivatives of the bodies, by name, which can be reused nearby: their ``factorised`` equations, and
    their responses to the ``touched`` (t,) tractions and the d free motions: displacements ``moved`` (2N,
    t + d), and the direct imbalance of the ``pieces`` (3p, t + d) of each. They took a number of
    ``solves``."""

    factorised: Mapping[str, Factorised]
    touched: IntArray
    moved: FloatArray
    pieces: Mapping[str, sparse.csr_array] = field(default_factory=dict)
    solves: int = 0


class Iteration:
    """A step from displacements ``u`` (2N,), pressures ``p`` and friction ``q`` (c,) at load ``factors``
    (L + d,), which correspond to the ``traction`` (2s,) of all sides up to rotations since. ``known`` are
    responses of the bodies to be reused; ``left`` (r,) residuals of bodies, by name, other than those of
    their equations. ``first`` guesses the status from pressures and gaps.

    Results are the updates ``du`` (2N,), ``dp``, ``dq`` (c,), ``free`` (d,) and ``traction`` (2s,), the
    status ``sets`` of all knots (c,), the ``responses`` and the number of ``solves``. Raises NumericalError
    if no status satisfies the linearised conditions.

    The equations of the ``chosen`` knots (k,), which may touch, and the free motions: gaps, slips and force
    balances change by ``matrix`` (2k + d, 2k + d). Pressures ``push`` and friction ``pull`` (t, k) on the
    touched tractions, which displace all sides by ``seen`` (2s, t) and turn with these by ``turning``
    (t, 2s); ``inverse`` (t, t) of 1 - ``turning seen`` sums that up, so that all unknowns change them by
    ``loads`` (t, 2k + d). Gaps and slips follow the sides by ``d_gap`` and ``d_slip`` (k, 2s). Forces
    ``missing`` (d,) on motions change ``by_displacement`` (d, 2N) and by touched tractions and motions,
    ``by_acting`` (d, t + d); floating bodies, by name, add the imbalance of their pieces by ``sums`` (k, 3p)
    to their motions numbered (k,)."""

    def __init__(
        self,
        system: ContactSystem,
        factors: FloatArray,
        response: SideResponse,
        u: FloatArray,
        traction: FloatArray,
        p: FloatArray,
        q: FloatArray,
        sets: ContactStatus,
        met: Meeting,
        *,
        first: bool,
        known: Responses | None = None,
        left: Mapping[str, FloatArray] | None = None,
    ) -> None:
        self.system, self.factors, self.response = system, factors, response
        self._p, self._q, self._met, contacts = p, q, met, system.contacts
        applied = met.tractions(p, q)
        factorised, z, self._loaded = {}, np.zeros(len(u)), dict[str, Loaded]()
        for name, projector in system.projectors.items():
            here = system.bodies[name]
            state = u[here], np.concatenate([factors, system.spread[name] @ applied])
            self._loaded[name] = (projector.body, *state)
            rest = projector.left(*state) if left is None else left[name]
            one = known.factorised[name] if known else projector.factorised(*state, iterating=True)
            factorised[name], z[here] = one, -one.solve(projector.scaled(rest))
        # Nodes that may touch, and the tractions that these affect.
        gap = met.gap + met.d_gap @ (system.onto @ z)
        reach = REACH_WITH_MOTIONS * system.length if contacts.free else 0.0
        near = met.facing & ((gap <= reach) | (p > 0.0))
        for _ in range(ADJACENT_NODES):
            near = met.facing & (contacts.adjacent @ near > 0.0)
        self.chosen = np.flatnonzero(near)
        columns = (2 * self.chosen[:, None] + np.arange(2)).ravel()
        touched = np.unique(met.carried[:, columns].tocoo().coords[0]).astype(np.int64)
        idle = not len(self.chosen) and not contacts.free
        if idle:
            self.responses = Responses(factorised, touched, np.zeros((len(u), 0)))
        elif known is None or not np.array_equal(known.touched, touched):
            self.responses = self._responses(factorised, touched)
        else:
            self.responses = known
        self.solves = len(factorised) + self.responses.solves
        self._balance(applied)
        self._linearise()
        if idle:
            none = np.zeros(len(p), dtype=bool)
            self.du, self.dp, self.dq, self.free, self.traction = z, -p, -q, np.zeros(0), -traction
            self.sets = ContactStatus(none, none, np.zeros(len(p)))
        else:
            self._solve(sets, z, applied - traction, first)

    def _responses(self, factorised: Mapping[str, Factorised], touched: IntArray) -> Responses:
        """The bodies' responses to the ``touched`` tractions and to their free motions."""
        system, free, count = self.system, self.system.contacts.free, len(touched)
        moved, pieces, solves = np.zeros((system.unknowns, count + free)), {}, 0
        for name, one in factorised.items():
            projector, moves = system.projectors[name], system.contacts.moving(name)
            spread = system.spread[name][:, touched].toarray()
            # Projections decay from node to node.
            nodal = np.flatnonzero((np.abs(spread) > NO_TRACTION).any(axis=1))
            whole = np.append(self.factors, np.zeros(projector.body.loads.count - len(self.factors)))
            known = slice(len(self.factors) - free, None)
            loads = load_columns(projector.body, self._loaded[name][1], whole, known)
            loads = sparse.csr_array(loads[:, np.concatenate([free + nodal, moves])])
            onto = np.zeros((len(nodal) + len(moves), count + free))
            onto[: len(nodal), :count] = spread[nodal]
            onto[len(nodal) + np.arange(len(moves)), count + moves] = 1.0
            moved[system.bodies[name]] = -one.solve_unrefined(projector.scaled(loads.toarray())) @ onto
            pieces[name] = sparse.csr_array(loads[loads.shape[0] - 3 * projector.body.count :] @ onto)
            solves += len(onto)
        return Responses(factorised, touched, moved, pieces, solves)

    def _balance(self, applied: FloatArray) -> None:
        """The forces missing on unknown motions with ``applied`` (2s,) tractions, and their derivatives."""
        system, contacts, responses = self.system, self.system.contacts, self.responses
        free, count = contacts.free, len(responses.touched)
        missing, direct = np.zeros(free), np.zeros((free, count + free))
        by_displacement = np.zeros((free, len(responses.moved)))
        self.sums: dict[str, tuple[IntArray, sparse.csr_array]] = {}
        moduli = {name: body.elastic.model.material.modulus for name, (body, *_) in self._loaded.items()}
        for one in (some for some in contacts.loose if some.components):
            here, rows, (body, own, acting) = system.bodies[one.body], one.numbers, self._loaded[one.body]
            series = BodySeries.at(body, own, acting)
            sums, moving = one.sums(body, series, own)
            missing[rows] = sums @ series.rows(0)[-3 * body.count :]
            by_displacement[rows, here] = (sums @ tangent_rows(body, own, acting)[1] + moving).toarray()
            direct[rows] = (sums @ responses.pieces[one.body]).toarray()
            direct[rows, count + rows] += DAMPING * moduli[one.body]
            self.sums[one.body] = rows, sums
        for plate in (some for some in contacts.plates if some.components):
            rows, known = plate.numbers, plate.force.shape[1]
            missing[rows] -= plate.unknown(plate.force @ self.factors[:known])
            for name in plate.surfaces:
                pull, by_moving = plate.pulled(name, *self._loaded[name])
                missing[rows] += plate.unknown(pull)
                by_displacement[rows, system.bodies[name]] += plate.unknown(by_moving.toarray())
                # Moments are about the hinge, which moves.
                arms = np.zeros_like(plate.motion)
                arms[ROTATION] = plate.motion[1] * pull[0] - plate.motion[0] * pull[1]
                direct[rows, count:] += plate.unknown(arms)[:, known:]
                direct[rows, count + rows] += DAMPING * moduli[name]
        for driven in contacts.driven:
            number, slave = driven.number, contacts.pairs[driven.contact].slave
            weight = np.zeros(len(applied))
            weight[contacts.pushing(driven)] = slave.weight
            missing[number] = weight @ applied - driven.force @ self.factors[: len(driven.force)]
            direct[number, :count] = weight[responses.touched]
            direct[number, count + number] = DAMPING * moduli[slave.body]
        self.missing, self.by_displacement = missing, by_displacement
        self.by_acting = by_displacement @ responses.moved + direct

    def _linearise(self) -> None:
        """The equations condensed to the chosen knots and the free motions."""
        system, contacts, met, chosen = self.system, self.system.contacts, self._met, self.chosen
        touched, count = self.responses.touched, len(self.responses.touched)
        # Displacements of all sides due to the touched tractions and the free motions.
        smooth = system.onto @ self.responses.moved
        seen, shifted = np.split(self.response.followed(smooth), [count], axis=1)
        self.seen = seen + self.response.by_traction[:, touched]
        for driven in contacts.driven:
            shifted[contacts.pushing(driven), driven.number] -= 1.0
        self.turning = met.turning(self._p, self._q)[touched]
        self.push = met.columns(met.normal)[touched][:, chosen].toarray()
        self.pull = met.columns(met.tangent)[touched][:, chosen].toarray()
        self.d_gap, self.d_slip = met.d_gap[chosen], met.d_slip[chosen]
        self.inverse = np.linalg.inv(np.eye(count) - self.turning @ self.seen)
        self.loads = self.inverse @ np.hstack([self.push, self.pull, self.turning @ shifted])
        by_all = self.seen @ self.loads
        by_all[:, 2 * len(chosen) :] += shifted
        by_traction, by_motion = np.split(self.by_acting, [count], axis=1)
        by_balance = by_traction @ self.loads
        by_balance[:, 2 * len(chosen) :] += by_motion
        self.matrix = np.concatenate([self.d_gap @ by_all, self.d_slip @ by_all, by_balance])

    def _followed(self, z: FloatArray, jump: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """What displacements ``z`` (2N,) of the clouds and a ``jump`` (2s,) of all tractions change: the
        touched tractions (t,); and gaps, slips and the balance (2k + d,)."""
        surface = self.response.followed(self.system.onto @ z)
        if jump is not None:
            surface = surface + self.response.by_traction @ jump
        turned = self.inverse @ (self.turning @ surface)
        surface = surface + self.seen @ turned
        balance = self.by_displacement @ z + self.by_acting[:, : len(turned)] @ turned
        return turned, np.concatenate([self.d_gap @ surface, self.d_slip @ surface, balance])

    def _moved(self, turned: FloatArray, change: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Changes of the touched tractions (t,), with those ``turned`` (t,), and of the displacements (2N,)
        by them, for a ``change`` (2k + d,) of the unknowns."""
        tractions = turned + self.loads @ change
        acting = np.append(tractions, change[2 * len(self.chosen) :])
        return tractions, self.responses.moved @ acting

    def _solve(self, sets: ContactStatus, z: FloatArray, jump: FloatArray, first: bool) -> None:
        """The updates that satisfy the conditions of the chosen knots, searched from a status."""
        chosen, count, touched = self.chosen, len(self.chosen), self.responses.touched
        mu, met, p, q = self.system.contacts.friction[chosen], self._met, self._p, self._q
        gap, slip = met.gap[chosen], met.slip[chosen]
        turned, step = self._followed(z, jump)
        step = step + np.concatenate([gap, slip, self.missing])
        now = np.concatenate([p[chosen], q[chosen], np.zeros(self.system.contacts.free)])
        closed, stuck = sets.closed[chosen], sets.stuck[chosen]
        if first:
            presses = p[chosen] > self.system.stiffness * gap
            closed, stuck = presses, presses & np.where(closed, stuck, mu > 0.0)
        nodes = np.flatnonzero(mu > 0.0)
        kept = np.concatenate([np.arange(count), count + nodes, np.arange(2 * count, len(step))])
        problem = Problem.of(self.matrix[np.ix_(kept, kept)], nodes, mu[nodes], count)
        sign = sets.slip_sign[chosen][nodes]
        start = ContactStatus.with_tractions(closed, stuck[nodes], sign, nodes)
        try:
            found = solve(problem, problem.rows * (step - self.matrix @ now)[kept], start)
        except Ray as error:
            raise NumericalError(
                "no contact state satisfies a linearised step", "the loads may move bodies that nothing holds"
            ) from error
        change = -now
        change[kept] += problem.columns * found.x
        tractions, moved = self._moved(turned, change)
        self.du, self.dp, self.dq, self.traction = z + moved, -p, -q, jump.copy()
        self.dp[chosen], self.dq[chosen], self.free = np.split(change, [count, 2 * count])
        self.traction[touched] += tractions
        masks, slip_sign = np.zeros((2, len(p)), dtype=bool), np.zeros(len(p))
        masks[0, chosen], masks[1, chosen[nodes]] = found.status.closed, found.status.stuck
        slip_sign[chosen[nodes]] = found.status.slip_sign
        self.sets = ContactStatus(masks[0], masks[1], slip_sign)

    def stability(self, met: Meeting) -> float:
        """Least resistance of a contact, at closed nodes between two others that are not held, to pressures
        that oscillate from node to node without forces on floating bodies."""
        contacts, least = self.system.contacts, np.inf
        pushed = self.seen @ self.push
        compliance = self.d_gap @ pushed
        held = np.flatnonzero(self.sets.stuck[self.chosen])
        if len(held):
            # Sticking nodes are fixed along the surface too.
            slips, pulled = self.d_slip[held] @ pushed, self.seen @ self.pull[:, held]
            compliance = compliance - self.d_gap @ pulled @ np.linalg.solve(self.d_slip[held] @ pulled, slips)
        loose = sum(len(one.components) for one in contacts.loose)
        unbalanced = self.by_acting[:loose, : len(self.responses.touched)] @ self.push
        number = np.full(len(self.sets.closed), -1, dtype=np.int64)
        number[self.chosen] = np.arange(len(self.chosen))
        for contact, here, _ in contacts.each:
            own = self.sets.closed[here] & ~contact.slave.held
            inner = own[1:-1] & own[:-2] & own[2:]
            some = 1 + np.flatnonzero(inner) if inner.any() else np.flatnonzero(own)
            materials = [self._loaded[side.body][0].elastic.model.material for side in contact.sides]
            soft = sum(one.contact_compliance(met.normal[here][some]) for one in materials)
            place, weight = number[here][some], contact.slave.weight[some]
            part = compliance[np.ix_(place, place)]
            free = weight, np.diag(soft), part, unbalanced[:, place]
            least = min(least, relative_resistance(*free, constrained=True))
        return least

    def softest(self, u: FloatArray, p: FloatArray, q: FloatArray) -> SoftMotion:
        """The softest motion, with displacements ``u`` (2N,), pressures and friction (c,): gaps of closed
        knots, and slips of sticking ones, do not change; friction of slipping ones changes with pressure."""
        system, chosen, count = self.system, self.chosen, len(self.chosen)
        p, q = p[chosen], q[chosen]
        closed = self.sets.closed[chosen] & (p > system.nothing)
        stuck = closed & self.sets.stuck[chosen]
        kept = np.concatenate([closed, stuck, np.ones(len(self.matrix) - 2 * count, dtype=bool)])
        whole = np.where(kept[:, None], self.matrix, np.eye(len(kept)))
        slips = np.flatnonzero(closed & ~self.sets.stuck[chosen])
        whole[count + slips, slips] -= q[slips] / p[slips]
        inverse = np.linalg.inv(whole)

        def displaced(force: FloatArray) -> FloatArray:
            z, missing = np.zeros(len(force)), np.zeros(len(self.missing))
            for name, (body, *_) in self._loaded.items():
                here = system.bodies[name]
                rows = rows_of_force(body, force[here])
                scaled = system.projectors[name].scaled(rows)
                z[here] = -self.responses.factorised[name].solve_unrefined(scaled)
                if name in self.sums:
                    numbers, sums = self.sums[name]
                    missing[numbers] += sums @ rows[body.node_rows :]
            turned, left = self._followed(z)
            left[2 * count :] += missing
            return z + self._moved(turned, -inverse @ np.where(kept, left, 0.0))[1]

        loaded = [(body, u[system.bodies[name]], self.factors) for name, (body, *_) in self._loaded.items()]
        return softest_motion(displaced, loaded)
