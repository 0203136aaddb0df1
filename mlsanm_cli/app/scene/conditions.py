"""Supports and loads on boundaries, and the displacements that they prescribe."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

from mlsanm_cli.case import Case, Displacement, Place, Platen
from mlsanm_cli.case.model.conditions import Support
from mlsanm_cli.case.model.loads import OnBoundary

Condition: TypeAlias = Support | OnBoundary


def conditions(case: Case) -> Iterator[tuple[str, Condition, Place]]:
    """Key, support or load, and place of all conditions on boundaries; of plates for each of their bodies."""
    for index, support in enumerate(case.support):
        if support.place is not None:
            yield f"support.{index}", support, support.place
    for load in case.load:
        if isinstance(load, OnBoundary):
            yield from ((f"load.{load.name}", load, place) for place in load.places)


def prescribes(condition: Condition) -> tuple[bool, bool]:
    """Whether a condition prescribes the displacements, or makes them rigid, in x and in y."""
    if isinstance(condition, Platen):
        return "x" in condition.control, "y" in condition.control
    if isinstance(condition, Displacement):
        x, y = condition.components
    elif isinstance(condition, Support):
        x, y = condition.ux, condition.uy
    else:
        return False, False
    return x is not None, y is not None


def stays(condition: Condition) -> bool:
    """Whether the displacements that a condition prescribes are zero."""
    if isinstance(condition, Displacement):
        return all(one is None or one == 0.0 for one in condition.components)
    return isinstance(condition, Support)
