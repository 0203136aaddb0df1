"""Path of bodies in contact: increments with Newton's method, exact contact and Coulomb friction."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.app.finite.accuracy import missed_in_contact
from mlsanm_cli.app.finite.checks import place_of
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.complementarity.problem import OPEN, STICK, ContactStatus
from mlsanm_cli.contact.finite.exact import ExactContact, FiniteContactState, dissipated, slides, undeformed
from mlsanm_cli.contact.finite.pair import RigidContact
from mlsanm_cli.contact.geometry.obstacles import Round
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.finite.body import far_from, most_stretched
from mlsanm_cli.mechanics.finite.body_series import BodySeries
from mlsanm_cli.solve.condensed_scene import factors_at
from mlsanm_cli.solve.state import Bifurcation, Checkpoint, PathStep, State

FIRST_INCREMENT = 0.25
"""First increment, as a part of a stage."""
INCREMENT_SLACK = 1.4
"""An increment within this factor of a requested state goes there."""
COARSE_TOLERANCE = 1e-3
"""Tolerance of a path that only tells where bodies touch."""
MAX_ITERATIONS = 14
"""Iterations after which an increment is halved; one that took a third of them makes the next one longer."""
MIN_INCREMENT = 1e-5
MAX_FAILED = 3
"""Failed increments after which equations renewed just before keep the residual of their state, as no state
near it solves them."""
BRACKET = 0.02
"""Part of the way into a stage below which an increment that loses stability is not halved: a branch leaves
the path in it, or a sharp bend does."""
BELOW = 0.98
"""Part of the estimated way to a loss of stability that an increment goes."""
BRANCH_STEPS = tuple(0.01 * 2.0**k for k in range(5))
"""Distances along the softest motion, over the extent of bodies, from which stable states are searched."""
RENEWAL_ANGLE = 0.5
"""Rotation of a body (radian) relative to the expansion point above which the equations rotate with it."""
MAX_SLIP = 0.2
"""Largest slip in an increment with friction, relative to the width of the contact, unless all nodes slide in
the same direction before and after it, which has no history."""
MAX_WORK_CHANGE = 0.2
"""Largest difference of the dissipated work by pressures at the end of an increment and by mean ones, whose
error is of second order, relative to the work up to the end of the stage at the present rate."""
MAX_APPROACH = 0.5
"""Largest motion of a node towards a possible partner in an increment: its gap plus this part of the thinner
body or disk, so that contact is not missed. No body moves further than this part of the smallest."""
MAX_STRETCH = 1.6
"""Largest stretch of a node in an increment relative to the expansion point."""
KEPT = {name: name for name in ("place", "normal", "surface", "stability")}
KEPT |= {"slip": "increment", "traction": "side_traction"}
"""Names of solutions in contact and of the ``solver``'s arrays of states."""


def contact_path(
    scene: FiniteScene, checkpoint: Checkpoint | None = None, at: tuple[float, ...] = (), coarse: bool = False
) -> Iterator[PathStep]:
    """All steps from the initial state on, or those after a ``checkpoint``; further positions ``at`` are
    saved. A ``coarse`` path tells where bodies touch. NumericalError if the path cannot be continued."""
    path = _Path(scene, coarse)
    wanted = sorted({*(scene.case.output.at or [float(len(scene.stages) - 1)]), *at})
    history = any(contact.friction for contact in scene.contacts.pairs)
    most = scene.case.solver.largest_increment
    steps, size, position = 0, 1.0 if coarse and not history else min(FIRST_INCREMENT, most), 0.0
    if checkpoint is None:
        first = path.first()
        saved = (first,) if 0.0 in wanted else ()
        yield PathStep(first, saved, factorizations=path.spent, checkpoint=path.checkpoint(first, size))
    else:
        path.take_up(checkpoint)
        size, position = checkpoint.pace, checkpoint.state.position
    ends = sorted({*wanted, *np.arange(1.0, len(scene.stages)).tolist()})
    for end in (one for one in ends if one > position):
        while position < end:
            reached, size = path.forward(position, end, size)
            steps += 1
            if steps > scene.case.solver.max_steps:
                message = f"the path stopped at position {reached:.6g}: max steps"
                raise NumericalError(message, "raise solver.max_steps")
            size = min(size, most) * path.measured(position, reached)
            state = path.state(reached)
            done = path.finished(state, reached - position, (state,) if reached in wanted else ())
            position = reached
            yield replace(done, checkpoint=path.checkpoint(state, size))


