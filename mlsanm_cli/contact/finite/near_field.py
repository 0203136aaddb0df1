"""Closed-form near fields of tractions that are linear between the points of a side, with images behind
planes of symmetry at its ends, and force densities at corners that free both faces
(:mod:`mlsanm_cli.mechanics.corner`)."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from itertools import product

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.finite.node_curve import wrapped
from mlsanm_cli.contact.finite.sides import Points
from mlsanm_cli.contact.geometry.grid import logarithm
from mlsanm_cli.contact.geometry.hat_pairs import Table
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.corner import Corner, CorneredForces, Forces
from mlsanm_cli.mechanics.corner_faces import smooth_step
from mlsanm_cli.mechanics.near_field import SURFACE_INSET, ComplexArray, SurfaceForces, as_complex
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import FINE_ROUND_OFF, ROUND_OFF

GAUSS = np.polynomial.legendre.leggauss(8)
TIP_EXPONENT = 6.0
"""Exponent of the grading of quadrature points towards a corner, where fields depend on the logarithm of the
distance."""


@dataclass(frozen=True)
class NearField:
    """Near fields of a ``side``'s tractions, with images behind planes of symmetry at its ends; in hollows
    they end at a ``center``."""

    side: Points
    body: ElasticBody
    center: complex | None

    @cached_property
    def _corners(self) -> list[tuple[Corner, FloatArray]]:
        """The corners with known fields, and the parts (c,) of their force densities: all for points within
        their reach, none beyond twice that."""
        known = [one for one in self.side.wedges if one is not None]
        places = as_complex(self.side.places)
        return [(one, smooth_step(one.distance(places) / one.reach - 1.0)) for one in known]

    @property
    def _mirrored(self) -> list[tuple[float, int, FloatArray]]:
        """For every symmetry plane its arc length, its axis, and the signs (2,) of both components of
        images."""
        side = self.side
        return [
            (float(side.arc[end]), axis, 1.0 - 2.0 * np.eye(2)[axis])
            for end, axis in zip((0, -1), side.mirrors, strict=True)
            if axis is not None
        ]

    @cached_property
    def _places(self) -> ComplexArray:
        """Points (c,) where forces act, those at ends shifted inwards."""
        side, places = self.side, as_complex(self.side.places)
        if side.around is None:
            for end, way in ((0, 1.0), (-1, -1.0)):
                places[end] += SURFACE_INSET * way * side.weight[end] * self._along[end]
        return places

    @cached_property
    def _along(self) -> ComplexArray:
        """Unit tangents (c,) in the direction of the arc length."""
        tangent: ComplexArray = 1j * as_complex(self.side.outward)
        ahead = as_complex(np.roll(self.side.places, -1, axis=0) - self.side.places)[0]
        return np.asarray(tangent * np.sign((ahead * np.conj(tangent[0])).real))

    def displaced(self, nodes: IntArray, seen: ComplexArray) -> FloatArray:
        """Displacements (2m, 2k) at places ``seen`` (m,) inside the body by the fields of unit forces at some
        ``nodes`` (k,)."""

        def moved(forces: Forces) -> FloatArray:
            found = forces.displacement(seen).transpose(0, 2, 3, 1)
            return found.reshape(2 * len(seen), 2 * len(forces.place))

        return self.summed(nodes, moved, 2 * len(seen))

    def summed(self, nodes: IntArray, of: Callable[[Forces], FloatArray], rows: int) -> FloatArray:
        """What (rows, 2k) is ``of`` the fields of unit forces at some ``nodes`` (k,), x and y in turn."""
        kernel, count = self.body.model.kernel, len(nodes)
        place, inward = self._places[nodes], -as_complex(self.side.outward[nodes])
        moved = of(SurfaceForces(kernel, place, inward, self.center)).reshape(rows, 2, count)
        for corner, weight in self._corners:
            near = np.flatnonzero(weight[nodes] > ROUND_OFF)
            if len(near):
                plain = SurfaceForces(kernel, place[near], inward[near], self.center)
                more = of(CorneredForces(plain, (corner,))) - of(plain)
                moved[:, :, near] += more.reshape(rows, 2, len(near)) * weight[nodes[near]]
        own = moved.reshape(rows, 2 * count)
        for arc, axis, sign in self._mirrored:
            center = self._center(arc, axis)
            images = SurfaceForces(kernel, self._image(place, arc, axis), _flipped(inward, axis), center)
            own = own + of(images) * np.repeat(sign, count)
        turned = own.reshape(rows, 2, count).transpose(0, 2, 1)
        return np.ascontiguousarray(turned).reshape(rows, 2 * count)

    def _center(self, arc: float, axis: int) -> complex | None:
        if self.center is None:
            return None
        return complex(self._image(np.array([self.center]), arc, axis)[0])

    def _image(self, place: ComplexArray, arc: float, axis: int) -> ComplexArray:
        plane = float(self.side.places[0 if arc == self.side.arc[0] else -1, axis])
        return _flipped(place, axis) + 2.0 * plane * (1.0 if axis == 0 else 1j)

    @property
    def field(self) -> FloatArray:
        """Displacements (2c, 2c) of the nodes due to unit tractions, linear between nodes."""
        side = self.side
        places, inward, arc = as_complex(side.places), -as_complex(side.outward), side.arc
        total = self._by(places, inward, self._along, arc, self.center)
        for plane, axis, sign in self._mirrored:
            flipped = self._image(places, plane, axis), _flipped(inward, axis)
            way, at = -_flipped(self._along, axis), 2.0 * plane - arc
            images = self._by(*flipped, way, at, self._center(plane, axis))
            total = total + images * sign
        for corner, weight in self._corners:
            if weight.any():
                total += self._cornered(corner) * weight[:, None, None]
        return np.asarray(total.transpose(0, 2, 1, 3).reshape(2 * side.count, 2 * side.count))

    def _cornered(self, corner: Corner) -> FloatArray:
        """Contribution of the force densities of a corner."""
        seen = as_complex(self.side.places)
        if corner.curved is not None:
            # Smooth within a hat except at the tip: represented by point forces.
            by = np.asarray(corner.beyond_wedge(self._places)) * self.side.weight[:, None, None]
        else:
            by = np.zeros((len(seen), len(seen), 2, 2))
        arc, hats, length = self._points(corner)
        x = np.maximum(corner.distance(seen), FINE_ROUND_OFF * corner.length)
        for c, d in product((0, 1), (0, 1)):
            by[:, :, c, d] += (corner.wedge.compliance(x, arc, c, d) * length) @ hats
        return by

    def _points(self, corner: Corner) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Quadrature points for tractions as distances (g,) from a corner, hat functions (g, c) of the nodes
        there, and weights (g,)."""
        at = corner.distance(as_complex(self.side.places))
        order = np.argsort(at)
        low, high = at[order[:-1], None], at[order[1:], None]
        share, weight = 0.5 * (1.0 + GAUSS[0]), 0.5 * GAUSS[1]
        first = np.arange(len(at) - 1)[:, None] == 0
        part = np.where(first, share**TIP_EXPONENT, share)
        size = np.where(first, TIP_EXPONENT * share ** (TIP_EXPONENT - 1.0), 1.0) * weight * (high - low)
        hats = np.zeros((*part.shape, len(at)))
        number = np.arange(len(at) - 1)
        hats[number, :, order[:-1]] = 1.0 - part
        hats[number, :, order[1:]] = part
        x = np.maximum(low + part * (high - low), FINE_ROUND_OFF * corner.length)
        return x.ravel(), hats.reshape(-1, len(at)), size.ravel()

    def _by(
        self,
        place: ComplexArray,
        inward: ComplexArray,
        along: ComplexArray,
        arc: FloatArray,
        center: complex | None,
    ) -> FloatArray:
        """Displacements (c, c, 2, 2) of the side's nodes due to tractions around points (c,) with unit
        normals inward and unit tangents (c,), at ``arc`` (c,) along the side or its image."""
        side, kernel = self.side, self.body.model.kernel
        seen = as_complex(side.places)
        apart = wrapped(side.arc[:, None] - arc, side.around)
        same = np.abs(apart) <= FINE_ROUND_OFF * side.arc[-1]
        w = seen[:, None] - place
        base = np.broadcast_to(inward if center is None else (seen - center)[:, None], w.shape)
        own = inward if center is None else place - center
        ahead, behind, twice = (kernel.displacement(one * along, own) for one in (1.0, -1.0, 2.0))
        by_log, turn = (twice - ahead) / np.log(2.0), 0.5 * (ahead - behind)
        smooth = kernel.displacement(np.where(same, 1.0, w), base)
        smooth -= logarithm(np.where(same, 1.0, apart))[..., None, None] * by_log
        smooth -= np.sign(apart)[..., None, None] * turn
        smooth[same] = np.broadcast_to(0.5 * (ahead + behind), smooth.shape)[same]
        if center is not None:
            smooth -= kernel.displacement(seen - center, seen - center)[:, None]
        log, sign = (_integrals(side, arc, *one) for one in (LOGARITHM, SIGN))
        found = smooth * side.weight[:, None, None] + log[..., None, None] * by_log
        return np.asarray(found + sign[..., None, None] * turn)


