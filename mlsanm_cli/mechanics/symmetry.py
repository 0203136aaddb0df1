"""Planes of symmetry: straight sides of bodies that are held in their normal component only.

Reflected at such a side, the body and all its tractions are those of a whole body without the side. With the
unit tangent e of the side, vectors are reflected by R = 2 e e^T - 1, and stresses by R s R. Two planes at an
angle of pi / p make a whole of 2 p copies, rotated by R R' as well.

Equation (7) of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.near_field import ComplexArray, PointForceField
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, ROUND_OFF

MAX_COPIES = 12
"""Largest number of copies of a part between two planes of symmetry."""


@dataclass(frozen=True)
class Image:
    """A reflection at a line through ``point`` (if it ``flips``), or a rotation: vectors v become ``turn`` v,
    or ``turn`` times the complex conjugate of v."""

    point: complex
    turn: complex
    flips: bool

    def points(self, z: ComplexArray) -> ComplexArray:
        """Images (...) of points."""
        return np.asarray(self.point + self.directions(z - self.point))

    def directions(self, v: ComplexArray) -> ComplexArray:
        """Images (...) of vectors."""
        return np.asarray(self.turn * (np.conj(v) if self.flips else v))

    @cached_property
    def matrix(self) -> FloatArray:
        """The same (2, 2) of vectors by components."""
        columns = self.directions(np.array([1.0, 1j]))
        return np.stack([columns.real, columns.imag])

    @cached_property
    def stress_matrix(self) -> FloatArray:
        """Stresses xx, yy, xy (3, 3) by those of which they are the images."""
        (a, b), (c, d) = self.matrix.T
        return np.array([[a * a, b * b, 2 * a * b], [c * c, d * d, 2 * c * d], [a * c, b * d, a * d + b * c]])


@dataclass(frozen=True)
class SymmetryPlane:
    """The line through ``point`` along the unit vector ``along``, which points into the body. Forces farther
    from it than ``reach`` do not need their images."""

    point: complex
    along: complex
    reach: float = 0.0

    @property
    def image(self) -> Image:
        """The reflection at it."""
        return Image(self.point, self.along**2, True)

    def height(self, z: ComplexArray) -> FloatArray:
        """Signed distances (...) of points from the plane."""
        return np.asarray(((z - self.point) * np.conj(self.along)).imag)

    def coincides(self, other: SymmetryPlane, slack: float) -> bool:
        """Whether another plane is the same line, up to a distance ``slack``."""
        parallel = abs((self.along * np.conj(other.along)).imag) <= ROUND_OFF
        return parallel and abs(float(self.height(np.array(other.point)))) <= slack

    def reflects(self, kernel: PointForceField) -> bool:
        """Whether the near field of a material is symmetric about the plane."""
        w, matrix = np.exp(1j * np.arange(1.0, 4.0)) * self.along, self.image.matrix
        base = np.full(len(w), self.along)
        field = kernel.displacement(self.image.directions(w), base)
        error = field - matrix @ kernel.displacement(w, base) @ matrix
        return bool(np.abs(error).max() <= ROUND_OFF * np.abs(field).max())


def copies_around(first: SymmetryPlane, last: SymmetryPlane) -> int | None:
    """Number 2 p of copies of a part between parallel planes or planes at an angle of pi / p, else None."""
    angle = abs(float(np.angle(last.along * np.conj(first.along))))
    count = 1 if angle <= COARSE_ROUND_OFF else round(np.pi / angle)
    closes = angle <= COARSE_ROUND_OFF or abs(angle - np.pi / count) <= COARSE_ROUND_OFF
    return 2 * count if closes and 2 * count <= MAX_COPIES else None


def images_of(planes: Sequence[SymmetryPlane]) -> tuple[Image, ...]:
    """The images of a part between up to two planes: all of a whole, or those behind parallel planes."""
    if len(planes) < 2:
        return tuple(plane.image for plane in planes)
    first, last = planes
    turn = complex(last.along * np.conj(first.along))
    if abs(turn - 1.0) <= COARSE_ROUND_OFF:
        return first.image, last.image
    if abs(turn + 1.0) <= COARSE_ROUND_OFF:
        return (first.image,)
    # The planes meet a distance from the first point.
    away = ((last.point - first.point) * np.conj(last.along)).imag / (first.along * np.conj(last.along)).imag
    center, count = first.point + away * first.along, (copies_around(first, last) or 0) // 2
    return tuple(
        Image(center, turn ** (2 * number) * (first.along**2 if flips else 1.0), flips)
        for flips in (True, False)
        for number in range(count)
        if flips or number
    )
