"""What is known in closed form of the response of a surface to pressures on a contact grid."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import product

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid, Pin
from mlsanm_cli.contact.geometry.hat_pairs import LOGARITHM, SIGN
from mlsanm_cli.contact.geometry.panels import on_panels
from mlsanm_cli.mechanics.corner import Corner
from mlsanm_cli.mechanics.near_field import ComplexArray, PointForceField, SurfaceForces
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import FINE_ROUND_OFF

DIFFERENCE_STEP = 1e-4
"""Step of difference quotients along a contact, as a fraction of its range."""
MAX_CACHED = 1000
"""Corner terms are cached for grids of up to this many nodes, to limit memory."""


@dataclass(frozen=True, eq=False)
class SurfaceResponse:
    """The response of the slave, or the master, to forces on a ``grid``, with the near field ``kernel`` of
    its material."""

    grid: ContactGrid
    kernel: PointForceField
    slave: bool

    @classmethod
    def of(cls, grid: ContactGrid, kernel: PointForceField, slave: bool) -> SurfaceResponse:
        """The response, kept with the grid, which is condensed again while others are refined."""
        if slave not in grid.responses:
            grid.responses[slave] = cls(grid, kernel, slave)
        found: SurfaceResponse = grid.responses[slave]
        return found

    @property
    def _center(self) -> complex | None:
        return self.grid.centers[0 if self.slave else 1]

    @cached_property
    def tensors(self) -> tuple[FloatArray, FloatArray]:
        """The tensors L and T (2, 2)."""
        side, kernel = self.grid.facing.side, self.kernel
        way, inward = self._way(self.grid.samples[:1])[0], side(self.grid.samples[:1], self.slave)[1][0]
        tangent: ComplexArray = np.array([way / np.abs(way)])
        base: ComplexArray = np.array([inward])
        ahead, behind = kernel.displacement(tangent, base)[0], kernel.displacement(-tangent, base)[0]
        log = (kernel.displacement(2.0 * tangent, base)[0] - ahead) / np.log(2.0)
        return log, 0.5 * (ahead - behind)

    def _way(self, s: FloatArray) -> ComplexArray:
        """Derivatives (k,) of the points of the surface by the coordinate ``s`` (k,)."""
        step = DIFFERENCE_STEP * (self.grid.last - self.grid.first)
        ahead, behind = (self.grid.facing.side(s + sign * step, self.slave)[0] for sign in (1.0, -1.0))
        return np.asarray((ahead - behind) / (2.0 * step))

    def smooth(self, at: FloatArray | None = None, by: FloatArray | None = None) -> FloatArray:
        """Near-field part of S (a, k, 2, 2) at coordinates ``at`` (a,) due to forces at coordinates ``by``
        (k,); both by default the samples."""
        grid, kernel, center = self.grid, self.kernel, self._center
        at, by = (grid.samples if one is None else one for one in (at, by))
        z, inward = grid.facing.side(by, self.slave)
        seen = grid.facing.side(at, self.slave)[0]
        w = seen[:, None] - z
        same = at[:, None] == by
        base = np.broadcast_to(inward if center is None else (seen - center)[:, None], w.shape)
        found = kernel.displacement(np.where(same, 1.0, w), base) - self._folded(at, by)
        row, column = np.nonzero(same)
        if len(row):
            way = self._way(at[row])
            stretch, tangent = np.abs(way), way / np.abs(way)
            both = [kernel.displacement(one, base[row, column]) for one in (tangent, -tangent)]
            limit = 0.5 * (both[0] + both[1]) + np.log(stretch)[:, None, None] * self.tensors[0]
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

    def _folded(self, at: FloatArray, by: FloatArray) -> FloatArray:
        """The kernel L ln|s - s'| + T sgn(s - s') (a, k, 2, 2) at coordinates ``at`` (a,) of places ``by``
        (k,) and all their images, zero of each to itself."""
        grid, (log, turn) = self.grid, self.tensors
        total = np.zeros((len(at), len(by), 2, 2))
        for sign, offset, matrix in grid.unfolding.copies:
            apart = at[:, None] - (sign * by + offset)
            values = [grid.pairs.kernel(one, apart)[..., None, None] for one in (LOGARITHM, SIGN)]
            total += (values[0] * log + values[1] * turn) @ matrix
        return total

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

    def cornered(self, which: int, by: int) -> FloatArray:
        """Double integrals (m, m) with the hats of the corner terms of displacements along pressures
        (``which`` 0) or tractions (1), due to pressures or tractions (``by``)."""
        if (which, by) in self._by_corners:
            return self._by_corners[which, by]
        count = len(self.grid.hats.place)
        total = np.zeros((count, count))
        for seen, compliance, acting in self.corner_terms(which, by):
            total += seen @ compliance @ acting.T
        if count <= MAX_CACHED:
            self._by_corners[which, by] = total
        return total

    @cached_property
    def _by_corners(self) -> dict[tuple[int, int], FloatArray]:
        """Cache of :meth:`cornered`."""
        return {}

    def corner_terms(
        self, which: int, by: int
    ) -> Iterator[tuple[sparse.csr_array, FloatArray, sparse.csr_array]]:
        """Terms of :meth:`cornered`: integrals (m, k) of observed displacements at points near a corner, its
        compliance (k, k), and integrals (m, k) of the forces."""
        corners = self.grid.corners_of(self.slave)
        if not corners:
            return
        hats, fold = self.grid.unfolded
        points, integrals = hats.towards_ends
        integrals = sparse.csr_array(fold.T @ integrals) if self.grid.mirrored else integrals
        directions = self._directions(points)
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

    def _directions(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Directions (e, 2) of pressures and of tractions at ``points`` (e,) of the copies of the range."""
        at, copy = self.grid.unfolding.located(points)
        normal, tangent = self.grid.facing.directions(at)
        return self.grid.unfolding.turned(normal, copy), self.grid.unfolding.turned(tangent, copy)

    def _away(self, corner: Corner, points: FloatArray) -> FloatArray:
        """Distances (e,) of ``points`` (e,) of the copies of the range from a corner, above round-off."""
        at, copy = self.grid.unfolding.located(points)
        away = corner.distance(self.grid.facing.side(at, self.slave)[0])
        reflected = np.array([sign for sign, *_ in self.grid.unfolding.copies])[copy] < 0.0
        for image in self.grid.images_of(self.slave):
            away = np.where(reflected, corner.reflected(away, image), away)
        return np.maximum(away, FINE_ROUND_OFF * corner.length)

    def at_pin(self, place: float, which: int) -> FloatArray:
        """Displacements x and y (2, m) at one coordinate ``place`` due to hats of pressures (``which`` 0) or
        tractions (1), in addition to S."""
        acting = self.grid.hats.at_places(self.grid.directions[which])
        return np.asarray(np.einsum("mcd,md->cm", self.singular(np.array([place]))[0], acting))


def pin_displacements(grid: ContactGrid, which: int) -> FloatArray:
    """What the pins on the surfaces of a grid move by (2 n, m), x of all n, then y, to stay where they are
    under hats of pressures (``which`` 0) or tractions (1), without what the samples represent."""
    count, pins = len(grid.hats.place), grid.pinned
    if not pins:
        return np.zeros((0, count))
    moved = [SurfaceResponse.of(grid, pin.kernel, pin.slave).at_pin(pin.place, which) for pin in pins]
    whole = -np.array(moved).transpose(1, 0, 2).reshape(2 * len(pins), count)
    return np.asarray(whole @ grid.deviation(np.eye(count), which))


def pins_of(grid: ContactGrid, slave: bool) -> list[tuple[int, Pin]]:
    """The pins on one of the two surfaces, with their numbers among all."""
    return [(number, pin) for number, pin in enumerate(grid.pinned) if pin.slave == slave]
