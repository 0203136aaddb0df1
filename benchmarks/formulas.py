"""Closed formulas that tests and the gallery compare with."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.app.checks.references import HertzLine
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation.series import root

ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class LameRing:
    """A ring of radii ``inner`` and ``outer`` under ``pressure`` from inside.

    ``modulus`` and ``poisson`` are E and nu in plane stress, E/(1 - nu^2) and nu/(1 - nu) in plane strain.

    Thick ring under pressure (Lame; Timoshenko and Goodier, Theory of Elasticity, section 28).
    """

    inner: float
    outer: float
    pressure: float
    modulus: float
    poisson: float

    @property
    def _factor(self) -> float:
        return self.pressure * self.inner**2 / (self.outer**2 - self.inner**2)

    def stress(self, r: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Radial and hoop stress (n,) at radii ``r`` (n,)."""
        ratio = (self.outer / r) ** 2
        return self._factor * (1.0 - ratio), self._factor * (1.0 + ratio)

    def displacement(self, r: FloatArray) -> FloatArray:
        """Radial displacement (n,)."""
        radial, hoop = self.stress(r)
        result: FloatArray = r / self.modulus * (hoop - self.poisson * radial)
        return result


def press_fit(inner: LameRing, outer: LameRing, interference: float) -> float:
    """Pressure between two rings, the inner one too large by ``interference`` in its radius.

    The ``pressure`` of the rings does not count. The inner ring's outer radius is the outer's inner one::

        interference = p (u_outer + u_inner) with u their radial displacements there under a unit pressure
    """
    radius = np.array([outer.inner])
    widened = float(replace(outer, pressure=1.0).displacement(radius)[0])
    # A pressure from outside is one from both sides less one from inside.
    even = -radius[0] * (1.0 - inner.poisson) / inner.modulus
    narrowed = even - float(replace(inner, pressure=1.0).displacement(radius)[0])
    return float(interference / (widened - narrowed))


@dataclass(frozen=True)
class KirschHole:
    """A hole of ``radius`` about the origin, the plate pulled along x by ``tension`` far away.

    Circular hole in an endless plate under tension (Kirsch; Timoshenko and Goodier, section 35).
    """

    radius: float
    tension: float

    def stress(self, points: FloatArray) -> FloatArray:
        """Stress (n, 3) in the order xx, yy, xy at ``points`` (n, 2) outside the hole."""
        x, y = points.T
        angle = np.arctan2(y, x)
        a2 = self.radius**2 / (x**2 + y**2)
        a4 = a2**2
        two, four = 2.0 * angle, 4.0 * angle
        xx = 1.0 - a2 * (1.5 * np.cos(two) + np.cos(four)) + 1.5 * a4 * np.cos(four)
        yy = -a2 * (0.5 * np.cos(two) - np.cos(four)) - 1.5 * a4 * np.cos(four)
        xy = -a2 * (0.5 * np.sin(two) + np.sin(four)) + 1.5 * a4 * np.sin(four)
        return np.asarray(self.tension * np.stack([xx, yy, xy], axis=1))

    def displacement(self, points: FloatArray, modulus: float, poisson: float) -> FloatArray:
        """Displacement (n, 2) at ``points`` (n, 2) outside the hole, in plane stress."""
        x, y = points.T
        rho, angle = np.hypot(x, y) / self.radius, np.arctan2(y, x)
        kappa = (3.0 - poisson) / (1.0 + poisson)
        scale = self.tension * self.radius * (1.0 + poisson) / (4.0 * modulus)
        one, three = angle, 3.0 * angle
        along = rho * (kappa + 1.0) * np.cos(one) + 2.0 / rho * ((1.0 + kappa) * np.cos(one) + np.cos(three))
        across = rho * (kappa - 3.0) * np.sin(one) + 2.0 / rho * ((1.0 - kappa) * np.sin(one) + np.sin(three))
        both = [along - 2.0 / rho**3 * np.cos(three), across - 2.0 / rho**3 * np.sin(three)]
        return np.asarray(scale * np.stack(both, axis=1))


