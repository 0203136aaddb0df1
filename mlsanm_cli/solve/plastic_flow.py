"""Equilibrium of bodies that flow, in contact, at given loads.

Unknowns are the eigenstresses s = C e of the plastic strains e at the nodes. They cause displacements through
the elastic factors, and gaps, on which the contact problem gives pressures; both give strains, and the return
map plastic strains again::

    s(strains(s)) - s = 0

by Newton's method. Its equations, I - (C - D) d strains/ds with the consistent tangent D, are known by
products and solved by GMRES: they are the identity wherever nothing flows, and well conditioned elsewhere, as
the elastic response to eigenstresses approximates a projection. Forcing terms are those of Eisenstat and
Walker 1996 (doi:10.1137/0917003, choice 2). Equation (34) of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.complementarity.basis import Ray
from mlsanm_cli.contact.laws.contact_state import ContactState, Linearised, residual
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
from mlsanm_cli.operators.linear.krylov import gmres
from mlsanm_cli.operators.system import FUNCTIONAL_TOLERANCE
from mlsanm_cli.records import dataclass
from mlsanm_cli.solve.condensed_scene import CondensedScene

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
    """A state for given eigenstresses ``unknowns`` (u,): contact, and by body ``strain`` and ``stress`` (n,
    4), ``tangent`` (n, 4, 4), ``history`` (n, 5) and ``work`` (n,) of plastic strains so far. ``misfit``
    (u,) is what the return map would change, of equilibrium states 0, in the norm of stresses of ``size``.
    ``updates`` and ``products`` count."""

    factors: FloatArray
    unknowns: FloatArray
    contact: ContactState
    strain: Mapping[str, FloatArray]
    stress: Mapping[str, FloatArray]
    tangent: Mapping[str, FloatArray]
    history: Mapping[str, FloatArray]
    work: Mapping[str, FloatArray]
    misfit: FloatArray
    size: float
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
    responses to each driver and, by the near fields of contacts on grids, to each pressure and traction."""
    condensed, body, model = built.condensed, built.scene.bodies[name], built.scene.bodies[name].model

    def stresses(displacement: FloatArray) -> FloatArray:
        return np.asarray(model.stress(displacement.reshape(-1, 2)).T.ravel())

    solutions = condensed.solutions.get(name)
    if solutions is None:
        solutions = body.system.solve(condensed.sources[name], FUNCTIONAL_TOLERANCE)
    by_drivers = np.stack([stresses(one) for one in solutions.T], axis=1)
    z, by_grids = as_complex(model.cloud.points), dict[str, FloatArray]()
    for pairing in condensed.drivers.on_grids:
        if name not in pairing.bodies:
            continue
        unit = np.eye(len(pairing.grid.hats.place))
        none, total = np.zeros_like(unit), np.zeros((3 * len(z), 2 * len(unit)))
        for slave, sign in pairing.sides_of(name):
            fields = NearFields.at(pairing.grid, model.kernel, slave, z)
            parts = [fields(*pair)[1] for pair in ((unit, none), (none, unit))]
            near = np.concatenate(parts, axis=2).transpose(1, 0, 2)
            total += sign * near.reshape(len(total), -1)
        by_grids[pairing.name] = total

    def stress(now: Condensed, unknowns: Sequence[FloatArray]) -> FloatArray:
        total = by_drivers @ now.drive(unknowns)
        total += stresses(now.inner[name][1])
        for pairing in now.reported:
            if pairing.name in by_grids:
                total += by_grids[pairing.name] @ np.concatenate(now.contact_values(pairing, unknowns))
        return np.asarray(total.reshape(3, -1).T)

    return stress


