"""Closed-form near field of surface forces: the simple radial stress distribution.

A force F at the surface point zeta, with w = z - zeta, causes the stresses -(2/pi) (F . w) w w^T / |w|^4
in an isotropic body (Flamant and Boussinesq; Johnson, Contact Mechanics, 1985,
doi:10.1017/CBO9781139171731, section 2.2): on a smooth surface their traction is F at zeta and smooth
elsewhere, so that the rest of the body's response is smooth at zeta. Points and vectors are complex
numbers x + i y. Displacements by unit forces in x and y are (..., 2, 2) arrays, components first, stresses
xx, yy and xy (..., 3, 2). Equation (6) of docs/method.md."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.kernels.radial import radial_displacement, radial_stress
from mlsanm_cli.mechanics.material import PlaneMaterial
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF

ComplexArray = NDArray[np.complex128]

BATCH_SIZE = 20_000
"""Pairs of a point and a force processed at once, which fit into the cache."""
SURFACE_INSET = 1e-3
"""Points on surfaces and forces at corners are shifted inside by this part of the local length."""


class PointForceField(Protocol):
    """The field of a unit force at the origin on the surface of a body of one material."""

    def displacement(self, w: ComplexArray, base: ComplexArray) -> FloatArray:
        """Displacements (..., 2, 2) at ``w``; angles from ``base``, the branch cut along -base."""

    def stress(self, w: ComplexArray) -> FloatArray:
        """Stresses (..., 3, 2) at ``w`` (...)."""

    def along(self, tangent: ComplexArray) -> FloatArray:
        """Traction (..., 2, 2) next to the force per unit curvature, by the unit ``tangent`` (...)."""


@dataclass(frozen=True)
class Isotropic:
    """Near field of an isotropic material with ``shear`` modulus and Muskhelishvili's constant ``kappa``."""

    shear: float
    kappa: float

    def displacement(self, w: ComplexArray, base: ComplexArray) -> FloatArray:
        flat = radial_displacement(_flat(w), _flat(np.broadcast_to(base, w.shape)), self.kappa)
        return flat.reshape(*w.shape, 2, 2) / (4.0 * np.pi * self.shear)

    def stress(self, w: ComplexArray) -> FloatArray:
        return -2.0 / np.pi * radial_stress(_flat(w)).reshape(*w.shape, 3, 2)

    def along(self, tangent: ComplexArray) -> FloatArray:
        x, y = tangent.real, tangent.imag
        table = np.stack([x * x, x * y, y * x, y * y], axis=-1)
        return -table.reshape(*table.shape[:-1], 2, 2) / np.pi


@dataclass(frozen=True)
class Anisotropic:
    """Near field of an anisotropic material: characteristic ``roots`` (2,), displacement factors ``p``, ``q``
    (2,). With z_k = x + root_k y and the potentials Phi_k = C_k log z_k, stresses are 2 Re sum (root_k^2, 1,
    -root_k) Phi_k', displacements 2 Re sum (p_k, q_k) Phi_k (Lekhnitskii, Theory of Elasticity of an
    Anisotropic Body, 1963)."""

    roots: ComplexArray
    p: ComplexArray
    q: ComplexArray

    @cached_property
    def _strengths(self) -> ComplexArray:
        """C_k for unit forces x and y (2, 2)."""
        system = np.stack([np.ones(2), self.roots])
        return np.asarray(np.linalg.solve(system, np.array([[0.0, -1j], [1j, 0.0]]) / (2.0 * np.pi)))

    def _own(self, w: ComplexArray) -> ComplexArray:
        """z_k (..., 2) of points or vectors (...)."""
        return np.asarray(w.real[..., None] + self.roots * w.imag[..., None])

    def _sums(self, factors: list[ComplexArray], values: ComplexArray) -> FloatArray:
        """2 Re sum factor_k value_k C_k (..., len(factors), 2)."""
        table = 2.0 * np.einsum("rk,...k,kd->...rd", np.stack(factors), values, self._strengths)
        return np.ascontiguousarray(table.real)

    def displacement(self, w: ComplexArray, base: ComplexArray) -> FloatArray:
        own = self._own(w)
        logarithm = np.log(np.abs(own)) + 1j * np.angle(own / self._own(base))
        return self._sums([self.p, self.q], logarithm)

    def stress(self, w: ComplexArray) -> FloatArray:
        return self._sums([self.roots**2, self.roots**0, -self.roots], 1.0 / self._own(w))

    def along(self, tangent: ComplexArray) -> FloatArray:
        # Leading terms of sigma(w) n(w) along w = e t - e^2 n / 2 on a surface of unit curvature.
        normal, own = -1j * tangent, self._own(tangent)
        steeper = self._sums([self.roots**2, self.roots**0, -self.roots], -self._own(normal) / own**2)
        return traction(self.stress(tangent), tangent) - 0.5 * traction(steeper, normal)


