"""``mlsanm compare``: several methods on the same scene and operators, by the rules of
docs/methods-compared.md."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from statistics import median
from typing import Any, ClassVar

import numpy as np

from mlsanm_cli.app.checks.references import read_case
from mlsanm_cli.app.context import Clock, Console, RunContext
from mlsanm_cli.app.output.checkpoint import attributes
from mlsanm_cli.case import Case, LoadedCase
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.inputs import results_of
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.files import write_json_atomic
from mlsanm_cli.io.plots.curves import Curve, Panel, Picture, draw
from mlsanm_cli.io.plots.figures import REFERENCE_LINE
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


class Comparison(ABC):
    """A scene set up for several ``methods``, ANM first, with states saved at the ``levels``; ``changed``
    returns its case with changes."""

    methods: Sequence[str]
    warnings: list[str]
    sizes: Mapping[str, Any]
    """Numbers of nodes and unknowns."""
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

    def figures(
        self,
        row: Measured,
        rows: Sequence[Measured],
        clock: Clock,
        analytic: bool,
        limits: Mapping[str, float],
    ) -> dict[str, Any]:
        """One method as in comparison.json, with the seconds of its set-up, and its differences from the
        first of the preceding methods with the same law, else from ANM."""
        setup, condensed = self.setup(row.name)
        own, none = (row.factorizations, row.solves), (0, 0)
        dense, sparse = (none, own) if condensed is None else (own, condensed)
        found: dict[str, Any] = {
            "method": row.name,
            "law": row.law,
            "status": "failed" if row.failure else "done",
            "steps": row.steps,
            "iterations": row.iterations,
            "dense_factorizations": dense[0],
            "sparse_factorizations": sparse[0],
            "dense_solves": dense[1],
            "sparse_solves": sparse[1],
            "seconds_setup": sum(clock.seconds[phase] for phase in setup),
            "seconds_path": row.seconds,
        }
        if row.failure:
            return found | {"reason": row.failure, "hint": row.hint}
        if analytic:
            found["reference_error"] = self.reference_error(row)
        before = [one for one in rows[: rows.index(row)] if not one.failure]
        against = next(iter([*(one for one in before if one.law == row.law), *before]), None)
        if against is None:
            return found
        same = against.law == row.law
        limit = next(iter(limits.values())) if same else limits["other_law"]
        apart = self.difference(row.states, against.states)
        agrees = all(value <= limit for value in apart.values())
        found |= {"against": against.name, "difference": apart, "limit": limit, "agrees": agrees}
        return found if same or agrees else found | self.convergence(row, against)


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


def compare(
    case_path: Path,
    *,
    methods: Sequence[str] = (),
    analytic: bool = False,
    levels: int = 10,
    tolerance: float | None = None,
    repeat: int = 1,
    picture: bool = True,
    overrides: tuple[str, ...] = (),
    out: Path | None = None,
    force: bool = False,
    threads: int = 1,
    console: Console,
    argv: tuple[str, ...] = (),
) -> Mapping[str, Any]:
    """Solves a case by several methods and writes comparison.json and a picture.

    ``methods`` besides ANM; ``analytic``: errors against the reference of the case; ``levels`` per stage at
    which states are compared; ``tolerance``: largest difference between methods with the same law (None: from
    solver.tolerance); ``repeat``: repetitions of each path; ``picture``: whether to draw the diagram.

    Returns the mapping of comparison.json with the ``directory`` added; its ``status`` is "agree", "disagree"
    (or a method other than ANM failed) or "failed" (ANM failed). Raises CaseError or RunError, with nothing
    written, for an invalid case or an unsuitable method, NumericalError for a scene that cannot be set up.
    """
    context = RunContext(Clock(), console)

    def changed(*changes: str) -> LoadedCase:
        return read_case(case_path, (*overrides, *changes))

    loaded, directory = changed(), out or results_of(case_path)
    kind: type[Comparison]
    if loaded.case.model.strain == "small":
        from mlsanm_cli.app.comparison.small_strain import SmallComparison as kind
    else:
        from mlsanm_cli.app.comparison.finite_strain import FiniteComparison as kind
    kind.refuse(loaded.case, methods, analytic)
    run_dir.check_comparison(directory, force)
    # Ends of stages, positions of the case, and even levels; rounded, so that equal ones are one number.
    stages = range(len(loaded.case.stage))
    even = {round(stage + i / levels, 12) for stage in stages for i in range(1, levels + 1)}
    even |= {position for position in loaded.case.output.at if position > 0.0}
    scene = kind(methods, context, changed, sorted(even))
    rows = []
    for name in scene.methods:
        console.phase(f"following the path: {name}")
        rows.append(scene.measure(name, repeat))
    scene.judge(rows[0])
    limits = scene.limits(tolerance)
    table = [scene.figures(row, rows, context.clock, analytic, limits) for row in rows]
    agree = all(row["status"] == "done" and row.get("agrees", True) for row in table)
    result = {
        "case": str(loaded.path),
        "title": loaded.case.title,
        "overrides": list(overrides),
        "status": "failed" if rows[0].failure else "agree" if agree else "disagree",
        "levels": sorted(rows[0].states),
        "limits": limits,
        **scene.sizes,
        "methods": table,
    }
    curves = scene.curves(rows) if picture and not rows[0].failure else {}
    result |= {"precision": curves} if curves else {}
    for warning in scene.warnings:
        console.warning(warning)
    result |= {
        "warnings": scene.warnings,
        "seconds": context.clock.seconds,
        "provenance": attributes(loaded, argv, threads),
    }
    run_dir.prepare_comparison(directory, force)
    if curves.get("smooth"):
        draw_precision(directory, curves)
    write_json_atomic(directory / run_dir.COMPARISON_FILE, result)
    return {**result, "directory": str(directory)}


def draw_precision(directory: Path, curves: Mapping[str, Any]) -> None:
    """Draws errors against CPU seconds and against factorisations, one curve per method, in the directory of
    comparison.json. The cost for the exact law, the reference of the errors, is a vertical line."""
    errors = [point["error"] for points in curves["smooth"].values() for point in points]
    panels = []
    labels = {"seconds": "CPU seconds of the path", "factorizations": "factorisations of tangents"}
    for key, label in labels.items():
        drawn, notes = [], []
        for name, points in curves["smooth"].items():
            cost, error = (np.array([point[part] for point in points]) for part in (key, "error"))
            drawn.append(Curve(cost, error, name))
            if key == "factorizations":
                notes += [(f"eta {one['eta']:.2g}", one[key], one["error"]) for one in points]
        if curves["exact"] and errors:
            cost = np.full(2, curves["exact"][key])
            ends = np.array([min(errors), max(errors)])
            drawn.append(Curve(cost, ends, "active set, exact law", REFERENCE_LINE))
        panels.append(Panel(drawn, label, "pressure, error against the exact law", notes=notes, scale="log"))
    picture = Picture(panels, "", "outside upper center", (8.4, 3.8), beside=True)
    draw(directory / run_dir.picture_name("comparison", "png"), picture)
