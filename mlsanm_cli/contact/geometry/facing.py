"""The two surfaces of a contact as functions of a common coordinate."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.cloud.surface import normals_towards
from mlsanm_cli.contact.geometry.obstacles import Shape
from mlsanm_cli.mechanics.eigenstress import Field
from mlsanm_cli.mechanics.near_field import ComplexArray, as_complex, as_real
from mlsanm_cli.records import dataclass


def turned(normal: FloatArray) -> FloatArray:
    """Vectors (n, 2) rotated by -90 degrees: (x, y) becomes (y, -x)."""
    return np.stack([normal[:, 1], -normal[:, 0]], axis=1)


@dataclass(frozen=True)
class Facing:
    """The two surfaces of a contact as functions of ``s``, the arc length along ``base``, with the closest
    points of the ``other`` surface or of a rigid ``obstacle``.

    An obstacle of larger curvature than the slave is the base itself. If the slave is not the base
    (``slave_first`` false), s is minus the arc length, so that it always increases along the slave; on a
    closed base it may continue past the start. The base is chosen by shape alone, so that results do not
    depend on the roles of slave and master. ``turn`` rotates the directions of pressures as bodies move. A
    ``profile`` over the slave's points is added to the gap.
    """

    base: Curve
    other: Curve | None
    obstacle: Shape | None = None
    slave_first: bool = True
    turn: float = 0.0
    profile: Field | None = None

    @property
    def curves(self) -> tuple[Curve, ...]:
        """The base and, if it is not an obstacle, the other surface."""
        return (self.base,) if self.other is None else (self.base, self.other)

    def _arc(self, s: FloatArray) -> FloatArray:
        arc = s if self.slave_first else -s
        return np.mod(arc, self.base.length) if self.base.closed else arc

    def _places(self, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Points (e, 2) of both surfaces, outward normals (e, 2), and directions (e, 2) of pressures."""
        arc = self._arc(s)
        points, outward = self.base.points(arc), self.base.normals(arc)
        if self.other is None:
            assert self.obstacle is not None
            there, normal = self.obstacle.closest(points, outward)
        else:
            place = self.other.closest(points)
            # At corners within the curves, normals of the sides that face each other.
            there, normal = self.other.points(place), normals_towards(self.other, place, outward)
            outward = normals_towards(self.base, arc, normal)
        along = as_real(as_complex(normal) * np.exp(1j * self.turn)) if self.turn else normal
        return points, there, outward, normal, along if self.slave_first else -along

    def opposite(self, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Points (e, 2) of the slave, opposite points of the master, and pressure directions (e, 2) on the
        slave, which are normals of the other surface."""
        points, there, *_, along = self._places(s)
        return (points, there, along) if self.slave_first else (there, points, along)

    def directions(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Directions (e, 2) of pressures and tractions on the slave, the master's outward normals turned."""
        normal = self.opposite(s)[2]
        return normal, turned(normal)

    def gap(self, s: FloatArray) -> FloatArray:
        """Initial gaps (e,)."""
        return self.gap_between(*self.opposite(s))

    def gap_between(self, points: FloatArray, partner: FloatArray, normal: FloatArray) -> FloatArray:
        """Initial gaps (e,) for the result of :meth:`opposite`."""
        drawn = np.asarray(((points - partner) * normal).sum(axis=1))
        return drawn if self.profile is None else drawn + self.profile.at(points)

    def side(self, s: FloatArray, slave: bool) -> tuple[ComplexArray, ComplexArray]:
        """Points (e,) of one of the two surfaces and unit normals (e,) into its body."""
        if slave == self.slave_first and (self.other is None or not len(self.base.corners)):
            arc = self._arc(s)
            return as_complex(self.base.points(arc)), -as_complex(self.base.normals(arc))
        return self.side_and_directions(s, slave)[:2]

    def side_and_directions(
        self, s: FloatArray, slave: bool
    ) -> tuple[ComplexArray, ComplexArray, tuple[FloatArray, FloatArray]]:
        """:meth:`side` and :meth:`directions` from one closest-point search."""
        points, there, outward, normal, along = self._places(s)
        seen = (points, outward) if slave == self.slave_first else (there, normal)
        return as_complex(seen[0]), -as_complex(seen[1]), (along, turned(along))

    def locate(self, points: FloatArray) -> FloatArray:
        """Coordinates s (e,) of ``points`` (e, 2) on or near the base, unwrapped along it."""
        arc = self.base.closest(points)
        s = arc if self.slave_first else -arc
        return np.unwrap(s, period=self.base.length) if self.base.closed else s