def kernel_of(material: PlaneMaterial) -> PointForceField:
    """The near field of a material."""
    c = material.in_plane
    shear, first = c[2, 2], c[0, 1]
    even = np.array([[first + 2.0 * shear, first, 0.0], [first, first + 2.0 * shear, 0.0], [0.0, 0.0, shear]])
    # Characteristic roots of nearly isotropic materials almost coincide, their fields are differences.
    if np.abs(c - even).max() <= ROUND_OFF * np.abs(c).max():
        return Isotropic(float(shear), float((first + 3.0 * shear) / (first + shear)))
    a, roots = np.linalg.inv(c), material.roots
    p = a[0, 0] * roots**2 + a[0, 1] - a[0, 2] * roots
    q = a[0, 1] * roots + a[1, 1] / roots - a[1, 2]
    return Anisotropic(roots, p, q)


def traction(stress: FloatArray, normal: ComplexArray) -> FloatArray:
    """Tractions (..., 2, 2) of stresses (..., 3, 2) on ``normal`` vectors (...)."""
    x, y = normal.real[..., None], normal.imag[..., None]
    xx, yy, xy = np.moveaxis(stress, -2, 0)
    return np.stack([xx * x + xy * y, xy * x + yy * y], axis=-2)


def as_complex(vectors: FloatArray) -> ComplexArray:
    """Vectors (..., 2) as complex numbers (...)."""
    return np.asarray(vectors[..., 0] + 1j * vectors[..., 1])


def as_real(numbers: ComplexArray) -> FloatArray:
    """Complex numbers (...) as vectors (..., 2)."""
    return np.stack([numbers.real, numbers.imag], axis=-1)


def _flat(numbers: ComplexArray) -> FloatArray:
    """Complex numbers (...) as vectors (n, 2)."""
    return np.ascontiguousarray(numbers, dtype=np.complex128).view(np.float64).reshape(-1, 2)


def by_component(table: FloatArray) -> FloatArray:
    """Displacements (e, k, 2, 2) as a matrix (2e, 2k): rows x of all points, then y; columns likewise."""
    e, k = table.shape[:2]
    return table.transpose(2, 0, 3, 1).reshape(2 * e, 2 * k)


def summed(fields: Callable[[ComplexArray], FloatArray], z: ComplexArray, force: FloatArray) -> FloatArray:
    """Sums (e, r, c) of the ``fields`` (e, k, r, 2) at points ``z`` (e,) by forces (k, 2, c)."""
    parts = np.array_split(z, 1 + len(z) * len(force) // BATCH_SIZE)
    return np.concatenate([np.tensordot(fields(some), force, ((1, 3), (0, 1))) for some in parts])


@dataclass(frozen=True)
class SurfaceForces:
    """Unit forces in x and y at points ``place`` (k,) of a body's surface with ``inward`` unit normals (k,),
    and the near field ``kernel`` of its material. In hollows every field ends at a ``center`` in the void,
    where the opposite force acts; the branch cut of the displacement is the line between both. Elsewhere it
    runs outwards along the normal."""

    kernel: PointForceField
    place: ComplexArray
    inward: ComplexArray
    center: complex | None = None

    def displacement(self, z: ComplexArray) -> FloatArray:
        """Displacements (e, k, 2, 2) at points ``z`` (e,) other than those of the forces."""
        return self.displacement_of_each(z[:, None])

    def stress(self, z: ComplexArray) -> FloatArray:
        """Stresses (e, k, 3, 2) at points ``z`` (e,)."""
        return self.stress_of_each(z[:, None])

    def displacement_of_each(self, z: ComplexArray) -> FloatArray:
        """Displacements (..., k, 2, 2) by each force at its own point ``z`` (..., k or 1)."""
        w = z - self.place
        if self.center is None:
            return self.kernel.displacement(w, self.inward)
        other = z - self.center
        return self.kernel.displacement(w, other) - self.kernel.displacement(other, other)

    def stress_of_each(self, z: ComplexArray) -> FloatArray:
        """Stresses (..., k, 3, 2) by each force at its own point ``z`` (..., k or 1)."""
        own = self.kernel.stress(z - self.place)
        return own if self.center is None else own - self.kernel.stress(z - self.center)

    def traction(self, z: ComplexArray, normal: ComplexArray, curvature: FloatArray) -> FloatArray:
        """Tractions (e, k, 2, 2) at surface points ``z`` (e,) with outward ``normal`` and ``curvature`` (e,);
        at the point of a force, the regular part."""
        w = z[:, None] - self.place
        at = np.abs(w) <= AT_FORCE * np.abs(z).max(initial=0.0)
        outward = np.broadcast_to(normal[:, None], w.shape)
        found = traction(self.kernel.stress(np.where(at, 1.0, w)), outward)
        e, k = np.nonzero(at)
        found[e, k] = curvature[e, None, None] * self.kernel.along(1j * normal[e])
        if self.center is not None:
            found -= traction(self.kernel.stress((z - self.center)[:, None]), normal[:, None])
        return found


AT_FORCE = 5e-6
"""Points closer to a force than this fraction of the coordinates get the traction at the force."""
