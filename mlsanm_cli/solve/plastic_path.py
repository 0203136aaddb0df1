"""Path of scenes with bodies that flow, in contact.

Unknowns are the eigenstresses s = C e of the plastic strains e at the nodes. They cause displacements through
the elastic factors, and gaps, on which the contact problem gives pressures; both give strains, and the return
map plastic strains again::

    s(strains(s)) - s = 0

by Newton's method. Its equations, I - (C - D) d strains/ds with the consistent tangent D, are known by
products and solved by GMRES: they are the identity wherever nothing flows, and well conditioned elsewhere, as
the elastic response to eigenstresses approximates a projection. Forcing terms are those of Eisenstat and
Walker 1996 (doi:10.1137/0917003, choice 2). Equation (34) of docs/method.md.

Every increment is computed at once and in two halves, which are kept. The difference of the strains is the
error of the halves, as the return map is of first order; its norm is at most ``solver.increment_error`` of
the largest one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import Any

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import finer_nodes
from mlsanm_cli.contact.complementarity.basis import Basis, Ray
from mlsanm_cli.contact.laws.contact_state import ContactState, residual, response
from mlsanm_cli.contact.laws.coulomb import increment, unloaded
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.contact_fields import NearFields
from mlsanm_cli.contact.response.eigenstress import NOTHING
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.defect import NextDegree
from mlsanm_cli.mechanics.elasticity import divergence_of_stress, stress_of
from mlsanm_cli.mechanics.laws.von_mises import HISTORY, plastic_stress
from mlsanm_cli.mechanics.near_field import as_complex
from mlsanm_cli.mechanics.rigid import ROTATION
from mlsanm_cli.operators.system import FUNCTIONAL_TOLERANCE, gmres
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import FINE_ROUND_OFF
from mlsanm_cli.solve.condensed_scene import CondensedScene, factors_at
from mlsanm_cli.solve.state import Checkpoint, PathStep, State

GROWTH = 2.0
"""Largest growth of increments."""
LEAST_INCREMENT = 2.0**-10
"""Part of a stage within which a limit load is enclosed."""
COLLAPSE = 10.0
"""Growth of strains over that of elastic bodies at the end of a path that counts as collapse."""
KEPT = {"stress": (4,), "history": (HISTORY,), "work": ()}
"""Quantities that continue a path, by body, and their shapes at a node."""
PLANE = [0, 1, 3]
"""Strains and stresses in the plane among xx, yy, zz, xy."""
MOST_UPDATES, LEAST_STEP = 20, 2.0**-6
"""Newton steps, and the shortest part of one, before a smaller increment is tried."""
DECREASE = 1e-4
"""Least decrease of the residual per step (Dennis and Schnabel 1996, doi:10.1137/1.9781611971200)."""
MEMORY = 10
"""Residuals of earlier steps of which none may be exceeded (Grippo, Lampariello and Lucidi 1986,
doi:10.1137/0723046): where nodes begin or cease to flow single steps increase the residual."""
FORCING, LARGEST_FORCING = 0.9, 0.1
"""Factor of the forcing terms, and the first one."""


class FlowError(NumericalError):
    """No state has been found at the end of an increment."""


@dataclass(frozen=True, eq=False)
class Flow:
    """A state for given eigenstresses ``unknowns`` (n, 3): contact, and at all nodes of bodies that flow
    ``strain`` and ``stress`` (n, 4), ``history`` (n, 5) and ``work`` (n,) of plastic strains so far, and the
    ``tangent`` (n, 3, 3) in the plane. ``misfit`` (n, 3) is what the return map would change, of equilibrium
    states 0, in the norm of stresses of ``size``. ``updates`` and ``products`` count."""

    unknowns: FloatArray
    contact: ContactState
    strain: FloatArray
    stress: FloatArray
    history: FloatArray
    work: FloatArray
    tangent: FloatArray = field(default_factory=lambda: np.zeros(0))
    misfit: FloatArray = field(default_factory=lambda: np.zeros(0))
    size: float = 0.0
    updates: int = 0
    products: int = 0

    @property
    def error(self) -> float:
        """The misfit relative to the stresses."""
        return float(np.linalg.norm(self.misfit)) / self.size if self.size else 0.0


def _elastic_stress(
    built: CondensedScene, name: str
) -> Callable[[Condensed, Sequence[FloatArray]], FloatArray]:
    """The stress (n, 3) of a body in states f, q, p, t of a scene, also by its eigenstresses: from the
    responses to each driver and the near fields of contacts on grids, kept per pressure and traction."""
    condensed, body, model = built.condensed, built.scene.bodies[name], built.scene.bodies[name].model
    solutions = condensed.solutions.get(name)
    if solutions is None:
        solutions = body.system.solve(condensed.sources[name], FUNCTIONAL_TOLERANCE)
    z, by_grids = as_complex(model.cloud.points), dict[str, FloatArray]()
    for pairing in condensed.drivers.on_grids:
        unit = np.eye(len(pairing.grid.hats.place))
        for slave, sign in pairing.sides_of(name):
            fields = NearFields.at(pairing.grid, model.kernel, slave, z)
            parts = [fields(*pair)[1] for pair in ((unit, 0.0 * unit), (0.0 * unit, unit))]
            near = np.concatenate(parts, axis=2).transpose(1, 0, 2).reshape(3 * len(z), -1)
            by_grids[pairing.name] = by_grids.get(pairing.name, 0.0) + sign * near

    def stress(now: Condensed, unknowns: Sequence[FloatArray]) -> FloatArray:
        moved = solutions @ now.drive(unknowns) + now.inner[name][1]
        total = model.stress(moved.reshape(-1, 2)).T.ravel()
        for pairing in now.reported:
            if pairing.name in by_grids:
                total = total + by_grids[pairing.name] @ np.concatenate(now.contact_values(pairing, unknowns))
        return np.asarray(total.reshape(3, -1).T)

    return stress


class PlasticScene:
    """A scene ``built`` with bodies that flow, whose nodes are ``rows`` (n,) of arrays, by body."""

    def __init__(self, built: CondensedScene) -> None:
        self.built, self.laws = built, built.laws
        self.bodies = {name: built.scene.bodies[name] for name in self.laws}
        clouds = [body.model.cloud for body in self.bodies.values()]
        ends = np.cumsum([0, *(len(cloud.points) for cloud in clouds)]).tolist()
        self.rows = {n: slice(a, b) for n, a, b in zip(self.bodies, ends[:-1], ends[1:], strict=True)}
        self._areas = np.concatenate([cloud.areas for cloud in clouds])
        self._root = np.sqrt(self._areas)[:, None]
        volume, length = sum(float(cloud.volumes.sum()) for cloud in clouds), np.sqrt(self._areas.sum())
        levers = [length if one.component == ROTATION else 1.0 for _, one in built.scene.unknown_motions]
        self._sections = volume / length * np.array(levers)
        known = built.condensed
        gap, slip, balance = (one.shifted(-one.constant) for one in (known.gap, known.slip, known.balance))
        self._linear = replace(known, gap=gap, slip=slip, balance=balance)
        self._elastic = {name: _elastic_stress(built, name) for name in self.bodies}

    def _within(self, condensed: Condensed, unknowns: FloatArray, **more: Any) -> Condensed:
        """A scene under eigenstresses ``unknowns`` (n, 3)."""
        assert condensed.eigen is not None
        stresses = {name: unknowns[rows] for name, rows in self.rows.items()}
        return condensed.eigen.within(condensed, stresses, **more)

    def _stress(self, condensed: Condensed, state: Sequence[FloatArray]) -> FloatArray:
        """The elastic stress (n, 3) of the whole strain in a state f, q, p, t."""
        return np.concatenate([stress(condensed, state) for stress in self._elastic.values()])

    def restored(self, state: State) -> Flow:
        """A state of the path, from which it goes on, or the first one."""
        kept = dict[str, FloatArray]()
        for key, shape in KEPT.items():
            none = {name: np.zeros((rows.stop - rows.start, *shape)) for name, rows in self.rows.items()}
            kept[key] = np.concatenate([state.solver.get(f"{key}.{n}", zero) for n, zero in none.items()])
        stress, history, work = kept.values()
        laws = [(law, self.rows[name]) for name, law in self.laws.items()]
        flowed = np.concatenate([plastic_stress(law.linear, history[rows]) for law, rows in laws])
        strain = np.concatenate([law.elastic_strain(stress[rows]) for law, rows in laws]) + history[:, :4]
        contact = state.contacts(self.built.condensed.friction_nodes)
        return Flow(flowed, contact, strain, stress, history, work)

    def advanced(self, before: Flow, factors: FloatArray, first: FloatArray | None = None) -> Flow:
        """The state at load ``factors`` (L,), searched from eigenstresses ``first``. Raises FlowError."""
        tolerance = self.built.case.solver.tolerance
        now = self._trial(before, factors, before.unknowns if first is None else first, before.contact)
        forcing, products, seen = LARGEST_FORCING, 0, [float(np.linalg.norm(now.misfit))]
        for updates in range(MOST_UPDATES + 1):
            if now.error <= tolerance:
                return replace(now, updates=updates, products=products)
            try:
                linear = Basis(self.built.condensed.problem, now.contact.status)
            except Ray as error:
                raise FlowError("the contact slides as a whole while bodies flow") from error
            change, count = self._settled(now, linear, now.misfit, forcing)
            products += count
            most, part = max(seen[-MEMORY:]), 1.0
            trial = self._trial(before, factors, now.unknowns + change, now.contact)
            while float(np.linalg.norm(trial.misfit)) > (1.0 - DECREASE * part) * most:
                part *= 0.5
                if part < LEAST_STEP:
                    raise FlowError("plastic strains do not settle")
                trial = self._trial(before, factors, now.unknowns + part * change, now.contact)
            now = trial
            seen.append(float(np.linalg.norm(now.misfit)))
            safe = FORCING * forcing**2
            wanted = max(FORCING * (seen[-1] / seen[-2]) ** 2, safe if safe > LARGEST_FORCING else 0.0)
            forcing = min(LARGEST_FORCING, wanted)
            forcing = max(forcing, 0.5 * tolerance / max(now.error, tolerance))
        raise FlowError(f"plastic strains have not settled after {MOST_UPDATES} updates")

    def _trial(self, before: Flow, factors: FloatArray, unknowns: FloatArray, guess: ContactState) -> Flow:
        """The state for eigenstresses ``unknowns`` (n, 3), with the contact set searched from a ``guess``."""
        condensed = self._within(self.built.condensed, unknowns)
        contact = increment(condensed, before.contact, factors, guess=guess.status)
        if contact is None:
            raise FlowError("no contact state balances the loads")
        elastic, parts = self._stress(condensed, contact.unknowns), []
        for name, rows in self.rows.items():
            law, material = self.laws[name], self.bodies[name].model.material
            whole = np.zeros((len(elastic[rows]), 4))
            whole[:, PLANE] = np.linalg.solve(material.stiffness, elastic[rows].T).T
            degrees = self.built.scene.degrees(name, factors)
            strain = whole - degrees[:, None] * material.free_expansion[[0, 1, 3, 2]]
            stress, tangent, history = law.update(strain, before.history[rows])
            flowed = plastic_stress(law.linear, history)
            parts.append((strain, stress, history, tangent[:, PLANE][:, :, PLANE], flowed))
        strain, stress, history, tangent, flowed = map(np.concatenate, zip(*parts, strict=True))
        mean = 0.5 * (stress + before.stress)
        work = before.work + (mean * (history - before.history)[:, :4]).sum(axis=1)
        misfit = self._root * (flowed - unknowns)
        size = float(np.hypot(self.size(elastic), self.size(unknowns)))
        return Flow(unknowns, contact, strain, stress, history, work, tangent, misfit, size)

    def residual(self, now: Flow) -> float:
        """The largest residual of a state: of its plastic strains, and of contacts and balances, relative to
        the root mean square of stresses and their forces and moments on sections as long as the root of the
        area."""
        stress = now.size / float(np.sqrt(self._areas.sum()))
        condensed = self._within(self.built.condensed, now.unknowns)
        return max(now.error, residual(condensed, now.contact, stress, stress * self._sections))

    def growth(self, now: Flow, change: FloatArray) -> float:
        """Strains per change of load factors (L,) over those of elastic bodies; unbounded at a limit load."""
        linear, none = Basis(self.built.condensed.problem, now.contact.status), np.zeros_like(now.unknowns)
        elastic, flowed, *_ = self._response(now, linear, none, change)
        unknowns = self._settled(now, linear, self._root * flowed, LARGEST_FORCING)[0]
        plastic = self._response(now, linear, unknowns, change)[0]
        return self.size(plastic) / (self.size(elastic) or 1.0)

    def size(self, values: FloatArray) -> float:
        """Norm of strains or stresses (n, ...), integrated over the bodies that flow."""
        return float(np.sqrt(self._areas @ (values**2).sum(axis=1)))

    def spatial_error(self, now: Flow) -> float:
        """Norm of the error of the displacements of a state by the spacings: the defect in equations of the
        next degree (:mod:`mlsanm_cli.mechanics.defect`) through the tangent. With fits B+ of that degree
        stresses change by D (B+ - B) u. Raises NumericalError if the cloud is too small for these."""
        scene, condensed = self.built.scene, self._within(self.built.condensed, now.unknowns)
        less, more = list[FloatArray](), dict[str, FloatArray]()
        for name, body in self.bodies.items():
            model, better = body.model, self._better[name]
            moved = condensed.solution(scene, name, now.contact.unknowns)[0].reshape(-1, 2)
            less.append(stress_of(model.stencils.derivatives(moved) - better.at_nodes(moved), np.eye(3)))
            stress = model.stress(moved) - now.unknowns[self.rows[name]]
            lost = model.stress_divergence(stress) - divergence_of_stress(better.at_nodes(stress))
            more[name] = np.zeros(body.rows)
            more[name][: lost.size] = lost.T.ravel()
        defect = np.einsum("nij,nj->ni", now.tangent, np.concatenate(less))
        linear = Basis(self.built.condensed.problem, now.contact.status)
        flowed = self._response(now, linear, defect, more=more)[1]
        change = self._settled(now, linear, self._root * flowed, LARGEST_FORCING)[0]
        *_, condensed, unknowns = self._response(now, linear, defect + change, more=more)
        solved = [condensed.solution(scene, name, unknowns)[0] for name in self.bodies]
        return self.size(np.concatenate(solved).reshape(-1, 2))

    @cached_property
    def _better(self) -> dict[str, NextDegree]:
        return {name: NextDegree(body.model) for name, body in self.bodies.items()}

    def _settled(
        self, now: Flow, linear: Basis, weighted: FloatArray, tolerance: float
    ) -> tuple[FloatArray, int]:
        """The eigenstresses (n, 3) after which the return map adds nothing, if it has added some,
        ``weighted`` (n, 3) by the areas; and the number of products."""

        def product(vector: FloatArray) -> FloatArray:
            values = vector.reshape(-1, 3)
            added = self._response(now, linear, values / self._root)[1]
            return np.asarray((values - self._root * added).ravel())

        found, count = gmres(product, weighted.ravel(), tolerance)
        return found.reshape(-1, 3) / self._root, count

    def _response(
        self,
        now: Flow,
        linear: Basis,
        unknowns: FloatArray,
        factors: FloatArray | None = None,
        more: Mapping[str, FloatArray] = NOTHING,
    ) -> tuple[FloatArray, FloatArray, Condensed, Sequence[FloatArray]]:
        """Changes of strains (n, 3) by those of eigenstresses ``unknowns`` (n, 3), load ``factors`` (L,) and
        ``more`` right-hand sides (r,) by body, the eigenstresses (n, 3) that the return map adds, and the
        scene without initial gaps under all these with its state f, q, p, t."""
        condensed = self._within(self._linear, unknowns, quick=True, more=more)
        factors = np.zeros(len(self.built.stages[0])) if factors is None else factors
        m, n = len(condensed.gap.constant), len(condensed.slip.constant)
        free = np.split(condensed.unscaled_rows(factors), [m, m + n])
        state = replace(response(linear, *free), factors=factors).unknowns
        elastic = self._stress(condensed, state)
        strain = np.zeros_like(elastic)
        for name, rows in self.rows.items():
            strain[rows] = elastic[rows] @ np.linalg.inv(self.bodies[name].model.material.stiffness)
        return strain, elastic - np.einsum("nij,nj->ni", now.tangent, strain), condensed, state


def plastic_path(built: CondensedScene, start: Checkpoint | None = None) -> Iterator[PathStep]:
    """The path, or its part after a checkpoint. Raises NumericalError at a limit load."""
    scene, errors, half = PlasticScene(built), np.zeros(2), 0.0
    if start is None:
        contact = unloaded(built.condensed, built.stages[0])
        first = State.of(contact, built.condensed.friction_nodes, 0.0)
        now, position, length = scene.restored(first), 0.0, 1.0
        yield _step(scene, now, position, 0.0, length, errors)
    else:
        now, position, length = scene.restored(start.state), start.position, start.pace
        errors, half = start.state.solver["errors"], float(start.history["half"][0])
    if half:
        # The second half of an increment.
        position = _rounded(built, position + half)
        now = scene.advanced(now, factors_at(built.stages, position))
        yield _step(scene, now, position, half, length, errors)
    largest, allowed = scene.size(now.strain), built.case.solver.increment_error
    for halt in built.stops:
        while halt - position > FINE_ROUND_OFF:
            wanted = done = min(length, halt - position, built.case.solver.largest_increment)
            whole: Flow | None = None
            while True:
                try:
                    whole = whole or scene.advanced(now, factors_at(built.stages, position + done))
                    middle = scene.advanced(now, factors_at(built.stages, position + 0.5 * done))
                    end = scene.advanced(middle, whole.contact.factors, whole.unknowns)
                except FlowError as failure:
                    whole, done = None, 0.5 * done
                    if done < LEAST_INCREMENT:
                        raise _beyond(built, scene, now, position, failure) from failure
                    continue
                error = scene.size(whole.strain - end.strain)
                if error <= allowed * max(largest, scene.size(end.strain)):
                    break
                whole, done = middle, 0.5 * done
            largest = max(largest, scene.size(middle.strain), scene.size(end.strain))
            # Errors of increments grow with the square of the length.
            most = min(GROWTH, float(np.sqrt(allowed * largest / error))) if error else GROWTH
            length = max(most * done, length if done == wanted else 0.0)
            half, now = 0.5 * done, end
            added, spatial = error / (largest or 1.0), scene.spatial_error(now)
            errors = np.array([errors[0] + added, max(errors[1], spatial)])
            yield _step(scene, middle, position + half, half, length, errors, half)
            position = _rounded(built, position + done)
            yield _step(scene, now, position, half, length, errors)


def _rounded(built: CondensedScene, position: float) -> float:
    """A position, or the requested one that it is up to round-off."""
    return next((halt for halt in built.stops if abs(halt - position) <= FINE_ROUND_OFF), position)


def _beyond(
    built: CondensedScene, scene: PlasticScene, now: Flow, position: float, failure: FlowError
) -> NumericalError:
    """The error of a path that ends at a ``position``: a limit load if strains grow fast, compared with those
    of elastic bodies, and some body does not harden."""
    stage = min(int(position), len(built.stages) - 2)
    change = built.stages[stage + 1] - built.stages[stage]
    loads = zip(built.scene.loads, change, now.contact.factors, strict=True)
    where = ", ".join([f"position {position:.6g}", *(f"{n} = {f:.6g}" for n, moved, f in loads if moved)])
    growth = scene.growth(now, change)
    perfect = [
        f"body {name}" for name, law in built.laws.items() if not law.hardens(now.history[scene.rows[name]])
    ]
    if growth < COLLAPSE or not perfect:
        hint = [finer_nodes(built.case, list(built.laws))]
        hint += [f"give {' and '.join(perfect)} some hardening, 1 % of E"] if perfect else []
        message = f"no equilibrium is found beyond {where}: {failure.message}"
        return FlowError(message, ", or ".join(hint))
    return NumericalError(
        f"collapse: {' and '.join(perfect)} reached the limit load at {where}: strains grow {growth:.3g} "
        "times as fast as elastic ones",
        "prescribe displacements instead of forces to go on, or give the material hardening",
    )


def _step(
    scene: PlasticScene,
    flow: Flow,
    position: float,
    length: float,
    pace: float,
    errors: FloatArray,
    half: float = 0.0,
) -> PathStep:
    """A step that ends at a state, of which another ``half`` follows at once, with ``errors`` (2,) so far:
    the sum of those of the increments, relative, and the largest of displacements by spacings."""
    built, solver = scene.built, {"errors": errors}
    for name, rows in scene.rows.items():
        solver |= {f"{key}.{name}": getattr(flow, key)[rows] for key in KEPT}
    state = State.of(flow.contact, built.condensed.friction_nodes, position, scene.residual(flow), solver)
    checkpoint = Checkpoint(state, {"half": np.array([half])}, pace=pace)
    counts = {"iterations": flow.updates, "solves": flow.products}
    return built.step(state, length=length, checkpoint=checkpoint, **counts)
