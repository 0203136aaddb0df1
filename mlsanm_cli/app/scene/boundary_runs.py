"""Boundaries of a case as consecutive pieces of an outline."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from mlsanm_cli.app.scene.outlines import numbers_of
from mlsanm_cli.case import Place
from mlsanm_cli.cloud.curves import Curve, Outline
from mlsanm_cli.cloud.joined import chain_of, chains_of
from mlsanm_cli.errors import CaseError, CaseProblem

END_TOLERANCE = 1e-6
"""Distance from the end of a piece, relative to its length, below which a point coincides with the end."""


@dataclass(frozen=True)
class BoundaryRun:
    """Consecutive pieces of a body's ``outline`` by ``numbers``; ``around``: they form a closed loop."""

    outline: Outline
    numbers: tuple[int, ...]
    around: bool

    @property
    def curves(self) -> tuple[Curve, ...]:
        return tuple(self.outline.curves[number] for number in self.numbers)

    @property
    def starts(self) -> list[float]:
        """Arc lengths at the starts of the pieces and at the end of the last one."""
        return [*accumulate((curve.length for curve in self.curves), initial=0.0)]

    def nearest(self, point: tuple[float, float]) -> tuple[float, float]:
        """The arc length of the nearest point of the run, and the distance."""
        best = (0.0, math.inf)
        for curve, start in zip(self.curves, self.starts, strict=False):
            s = curve.closest(np.array([point]))
            away = float(np.hypot(*(curve.points(s) - np.array(point))[0]))
            if away < best[1]:
                at = float(s[0])
                for end in (0.0, curve.length):
                    at = end if abs(at - end) <= END_TOLERANCE * curve.length and not curve.closed else at
                best = start + at, away
        return best


def run_of(outlines: Mapping[str, Outline], place: Place, key: str) -> BoundaryRun:
    """The pieces of a place in the outline of its body as drawn. Raises CaseError if they do not join."""
    return run_on(outlines[place.body], place, key)


def run_on(outline: Outline, place: Place, key: str) -> BoundaryRun:
    """The pieces of a place in an outline. Raises CaseError if they do not join."""
    numbers = [number for edge in place.edges for number in numbers_of(outline, edge)]
    found = chain_of(outline, numbers)
    if found is None:
        groups = [f'"{name}"' for name in _groups(outline, numbers)]
        message = f"{', '.join(groups[:-1])} and {groups[-1]} do not join end to end"
        hint = "the pieces of one surface are consecutive along the outline"
        raise CaseError((CaseProblem(key, message, hint=hint),))
    return BoundaryRun(outline, *found)


def runs_on(outline: Outline, place: Place, key: str) -> list[BoundaryRun]:
    """The runs of a part, or of all boundaries of a place, whose pieces need not join."""
    if place.ends:
        return [run_on(outline, place, key)]
    chains = [chain for edge in place.edges for chain in chains_of(outline, numbers_of(outline, edge))]
    return [BoundaryRun(outline, *chain) for chain in chains]


def _groups(outline: Outline, numbers: Sequence[int]) -> list[str]:
    """The names of the pieces, in groups that join."""
    return [
        "+".join(dict.fromkeys(outline.names[k].partition("/")[0] for k in chain))
        for chain, _ in chains_of(outline, numbers)
    ]


def range_of(run: BoundaryRun, place: Place) -> tuple[float, float]:
    """Arc length of the start of a part of a run, and the length of the part."""
    assert place.ends is not None
    (one, _), (other, _) = (run.nearest(end) for end in place.ends)
    if run.around or run.curves[0].closed:
        return one, (other - one) % run.starts[-1]
    return min(one, other), abs(other - one)
