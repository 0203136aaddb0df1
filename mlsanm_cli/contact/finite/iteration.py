"""One Newton step for bodies and contacts at finite strain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.complementarity.problem import OPEN, SLIP, STICK
from mlsanm_cli.contact.finite.free import DrivenObstacle
from mlsanm_cli.contact.finite.linearised import Balance, Linearised
from mlsanm_cli.contact.finite.meeting import Meeting
from mlsanm_cli.contact.finite.sets import NodeSets, settled
from mlsanm_cli.contact.finite.side_response import SideResponse
from mlsanm_cli.contact.finite.update import ContactSystem, IterationResult, Responses
from mlsanm_cli.mechanics.finite.body_series import BodySeries
from mlsanm_cli.mechanics.finite.projector import Factorised
from mlsanm_cli.mechanics.finite.tangent import load_columns, tangent_rows
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
class Iteration:
    """Newton steps at load ``factors`` (L,), with ``known`` responses of the bodies if given. ``left`` (r,)
    are the residuals of bodies, by name, if they are not to be those of their equations."""

    system: ContactSystem
    factors: FloatArray
    response: SideResponse
    known: Responses | None = None
    left: Mapping[str, FloatArray] = field(default_factory=dict)

    def taken(
        self,
        u: FloatArray,
        traction: FloatArray,
        p: FloatArray,
        q: FloatArray,
        sets: NodeSets,
        met: Sequence[Meeting],
        first: bool,
    ) -> IterationResult:
        """One step from displacements (2N,), pressures and friction (c,), which correspond to the
        ``traction`` (2s,) of all sides up to rotations since."""
        system, contacts = self.system, self.system.contacts
        applied = contacts.tractions(met, p, q)
        jump = applied - traction
        factorised, z = {}, np.zeros(len(u))
        for name, projector in system.projectors.items():
            here = system.bodies[name]
            whole = np.concatenate([self.factors, system.spread[name] @ applied])
            left = self.left[name] if self.left else projector.left(u[here], whole)
            if self.known is not None:
                factorised[name] = self.known.factorised[name]
            else:
                factorised[name] = projector.factorised(u[here], whole, iterating=True)
            z[here] = -factorised[name].solve(projector.scaled(left))
        chosen, touched = self._chosen(z, p, met)
        if not len(chosen) and not contacts.free:
            none, nothing = np.zeros(len(p)), np.zeros((0, 0))
            sets, alone = NodeSets(none.astype(np.int8), none), Responses(factorised, touched, 0)
            state = self._linearised(u, applied, p, q, met, chosen, alone)
            args = (chosen, nothing, nothing, len(factorised), alone, state)
            return IterationResult(z, -p, -q, np.zeros(0), -traction, sets, *args)
        responses = self.known
        if responses is None or not responses.moved or not np.array_equal(responses.touched, touched):
            responses = self._responses(u, factorised, touched)
        state = self._linearised(u, applied, p, q, met, chosen, responses)
        return self._settled(p, q, sets, met, z, jump, state, first)

    def _chosen(self, z: FloatArray, p: FloatArray, met: Sequence[Meeting]) -> tuple[IntArray, IntArray]:
        """The nodes that may touch after the displacements ``z`` (2N,), and the tractions (t,) of all sides
        that these affect."""
        chosen, touched = [], []
        smooth = self.system.onto @ z
        reach = REACH_WITH_MOTIONS * self.system.length if self.system.contacts.free else 0.0
        for one, (contact, here, there) in zip(met, self.system.contacts.each, strict=True):
            gap = one.gap + one.d_gap @ smooth[there]
            near = one.facing & ((gap <= reach) | (p[here] > 0.0))
            for _ in range(ADJACENT_NODES):
                adjacent = near.copy()
                adjacent[1:] |= near[:-1]
                adjacent[:-1] |= near[1:]
                if contact.slave.around is not None:
                    adjacent[0] |= near[-1]
                    adjacent[-1] |= near[0]
                near = adjacent & one.facing
            own = np.flatnonzero(near)
            chosen.append(here.start + own)
            reached = np.unique(one.carried[:, own].tocoo().coords[0])
            nodes = np.concatenate([own, contact.slave.count + reached])
            touched.append(there.start + (2 * nodes[:, None] + np.arange(2)).ravel())
        return (
            np.concatenate([*chosen, np.zeros(0, dtype=np.int64)]),
            np.concatenate([*touched, np.zeros(0, dtype=np.int64)]),
        )

    def _responses(self, u: FloatArray, factorised: Mapping[str, Factorised], touched: IntArray) -> Responses:
        """The bodies' responses to the ``touched`` tractions and to their free motions."""
        system, free = self.system, self.system.contacts.free
        columns, moved, pieces, solves = {}, {}, {}, 0
        for name, one in factorised.items():
            projector, tractions = system.projectors[name], system.columns[name]
            acting, moves = np.flatnonzero(np.isin(touched, tractions)), system.contacts.moving(name)
            spread = system.spread[name][:, touched[acting]].toarray()
            # Projections decay from node to node.
            nodal = np.flatnonzero((np.abs(spread) > NO_TRACTION).any(axis=1))
            whole = np.append(self.factors, np.zeros(projector.body.loads.count - len(self.factors)))
            known = slice(len(self.factors) - free, None)
            loads = load_columns(projector.body, u[system.bodies[name]], whole, known)
            loads = sparse.csr_array(loads[:, np.concatenate([free + nodal, moves])])
            onto = np.zeros((len(nodal) + len(moves), len(acting) + len(moves)))
            onto[: len(nodal), : len(acting)] = spread[nodal]
            onto[len(nodal) :, len(acting) :] = np.eye(len(moves))
            columns[name] = np.concatenate([acting, len(touched) + moves])
            moved[name] = -one.solve_unrefined(projector.scaled(loads.toarray())) @ onto
            pieces[name] = sparse.csr_array(loads[loads.shape[0] - 3 * projector.body.count :] @ onto)
            solves += len(nodal) + len(moves)
        return Responses(factorised, touched, solves, columns, moved, pieces)

    def _balance(self, u: FloatArray, applied: FloatArray, responses: Responses) -> Balance:
        """Forces missing on unknown motions with ``applied`` (2s,) tractions, and their derivatives."""
        system, contacts = self.system, self.system.contacts
        free, count = contacts.free, len(responses.touched)
        missing, derivative, summed = np.zeros(free), np.zeros((free, count + free)), {}
        by_displacement = np.zeros((free, len(u)))
        for one in (some for some in contacts.loose if some.count):
            here, rows, columns = system.bodies[one.body], one.numbers, responses.columns[one.body]
            body = system.projectors[one.body].body
            whole = np.concatenate([self.factors, system.spread[one.body] @ applied])
            series = BodySeries.at(body, u[here], whole)
            sums, moving = one.sums(body, series, u[here])
            moved = sums @ tangent_rows(body, u[here], whole)[1] + moving
            missing[rows] = sums @ series.rows(0)[-3 * body.count :]
            by_displacement[rows, here] = moved.toarray()
            direct = (sums @ responses.pieces[one.body]).toarray()
            derivative[np.ix_(rows, columns)] = direct + moved @ responses.moved[one.body]
            derivative[rows, count + rows] += DAMPING * body.elastic.model.material.modulus
            summed[one.body] = rows, sums
        for plate in (some for some in contacts.plates if some.components):
            rows, known = plate.numbers, plate.force.shape[1]
            missing[rows] -= plate.given(self.factors[:known])
            for name in plate.surfaces:
                here, columns = system.bodies[name], responses.columns[name]
                body = system.projectors[name].body
                whole = np.concatenate([self.factors, system.spread[name] @ applied])
                pull, by_moving = plate.pulled(body, name, u[here], whole)
                moved = plate.unknown(by_moving.toarray())
                missing[rows] += plate.unknown(pull)
                by_displacement[rows, here] += moved
                derivative[np.ix_(rows, columns)] += moved @ responses.moved[name]
                derivative[rows, count:] += plate.unknown(plate.arms(pull))[:, known:]
                derivative[rows, count + rows] += DAMPING * body.elastic.model.material.modulus
        for driven in contacts.driven:
            number, contact = driven.number, contacts.pairs[driven.contact]
            weight = np.zeros(len(applied))
            weight[self._driven(driven)] = contact.slave.weight
            missing[number] = weight @ applied - driven.force @ self.factors[: len(driven.force)]
            derivative[number, :count] = weight[responses.touched]
            modulus = system.projectors[contact.slave.body].body.elastic.model.material.modulus
            derivative[number, count + number] = DAMPING * modulus
        return Balance(missing, by_displacement, derivative, summed)

    def _driven(self, driven: DrivenObstacle) -> IntArray:
        """The tractions of all sides that act on an obstacle along its motion."""
        contact, _, there = self.system.contacts.each[driven.contact]
        first = there.start + driven.component
        return np.arange(first, first + 2 * contact.slave.count, 2)

    def _linearised(
        self,
        u: FloatArray,
        applied: FloatArray,
        p: FloatArray,
        q: FloatArray,
        met: Sequence[Meeting],
        chosen: IntArray,
        responses: Responses,
    ) -> Linearised:
        """The equations linearised, condensed to the ``chosen`` (k,) knots and the free motions."""
        system, contacts, touched = self.system, self.system.contacts, responses.touched
        response, count = self.response, len(touched)
        balance = self._balance(u, applied, responses)
        # Displacements of all sides due to the touched tractions and the free motions.
        smooth = np.zeros((contacts.size, count + contacts.free))
        for name, columns in responses.columns.items():
            smooth[:, columns] += system.onto[:, system.bodies[name]] @ responses.moved[name]
        seen, shifted = np.split(response.followed(smooth), [count], axis=1)
        seen = seen + response.by_traction[:, touched]
        for driven in contacts.driven:
            shifted[self._driven(driven), driven.number] -= 1.0
        turns = [one.turning(p[at], q[at]) for one, (_, at, _) in zip(met, contacts.each, strict=True)]
        turning = _diagonal(turns)[touched]
        push, pull = (
            _diagonal([one.columns(getattr(one, key)) for one in met])[touched][:, chosen].toarray()
            for key in ("normal", "tangent")
        )
        d_gap, d_slip = (_diagonal([getattr(one, k) for one in met])[chosen] for k in ("d_gap", "d_slip"))
        inverse = np.linalg.inv(np.eye(len(touched)) - turning @ seen)
        loads = inverse @ np.hstack([push, pull, turning @ shifted])
        by_all = seen @ loads
        by_all[:, 2 * len(chosen) :] += shifted
        by_traction, by_motion = np.split(balance.by_acting, [count], axis=1)
        by_balance = by_traction @ loads
        by_balance[:, 2 * len(chosen) :] += by_motion
        matrix = np.concatenate([d_gap @ by_all, d_slip @ by_all, by_balance])
        parts = (matrix, loads, push, pull, seen, turning, inverse, d_gap, d_slip)
        return Linearised(system, self.factors, response, responses, balance, chosen, *parts)

    def _settled(
        self,
        p: FloatArray,
        q: FloatArray,
        sets: NodeSets,
        met: Sequence[Meeting],
        z: FloatArray,
        jump: FloatArray,
        state: Linearised,
        first: bool,
    ) -> IterationResult:
        system, contacts, chosen = self.system, self.system.contacts, state.chosen
        mu, responses, touched = contacts.friction[chosen], state.responses, state.responses.touched
        gap, slip = (
            np.concatenate([*(getattr(one, key) for one in met), mu[:0]])[chosen] for key in ("gap", "slip")
        )
        turned, step = state.followed(z, jump)
        step = step + np.concatenate([gap, slip, state.balance.missing])
        now = np.concatenate([p[chosen], q[chosen], np.zeros(contacts.free)])
        guess = NodeSets(sets.status[chosen], sets.slip_sign[chosen])
        if first:
            closed = p[chosen] > system.stiffness * gap
            held = np.where(mu > 0.0, STICK, SLIP)
            status = np.where(closed, np.where(guess.closed, guess.status, held), OPEN).astype(np.int8)
            guess = NodeSets(status, np.where(status == SLIP, guess.slip_sign, 0.0))
        change, found = settled(state.matrix, step, now, mu, guess)
        dp, dq, free = np.split(change, [len(chosen), 2 * len(chosen)])
        tractions, du = state.moved(turned, change)
        moving = jump.copy()
        moving[touched] += tractions
        whole_p, whole_q = -p, -q
        whole_p[chosen], whole_q[chosen] = dp, dq
        status, slip_sign = np.zeros(len(p), dtype=np.int8), np.zeros(len(p))
        status[chosen], slip_sign[chosen] = found.status, found.slip_sign
        d_gap, d_slip, seen, push = state.d_gap, state.d_slip, state.seen, state.push
        compliance = d_gap @ (seen @ push)
        stuck = np.flatnonzero((found.status == STICK) & (mu > 0.0))
        if len(stuck):
            # Sticking nodes are fixed along the surface too.
            slips, held = d_slip[stuck] @ (seen @ push), seen @ state.pull[:, stuck]
            compliance = compliance - d_gap @ held @ np.linalg.solve(d_slip[stuck] @ held, slips)
        by_traction = state.balance.by_acting[:, : len(touched)]
        on_bodies = by_traction[: sum(one.count for one in contacts.loose)] @ push
        args = (chosen, compliance, on_bodies, len(responses.columns) + responses.solves, responses, state)
        return IterationResult(z + du, whole_p, whole_q, free, moving, NodeSets(status, slip_sign), *args)


def _diagonal(blocks: Sequence[sparse.csr_array]) -> sparse.csr_array:
    return sparse.csr_array(sparse.block_diag([sparse.csr_array((0, 0)), *blocks], format="csr"))