def _flipped(values: ComplexArray, axis: int) -> ComplexArray:
    return np.asarray(-np.conj(values) if axis == 0 else np.conj(values))


LOGARITHM: tuple[Table, Table] = (
    lambda t: 0.5 * t**2 * (logarithm(t) - 1.5),
    lambda t: t * (logarithm(t) - 1.0),
)
SIGN: tuple[Table, Table] = (lambda t: 0.5 * np.sign(t) * t**2, np.abs)
"""Second and first integrals of ln|t| and of sgn(t)."""


def _integrals(side: Points, arc: FloatArray, second: Table, first: Table) -> FloatArray:
    """Integrals (c, c), observed at the nodes, of a kernel of the distance with the hat functions of the
    nodes at ``arc`` (c,) along the side or its image."""
    steps = np.diff(arc if side.around is None else np.append(arc, arc[0] + side.around))
    if side.around is None:
        before, after = np.append(0.0, steps), np.append(steps, 0.0)
    else:
        before, after = np.roll(steps, 1), steps
    # Extended precision: second differences over short steps, far away.
    apart: FloatArray = wrapped(side.arc[:, None] - arc, side.around).astype(np.longdouble)
    total = np.zeros_like(apart)
    for step, sense in ((before, 1.0), (after, -1.0)):
        # Steps of an image that runs backwards are negative.
        way = sense * np.sign(np.where(step == 0.0, 1.0, step))
        size = np.where(step == 0.0, 1.0, np.abs(step))
        part = (second(apart + way * size) - second(apart)) / size - way * first(apart)
        total += np.where(step == 0.0, 0.0, part)
    return np.asarray(total, dtype=np.float64)
