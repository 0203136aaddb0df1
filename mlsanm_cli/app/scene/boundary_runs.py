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
from mlsanm_cli.cloud.joined import Chain, chains_of, joined, part_of
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.roundoff import COARSE_ROUND_OFF


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
    def curve(self) -> Curve:
        """The pieces as one curve."""
        return joined(self.curves, self.around)

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
                    at = end if abs(at - end) <= COARSE_ROUND_OFF * curve.length and not curve.closed else at
                best = start + at, away
        return best

    def range_of(self, place: Place) -> tuple[float, float]:
        """Arc length of the start of a place on the run, and the length of the place."""
        if place.ends is None:
            return 0.0, self.starts[-1]
        (one, _), (other, _) = (self.nearest(end) for end in place.ends)
        if self.around:
            return one, (other - one) % self.starts[-1]
        return min(one, other), abs(other - one)

    def part(self, place: Place) -> Curve:
        """The curve of a place on the run."""
        first, length = self.range_of(place)
        return part_of(self.curve, first, first + length) if place.ends else self.curve

    def continues(self, at: float) -> bool:
        """Whether the run continues on both sides of the arc length ``at``."""
        return self.around or COARSE_ROUND_OFF < at / self.starts[-1] < 1.0 - COARSE_ROUND_OFF


def run_of(outlines: Mapping[str, Outline], place: Place, key: str) -> BoundaryRun:
    """The pieces of a place in the outline of its body as drawn. Raises CaseError if they do not join."""
    outline = outlines[place.body]
    chains = chains_at(outline, place.edges)
    if len(chains) == 1:
        return BoundaryRun(outline, *chains[0])
    names = (dict.fromkeys(outline.names[k].partition("/")[0] for k in chain) for chain, _ in chains)
    groups = [f'"{"+".join(some)}"' for some in names]
    message = f"{', '.join(groups[:-1])} and {groups[-1]} do not join end to end"
    hint = "the pieces of one surface are consecutive along the outline"
    raise CaseError((CaseProblem(key, message, hint=hint),))


def chains_at(outline: Outline, edges: Sequence[str]) -> list[Chain]:
    """The chains of curves that form the boundaries named ``edges``."""
    return chains_of(outline, [number for edge in edges for number in numbers_of(outline, edge)])
