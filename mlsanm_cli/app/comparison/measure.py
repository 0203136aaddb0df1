"""Measurement of one method on a condensed scene: states at the levels, work, or failure."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from statistics import median

from mlsanm_cli.app.assessment.checks import check_state
from mlsanm_cli.app.comparison.methods import Method, law_of
from mlsanm_cli.case import Case
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.paths import load_path
from mlsanm_cli.solve.state import State


@dataclass(frozen=True)
class Measured:
    """``states`` by position, as far as the path was followed, and the counts of the whole path.

    ``seconds`` is the median CPU time of the path; ``failure`` and ``hint`` are empty if it was completed.
    """

    method: Method
    law: str
    states: Mapping[float, State]
    steps: int
    iterations: int
    factorizations: int
    solves: int
    seconds: float
    failure: str = ""
    hint: str = ""

    @property
    def done(self) -> bool:
        """Whether the path was completed."""
        return not self.failure


def measure(built: CondensedScene, method: Method, case: Case, repeat: int = 1) -> Measured:
    """Follows the path of ``built`` with the settings of ``case``, ``repeat`` times, with states saved at its
    ``output.at``."""
    runs = [_once(replace(built, case=case), method) for _ in range(repeat)]
    return replace(runs[0], seconds=median(run.seconds for run in runs))


def _once(built: CondensedScene, method: Method) -> Measured:
    states: dict[float, State] = {}
    # The first state, at the start of the path, is not a step.
    steps, iterations, factorizations, solves, seconds = -1, 0, 0, 0, 0.0
    failure = hint = ""
    path = load_path(built)
    try:
        while True:
            begun = time.process_time()
            try:
                step = next(path, None)
            finally:
                seconds += time.process_time() - begun
            if step is None:
                break
            steps += 1
            iterations += step.iterations
            factorizations += step.factorizations
            solves += step.solves
            for state in (step.state, *step.saved):
                check_state(built, state)
            states |= {state.position: state for state in step.saved}
    except NumericalError as error:
        failure, hint = error.message, error.hint
    law = law_of(built.case)
    return Measured(
        method, law, states, max(steps, 0), iterations, factorizations, solves, seconds, failure, hint
    )
