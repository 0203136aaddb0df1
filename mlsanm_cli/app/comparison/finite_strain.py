"""``mlsanm compare`` at finite strain: power series and Newton's method, on the same equations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from mlsanm_cli.app.checks.check import Verdicts
from mlsanm_cli.app.comparison.compare import (
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
from mlsanm_cli.app.finite.checks import deformation
from mlsanm_cli.app.finite.path import finite_path
from mlsanm_cli.app.finite.scene import finite_scene
from mlsanm_cli.app.scene.build import build_scene
from mlsanm_cli.case import Case
from mlsanm_cli.errors import RunError
from mlsanm_cli.solve.state import PathStep, State

OTHER_EQUATIONS_LIMIT = 1e-2
"""Largest difference, relative to the largest displacement, if Newton's method could not use the equations of
the power series and renewed them in other states: a part of the discretisation error."""


class FiniteComparison(Comparison):
    """One body without contact: both methods renew their equations in the same states."""

    def __init__(
        self, methods: Sequence[str], context: RunContext, changed: Changed, levels: Sequence[float]
    ) -> None:
        loaded = changed(f"output.at={list(levels)!r}")
        prepared = build_scene(loaded, context)
        self.methods, self.warnings = (ANM, NEWTON), []
        with context.phase("operators"):
            self._scene = finite_scene(loaded.case, prepared)
        self.sizes = {"nodes": self._scene.unknowns // 2, "contact_unknowns": 0}
        self._renewals: dict[str, tuple[State, ...]] = {}

    @classmethod
    def refuse(cls, case: Case, methods: Sequence[str], analytic: bool) -> None:
        other = next((name for name in methods if name != NEWTON), None)
        for wrong, message, hint in (
            (
                case.contact or len(case.body) > 1,
                "finite strain with contact or several bodies has a single method: there is nothing to "
                "compare",
                "",
            ),
            (other, f"--{other}: finite strain has power series and Newton's method only", "--newton"),
            (analytic, "--analytic: there is no closed formula for finite strain", "--newton"),
            (not methods, "nothing to compare ANM with", "add --newton"),
        ):
            if wrong:
                raise RunError(message, hint)

    def measure(self, name: str, repeat: int = 1) -> Measured:
        case = self._scene.case
        solver = case.solver.model_copy(update={"method": name})
        chosen = replace(self._scene, case=case.model_copy(update={"solver": solver}))
        steps, verdicts = list[PathStep](), Verdicts(lambda check: None)

        def take(step: PathStep) -> None:
            steps.append(step)
            verdicts.judge(deformation(chosen, step.state))

        def path() -> Iterator[PathStep]:
            steps.clear()
            return finite_path(chosen, renewals=self._renewals.get(ANM))

        found = followed(name, "finite strain", path, repeat, take)
        # Equations have been renewed where those of the next step have another base.
        bases = [step.checkpoint.history["base_state"] for step in steps if step.checkpoint]
        pairs = zip(steps, pairwise(bases), strict=False)
        self._renewals[name] = tuple(step.state for step, ends in pairs if not np.array_equal(*ends))
        return found

    def limits(self, tolerance: float | None) -> dict[str, float]:
        shared = len(self._renewals[NEWTON]) == len(self._renewals[ANM])
        limit = SAME_LAW_FACTOR * self._scene.case.solver.tolerance if shared else OTHER_EQUATIONS_LIMIT
        return {"displacement": limit if tolerance is None else tolerance}

    def difference(self, found: States, reference: States) -> dict[str, float]:
        shared = found.keys() & reference.keys()
        largest = max((float(np.abs(reference[at].displacement).max()) for at in shared), default=0.0)
        apart = [float(np.abs(found[at].displacement - reference[at].displacement).max()) for at in shared]
        displacement = max(apart, default=0.0) / largest if largest else 0.0
        return {"pressure": 0.0, "traction": 0.0, "displacement": displacement}
