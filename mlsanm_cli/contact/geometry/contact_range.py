"""The range of a contact: the part of its surfaces that can carry pressure."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.geometry.contact_grid import Pin
from mlsanm_cli.contact.geometry.facing import Facing
from mlsanm_cli.contact.geometry.grid import Hats
from mlsanm_cli.contact.geometry.unfolding import Planes
from mlsanm_cli.mechanics.corner import Corner
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

SAMPLES = 2000
"""Points at which the gap is sampled to find minima."""


@dataclass(frozen=True)
class ContactRange:
    """A contact's range from ``first`` to ``last``.

    ``nearest`` is the coordinate of the smallest gap, ``centers`` the points in hollows at which near fields
    end, ``corners`` those of both bodies that pressures may approach, ``planes`` those of symmetry at its
    ends, ``places`` the number of local minima of the gap. An end is ``whole`` if one of the surfaces ends
    there, so that pressures may reach it, or if the range closes on itself, all ``around``. ``pins`` are
    single held nodes on the surfaces.
    """

    facing: Facing
    first: float
    last: float
    nearest: float
    centers: tuple[complex | None, complex | None]
    corners: tuple[tuple[Corner, ...], tuple[Corner, ...]]
    planes: Planes
    whole: tuple[bool, bool]
    places: int = 1
    around: bool = False
    pins: tuple[Pin, ...] = ()

    def within(self, s: FloatArray) -> BoolArray:
        """Mask (e,) of coordinates inside the range and not at a corner."""
        inset = COARSE_ROUND_OFF * (self.last - self.first)
        away = s - self.first
        away = np.mod(away, self.facing.base.length) if self.facing.base.closed else away
        return np.asarray(self.around | (away > inset) & (away < self.last - self.first - inset))

    def extended(self, first: float, last: float) -> tuple[float, float]:
        """The part of the range between ``first`` and ``last``, up to planes of symmetry that are close."""
        near = [0.0 if plane is None else plane.reach for plane in self.planes]
        return (
            self.first if first - near[0] <= self.first else first,
            self.last if last + near[1] >= self.last else last,
        )

    def hats(self, nodes: FloatArray) -> Hats:
        """Hat functions on increasing ``nodes``, with half hats at whole ends that they reach."""
        first, last = nodes[0] == self.first and self.whole[0], nodes[-1] == self.last and self.whole[1]
        if not self.around:
            return Hats.on(nodes, (first, last))
        return Hats.on(nodes, (True, True), self.facing.base.length) if first and last else Hats(nodes)

    @cached_property
    def drawn_gaps(self) -> tuple[FloatArray, FloatArray]:
        """Coordinates (e,) sampled over the range, and initial gaps (e,)."""
        places = np.linspace(self.first, self.last, SAMPLES)
        return places, self.facing.gap(places)
