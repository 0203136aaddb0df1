"""Pieces of an outline end to end, from what a case calls a boundary."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from mlsanm_cli.app.scene.outlines import drawn, numbers_of
from mlsanm_cli.case import Case, Place
from mlsanm_cli.cloud.curves import Curve, Outline
from mlsanm_cli.cloud.joined import chain_of
from mlsanm_cli.errors import CaseError, CaseProblem

AT_END = 1e-6
"""Ends of parts nearer than this part of a piece's length to its end are there."""


@dataclass(frozen=True)
class BoundaryRun:
    """Pieces of a body's ``outline`` by their ``numbers`` in order, ``around`` if they are a whole loop."""

    outline: Outline
    numbers: tuple[int, ...]
    around: bool

    @property
    def curves(self) -> tuple[Curve, ...]:
        return tuple(self.outline.curves[number] for number in self.numbers)

    @property
    def starts(self) -> list[float]:
        """Arc lengths where the pieces begin, and where the last one ends."""
        return [*accumulate((curve.length for curve in self.curves), initial=0.0)]

    def nearest(self, point: tuple[float, float]) -> tuple[float, float]:
        """The arc length nearest to a point, and how far that is."""
        best = (0.0, math.inf)
        for curve, start in zip(self.curves, self.starts, strict=False):
            s = curve.closest(np.array([point]))
            away = float(np.hypot(*(curve.points(s) - np.array(point))[0]))
            if away < best[1]:
                at = float(s[0])
                for end in (0.0, curve.length):
                    at = end if abs(at - end) <= AT_END * curve.length and not curve.closed else at
                best = start + at, away
        return best


def run_of(case: Case, place: Place, key: str) -> BoundaryRun:
    """The pieces of a place in the outline as drawn. Raises CaseError where they do not join."""
    body = next(one for one in case.body if one.name == place.body)
    return run_on(drawn(body.shape), place, key)


def run_on(outline: Outline, place: Place, key: str) -> BoundaryRun:
    """The pieces of a place in an outline. Raises CaseError where they do not join."""
    numbers = [number for edge in place.edges for number in numbers_of(outline, edge)]
    found = chain_of(outline, numbers)
    if found is None:
        groups = [f'"{name}"' for name in _groups(outline, numbers)]
        message = f"{', '.join(groups[:-1])} and {groups[-1]} do not join end to end"
        hint = "the pieces of one surface are consecutive along the outline"
        raise CaseError((CaseProblem(key, message, hint=hint),))
    return BoundaryRun(outline, *found)


def _groups(outline: Outline, numbers: Sequence[int]) -> list[str]:
    """The names of pieces that do join, group by group."""
    left, groups = sorted(set(numbers)), list[str]()
    while left:
        group = left[:1]
        while len(group) < len(left) and chain_of(outline, left[: len(group) + 1]) is not None:
            group = left[: len(group) + 1]
        left = left[len(group) :]
        groups.append("+".join(dict.fromkeys(outline.names[k].partition("/")[0] for k in group)))
    return groups


def range_of(run: BoundaryRun, place: Place) -> tuple[float, float]:
    """Where along a run a part of it begins, and its length."""
    assert place.ends is not None
    (one, _), (other, _) = (run.nearest(end) for end in place.ends)
    if run.around or run.curves[0].closed:
        return one, (other - one) % run.starts[-1]
    return min(one, other), abs(other - one)
