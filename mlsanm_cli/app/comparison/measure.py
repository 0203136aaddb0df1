"""The methods of `mlsanm compare`, as changes of the case by ``--set``, and their measurement: states at the
levels, work, or failure.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from statistics import median
from typing import Any

import numpy as np

from mlsanm_cli.app.checks.check import Verdicts
from mlsanm_cli.app.checks.states import checks_of
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.records import dataclass
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.paths import load_path
from mlsanm_cli.solve.state import PathStep, State

ANM, NEWTON, ACTIVE_SET = "anm", "newton", "active-set"


@dataclass(frozen=True)
class Method:
    """A method's ``name`` in the table and the ``changes`` of the case that select it."""

    name: str
    changes: tuple[str, ...]

    @property
    def is_exact(self) -> bool:
        """Whether it solves the exact law, on the condensed system."""
        return self.name == ACTIVE_SET


def method_of(case: Case, name: str, softer: float = 1.0) -> Method:
    """A method for the scene of the case, with eta and stick of all contacts multiplied by ``softer``."""
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
    return Method(name, (*changes, f'solver.method="{name}"'))


def chosen_methods(case: Case, asked: Iterable[str]) -> tuple[Method, ...]:
    """ANM, the methods ``asked`` for, and that of the case, in the order of the table. ``asked`` may contain
    "newton" and "active-set"."""
    wanted = {ANM, *asked, case.solver.method if case.is_regularized else ACTIVE_SET}
    return tuple(method_of(case, name) for name in (ANM, NEWTON, ACTIVE_SET) if name in wanted)


@dataclass
class Measured:
    """``states`` by position, as far as the path was followed, and the counts of the whole path. ``seconds``
    is the median CPU time of the path; ``failure`` and ``hint`` are empty if it was completed."""

    method: Method
    law: str
    states: dict[float, Any] = field(default_factory=dict)
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

    def row(self, setup: float, condensed: tuple[int, int] | None = None) -> dict[str, Any]:
        """The method as in comparison.json, with the seconds of its ``setup``; ``condensed`` are the sparse
        factorisations and solutions before a path on the condensed system, None for other paths."""
        own = self.factorizations, self.solves
        dense, sparse = ((0, 0), own) if condensed is None else (own, condensed)
        found = {
            "method": self.method.name,
            "law": self.law,
            "status": "done" if self.done else "failed",
            "steps": self.steps,
            "iterations": self.iterations,
            "dense_factorizations": dense[0],
            "sparse_factorizations": sparse[0],
            "dense_solves": dense[1],
            "sparse_solves": sparse[1],
            "seconds_setup": setup,
            "seconds_path": self.seconds,
        }
        return found if self.done else found | {"reason": self.failure, "hint": self.hint}


def measure(built: CondensedScene, method: Method, case: Case, repeat: int = 1) -> Measured:
    """Follows the path of ``built`` with the settings of ``case``, ``repeat`` times, with states saved at its
    ``output.at``."""
    chosen, verdicts = replace(built, case=case), Verdicts(lambda check: None)

    def check(step: PathStep) -> None:
        for state in (step.state, *step.saved):
            verdicts.judge(checks_of(chosen, state))

    return measure_path(method, case.touching[0].regularization.law, lambda: load_path(chosen), repeat, check)


def measure_path(
    method: Method, law: str, path: Callable[[], Iterator[Any]], repeat: int, check: Callable[[Any], None]
) -> Measured:
    """Follows a ``path`` ``repeat`` times; ``check`` is called with every step, and may raise
    NumericalError."""
    runs = [_once(Measured(method, law), path(), check) for _ in range(repeat)]
    return replace(runs[0], seconds=median(run.seconds for run in runs))


def _once(found: Measured, path: Iterator[Any], check: Callable[[Any], None]) -> Measured:
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


