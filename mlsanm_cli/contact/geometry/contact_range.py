"""The range of a contact in which pressures may lie."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.geometry.facing import Facing
from mlsanm_cli.contact.geometry.grid import Hats
from mlsanm_cli.mechanics.corner import Corner

END_TOLERANCE = 1e-6
"""Distance from the end of a range, relative to the range, below which a point coincides with the end."""
SAMPLES = 2000
"""Points at which a range is searched for summits of its profile."""


@dataclass(frozen=True)
class ContactRange:
    """A contact's range from ``first`` to ``last``, the place ``nearest`` to the other surface, where fields
    end in hollows, the ``corners`` of both bodies that pressures may come near, and in how many ``places``
    surfaces come close. Ends that are ``whole`` are where one of the surfaces ends, so that there may be
    pressures right up to it, or where the range meets itself, having gone all ``around``."""

    facing: Facing
    first: float
    last: float
    nearest: float
    centers: tuple[complex | None, complex | None]
    corners: tuple[tuple[Corner, ...], tuple[Corner, ...]]
    whole: tuple[bool, bool]
    places: int = 1
    around: bool = False

    def within(self, s: FloatArray) -> BoolArray:
        """Whether places (e,) lie between its ends, not at a corner."""
        inset = END_TOLERANCE * (self.last - self.first)
        away = s - self.first
        away = np.mod(away, self.facing.base.length) if self.facing.base.closed else away
        return np.asarray(self.around | (away > inset) & (away < self.last - self.first - inset))

    def hats(self, nodes: FloatArray) -> Hats:
        """Hats on ``nodes``, increasing, up to the ends of surfaces that they reach."""
        first, last = nodes[0] == self.first and self.whole[0], nodes[-1] == self.last and self.whole[1]
        if not self.around:
            return Hats.on(nodes, (first, last))
        return Hats.on(nodes, (True, True), self.facing.base.length) if first and last else Hats(nodes)

    @cached_property
    def drawn_gaps(self) -> tuple[FloatArray, FloatArray]:
        """Places (e,) close to each other all over the range, and the gaps (e,) as drawn there."""
        places = np.linspace(self.first, self.last, SAMPLES)
        return places, self.facing.gap(places)
