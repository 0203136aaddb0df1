"""The methods of ``mlsanm compare`` on one scene: at small strain the regularised law by power series and by
Newton's method, and the exact law; of a body at finite strain power series and Newton's method."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from itertools import pairwise
from statistics import median
from typing import Any

import numpy as np

from mlsanm_cli.app.analysis.finite_strain import FiniteStrain
from mlsanm_cli.app.analysis.small_strain import SmallStrain
from mlsanm_cli.app.checks.check import Verdicts
from mlsanm_cli.app.checks.end import End, pressed_spacings
from mlsanm_cli.app.checks.energy import balance, energy_error, work
from mlsanm_cli.app.checks.references import reference_profile
from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.finite.path import finite_path
from mlsanm_cli.app.run import analysis_of
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, LoadedCase
from mlsanm_cli.errors import NumericalError, RunError
from mlsanm_cli.records import dataclass
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.fields import fields_of
from mlsanm_cli.solve.state import PathStep, State

ANM, NEWTON, ACTIVE_SET = "anm", "newton", "active-set"
SAME_LAW_FACTOR = 100.0
"""Largest difference of methods with the same law over ``solver.tolerance``; that of published cases is 4.4,
of pressures next to the corner of a block 12."""
OTHER_EQUATIONS_LIMIT = 1e-2
"""Largest difference, relative to the largest displacement, if Newton's method could not use the equations of
the power series and renewed them in other states: a part of the discretisation error."""
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

Changed = Callable[..., LoadedCase]
"""Returns the case with further changes, as by ``--set``."""
States = Mapping[float, State]
"""States by position."""


@dataclass
class Measured:
    """``states`` by position, as far as the method ``name`` followed the path, and its counts. ``seconds`` is
    the median CPU time; ``failure`` is empty if the path was completed."""

    name: str
    law: str
    states: dict[float, State] = field(default_factory=dict)
    steps: int = 0
    iterations: int = 0
    factorizations: int = 0
    solves: int = 0
    seconds: float = 0.0
    failure: str = ""
    hint: str = ""


def followed(
    name: str,
    law: str,
    path: Callable[[], Iterator[PathStep]],
    repeat: int,
    check: Callable[[PathStep], None],
) -> Measured:
    """Follows a ``path`` ``repeat`` times; ``check`` is called with every step, may raise NumericalError."""
    runs = [Measured(name, law) for _ in range(repeat)]
    for found in runs:
        steps, count = path(), 0
        try:
            while True:
                begun = time.process_time()
                try:
                    step = next(steps, None)
                finally:
                    found.seconds += time.process_time() - begun
                if step is None:
                    break
                # The first state, at the start of the path, is not a step.
                found.steps, count = count, count + 1
                found.iterations += step.iterations
                found.factorizations += step.factorizations
                found.solves += step.solves
                check(step)
                for state in step.saved:
                    found.states.setdefault(state.position, state)
        except NumericalError as error:
            found.failure, found.hint = error.message, error.hint
    return replace(runs[0], seconds=median(run.seconds for run in runs))


def chosen_methods(case: Case, asked: Iterable[str]) -> tuple[str, ...]:
    """ANM, the methods ``asked`` for, and at small strain that of the case, in the order of the table.
    ``asked`` may contain "newton" and "active-set"."""
    wanted = {ANM, *asked}
    if case.model.strain == "small":
        wanted.add(case.solver.method if case.is_regularized else ACTIVE_SET)
    return tuple(name for name in (ANM, NEWTON, ACTIVE_SET) if name in wanted)


def refuse(case: Case, asked: Sequence[str], analytic: bool) -> None:
    """Raises RunError for methods that are not available, and if there is nothing to compare."""
    finite, small = case.model.strain == "finite", case.model.strain == "small"
    other = next((name for name in asked if name != NEWTON), None)
    for wrong, message, hint in (
        (
            finite and (case.contact or len(case.body) > 1),
            "finite strain with contact or several bodies has a single method: there is nothing to compare",
            "",
        ),
        (finite and other, f"--{other}: finite strain has power series and Newton's method only", "--newton"),
        (finite and analytic, "--analytic: there is no closed formula for finite strain", "--newton"),
        (finite and not asked, "nothing to compare ANM with", "add --newton"),
        (
            any(case.material[body.material].flows for body in case.body),
            "bodies with a yield stress have one method only",
            "use mlsanm run",
        ),
        (
            small and not case.touching,
            "the case has no unilateral [[contact]]: it is linear, and all methods are the same",
            "use mlsanm run",
        ),
        (
            analytic and case.reference is None,
            "--analytic: the case names no reference",
            "add [reference] with its solution",
        ),
        (
            len(chosen_methods(case, asked)) == 1 and not analytic,
            "no method to compare with ANM",
            "add --newton, --active-set or --analytic",
        ),
    ):
        if wrong:
            raise RunError(message, hint)


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


class Comparison:
    """A scene set up once for several ``methods``, ANM first, with states saved at the ``levels``; at small
    strain all share the nodal pressures of the regularised law. ``changed`` returns its case with changes.
    Methods at finite strain renew their equations in the same states."""

    def __init__(
        self, asked: Sequence[str], context: RunContext, changed: Changed, levels: Sequence[float]
    ) -> None:
        self._changed, self._levels, self._context = changed, f"output.at={list(levels)!r}", context
        self.case, self.warnings = changed().case, list[str]()
        self.methods = chosen_methods(self.case, asked)
        # Refused before anything is computed.
        cases = [self._changed_case(name) for name in self.methods]
        self._verdicts = Verdicts(lambda check: self.warnings.append(check.text))
        analysis = analysis_of(changed(*changes_for(self.case, ANM)), context)
        analysis.set_up(self._verdicts)
        self._analysis = analysis.with_case(cases[0])
        self._renewals: dict[str, tuple[State, ...]] = {}

    def _changed_case(self, name: str, softer: float = 1.0) -> Case:
        return self._changed(self._levels, *changes_for(self.case, name, softer)).case

    @property
    def _built(self) -> CondensedScene:
        assert isinstance(self._analysis, SmallStrain)
        return self._analysis.built

    @property
    def sizes(self) -> Mapping[str, Any]:
        """Numbers of nodes and unknowns, and eta by contact."""
        sizes = self._analysis.sizes({})
        eta = {contact.name: contact.regularization.eta for contact in self.case.contact}
        return {name: sizes[name] for name in ("nodes", "contact_unknowns")} | ({"eta": eta} if eta else {})

    @property
    def condensed(self) -> tuple[int, int]:
        """Sparse factorisations and solutions before a path on the condensed system."""
        return len(self._built.scene.bodies), self._built.condensed.solves

    def measure(self, name: str, repeat: int = 1, softer: float = 1.0) -> Measured:
        """Follows the path by a method ``repeat`` times."""
        case, steps = self._changed_case(name, softer), list[PathStep]()
        verdicts = Verdicts(lambda check: None)
        analysis = self._analysis.with_case(case)

        def path() -> Iterator[PathStep]:
            steps.clear()
            if isinstance(analysis, FiniteStrain):
                return finite_path(analysis.built, renewals=self._renewals.get(ANM))
            return analysis.path()

        def check(step: PathStep) -> None:
            steps.append(step)
            for state in (step.state, *step.saved):
                verdicts.judge(analysis.checks(state))

        law = case.touching[0].regularization.law if case.touching else "finite strain"
        found = followed(name, law, path, repeat, check)
        # Equations have been renewed where those of the next step have another base.
        bases = [step.checkpoint.history.get("base_state", ()) for step in steps if step.checkpoint]
        pairs = zip(steps, pairwise(bases), strict=False)
        self._renewals[name] = tuple(step.state for step, ends in pairs if not np.array_equal(*ends))
        return found

    def judge(self, series: Measured) -> None:
        """Checks the last state of ANM."""
        self.warnings += self._analysis.notes
        if self.case.touching and not series.failure:
            built, last = self._built, series.states[max(series.states)]
            fields, _ = fields_of(built, [last], stress=True)[0]
            end = End(built, None, last, 0.0, energy_error(built, last, fields), {})
            for check in (pressed_spacings, balance, work):
                self._verdicts.judge(check(end))

    def limits(self, tolerance: float | None) -> dict[str, float]:
        """The largest differences, first that of methods with the same law."""
        same = SAME_LAW_FACTOR * self._analysis.case.solver.tolerance if tolerance is None else tolerance
        if self.case.touching:
            return {"same_law": same, "other_law": other_law_limit(self._analysis.case)}
        if tolerance is None and len(self._renewals[NEWTON]) != len(self._renewals[ANM]):
            same = OTHER_EQUATIONS_LIMIT
        return {"displacement": same}

    def difference(self, found: States, reference: States) -> dict[str, float]:
        """Largest relative differences of pressures, tractions and displacements at common levels."""
        apart, peak, largest = np.zeros(3), 0.0, 0.0

        def size(values: FloatArray) -> float:
            return float(np.abs(values).max(initial=0.0))

        for position in found.keys() & reference.keys():
            one, other = found[position], reference[position]
            moved, reached = (self._analysis.displacement(state) for state in (one, other))
            changes = one.pressure - other.pressure, one.traction - other.traction
            apart = np.maximum(apart, [*map(size, changes), size(np.hypot(*(moved - reached).T))])
            peak = max(peak, float(other.pressure.max(initial=0.0)))
            largest = max(largest, size(np.hypot(*reached.T)))
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
        """Whether two laws that differ by more than the limit agree in the limit."""
        smooth, exact = (against, row) if row.law == "exact" else (row, against)
        softer = self.measure(smooth.name, softer=SOFTER)
        before = self.surface_error(softer.states, exact.states) if not softer.failure else 0.0
        now = self.surface_error(smooth.states, exact.states)
        return {"convergence": (before, now), "agrees": now <= CONVERGENCE_RATIO * before}

    def reference_error(self, row: Measured) -> dict[str, float | None]:
        """Error of the pressure of every contact against the closed formula."""
        last, built = row.states[max(row.states)], self._built
        profiles = {one.name: reference_profile(built, one, last) for one in built.condensed.pairings}
        return {name: None if profile is None else profile.error_l2 for name, profile in profiles.items()}

    def curves(self, rows: Sequence[Measured]) -> Mapping[str, Any]:
        """Work-precision curves; empty if there are none."""
        if not self.case.touching:
            return {}
        self._context.console.phase("following the paths at larger eta, for the picture")
        exact = next((row for row in rows if not row.failure and row.name == ACTIVE_SET), None)
        reference = self.measure(ACTIVE_SET) if exact is None else exact
        if reference.failure:
            self.warnings.append("no picture: the exact law has no state at some level")
            return {"smooth": {}, "exact": None}
        eta = max(contact.regularization.eta for contact in self.case.touching)
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
