"""A scene whose path several methods follow, and the measurement of each: states at the levels, work, or
failure."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from statistics import median
from typing import Any, ClassVar

from mlsanm_cli.app.context import RunContext
from mlsanm_cli.case import Case, LoadedCase
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.records import dataclass
from mlsanm_cli.solve.state import PathStep, State

ANM, NEWTON, ACTIVE_SET = "anm", "newton", "active-set"
SAME_LAW_FACTOR = 100.0
"""Largest difference of methods with the same law over ``solver.tolerance``; that of published cases is 4.4,
of pressures next to the corner of a block 12."""

Changed = Callable[..., LoadedCase]
"""Returns the case with further changes, as by ``--set``."""
States = Mapping[float, State]
"""States by position."""


@dataclass
class Measured:
    """``states`` by position, as far as the path was followed by the method ``name``, and the counts of the
    whole path. ``seconds`` is the median CPU time of the path; ``failure`` and ``hint`` are empty if it was
    completed."""

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

    @property
    def done(self) -> bool:
        """Whether the path was completed."""
        return not self.failure


class Comparison(ABC):
    """A scene set up for several ``methods``, ANM first, with states saved at the ``levels``; ``changed``
    returns its case with changes."""

    methods: Sequence[str]
    warnings: list[str]
    phases: ClassVar[tuple[str, ...]] = ("cloud", "operators")
    """Set-up phases of all methods."""

    @abstractmethod
    def __init__(
        self, methods: Sequence[str], context: RunContext, changed: Changed, levels: Sequence[float]
    ) -> None: ...

    @classmethod
    @abstractmethod
    def refuse(cls, case: Case, methods: Sequence[str], analytic: bool) -> None:
        """Raises RunError for methods that are not available, and if there is nothing to compare."""

    @abstractmethod
    def measure(self, name: str, repeat: int = 1) -> Measured:
        """Follows the path by a method ``repeat`` times."""

    @abstractmethod
    def difference(self, found: States, reference: States) -> dict[str, float]:
        """Largest relative differences of pressures, tractions and displacements at common levels."""

    @abstractmethod
    def limits(self, tolerance: float | None) -> dict[str, float]:
        """The largest differences, first that of methods with the same law."""

    @property
    @abstractmethod
    def sizes(self) -> dict[str, Any]:
        """Numbers of nodes and unknowns."""

    def setup(self, name: str) -> tuple[Sequence[str], tuple[int, int] | None]:
        """The phases in which a method is set up, and the sparse factorisations and solutions before a path
        on the condensed system, None for other paths."""
        return self.phases, None

    def judge(self, series: Measured) -> None:
        """Checks the last state of ANM."""
        return

    def convergence(self, row: Measured, against: Measured) -> dict[str, Any]:
        """Whether two laws that differ by more than the limit agree in the limit."""
        return {}

    def reference_error(self, row: Measured) -> dict[str, float | None]:
        """Error of the pressure of every contact against the closed formula."""
        return {}

    def curves(self, rows: Sequence[Measured]) -> Mapping[str, Any]:
        """Work-precision curves; empty if there are none."""
        return {}


def followed(
    name: str,
    law: str,
    path: Callable[[], Iterator[PathStep]],
    repeat: int,
    check: Callable[[PathStep], None],
) -> Measured:
    """Follows a ``path`` ``repeat`` times; ``check`` is called with every step, and may raise
    NumericalError."""
    runs = [_once(Measured(name, law), path(), check) for _ in range(repeat)]
    return replace(runs[0], seconds=median(run.seconds for run in runs))


def _once(found: Measured, path: Iterator[PathStep], check: Callable[[PathStep], None]) -> Measured:
    # The first state, at the start of the path, is not a step.
    steps = -1
    try:
        while True:
            begun = time.process_time()
            try:
                step = next(path, None)
            finally:
                found.seconds += time.process_time() - begun
            if step is None:
                break
            steps += 1
            found.iterations += step.iterations
            found.factorizations += step.factorizations
            found.solves += step.solves
            check(step)
            for state in step.saved:
                found.states.setdefault(state.position, state)
    except NumericalError as error:
        found.failure, found.hint = error.message, error.hint
    found.steps = max(steps, 0)
    return found