class _Path:
    """Current state of the path and its equations."""

    def __init__(self, scene: FiniteScene, coarse: bool) -> None:
        self._scene, self._coarse = scene, coarse
        contacts, self._projectors = scene.contacts, dict(scene.undeformed)
        # Typical displacement: the largest prescribed one, or response of a body to the loads.
        found, known = [1e-3 * scene.size], scene.stages.shape[1]
        rigid = [one for one in contacts.pairs if isinstance(one, RigidContact)]
        found += [float(np.abs(scene.stages @ one.motion[:, :known].T).max()) for one in rigid]
        for name, body in scene.bodies.items():
            still, more = np.zeros(body.unknowns), np.zeros(body.loads.count - known)
            for factors in (one for one in scene.stages[1:] if one.any()):
                left = BodySeries.at(body, still, np.append(factors, more)).rows(0)
                found.append(float(np.abs(self._projectors[name].displaced(left)).max()))
        self._length = min(max(found), scene.size)
        modulus = max(body.elastic.model.material.modulus for body in scene.bodies.values())
        self._stiffness = modulus / scene.size
        self.now, self._settled = undeformed(scene.unknowns, contacts), False
        self._slip = self._work = self.now.pressure
        self._before: FloatArray | None = None
        self._fresh: frozenset[str] = frozenset()
        self.bifurcations: tuple[Bifurcation, ...] = ()
        self._earlier: list[FiniteContactState] = []
        self.error, self._largest = 0.0, 0.0
        self._missing = np.zeros((contacts.size, contacts.size))
        for compliance, (side, here) in zip(scene.compliances, contacts.sides, strict=True):
            self._missing[here, here] = compliance.beyond_cloud(side)
        self.spent, self._iterations, self._solves = len(scene.bodies), 0, 0

    def take_up(self, checkpoint: Checkpoint) -> None:
        """Continue from a checkpoint."""
        scene, state, history = self._scene, checkpoint.state, checkpoint.history
        self._slip, self._work, self._settled = state.slip, state.work, True
        sets = _status(state.status, state.solver["slip_sign"])
        known = state.displacement, state.pressure, state.traction, state.gap, state.motion, sets
        kept: dict[str, Any] = {name: state.solver[key] for name, key in KEPT.items()}
        self.now = FiniteContactState(*known, **kept, residual=state.residual)
        self.error, self._largest = history["increment_error"].tolist()
        if len(history["earlier_status"]):
            # Of the state before, the places and statuses are what an increment over both begins with.
            sets = _status(history["earlier_status"], history["earlier_sign"])
            self._earlier = [replace(self.now, place=history["earlier_place"], sets=sets)]
        counts = [body.loads.count for body in scene.bodies.values()]
        acting = np.split(history["acting"], np.cumsum(counts)[:-1])
        bases = scene.parts(history["base_state"]).items()
        for (name, base), factors, keeps in zip(bases, acting, history["keeps"], strict=True):
            if not np.array_equal(base, self._projectors[name].base_state):
                self._projectors[name] = scene.projector(name, base, factors, bool(keeps))
        self.spent = 0

    def checkpoint(self, state: State, size: float) -> Checkpoint:
        """Checkpoint at a ``state`` with the ``size`` of the next increment, and the equations: their states
        and load factors, and whether those of each body keep a residual."""
        every, earlier = self._projectors.values(), next(reversed(self._earlier), None)
        history = {
            "base_state": np.concatenate([one.base_state for one in every]),
            "acting": np.concatenate([one.factors for one in every]),
            "keeps": np.array([bool(one.rest.any()) for one in every]),
            "increment_error": np.array([self.error, self._largest]),
            "earlier_place": earlier.place if earlier else np.zeros(0),
            "earlier_status": earlier.status if earlier else np.zeros(0, dtype=np.int8),
            "earlier_sign": earlier.sets.slip_sign if earlier else np.zeros(0),
        }
        return Checkpoint(state, history, pace=size)

    def first(self) -> State:
        """The state before loading. NumericalError if the iterations do not converge."""
        found = self._solved(0.0)
        if found is None:
            self._failed(0.0, None)
        self.now, self._settled = found, True
        return self.state(0.0)

    def forward(self, position: float, end: float, size: float) -> tuple[float, float]:
        """One increment of about ``size`` towards ``end``: position reached, and size of the next one."""
        stage, whole, failed, friction = int(position), size, 0, self._scene.contacts.friction
        while True:
            reached = end if position + INCREMENT_SLACK * size >= end else position + size
            reached = min(reached, float(stage + 1))
            length, found = reached - position, self._solved(reached)
            shorter, bracket = 0.5 * length, BRACKET * (reached - stage)
            if found is not None and self.now.soft.stable and not found.soft.stable:
                # The part at which the softest motion, if it were linear in the load, loses its resistance.
                before = self.now.soft.resistance
                part = before / (before - found.soft.resistance)
                if length <= bracket:
                    found = self._branched(position + part * length, reached, found)
                else:
                    shorter = min(max(BELOW * length * part, 0.5 * bracket), shorter)
                    found = None
            if found is not None:
                far = self._excess(found, position, reached)
                if self.bifurcations or (far <= 1.0 and self._stretched(found)[0] <= MAX_STRETCH):
                    closed = found.sets.closed | self.now.sets.closed
                    self._slip = self._slip + np.where(closed, found.slip, 0.0)
                    mean = 0.5 * (found.pressure + self.now.pressure)
                    self._work = self._work + dissipated(friction, self.now, found, mean)
                    self._earlier = [*self._earlier[-1:], self.now]
                    self._before, self.now = self.now.place, found
                    longer = 1.6 if 3 * found.iterations <= MAX_ITERATIONS else 1.0
                    return reached, size * min(longer, 0.9 / far if far else longer)
            size, failed = shorter, failed + 1
            if failed == MAX_FAILED and self._fresh:
                # New equations that did not keep what their rows were left with do so now.
                for name in self._fresh:
                    base, factors = self._projectors[name].base_state, self._projectors[name].factors
                    self._projectors[name] = self._scene.projector(name, base, factors, keeps=True)
                    self.spent += 1
                self._fresh, size = frozenset(), whole
            if size < MIN_INCREMENT:
                self._failed(position, found)

    def _excess(self, found: FiniteContactState, position: float, reached: float) -> float:
        """Largest ratio of slips, work and motions in an increment to a state to their limits."""
        scene, contacts, now, ratios = self._scene, self._scene.contacts, self.now, [0.0]
        for contact, here, _ in contacts.each:
            closed = found.sets.closed[here] | now.sets.closed[here]
            if contact.friction and closed.any() and not slides(now, found, here):
                width = float(contact.slave.weight[closed].sum())
                ratios.append(float(np.abs(found.slip[here][closed]).max()) / (MAX_SLIP * width))
        if not self._coarse:
            part = (reached - position) / (int(position) + 1.0 - position)
            pressures = found.pressure, 0.5 * (found.pressure + now.pressure)
            last, mean = (dissipated(contacts.friction, now, found, one) for one in pressures)
            ahead = float(contacts.weight @ (self._work + mean / part))
            change = float(contacts.weight @ np.abs(last - mean))
            ratios.append(change / (MAX_WORK_CHANGE * ahead) if ahead > 0.0 else 0.0)
        sizes = {name: np.ptp(body.elastic.model.cloud.points, axis=0) for name, body in scene.bodies.items()}
        moved = np.abs(found.displacement - now.displacement).max()
        ratios.append(float(moved / (MAX_APPROACH * min(size.max() for size in sizes.values()))))
        before = np.append(factors_at(scene.stages, position), now.free)
        after = np.append(factors_at(scene.stages, reached), found.free)
        for contact, here, own in contacts.each:
            place = now.place[here]
            then = contact.apart(now.surface[own].reshape(-1, 2), before, place)
            way = np.hypot(*(contact.apart(found.surface[own].reshape(-1, 2), after, place) - then).T)
            thin = min(sizes[side.body].min() for side in contact.sides)
            gap = np.minimum(now.gap[here], sizes[contact.slave.body].max())
            if isinstance(contact, RigidContact) and isinstance(contact.shape, Round):
                thin = min(thin, contact.shape.radius)
            ratios.append(float((way / (np.maximum(gap, 0.0) + MAX_APPROACH * thin)).max()))
        return max(ratios)

    def _branched(self, at: float, reached: float, lost: FiniteContactState) -> FiniteContactState:
        """A stable state beyond a bifurcation ``at`` a position before the one ``reached``: found from the
        unstable state ``lost``, displaced in its softest motion. The latter if there is none."""
        side = lost.soft.part_in(self.now.displacement)
        motion = -lost.soft.motion if side < 0.0 else lost.soft.motion
        for part in (sense * part for part in BRANCH_STEPS for sense in (1.0, -1.0)):
            moved = lost.displacement + part * self._scene.size * motion
            stable = self._solved(reached, replace(lost, displacement=moved))
            if stable is not None and stable.soft.stable:
                break
        else:
            stable = None
        self.bifurcations = (Bifurcation(at, motion, stable is not None, bool(side)),)
        return stable or lost

    def _stretched(self, found: FiniteContactState) -> tuple[float, str, int]:
        """Largest stretch of a node relative to the expansion point of its equations, its body and number."""
        parts, stretched = self._scene.parts(found.displacement), []
        for name, body in self._scene.bodies.items():
            most, node = most_stretched(body, parts[name], self._projectors[name].base_state)
            stretched.append((most, name, node))
        return max(stretched)

    def measured(self, position: float, reached: float) -> float:
        """Factor of the next increment after those to ``position`` and to ``reached``. If both have friction
        with a memory, their error is what one increment in their place changes of the forces; nodes that
        stick keep it."""
        if self._coarse or len(self._earlier) < 2 or int(position) == position:
            return 1.0
        first, middle = self._earlier
        self._earlier = []
        contacts = self._scene.contacts
        if all(not one.friction or slides(middle, self.now, here) for one, here, _ in contacts.each):
            return 1.0
        whole = self._solved(reached, self.now, first)
        if whole is None:
            return 1.0
        work = contacts.weight * np.abs(self.now.shear)
        kept = self.now.sets.stuck & first.sets.stuck
        memory = float(work @ kept) / float(work.sum()) if work.any() else 0.0
        force, other = (contacts.forces(one.traction) for one in (self.now, whole))
        self._largest = max(self._largest, float(np.hypot(*force.T).max()))
        change = float(np.hypot(*(other - force).T).max())
        self.error = memory * self.error + change
        allowed = self._scene.case.solver.increment_error * self._largest
        return float(np.clip(np.sqrt(allowed / change), 0.5, 1.0)) if change else 1.0

    def _solved(
        self,
        position: float,
        start: FiniteContactState | None = None,
        earlier: FiniteContactState | None = None,
    ) -> FiniteContactState | None:
        """The state at a ``position``, searched from ``start`` or the present one, after ``earlier``."""
        begin, tolerance, found = earlier or self.now, self._scene.case.solver.tolerance, None
        if self._coarse:
            tolerance = max(tolerance, COARSE_TOLERANCE)
        args = (start or self.now, factors_at(self._scene.stages, position), tolerance, MAX_ITERATIONS)
        before, most = begin.place if self._settled else None, MAX_ITERATIONS
        with np.errstate(all="ignore"), suppress(np.linalg.LinAlgError, NumericalError):
            found = self._system.solved(*args, before, begin.sets.closed)
        self.spent += found.factorizations if found else most * len(self._projectors)
        self._iterations += found.iterations if found else most
        self._solves += found.solves if found else 0
        return found

    @property
    def _system(self) -> ExactContact:
        args = (self._scene.contacts, self._length, self._stiffness, self._missing)
        return ExactContact(dict(self._projectors), *args)

    def _failed(self, position: float, found: FiniteContactState | None) -> NoReturn:
        """Raise the error of an increment that fails, ``found`` but too long or not."""
        where = f"the path stopped at position {position:.6g}"
        if found is not None:
            most, name, node = self._stretched(found)
            if most > MAX_STRETCH:
                there = place_of(self._scene, name, node)
                hint = "use finer nodes there, round corners that are crushed, or use smaller loads"
                message = f"{where}: {there} would be stretched by a factor of {most:.3g} at once"
                raise NumericalError(message, hint)
        hint = "use finer nodes where bodies touch, smaller loads, or raise solver.tolerance"
        raise NumericalError(f"{where}: the contact iterations of an increment do not converge", hint)

    def finished(self, state: State, length: float, saved: tuple[State, ...]) -> PathStep:
        """The step that ends in a state. Equations far from their expansion point are renewed."""
        ends = (self._system, self._scene.undeformed, self.now, self._before, state.driven)
        renewed, kept, self._fresh = False, 0.0, frozenset()
        # Work of the tractions on the displacements that would remove the kept residuals.
        moved = {name: one.displaced(one.rest) for name, one in self._projectors.items() if one.rest.any()}
        for side, here in self._scene.contacts.sides:
            if side.body in moved:
                along = (side.onto @ moved[side.body][side.nodes.unknowns]) * state.side_traction[here]
                kept += float(np.repeat(side.weight, 2) @ along)
        for name, (body, own, acting) in self._scene.loaded(state).items():
            base_state = self._projectors[name].base_state
            angle = body.turn(own) - body.turn(base_state)
            if far_from(body, own, base_state):
                base_state, self._fresh = own, self._fresh | {name}
            elif abs(np.exp(1j * angle) - 1.0) > RENEWAL_ANGLE:
                if name in self._scene.upright:
                    base_state = own
                else:
                    nodes, (cos, sin) = body.elastic.model.cloud.points, (np.cos(angle), np.sin(angle))
                    places = nodes + base_state.reshape(-1, 2)
                    base_state = (places @ np.array([[cos, sin], [-sin, cos]]) - nodes).ravel()
            else:
                continue
            self._projectors[name] = self._scene.projector(name, base_state, acting)
            self.spent += 1
            renewed = True
        if renewed:
            self._earlier = []
            # Free motions with the current rotation of the pins.
            free, parts = self.now.free.copy(), self._scene.parts(self.now.displacement)
            for one in self._scene.contacts.loose:
                body = self._projectors[one.body].body
                if body.pins:
                    at_pins = body.single[-body.pins :] @ parts[one.body]
                    free[one.numbers] = np.linalg.solve(one.moves, at_pins)
            self.now = replace(self.now, free=free)
        counts = (length, 0, self._iterations, self.spent, self._solves)
        more: dict[str, Any] = {"renewed": renewed, "kept": kept, "bifurcations": self.bifurcations}
        step = PathStep(state, saved, *counts, **more, missed=partial(missed_in_contact, *ends))
        self.bifurcations = ()
        self.spent = self._iterations = self._solves = 0
        return step

    def state(self, position: float) -> State:
        """The present solution as a state of the path."""
        factors, now = factors_at(self._scene.stages, position), self.now
        contact = (now.pressure, now.gap, now.free, now.status, now.residual, now.shear)
        solver = {key: np.asarray(getattr(now, name)) for name, key in KEPT.items()} | {
            "slip_sign": now.sets.slip_sign,
            "unstable": np.array(now.soft.unstable),
            "increment_error": np.array(self.error / self._largest if self._largest else 0.0),
        }
        return State(position, factors, *contact, self._slip, self._work, now.displacement, solver)


def _status(status: NDArray[np.int8], slip_sign: FloatArray) -> ContactStatus:
    """The status of knots, all of which may have friction, from their ``status`` (c,) as stored."""
    return ContactStatus(status != OPEN, status == STICK, slip_sign)