SAME_LAW_FACTOR = 100.0
"""Largest difference of methods with the same law over ``solver.tolerance``; that of published cases is 4.4,
of pressures next to the corner of a block 12."""
ETA_FACTOR, STICK_FACTOR = 6.0, 10.0
"""Largest differences of pressures and tractions due to the regularised law, over the root of eta and over
``stick``: it smooths the pressure at the edge of a contact by up to 4.3 times the root of eta."""

SOFTER, CONVERGENCE_RATIO = 10.0, 0.75
"""At corners pressures are unbounded, and these limits do not apply to the largest. The regularised law also
agrees with the exact one if its L2 error is at most this ratio of that with ``SOFTER`` times eta and
stick."""


def difference(
    built: CondensedScene, found: Mapping[float, State], reference: Mapping[float, State]
) -> dict[str, float]:
    """Largest differences of the states ``found`` from those of the ``reference`` over all nodes and common
    levels: pressures and tractions relative to the peak pressure, displacements relative to the largest
    one."""
    pressure = traction = displacement = peak = largest = 0.0
    for position in found.keys() & reference.keys():
        one, other = found[position], reference[position]
        change = tuple(a - b for a, b in zip(one.unknowns, other.unknowns, strict=True))
        pressure = np.maximum(pressure, np.abs(one.pressure - other.pressure).max(initial=0.0))
        traction = np.maximum(traction, np.abs(one.traction - other.traction).max(initial=0.0))
        # Displacements are linear in the unknowns.
        displacement = np.maximum(displacement, _largest_displacement(built, change))
        peak = max(peak, float(other.pressure.max(initial=0.0)))
        largest = max(largest, _largest_displacement(built, other.unknowns))
    return {
        "pressure": float(pressure) / (peak or 1.0),
        "traction": float(traction) / (peak or 1.0),
        "displacement": float(displacement) / (largest or 1.0),
    }


def _largest_displacement(built: CondensedScene, unknowns: tuple[FloatArray, ...]) -> float:
    """Largest displacement of a node for given unknowns."""
    moved = [built.condensed.displacement(built.scene, name, unknowns) for name in built.scene.bodies]
    return max(float(np.hypot(*u.T).max()) for u in moved)


def same_law_limit(case: Case) -> float:
    """Largest difference between methods with the same law."""
    return SAME_LAW_FACTOR * case.solver.tolerance


def other_law_limit(case: Case) -> float:
    """Largest difference between the regularised and the exact law."""
    eta = max(contact.regularization.eta for contact in case.touching)
    stick = max((c.regularization.stick for c in case.touching if c.friction), default=0.0)
    return float(ETA_FACTOR * np.sqrt(eta) + STICK_FACTOR * stick)


def surface_error(built: CondensedScene, found: Mapping[float, State], exact: Mapping[float, State]) -> float:
    """Largest L2 norm over all levels of the difference of pressures and tractions from the exact ones,
    relative to the largest norm of these."""
    weight, nodes = built.condensed.weight, built.condensed.friction_nodes

    def norm(pressure: FloatArray, traction: FloatArray) -> float:
        return float(np.sqrt(weight @ pressure**2 + weight[nodes] @ traction**2))

    worst = max(
        norm(found[position].pressure - state.pressure, found[position].traction - state.traction)
        for position, state in exact.items()
    )
    return worst / max(norm(state.pressure, state.traction) for state in exact.values())


def compared(against: str, apart: Mapping[str, float], limit: float) -> dict[str, Any]:
    """Entries of a method in comparison.json: its differences ``apart`` from the method ``against``."""
    agrees = all(value <= limit for value in apart.values())
    return {"against": against, "difference": apart, "limit": limit, "agrees": agrees}


def agreement(table: Sequence[Mapping[str, Any]]) -> str:
    """The status of a comparison from its rows, ANM first: "agree", "disagree", or "failed" if ANM failed."""
    if table[0]["status"] == "failed":
        return "failed"
    agree = all(row["status"] == "done" and row.get("agrees", True) for row in table)
    return "agree" if agree else "disagree"
