"""Closed-form near fields of tractions at points of a side, linear between them: those of contact grids
(:mod:`mlsanm_cli.contact.geometry.surface_response`), observed at the points."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.finite.sides import Points
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.facing import Facing
from mlsanm_cli.contact.geometry.grid import Hats
from mlsanm_cli.contact.geometry.surface_response import SurfaceResponse
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.corner import CorneredForces
from mlsanm_cli.mechanics.near_field import SURFACE_INSET, SurfaceForces, as_complex
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class NearField:
    """Near fields of a ``side``'s tractions; in hollows they end at a ``center``."""

    side: Points
    body: ElasticBody
    center: complex | None

    @cached_property
    def _grid(self) -> ContactGrid:
        side = self.side
        ends, corners = side.ends, tuple(replace(one, fades=True) for one in side.wedges if one)
        hats = Hats.on(ends, (True, True), side.around)
        around = (self.center, None), (corners, ()), side.planes
        return ContactGrid(Facing(side.geometry, None), float(ends[0]), float(ends[-1]), 1, hats, *around)

    @cached_property
    def _arc(self) -> FloatArray:
        """Arc lengths (c,) of forces, those at ends shifted inwards."""
        arc = self.side.arc.copy()
        if self.side.around is None:
            arc[[0, -1]] += SURFACE_INSET * self.side.weight[[0, -1]] * np.array([1.0, -1.0])
        return arc

    def forces(self, chosen: IntArray | slice = slice(None)) -> CorneredForces:
        """Unit forces at all or the ``chosen`` points (k,)."""
        place, inward = self._grid.facing.side(self._arc[chosen], True)
        own = SurfaceForces(self.body.model.kernel, place, inward, self.center)
        return CorneredForces(own, self._grid.corners_of(True), self._grid.images_of(True))

    def displaced(self, places: FloatArray) -> FloatArray:
        """Displacements (2n, 2c) at ``places`` (n, 2) inside the body by unit tractions."""
        found = self.forces().displacement(as_complex(places)) * self.side.weight[:, None, None]
        return _interleaved(found)

    @property
    def field(self) -> FloatArray:
        """Displacements (2c, 2c) of the points due to unit tractions."""
        response = SurfaceResponse(self._grid, self.body.model.kernel, True)
        sharp = response.singular(self.side.arc)
        if self.side.around is not None:
            sharp[:, 0] += sharp[:, -1]
        smooth = response.smooth(self._arc, self._arc) * self.side.weight[:, None, None]
        return _interleaved(smooth + sharp[:, : self.side.count])


def _interleaved(table: FloatArray) -> FloatArray:
    """Displacements (e, k, 2, 2) as a matrix (2e, 2k), x and y in turn."""
    rows, columns = table.shape[:2]
    return np.asarray(table.transpose(0, 2, 1, 3).reshape(2 * rows, 2 * columns))