@dataclass(frozen=True)
class AnisotropicHole:
    """A hole of ``radius`` about the origin in a plate with a ``stiffness`` (3, 3) in plane stress, pulled
    along x by ``tension`` far away. Not for isotropic plates, whose roots are one.

    Circular hole in an endless anisotropic plate under tension (Lekhnitskii, Anisotropic Plates, section 38).

    Two functions of z_k = x + mu_k y, with the roots mu_k of the characteristic equation above the real axis,
    A_k / zeta_k each, where zeta_k maps the outside of the hole's image in that plane to that of a circle.
    """

    stiffness: FloatArray
    radius: float
    tension: float

    def _parts(self, points: FloatArray) -> Iterator[tuple[complex, ComplexArray, ComplexArray]]:
        """Both roots, their functions (n,) and derivatives (n,) at ``points`` (n, 2)."""
        a, (x, y) = np.linalg.inv(self.stiffness), points.T
        roots = np.roots([a[0, 0], -2.0 * a[0, 2], 2.0 * a[0, 1] + a[2, 2], -2.0 * a[1, 2], a[1, 1]])
        one, other = roots[roots.imag > 0.0]
        factor = 0.5j * self.tension * self.radius / (other - one)
        for mu, share in ((one, factor), (other, -factor)):
            z, unit = x + mu * y, self.radius * (1.0 - 1j * mu)
            away = np.sqrt(z**2 - self.radius**2 * (1.0 + mu**2))
            # The branch outside the circle.
            away = np.where(np.abs(z + away) < np.abs(z - away), -away, away)
            zeta = (z + away) / unit
            yield mu, share / zeta, -share / zeta**2 * (1.0 + z / away) / unit

    def stress(self, points: FloatArray) -> FloatArray:
        """Stress (n, 3) in the order xx, yy, xy at ``points`` (n, 2) outside the hole."""
        found = np.tile([self.tension, 0.0, 0.0], (len(points), 1))
        for mu, _, slope in self._parts(points):
            found += 2.0 * np.stack([mu**2 * slope, slope, -mu * slope], axis=1).real
        return found

    def displacement(self, points: FloatArray) -> FloatArray:
        """Displacement (n, 2) at ``points`` (n, 2) outside the hole, but for a rigid motion."""
        a, (x, y) = np.linalg.inv(self.stiffness), points.T
        far = [a[0, 0] * x + 0.5 * a[0, 2] * y, a[0, 1] * y + 0.5 * a[0, 2] * x]
        found = self.tension * np.stack(far, axis=1)
        for mu, value, _ in self._parts(points):
            along = a[0, 0] * mu**2 + a[0, 1] - a[0, 2] * mu
            across = a[0, 1] * mu + a[1, 1] / mu - a[1, 2]
            found += 2.0 * np.stack([along * value, across * value], axis=1).real
        return found


FIT = 0.91357
"""b of a pin without clearance: 84.8 degrees to either side, whatever the force."""