class PlasticScene:
    """A scene ``built`` with bodies that flow."""

    def __init__(self, built: CondensedScene) -> None:
        self.built, self.laws = built, built.laws
        self.bodies = {name: built.scene.bodies[name] for name in self.laws}
        assert built.condensed.eigen is not None
        self._eigen = built.condensed.eigen
        counts = [3 * len(body.model.cloud.points) for body in self.bodies.values()]
        ends = np.cumsum([0, *counts]).tolist()
        self._places = {n: slice(a, b) for n, a, b in zip(self.bodies, ends[:-1], ends[1:], strict=True)}
        clouds = [body.model.cloud for body in self.bodies.values()]
        self._root = np.sqrt(np.concatenate([np.tile(cloud.areas, 3) for cloud in clouds]))
        self._area = sum(float(cloud.areas.sum()) for cloud in clouds)
        volume, length = sum(float(cloud.volumes.sum()) for cloud in clouds), np.sqrt(self._area)
        levers = [length if one.component == ROTATION else 1.0 for _, one in built.scene.unknown_motions]
        self._sections = volume / length * np.array(levers)
        known = built.condensed
        gap, slip, balance = (one.shifted(-one.constant) for one in (known.gap, known.slip, known.balance))
        self._linear = replace(known, gap=gap, slip=slip, balance=balance)
        self._elastic = {name: _elastic_stress(built, name) for name in self.bodies}

    def unloaded(self) -> Flow:
        """The state without loads, strains and contact pressures."""
        factors, condensed = self.built.stages[0], self.built.condensed
        count = {name: len(body.model.cloud.points) for name, body in self.bodies.items()}
        none = {name: np.zeros((n, 4)) for name, n in count.items()}
        work = {name: np.zeros(n) for name, n in count.items()}
        history = {name: np.zeros((n, HISTORY)) for name, n in count.items()}
        start, contact = np.zeros(len(self._root)), unloaded(condensed, factors)
        return Flow(factors, start, contact, none, none, {}, history, work, np.zeros(0), 0.0)

    def advanced(self, before: Flow, factors: FloatArray, first: FloatArray | None = None) -> Flow:
        """The state after an increment to load ``factors`` (L,), searched from eigenstresses ``first`` (u,).
        Raises FlowError."""
        tolerance = self.built.case.solver.tolerance
        now = self._trial(before, factors, before.unknowns if first is None else first, before.contact)
        forcing, products, seen = LARGEST_FORCING, 0, [float(np.linalg.norm(now.misfit))]
        for updates in range(MOST_UPDATES + 1):
            if now.error <= tolerance:
                return replace(now, updates=updates, products=products)
            try:
                linear = Linearised(self.built.condensed, now.contact.status)
            except Ray as error:
                raise FlowError("the contact slides as a whole while bodies flow") from error
            change, count = gmres(partial(self._product, now, linear), now.misfit, forcing)
            products += count
            most, part = max(seen[-MEMORY:]), 1.0
            trial = self._trial(before, factors, now.unknowns + change / self._root, now.contact)
            while float(np.linalg.norm(trial.misfit)) > (1.0 - DECREASE * part) * most:
                part *= 0.5
                if part < LEAST_STEP:
                    raise FlowError("plastic strains do not settle")
                trial = self._trial(before, factors, now.unknowns + part * change / self._root, now.contact)
            now = trial
            seen.append(float(np.linalg.norm(now.misfit)))
            rate = seen[-1] / seen[-2]
            safe = FORCING * forcing**2
            forcing = min(LARGEST_FORCING, max(FORCING * rate**2, safe if safe > LARGEST_FORCING else 0.0))
            forcing = max(forcing, 0.5 * tolerance / max(now.error, tolerance))
        raise FlowError(f"plastic strains have not settled after {MOST_UPDATES} updates")

    def _trial(self, before: Flow, factors: FloatArray, unknowns: FloatArray, guess: ContactState) -> Flow:
        """The state for eigenstresses ``unknowns`` (u,), with the contact set searched from a ``guess``."""
        scene, stresses = self.built.scene, self._split(unknowns)
        condensed = self._eigen.within(self.built.condensed, stresses)
        contact = increment(condensed, before.contact, factors, guess=guess.status)
        if contact is None:
            raise FlowError("no contact state balances the loads")
        strain, stress, tangent, history, work, misfits = {}, {}, {}, {}, {}, []
        size = 0.0
        for name, body in self.bodies.items():
            law, model = self.laws[name], body.model
            elastic = self._elastic[name](condensed, contact.unknowns)
            whole = np.zeros((len(elastic), 4))
            whole[:, PLANE] = np.linalg.solve(model.material.stiffness, elastic.T).T
            degrees = scene.degrees(name, factors)
            strain[name] = whole - degrees[:, None] * model.material.free_expansion[[0, 1, 3, 2]]
            stress[name], tangent[name], history[name] = law.update(strain[name], before.history[name])
            flowed = history[name][:, :4] - before.history[name][:, :4]
            mean = 0.5 * (stress[name] + before.stress[name])
            work[name] = before.work[name] + (mean * flowed).sum(axis=1)
            misfits.append((plastic_stress(law.linear, history[name]) - stresses[name]).T.ravel())
            size += float(model.cloud.areas @ (elastic**2).sum(axis=1))
        misfit = self._root * np.concatenate(misfits)
        size = float(np.sqrt(size + np.sum((self._root * unknowns) ** 2)))
        return Flow(factors, unknowns, contact, strain, stress, tangent, history, work, misfit, size)

    def residual(self, now: Flow) -> float:
        """The largest residual of a state: of its plastic strains, and of contacts and balances, relative to
        the root mean square of stresses and their forces and moments on sections as long as the root of the
        area."""
        stresses = self._split(now.unknowns)
        stress = now.size / np.sqrt(self._area)
        condensed = self._eigen.within(self.built.condensed, stresses)
        return max(now.error, residual(condensed, now.contact, stress, stress * self._sections))

    def growth(self, now: Flow, change: FloatArray) -> float:
        """Strains per change of load factors (L,) over those of elastic bodies; unbounded at a limit load."""
        linear, none = Linearised(self.built.condensed, now.contact.status), np.zeros(len(now.unknowns))
        elastic, flowed = self._response(now, linear, none, change)
        unknowns = gmres(partial(self._product, now, linear), self._root * flowed, LARGEST_FORCING)[0]
        plastic = self._response(now, linear, unknowns / self._root, change)[0]
        return self.size(plastic) / (self.size(elastic) or 1.0)

    def size(self, strain: Mapping[str, FloatArray]) -> float:
        """Norm of strains (n, ...) of all bodies that flow, integrated over these."""
        squares = (self.bodies[name].model.cloud.areas @ (one**2).sum(axis=1) for name, one in strain.items())
        return float(np.sqrt(sum(squares)))

    def spatial_error(self, now: Flow) -> float:
        """Norm of the error of the displacements of a state by the spacings: the defect in equations of the
        next degree (:mod:`mlsanm_cli.mechanics.defect`) through the tangent. With fits B+ of that degree
        stresses change by D (B+ - B) u. Raises NumericalError if the cloud is too small for these."""
        scene, stresses = self.built.scene, self._split(now.unknowns)
        condensed = self._eigen.within(self.built.condensed, stresses)
        defect, more = np.zeros(len(now.unknowns)), {}
        for name, body in self.bodies.items():
            model, better = body.model, self._better[name]
            moved = condensed.solution(scene, name, now.contact.unknowns)[0].reshape(-1, 2)
            less = stress_of(model.stencils.derivatives(moved) - better.at_nodes(moved), np.eye(3))
            tangent = now.tangent[name][:, PLANE][:, :, PLANE]
            defect[self._places[name]] = np.einsum("nij,nj->ni", tangent, less).T.ravel()
            stress = model.stress(moved) - stresses[name]
            lost = model.stress_divergence(stress) - divergence_of_stress(better.at_nodes(stress))
            more[name] = np.zeros(body.rows)
            more[name][: lost.size] = lost.T.ravel()
        linear, none = Linearised(self.built.condensed, now.contact.status), np.zeros(len(now.factors))
        flowed = self._response(now, linear, defect, none, more)[1]
        change = gmres(partial(self._product, now, linear), self._root * flowed, LARGEST_FORCING)[0]
        condensed, found = self._linearly(linear, defect + change / self._root, none, more)
        solved = {name: condensed.solution(scene, name, found.unknowns)[0] for name in self.bodies}
        return self.size({name: one.reshape(-1, 2) for name, one in solved.items()})

    @cached_property
    def _better(self) -> dict[str, NextDegree]:
        return {name: NextDegree(body.model) for name, body in self.bodies.items()}

    def _product(self, now: Flow, linear: Linearised, vector: FloatArray) -> FloatArray:
        """The equations (u,) of a state applied to a change, both weighted by the areas."""
        none = np.zeros(len(now.factors))
        flowed = self._response(now, linear, vector / self._root, none)[1]
        return np.asarray(vector - self._root * flowed)

    def _linearly(
        self,
        linear: Linearised,
        unknowns: FloatArray,
        factors: FloatArray,
        more: Mapping[str, FloatArray] = NOTHING,
    ) -> tuple[Condensed, ContactState]:
        """The scene without initial gaps under eigenstresses ``unknowns`` (u,) and ``more`` right-hand sides
        (r,), and the response of the contacts to both and to load ``factors`` (L,)."""
        condensed = self._eigen.within(self._linear, self._split(unknowns), quick=True, more=more)
        rows = condensed.unscaled_rows(factors)
        m, n = len(condensed.gap.constant), len(condensed.slip.constant)
        response = linear.response(rows[:m], rows[m : m + n], rows[m + n :])
        return condensed, replace(response, factors=factors)

    def _response(
        self,
        now: Flow,
        linear: Linearised,
        unknowns: FloatArray,
        factors: FloatArray,
        more: Mapping[str, FloatArray] = NOTHING,
    ) -> tuple[dict[str, FloatArray], FloatArray]:
        """Changes of strains (n, 3) by body by those of eigenstresses ``unknowns`` (u,), load ``factors``
        (L,) and ``more`` right-hand sides (r,), and the eigenstresses (u,) that the return map adds."""
        condensed, found = self._linearly(linear, unknowns, factors, more)
        strains, parts = dict[str, FloatArray](), list[FloatArray]()
        for name, body in self.bodies.items():
            model, tangent = body.model, now.tangent[name][:, PLANE][:, :, PLANE]
            elastic = self._elastic[name](condensed, found.unknowns)
            strain = np.asarray(elastic @ np.linalg.inv(model.material.stiffness), dtype=np.float64)
            strains[name] = strain
            parts.append((elastic - np.einsum("nij,nj->ni", tangent, strain)).T.ravel())
        return strains, np.asarray(np.concatenate(parts))

    def _split(self, unknowns: FloatArray) -> dict[str, FloatArray]:
        """Eigenstresses (n, 3) by body."""
        return {name: unknowns[place].reshape(3, -1).T for name, place in self._places.items()}
