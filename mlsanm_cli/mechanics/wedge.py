"""Forces near a corner: densities that free both faces of an infinite wedge of tractions.

The field of a force on a straight face (:mod:`mlsanm_cli.mechanics.near_field`) leaves that face
traction-free, but not the other face of a wedge. Force densities along both faces remove the tractions: for a
force at distance x' from the tip they are psi(ln(x / x')) per logarithm of the distance x. With the kernels A
of the tractions on the second face due to forces on the first, and B the reverse::

    psi_2 + A * (delta + psi_1) = 0,    psi_1 + B * psi_2 = 0

where * is convolution in ln x, solved by the Mellin transform. For normal forces at a right angle these are
Hetenyi's images (Hetenyi 1960, doi:10.1115/1.3643978).

If the second face slides along a straight frictionless wall, the wall is a symmetry line: forces have images
on the mirrored first face, and the wedge is twice as wide. At a right angle the images suffice.

If the second face is clamped, the forces along it suppress its deformation instead. With C and D the
derivatives by ln x of its displacements due to forces on the first face and on itself::

    C * (delta + psi_1) + D * psi_2 = 0,    psi_1 + B * psi_2 = 0

All forces then have zero resultant, and the second face moves by a constant.

Equation (10) of docs/method.md.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.kernels.radial import cubic_rows
from mlsanm_cli.mechanics.near_field import ComplexArray, PointForceField, traction
from mlsanm_cli.records import dataclass

STEP, COUNT = 0.02, 4096
"""Uniform grid of ln(x / x')."""
TRUNCATION = 38.0
"""Densities are truncated beyond this |ln(x / x')|."""
DIFFERENCE_STEP = 0.01
"""Step of finite differences of displacements, as a fraction of STEP."""


@dataclass(frozen=True)
class Wedge:
    """A wedge of a body with the near field ``kernel``, between two straight faces with unit tangents from
    the tip: ``along`` the face with forces, the material on the side ``turn`` (1j or -1j) times it, and
    ``other`` along the second face, which is free, ``sliding`` along a wall or ``clamped``. Interior angles
    up to 260 degrees, half of that if ``sliding``: branch cuts run outwards."""

    kernel: PointForceField
    along: complex
    other: complex
    turn: complex
    sliding: bool = False
    clamped: bool = False

    @property
    def second(self) -> complex:
        """Unit tangent of the second face with forces: the other face, or the mirrored first one."""
        return self.other**2 * np.conj(self.along) if self.sliding else self.other

    @property
    def image(self) -> FloatArray:
        """Image force (2, 2) on the second face of a unit force; zero unless it slides."""
        axis = np.array([self.other.real, self.other.imag])
        return self.sliding * np.asarray(2.0 * np.outer(axis, axis) - np.eye(2))

    @property
    def inward(self) -> tuple[complex, complex]:
        """Unit normals into the body, or its image, on the two faces."""
        return self.turn * self.along, -self.turn * self.second

    @cached_property
    def grid(self) -> FloatArray:
        """ln(x / x') (n,)."""
        return np.asarray(STEP * (np.arange(COUNT) - COUNT // 2), dtype=np.float64)

    @cached_property
    def densities(self) -> tuple[FloatArray, FloatArray]:
        """psi (n, 2, 2) on the two faces, components first, for forces x and y."""
        place, normals = np.exp(self.grid), [-one for one in self.inward]

        def transformed(seen: complex, by: complex, normal: complex) -> ComplexArray:
            found = traction(self.kernel.stress(place * seen - by), np.full(COUNT, normal))
            values = np.fft.ifftshift(found * place[:, None, None], axes=0)
            return np.asarray(STEP * np.fft.fft(values, axis=0))

        b = transformed(self.along, self.second, normals[0])
        if self.clamped:
            c, d = self._stretching()
            second = -np.linalg.solve(d - c @ b, c)
            first = -b @ second
        else:
            a = transformed(self.second, self.along, normals[1])
            first = np.linalg.solve(np.eye(2) - b @ a, b @ a)
            second = -a @ (np.eye(2) + first)

        def back(values: NDArray[Any]) -> FloatArray:
            found = np.fft.fftshift(np.fft.ifft(values, axis=0), axes=0).real / STEP
            found[np.abs(self.grid) > TRUNCATION] = 0.0
            return np.asarray(found)

        own, beyond = back(first), back(second)
        if not self.sliding:
            return own, beyond
        both = own + self.image @ beyond
        return both, np.asarray(self.image @ both)

    def _stretching(self) -> tuple[ComplexArray, ComplexArray]:
        """Transforms (n, 2, 2) of C and D times tan(pi z), z the transform variable. C tends to the
        logarithmic tensor L like L / (1 + exp(-t)), with the transform -pi / sin(pi z); D is L / (1 -
        exp(-t)), with the transform -pi cot(pi z), plus the step under the force."""
        shift = DIFFERENCE_STEP * STEP
        before, after = (
            self.kernel.displacement(
                np.asarray(np.exp(self.grid + sign * shift) * self.second - self.along),
                np.full(COUNT, self.inward[0]),
            )
            for sign in (-1.0, 1.0)
        )
        growing = (1.0 / (1.0 + np.exp(-self.grid)))[:, None, None] * self.logarithm
        rest = (after - before) / (2.0 * shift) - growing
        frequency = 2.0 * np.pi * np.fft.fftfreq(COUNT, STEP)[:, None, None]
        tangent = -1j * np.tanh(np.pi * frequency)
        ahead, behind = (
            self.kernel.displacement(np.array([sign * self.second]), np.array([self.inward[1]]))[0]
            for sign in (1.0, -1.0)
        )
        seen = tangent * STEP * np.fft.fft(np.fft.ifftshift(rest, axes=0), axis=0)
        seen -= np.pi / np.cosh(np.pi * frequency) * self.logarithm
        return seen, tangent * (ahead - behind) - np.pi * self.logarithm

    @cached_property
    def logarithm(self) -> FloatArray:
        """Coefficient (2, 2) of the logarithm of the length unit in displacements due to a force."""
        ahead = np.array([self.inward[0]], dtype=np.complex128)
        one, other = (self.kernel.displacement(size * ahead, ahead)[0] for size in (1.0, 2.0))
        return np.asarray((other - one) / np.log(2.0))

    @cached_property
    def moved(self) -> FloatArray:
        """Displacements (n, 2, 2) of the first face by densities and image of a unit force at distance 1."""
        kept = np.abs(self.grid) <= TRUNCATION
        total = np.zeros((COUNT, 2, 2))
        # Half a step off the grid of densities, to avoid the singular point.
        apart = STEP * (np.arange(-COUNT + 1, COUNT) + 0.5)
        for density, face, inward in zip(self.densities, (self.along, self.second), self.inward, strict=True):
            w = np.asarray(np.exp(np.minimum(apart, 600.0)) * self.along - face, dtype=np.complex128)
            seen = self.kernel.displacement(w, np.full(len(w), inward))
            # Discrete convolution: the sum over k of seen[j - k] density[k].
            spectra = [np.fft.rfft(one, 4 * COUNT, axis=0) for one in (seen, density)]
            product = np.fft.irfft(spectra[0] @ spectra[1], 4 * COUNT, axis=0)
            total += STEP * product[COUNT - 1 : 2 * COUNT - 1]
            total += self.logarithm @ (STEP * (self.grid[:, None, None] * density)[kept].sum(axis=0))
        # Correction for a logarithmic singularity midway between grid points (Sidi and Israeli 1988,
        # doi:10.1007/BF01061258).
        middle = interpolated(self.densities[0], self.grid + 0.5 * STEP)
        total -= STEP * np.log(2.0) * (self.logarithm @ middle)
        if self.sliding:
            w = np.asarray(np.exp(self.grid + 0.5 * STEP) * self.along - self.second, dtype=np.complex128)
            total += self.kernel.displacement(w, np.full(len(w), self.inward[1])) @ self.image
        return total

    def compliance(self, x: FloatArray, source: FloatArray, which: int, by: int) -> FloatArray:
        """These displacements ``which`` (e, k) at ``x`` (e,) by forces in ``by`` at ``source`` (k,)."""
        own = interpolated(self.moved[:, which, by], np.log(x)[:, None] - (np.log(source) + 0.5 * STEP))
        whole = STEP * (self.densities[0] + self.densities[1]).sum(axis=0) + self.image
        return np.asarray(own + np.log(source) * (self.logarithm @ whole)[which, by])


def interpolated(table: FloatArray, t: FloatArray) -> FloatArray:
    """Cubic interpolation (..., rest) of a ``table`` (n, rest) over the grid at ``t``, constant beyond."""
    return cubic(table, t / STEP + COUNT // 2)


def cubic(table: FloatArray, at: FloatArray) -> FloatArray:
    """Cubic interpolation (..., rest) of a ``table`` (n, rest) at fractional row numbers ``at`` (...)."""
    rows = np.ascontiguousarray(table.reshape(len(table), -1))
    found = cubic_rows(rows, np.ascontiguousarray(at, dtype=np.float64).ravel())
    return np.asarray(found).reshape(*at.shape, *table.shape[1:])