@dataclass(frozen=True)
class PinInHole:
    """A pin of ``radius`` in a hole larger by ``clearance`` > 0, pressed by ``force`` per unit thickness.

    ``modulus`` is E in plane stress and E/(1-ν²) in plane strain.

    Pin in a hole of nearly its own size, without friction, both of one material (Persson 1964).

    As given by Ciavarella and Decuzzi, International Journal of Solids and Structures 38 (2001) 4507,
    doi:10.1016/S0020-7683(00)00289-4: the pin is pressed by a force at its centre, the plate is endless. With
    b = tan(ε/2), ε half the angle of contact, Q the force per thickness, ΔR the clearance in radius:

        E* ΔR / Q = (2 - 2 b⁴ - ln(1 + b²)) / (π b² (1 + b²))
        p(θ) = Q/R [2/(π √(1+b²)) √(b²-y²)/(1+y²)
               + ln((√(1+b²)+√(b²-y²)) / (√(1+b²)-√(b²-y²))) / (2π b² (1+b²))]

    y = tan(θ/2), and E* = E in plane stress, E/(1-ν²) in plane strain.
    """

    radius: float
    clearance: float
    force: float
    modulus: float

    @cached_property
    def b(self) -> float:
        """tan(ε/2)."""
        ratio = self.modulus * self.clearance / self.force
        # The ratio falls as b grows; the half-plane's b² = 2/(π ratio) is above the root.
        high = min(2.0 * FIT, math.sqrt(2.0 / (math.pi * ratio)))
        return root(lambda b: clearance_ratio(b) - ratio, 1e-3 * high, high, 1e-15)

    @property
    def half_angle(self) -> float:
        """ε, half the angle of contact (radian)."""
        return 2.0 * math.atan(self.b)

    @property
    def peak_pressure(self) -> float:
        """Pressure in the middle of the contact."""
        return float(self.pressure(np.zeros(1))[0])

    def pressure(self, angle: FloatArray) -> FloatArray:
        """Pressure (n,) at ``angle`` (n,) from the line of the force (radian)."""
        b2 = self.b**2
        y2 = np.minimum(np.tan(0.5 * np.abs(angle)) ** 2, b2)
        width, root = math.sqrt(1.0 + b2), np.sqrt(b2 - y2)
        first = 2.0 / (math.pi * width) * root / (1.0 + y2)
        second = np.log((width + root) / (width - root)) / (2.0 * math.pi * b2 * (1.0 + b2))
        inside = np.abs(angle) < self.half_angle
        return np.asarray(np.where(inside, self.force / self.radius * (first + second), 0.0))


def clearance_ratio(b: float) -> float:
    """E* ΔR / Q of a contact with tan(ε/2) = ``b``."""
    return (2.0 - 2.0 * b**4 - math.log1p(b**2)) / (math.pi * b**2 * (1.0 + b**2))


def plates_approach(force: float, radius: float, modulus: float) -> float:
    """By how much two rigid plates come closer that squeeze a cylinder between them (Johnson 1985, eq. 5.57).

    ``modulus`` is the cylinder's E/(1 - nu^2) in plane strain; a is the half-width on either side::

        approach = 2 P / (pi modulus) (2 ln(4 R / a) - 1)
    """
    width = HertzLine(force, radius, modulus).half_width
    return 2.0 * force / (math.pi * modulus) * (2.0 * math.log(4.0 * radius / width) - 1.0)


@dataclass(frozen=True)
class FlatPunch:
    """A smooth punch of ``half_width`` a pressed by ``force`` P per unit thickness.

    Flat rigid punch on a half-plane (Johnson, Contact Mechanics, 1985, section 2.8).

    doi:10.1017/CBO9781139171731
    """

    force: float
    half_width: float

    def pressure(self, x: FloatArray) -> FloatArray:
        """P / (pi sqrt(a^2 - x^2)) at |x| < a from the middle; infinite at the edges."""
        result: FloatArray = self.force / (np.pi * np.sqrt(self.half_width**2 - x**2))
        return result


def stress_below(hertz: HertzLine, x: FloatArray, z: FloatArray) -> FloatArray:
    """Stresses (n, 3) in the order xx, zz, xz at depth z > 0 below a Hertz line contact (McEwen 1949, as
    given by Johnson 1985, chapter 4)."""
    a, p0 = hertz.half_width, hertz.peak_pressure
    s = a**2 - x**2 + z**2
    root = np.sqrt(s**2 + 4.0 * x**2 * z**2)
    m = np.sqrt(0.5 * (root + s))
    n = np.copysign(np.sqrt(np.maximum(0.5 * (root - s), 0.0)), x)
    ratio = (z**2 + n**2) / (m**2 + n**2)
    xx = -(p0 / a) * (m * (1.0 + ratio) - 2.0 * z)
    zz = -(p0 / a) * m * (1.0 - ratio)
    xz = -(p0 / a) * n * (m**2 - z**2) / (m**2 + n**2)
    return np.stack([xx, zz, xz], axis=1)
