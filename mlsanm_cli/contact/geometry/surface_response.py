"""What is known in closed form of the response of a surface to pressures on a contact grid."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import product

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.grid import on_panels
from mlsanm_cli.contact.geometry.hat_pairs import LOGARITHM, SIGN
from mlsanm_cli.mechanics.corner import Corner, CorneredForces, Forces
from mlsanm_cli.mechanics.near_field import ComplexArray, PointForceField, SurfaceForces
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import FINE_ROUND_OFF

DIFFERENCE_STEP = 1e-4
"""Step of difference quotients along a contact, as a fraction of its range."""


@dataclass(frozen=True, eq=False)
class SurfaceResponse:
    """The response of slave or master to forces on a ``grid``, with the near field ``kernel``."""

    grid: ContactGrid
    kernel: PointForceField
    slave: bool

    @classmethod
    def of(cls, grid: ContactGrid, kernel: PointForceField, slave: bool) -> SurfaceResponse:
        """The response, kept with the grid, which is condensed again while others are refined."""
        found: SurfaceResponse = grid.responses.setdefault(slave, cls(grid, kernel, slave))
        return found

    @cached_property
    def forces(self) -> Forces:
        """Unit forces at the samples, with the corrections at corners and planes of symmetry."""
        grid, center = self.grid, self.grid.centers[0 if self.slave else 1]
        own = SurfaceForces(self.kernel, *grid.facing.side(grid.samples, self.slave), center)
        around = grid.corners_of(self.slave), grid.images_of(self.slave)
        return CorneredForces(own, *around) if any(around) else own

    @cached_property
    def tensors(self) -> tuple[FloatArray, FloatArray]:
        """The tensors L and T (2, 2)."""
        kernel, first = self.kernel, self.grid.samples[:1]
        way, base = self._way(first), self.grid.facing.side(first, self.slave)[1]
        tangent: ComplexArray = way / np.abs(way)
        ahead, behind = kernel.displacement(tangent, base)[0], kernel.displacement(-tangent, base)[0]
        log = (kernel.displacement(2.0 * tangent, base)[0] - ahead) / np.log(2.0)
        return log, 0.5 * (ahead - behind)

    def _way(self, s: FloatArray) -> ComplexArray:
        """Derivatives (k,) of the points of the surface by the coordinate ``s`` (k,)."""
        step = DIFFERENCE_STEP * (self.grid.last - self.grid.first)
        ahead, behind = (self.grid.facing.side(s + sign * step, self.slave)[0] for sign in (1.0, -1.0))
        return np.asarray((ahead - behind) / (2.0 * step))

    def smooth(self, at: FloatArray | None = None, by: FloatArray | None = None) -> FloatArray:
        """Near-field part of S (a, k, 2, 2) ``at`` coordinates (a,) ``by`` forces (k,) or at samples."""
        grid, kernel, (log, turn) = self.grid, self.kernel, self.tensors
        center = grid.centers[0 if self.slave else 1]
        at, by = (grid.samples if one is None else one for one in (at, by))
        z, inward = grid.facing.side(by, self.slave)
        seen = grid.facing.side(at, self.slave)[0]
        w = seen[:, None] - z
        same = at[:, None] == by
        base = np.broadcast_to(inward if center is None else (seen - center)[:, None], w.shape)
        # L ln|s - s'| + T sgn(s - s') of forces and all their images, zero of each to itself.
        folded = np.zeros((len(at), len(by), 2, 2))
        for sign, offset, matrix in grid.unfolding.copies:
            apart = at[:, None] - (sign * by + offset)
            values = [grid.pairs.kernel(one, apart)[..., None, None] for one in (LOGARITHM, SIGN)]
            folded += (values[0] * log + values[1] * turn) @ matrix
        found = kernel.displacement(np.where(same, 1.0, w), base) - folded
        row, column = np.nonzero(same)
        if len(row):
            way = self._way(at[row])
            stretch, tangent = np.abs(way), way / np.abs(way)
            both = [kernel.displacement(one, base[row, column]) for one in (tangent, -tangent)]
            limit = 0.5 * (both[0] + both[1]) + np.log(stretch)[:, None, None] * log
            one = np.ones(len(row), dtype=np.complex128)
            found[row, column] += limit - kernel.displacement(one, base[row, column])
        if center is not None:
            other = seen - center
            found -= kernel.displacement(other, other)[:, None]
        plain, images = SurfaceForces(kernel, z, inward, center), grid.images_of(self.slave)
        for image in images:
            found += image.matrix.T @ plain.displacement(image.points(seen))
        for corner in grid.corners_of(self.slave):
            if corner.curved is not None:
                found += corner.beyond_wedge(z, images, seen)
        return np.asarray(found)

    def singular(self, at: FloatArray) -> FloatArray:
        """Displacements (a, m, 2, 2) at coordinates ``at`` (a,) due to hats of unit tractions x and y, in
        addition to S: integrals of L ln|s - s'| + T sgn(s - s') and of the terms of corners."""
        grid, (log, turn) = self.grid, self.tensors
        by_log, by_turn = (grid.pairs.at(one, at)[..., None, None] for one in (LOGARITHM, SIGN))
        values = by_log * log + by_turn * turn
        hats = grid.unfolded[0]
        points, integrals = hats.towards_ends
        for corner in grid.corners_of(self.slave):
            x, here = self._away(corner, points), self._away(corner, at)
            # The share at the place of a hat, as of the force that stands for it in the rest of the response.
            share = corner.share(self._away(corner, hats.place))[:, None]
            for image in (None, *grid.images_of(self.slave)):
                seen = here if image is None else corner.reflected(here, image)
                moved = np.empty_like(values)
                for c, d in product((0, 1), repeat=2):
                    moved[:, :, c, d] = (share * (integrals @ corner.wedge.compliance(seen, x, c, d).T)).T
                values += moved if image is None else image.matrix.T @ moved
        copies = np.split(values, len(grid.unfolding.copies), axis=1)
        each = zip(copies, grid.unfolding.copies, strict=True)
        return np.asarray(sum(part[:, :: int(sign)] @ matrix for part, (sign, _, matrix) in each))

    def corner_terms(
        self, which: int, by: int
    ) -> Iterator[tuple[sparse.csr_array, FloatArray, sparse.csr_array]]:
        """Double integrals with the hats of the corner terms of displacements along pressures (``which`` 0)
        or tractions (1), due to pressures or tractions (``by``), as products: integrals (m, k) of observed
        displacements at points near a corner, its compliance (k, k), and integrals (m, k) of the forces."""
        corners = self.grid.corners_of(self.slave)
        if not corners:
            return
        hats, fold = self.grid.unfolded
        points, integrals = hats.towards_ends
        integrals = sparse.csr_array(fold.T @ integrals)
        directions = self.grid.directions_at(points)
        present = [np.flatnonzero(np.abs(one).max(axis=0) > FINE_ROUND_OFF).tolist() for one in directions]
        for corner in corners:
            x, shares = on_panels(self._away(corner, points))
            parts = {
                (side, c): integrals @ (shares * directions[side][:, c, None])
                for side in {which, by}
                for c in present[side]
            }
            for c, d in product(present[which], present[by]):
                yield parts[which, c], corner.wedge.compliance(x, x, c, d), parts[by, d]

    def _away(self, corner: Corner, points: FloatArray) -> FloatArray:
        """Distances (e,) of ``points`` (e,) of the copies of the range from a corner, above round-off."""
        at, copy = self.grid.unfolding.located(points)
        away = corner.distance(self.grid.facing.side(at, self.slave)[0])
        reflected = np.array([sign for sign, *_ in self.grid.unfolding.copies])[copy] < 0.0
        for image in self.grid.images_of(self.slave):
            away = np.where(reflected, corner.reflected(away, image), away)
        return np.maximum(away, FINE_ROUND_OFF * corner.length)
