"""``mlsanm compare`` at small strain: the regularised law by power series and Newton's method, and the exact
one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mlsanm_cli.app.checks.check import Verdicts, all_of
from mlsanm_cli.app.checks.end import End, pressed_spacings
from mlsanm_cli.app.checks.ended import balance, work
from mlsanm_cli.app.checks.energy import energy_error
from mlsanm_cli.app.checks.quality import announce, factor_notes
from mlsanm_cli.app.checks.references import reference_profile
from mlsanm_cli.app.checks.refinement import set_up
from mlsanm_cli.app.checks.states import STATE
from mlsanm_cli.app.comparison.compare import (
    ACTIVE_SET,
    ANM,
    NEWTON,
    SAME_LAW_FACTOR,
    Changed,
    Comparison,
    Measured,
    States,
    followed,
)
from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.scene.build import build_scene
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.errors import RunError
from mlsanm_cli.solve.fields import fields_of
from mlsanm_cli.solve.paths import load_path
from mlsanm_cli.solve.state import PathStep

CONDENSED_PHASES = ("factorization", "condensation")
"""Set-up phases of the method on the condensed system."""
ETA_FACTOR, STICK_FACTOR = 6.0, 10.0
"""Largest differences of pressures and tractions due to the regularised law, over the root of eta and over
``stick``: it smooths the pressure at the edge of a contact by up to 4.3 times the root of eta."""
SOFTER, CONVERGENCE_RATIO = 10.0, 0.75
"""At corners pressures are unbounded, and these limits do not apply to the largest. The regularised law also
agrees with the exact one if its L2 error is at most this ratio of that with ``SOFTER`` times eta and
stick."""
ETA_FACTORS = (100.0, 10.0)
"""Multiples of the eta of the case at which the regularised methods are also measured for the picture."""
MAX_ETA = 0.1
"""For larger eta the regularised law does not represent contact."""


def chosen_methods(case: Case, asked: Iterable[str]) -> tuple[str, ...]:
    """ANM, the methods ``asked`` for, and that of the case, in the order of the table. ``asked`` may contain
    "newton" and "active-set"."""
    wanted = {ANM, *asked, case.solver.method if case.is_regularized else ACTIVE_SET}
    return tuple(name for name in (ANM, NEWTON, ACTIVE_SET) if name in wanted)


def changes_for(case: Case, name: str, softer: float = 1.0) -> tuple[str, ...]:
    """The changes of a case by which a method solves it, with eta and stick of all contacts multiplied by
    ``softer``."""
    law = "exact" if name == ACTIVE_SET else "hyperbolic"
    changes = [f'contact.{contact.name}.regularization.law="{law}"' for contact in case.touching]
    if softer != 1.0:
        changes += [
            f"contact.{contact.name}.regularization.{key}={softer * getattr(contact.regularization, key)!r}"
            for contact in case.touching
            for key in (("eta", "stick") if contact.friction else ("eta",))
        ]
    if law == "exact":
        changes.append('solver.formulation="condensed"')
    return (*changes, f'solver.method="{name}"')


def other_law_limit(case: Case) -> float:
    """Largest difference between the regularised and the exact law."""
    eta = max(contact.regularization.eta for contact in case.touching)
    stick = max((c.regularization.stick for c in case.touching if c.friction), default=0.0)
    return float(ETA_FACTOR * np.sqrt(eta) + STICK_FACTOR * stick)


class SmallComparison(Comparison):
    """A scene with contact; all methods share the nodal pressures of the regularised law."""

    def __init__(
        self, methods: Sequence[str], context: RunContext, changed: Changed, levels: Sequence[float]
    ) -> None:
        self._changed, self._levels, self._context = changed, f"output.at={list(levels)!r}", context
        self._case = changed().case
        self.methods, self.warnings = chosen_methods(self._case, methods), []
        # Refused before anything is computed.
        cases = [self._changed_case(name) for name in self.methods]
        self._verdicts = Verdicts(lambda check: self.warnings.append(check.text))
        shared = changed(*changes_for(self._case, ANM))
        prepared = build_scene(shared, context)
        announce(shared.case, prepared, context, self._verdicts)
        _, built, *_ = set_up(shared.case, prepared, context, self._verdicts)
        self._built = replace(built, case=cases[0])
        self.sizes = {
            "nodes": sum(len(body.model.cloud.points) for body in built.scene.bodies.values()),
            "contact_unknowns": len(built.condensed.weight) + len(built.condensed.friction_nodes),
            "eta": {contact.name: contact.regularization.eta for contact in self._case.contact},
        }

    def _changed_case(self, name: str, softer: float = 1.0) -> Case:
        return self._changed(self._levels, *changes_for(self._case, name, softer)).case

    @classmethod
    def refuse(cls, case: Case, methods: Sequence[str], analytic: bool) -> None:
        if any(case.material[body.material].flows for body in case.body):
            raise RunError("bodies with a yield stress have one method only", "use mlsanm run")
        if not case.touching:
            raise RunError(
                "the case has no unilateral [[contact]]: it is linear, and all methods are the same",
                "use mlsanm run",
            )
        if analytic and case.reference is None:
            raise RunError("--analytic: the case names no reference", "add [reference] with its solution")
        if len(chosen_methods(case, methods)) == 1 and not analytic:
            raise RunError("no method to compare with ANM", "add --newton, --active-set or --analytic")

    def setup(self, name: str) -> tuple[Sequence[str], tuple[int, int] | None]:
        if name != ACTIVE_SET:
            return super().setup(name)
        counts = len(self._built.scene.bodies), self._built.condensed.solves
        return (*self.phases, *CONDENSED_PHASES), counts

    def measure(self, name: str, repeat: int = 1, softer: float = 1.0) -> Measured:
        case, verdicts = self._changed_case(name, softer), Verdicts(lambda check: None)
        chosen = replace(self._built, case=case)

        def check(step: PathStep) -> None:
            for state in (step.state, *step.saved):
                verdicts.judge(all_of(STATE, chosen, state))

        law = case.touching[0].regularization.law
        return followed(name, law, lambda: load_path(chosen), repeat, check)

    def judge(self, series: Measured) -> None:
        self.warnings += factor_notes(self._built.scene)
        if not series.failure:
            built, last = self._built, series.states[max(series.states)]
            fields, _ = fields_of(built, [last], stress=True)[0]
            end = End(built, None, last, 0.0, energy_error(built, last, fields), {})
            for check in (pressed_spacings, balance, work):
                self._verdicts.judge(check(end))

    def limits(self, tolerance: float | None) -> dict[str, float]:
        same = SAME_LAW_FACTOR * self._built.case.solver.tolerance
        return {
            "same_law": same if tolerance is None else tolerance,
            "other_law": other_law_limit(self._built.case),
        }

    def difference(self, found: States, reference: States) -> dict[str, float]:
        condensed, scene, apart = self._built.condensed, self._built.scene, np.zeros(3)
        peak = largest = 0.0

        def moved(unknowns: tuple[FloatArray, ...]) -> float:
            bodies = [condensed.displacement(scene, name, unknowns) for name in scene.bodies]
            return max(float(np.hypot(*u.T).max()) for u in bodies)

        for position in found.keys() & reference.keys():
            one, other = found[position], reference[position]
            _, _, pressure, traction = change = tuple(
                a - b for a, b in zip(one.unknowns, other.unknowns, strict=True)
            )
            # Displacements are linear in the unknowns.
            sizes = np.abs(pressure).max(initial=0.0), np.abs(traction).max(initial=0.0), moved(change)
            apart = np.maximum(apart, sizes)
            peak = max(peak, float(other.pressure.max(initial=0.0)))
            largest = max(largest, moved(other.unknowns))
        apart /= (peak or 1.0, peak or 1.0, largest or 1.0)
        return dict(zip(("pressure", "traction", "displacement"), apart.tolist(), strict=True))

    def surface_error(self, found: States, exact: States) -> float:
        """Largest L2 norm over all levels of the difference of pressures and tractions from the exact ones,
        relative to the largest norm of these."""
        weight, nodes = self._built.condensed.weight, self._built.condensed.friction_nodes

        def norm(pressure: FloatArray, traction: FloatArray) -> float:
            return float(np.sqrt(weight @ pressure**2 + weight[nodes] @ traction**2))

        worst = max(
            norm(found[at].pressure - state.pressure, found[at].traction - state.traction)
            for at, state in exact.items()
        )
        return worst / max(norm(state.pressure, state.traction) for state in exact.values())

    def convergence(self, row: Measured, against: Measured) -> dict[str, Any]:
        smooth, exact = (against, row) if row.law == "exact" else (row, against)
        softer = self.measure(smooth.name, softer=SOFTER)
        before = self.surface_error(softer.states, exact.states) if not softer.failure else 0.0
        now = self.surface_error(smooth.states, exact.states)
        return {"convergence": (before, now), "agrees": now <= CONVERGENCE_RATIO * before}

    def reference_error(self, row: Measured) -> dict[str, float | None]:
        last, built = row.states[max(row.states)], self._built
        profiles = {one.name: reference_profile(built, one, last) for one in built.condensed.pairings}
        return {name: None if profile is None else profile.error_l2 for name, profile in profiles.items()}

    def curves(self, rows: Sequence[Measured]) -> Mapping[str, Any]:
        self._context.console.phase("following the paths at larger eta, for the picture")
        exact = next((row for row in rows if not row.failure and row.name == ACTIVE_SET), None)
        reference = self.measure(ACTIVE_SET) if exact is None else exact
        if reference.failure:
            self.warnings.append("no picture: the exact law has no state at some level")
            return {"smooth": {}, "exact": None}
        eta = max(contact.regularization.eta for contact in self._case.touching)
        smooth = {}
        for row in (row for row in rows if row.name != ACTIVE_SET):
            factors = [factor for factor in ETA_FACTORS if factor * eta <= MAX_ETA]
            points = [(factor * eta, self.measure(row.name, softer=factor)) for factor in factors]
            smooth[row.name] = [
                {
                    "eta": value,
                    "error": self.surface_error(found.states, reference.states),
                    "seconds": found.seconds,
                    "factorizations": found.factorizations,
                }
                for value, found in (*points, (eta, row))
                if not found.failure
            ]
        cost = exact and {"seconds": exact.seconds, "factorizations": exact.factorizations}
        return {"smooth": smooth, "exact": cost}
