"""Contact grids: contacts whose pressures act through closed-form near fields.

The response of a body at s to a force f at s' of the contact is::

    G(s, s') = L ln|s - s'| + T sgn(s - s') + S(s, s')

with the material's tensors L and T and a smooth S: the rest of the near field, and the remainder computed on
the body's cloud (:mod:`mlsanm_cli.mechanics.remainder`). S is sampled at Chebyshev points of the range and
interpolated to any number of pressures and gaps. At planes of symmetry all of it is reflected
(:mod:`mlsanm_cli.contact.geometry.unfolding`).
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.cloud.membership import cross
from mlsanm_cli.contact.geometry.clusters import Chain, hierarchical
from mlsanm_cli.contact.geometry.facing import Facing, turned
from mlsanm_cli.contact.geometry.grid import Hats
from mlsanm_cli.contact.geometry.hat_pairs import HatPairs
from mlsanm_cli.contact.geometry.unfolding import Planes, Unfolding
from mlsanm_cli.mechanics.corner import Corner
from mlsanm_cli.mechanics.near_field import PointForceField, as_complex, as_real
from mlsanm_cli.mechanics.symmetry import Image, images_of
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, ROUND_OFF

SAMPLES = 2000
"""Points at which the gap is sampled to find minima."""


@dataclass(frozen=True)
class Pin:
    """A single held ``node`` of one of the bodies, with the near field ``kernel``, at coordinate ``place`` of
    its contact surface, on which the contact does not push."""

    node: int
    slave: bool
    place: float
    kernel: PointForceField


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


@dataclass(frozen=True)
class ContactGrid:
    """A contact's range from ``first`` to ``last`` with ``count`` Chebyshev samples and the ``hats`` of its
    pressures. ``centers`` are the points in hollows of slave and master at which near fields end, ``corners``
    those at the ends of their surfaces, ``planes`` those of symmetry at the ends of its widest range,
    ``pins`` the single nodes held on the surfaces. A ``provisional`` grid only locates the contact."""

    facing: Facing
    first: float
    last: float
    count: int
    hats: Hats
    centers: tuple[complex | None, complex | None] = (None, None)
    corners: tuple[tuple[Corner, ...], tuple[Corner, ...]] = ((), ())
    planes: Planes = (None, None)
    pins: tuple[Pin, ...] = ()
    provisional: bool = False

    @property
    def ends(self) -> FloatArray:
        """The coordinates ``first`` and ``last`` (2,)."""
        return np.array([self.first, self.last])

    def around(self, s: FloatArray) -> FloatArray:
        """Coordinates (e,), on a closed base shifted by whole periods to be nearest to the range."""
        base = self.facing.base
        if not base.closed:
            return s
        middle = 0.5 * (self.first + self.last)
        return s - base.length * np.round((s - middle) / base.length)

    @cached_property
    def mirrors(self) -> Planes:
        """The planes of symmetry at which the range ends."""
        (first, last), whole = self.planes, self.hats.whole
        return first if whole[0] else None, last if whole[1] else None

    @property
    def mirrored(self) -> bool:
        """Whether the range ends at a plane of symmetry."""
        return self.mirrors != (None, None)

    @cached_property
    def unfolding(self) -> Unfolding:
        """The range reflected at these planes."""
        return Unfolding(self.first, self.last, self.count, self.mirrors)

    @cached_property
    def untracted(self) -> BoolArray:
        """Mask (m,) of hats at planes of symmetry without tractions: those along a surface at a right angle
        with the plane change their sign there."""
        found = np.zeros(len(self.hats.place), dtype=bool)
        tangents = as_complex(self.facing.directions(self.ends)[1])
        for end, plane, tangent in zip((0, -1), self.mirrors, tangents, strict=True):
            if plane is not None:
                found[end] = abs((tangent * np.conj(plane.along)).real) <= COARSE_ROUND_OFF
        return found

    def images_of(self, slave: bool) -> tuple[Image, ...]:
        """The images of one of the two bodies at these planes, which pass through the ends of its surface."""
        tips = zip(self.mirrors, self.facing.side(self.ends, slave)[0], strict=True)
        return images_of([replace(one, point=complex(tip)) for one, tip in tips if one is not None])

    def corners_of(self, slave: bool) -> tuple[Corner, ...]:
        """The corners of one of the two bodies near the range."""
        chosen = self.corners[0 if slave else 1]
        if not chosen:
            return ()
        ends = self.facing.side(self.ends, slave)[0]
        return tuple(one for one in chosen if one.distance(ends).min() < one.reach)

    @cached_property
    def pinned(self) -> tuple[Pin, ...]:
        """The pins within the range: others are seen by samples."""
        slack = COARSE_ROUND_OFF * (self.last - self.first)
        at = self.around(np.array([pin.place for pin in self.pins]))
        inside = (at >= self.first - slack) & (at <= self.last + slack)
        placed = zip(self.pins, np.clip(at, self.first, self.last).tolist(), inside, strict=True)
        return tuple(replace(pin, place=place) for pin, place, kept in placed if kept)

    @property
    def samples(self) -> FloatArray:
        """Coordinates (k,) of the samples."""
        return self.unfolding.samples

    @cached_property
    def responses(self) -> dict[bool, Any]:
        """Cache of :meth:`mlsanm_cli.contact.geometry.surface_response.SurfaceResponse.of` by body."""
        return {}

    @cached_property
    def opposite(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """:meth:`Facing.opposite` at the hats' points."""
        return self.facing.opposite(self.hats.points)

    @property
    def directions(self) -> tuple[FloatArray, FloatArray]:
        """:meth:`Facing.directions` (g, 2) at the hats' points."""
        return self.opposite[2], turned(self.opposite[2])

    @cached_property
    def gap(self) -> FloatArray:
        """Initial gaps (m,), averaged over the hats."""
        return self.hats.at_places(self.facing.gap_between(*self.opposite)[:, None])[:, 0]

    @cached_property
    def axes(self) -> FloatArray:
        """Vectors (2, k, 2) at the samples along which displacements are even and odd at planes of symmetry:
        along and across these, or between two at an angle normal and tangent; without planes x and y."""
        return self._axes_at(self.samples)

    def _axes_at(self, s: FloatArray) -> FloatArray:
        ways = [plane.along for plane in self.mirrors if plane is not None]
        if not ways:
            return np.repeat(np.eye(2)[:, None], len(s), axis=1)
        if max(abs((way * np.conj(ways[0])).imag) for way in ways) <= COARSE_ROUND_OFF:
            # Not the normal: splines meet planes at angles that are not exactly right.
            normal = np.repeat(as_real(np.array(ways[:1])), len(s), axis=0)
        else:
            normal = as_real(self.facing.side(s, True)[1])
        return np.stack([normal, turned(normal)])

    @cached_property
    def spreads(self) -> tuple[FloatArray, FloatArray]:
        """Forces (2k, m) x and y at the samples equivalent to hats of pressures, and of tractions; the
        transpose integrates displacements along these with the hats."""
        shares, axes, found = self.unfolding.cardinals(self.hats.points), self._axes_at(self.hats.points), []
        for direction in self.directions:
            parts = zip((axes * direction).sum(axis=2), shares, strict=True)
            along = np.array([(self.hats.integrals @ (part[:, None] * share)).T for part, share in parts])
            found.append(np.concatenate(np.einsum("akc,akm->ckm", self.axes, along)))
        return found[0], found[1]

    @cached_property
    def means(self) -> tuple[FloatArray, FloatArray]:
        """Averages (m, 2k) over the hats of displacements at the samples, along pressures and tractions."""
        normal, tangent = self.spreads
        return normal.T / self.hats.weight[:, None], tangent.T / self.hats.weight[:, None]

    @cached_property
    def covers(self) -> bool:
        """Whether the range is the whole of straight surfaces of the bodies. The mean traction is then an
        ordinary surface traction, to which their response is exact, and near fields take the deviation."""
        straight = float(np.ptp(self.directions[0], axis=0).max()) <= ROUND_OFF
        if self.hats.whole != (True, True) or not straight:
            return False
        for slave in (True, False):
            curve = self.facing.base if slave == self.facing.slave_first else self.facing.other
            if curve is not None:
                if curve.closed:
                    return False
                long = float(abs(np.diff(self.facing.side(self.ends, slave)[0])[0]))
                ends_known = len(self.corners_of(slave)) + sum(map(bool, self.mirrors)) == 2
                if abs(long - curve.length) > ROUND_OFF * curve.length or not ends_known:
                    return False
        return True

    @property
    def evened(self) -> tuple[bool, bool]:
        """Whether the mean of pressures, and of tractions, which are odd at planes, is an ordinary load."""
        return self.covers, self.covers and not self.mirrored

    @cached_property
    def mean_weights(self) -> FloatArray:
        """Weights (m,) of the mean along the contact."""
        return np.asarray(self.hats.weight / self.hats.weight.sum())

    def deviation(self, values: FloatArray, which: int) -> FloatArray:
        """Part of nodal pressures (``which`` 0) or tractions (1) (m, ...) that acts through near fields."""
        if not self.evened[which]:
            return values
        return np.asarray(values - self.mean_weights @ values)

    @cached_property
    def unfolded(self) -> tuple[Hats, sparse.csr_array]:
        """The hats of all copies of the range, and the matrix from values at the hats to theirs."""
        return self.unfolding.hats(self.hats), self.unfolding.fold(len(self.hats.place))

    @cached_property
    def pairs(self) -> HatPairs:
        """Double integrals of kernels with the hats of all copies."""
        return HatPairs(self.unfolded[0])

    def directions_at(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Directions (e, 2) of pressures and of tractions at ``points`` (e,) of the copies of the range."""
        at, copy = self.unfolding.located(points)
        normal, tangent = self.facing.directions(at)
        return self.unfolding.turned(normal, copy), self.unfolding.turned(tangent, copy)

    @cached_property
    def _unfolded_directions(self) -> tuple[FloatArray, FloatArray]:
        return self.directions_at(self.pairs.hats.points) if self.mirrored else self.directions

    def singular_integrals(self, log: FloatArray, turn: FloatArray, which: int, by: int) -> FloatArray:
        """Double integrals (m, m) with the hats of log ln|s - s'| + turn sgn(s - s') and its images, along
        pressures (0) or tractions (1)."""
        directions, fold = self._unfolded_directions, self.unfolded[1]
        whole = self.pairs.integrals(log, turn, directions[which], directions[by])
        return np.asarray(fold.T @ (fold.T @ whole.T).T) / len(self.unfolding.copies)

    def singular_chains(self, log: FloatArray, turn: FloatArray) -> tuple[sparse.csr_array, list[Chain]]:
        """:meth:`singular_integrals` of pressures as near entries (m, m) and matrix products."""
        near, far = hierarchical(self.pairs, log, turn, self._unfolded_directions[0])
        fold = self.unfolded[1]
        folded = sparse.csr_array(fold.T / len(self.unfolding.copies))
        return sparse.csr_array(folded @ near @ fold), [(folded, *chain, fold) for chain in far]

    def resultants(self, slave: bool) -> list[FloatArray]:
        """Force x, y and moment about the origin (3, m) on one body by unit pressures, and tractions."""
        sign, found = 1.0 if slave else -1.0, []
        for direction in self.directions:
            moment = cross(self.opposite[0 if slave else 1], direction)
            found.append(sign * (self.hats.integrals @ np.column_stack([direction, moment])).T)
        return found

    def coefficients(self, kernel: FloatArray) -> FloatArray:
        """Largest Chebyshev coefficients (k,) of each order, in either argument, of a kernel (2k, 2k)."""
        count, axes = self.count, self.axes
        blocks = np.einsum("akc,ckdl,bld->abkl", axes, kernel.reshape(2, count, 2, count), axes)
        largest = np.zeros(count)
        for a, b in product((0, 1), repeat=2):
            left = self.unfolding.spectrum(blocks[a, b])[a]
            table = np.abs(self.unfolding.spectrum(left.T)[b])
            largest = np.maximum(largest, np.maximum(table.max(axis=0), table.max(axis=1)))
        return largest
