"""Hyperelastic laws in the plane: first Piola-Kirchhoff stress P of the deformation gradient F, as series.

With Lame's constants lam and mu (of small strains), E = (F^T F - 1)/2 and J = det F in three dimensions::

    saint-venant-kirchhoff    P = F S,  S = lam tr(E) 1 + 2 mu E
    neo-hookean               P = mu F + (lam ln J - mu) F^-T

In plane strain the out-of-plane stretch is 1. In plane stress it makes the out-of-plane stress vanish: S is
linear in E with lam* = 2 lam mu / (lam + 2 mu) in place of lam; for neo-Hooke the squared stretch theta
solves mu (theta - 1) + lam ln(J_2 sqrt(theta)) = 0, J_2 = det F in the plane, so that P = mu F - mu theta
F^-T.

A body with thermal stretch w deforms elastically by F / w, out of plane too::

    P(F) = w^2 P_e(F / w)

Components are ordered 11, 12, 21, 22. Bonet and Wood, Nonlinear Continuum Mechanics for Finite Element
Analysis, sections 6.4 and 6.5.

Equations (19) and (21) of docs/method.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.finite.response import Kind, Kirchhoff, Neo, Response, Warm

WAVE_DIRECTIONS = 24
"""Directions, over half a turn, in which ellipticity is tested."""


@dataclass(frozen=True)
class Law:
    """A law of one of two kinds, with Lame's constants ``lam``, ``mu`` in ``plane`` "strain" or "stress"."""

    kind: Kind
    lam: float
    mu: float
    plane: str

    @classmethod
    def isotropic(cls, kind: Kind, modulus: float, poisson: float, plane: str) -> Law:
        """The law for Young's ``modulus`` and ``poisson`` ratio."""
        lam = modulus * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)) if poisson < 0.5 else np.inf
        return cls(kind, lam, 0.5 * modulus / (1.0 + poisson), plane)

    def series(self, orders: int, jets: int, points: int, warm: bool = False) -> Response:
        """Empty series of ``orders`` beyond the state at ``points`` points, with ``jets`` of 1 (values) or 3
        (with spatial derivatives); with thermal stretches if ``warm``."""
        shape = (orders + 1, jets, points)
        make = Neo if self.kind == "neo-hookean" else Kirchhoff
        return Warm(make(self, shape), shape) if warm else make(self, shape)

    def state(self, gradient: FloatArray, stretch: FloatArray | None = None, orders: int = 0) -> Response:
        """The response, values only, to a displacement ``gradient`` (4, n) and thermal ``stretch`` (n,), with
        room for ``orders``."""
        response = self.series(orders, 1, gradient.shape[1], stretch is not None)
        response.put(0, gradient[:, None], None if stretch is None else stretch[None])
        return response

    def stress(self, gradient: FloatArray, stretch: FloatArray | None = None) -> FloatArray:
        """P (4, n) at a displacement ``gradient`` (4, n) and thermal ``stretch`` (n,)."""
        return np.asarray(self.state(gradient, stretch).stress[:, 0, 0])

    def moduli(self, gradient: FloatArray, stretch: FloatArray | None = None) -> FloatArray:
        """dP/dF (4, 4, n) at a displacement ``gradient`` (4, n) and thermal ``stretch`` (n,)."""
        response = self.state(gradient, stretch, 1)
        found = np.empty((4, 4, gradient.shape[1]))
        for component in range(4):
            unit = np.zeros((4, 1, gradient.shape[1]))
            unit[component] = 1.0
            response.put(1, unit)
            found[:, component] = response.stress[:, 1, 0]
        return found

    def across(self, gradient: FloatArray, stretch: FloatArray | None = None) -> FloatArray:
        """Out-of-plane stretch (n,)."""
        if self.plane == "strain":
            return np.ones(gradient.shape[1])
        return np.asarray(self.state(gradient, stretch).across())

    def stress_across(self, gradient: FloatArray, stretch: FloatArray | None = None) -> FloatArray:
        """Out-of-plane Cauchy stress (n,)."""
        if self.plane == "stress":
            return np.zeros(gradient.shape[1])
        w = np.ones(gradient.shape[1]) if stretch is None else stretch
        thin = 1.0 / w**2
        strain = green(gradient)
        if self.kind == "neo-hookean":
            volume = (1.0 + determinant(gradient)) / w**3
            return np.asarray((self.lam * np.log(volume) + self.mu * (thin - 1.0)) / volume)
        whole = (strain[0] + strain[1]) * thin + 1.5 * (thin - 1.0)
        second = self.lam * whole + self.mu * (thin - 1.0)
        return np.asarray(w * second / (1.0 + determinant(gradient)))

    def ellipticity(self, gradient: FloatArray, stretch: FloatArray | None = None) -> FloatArray:
        """Smallest eigenvalue (n,) over mu of the acoustic tensor A_iJkL N_J N_L over all directions N; where
        it is not positive the material loses ellipticity."""
        moduli = self.moduli(gradient, stretch).reshape(2, 2, 2, 2, -1)
        least = np.full(gradient.shape[1], np.inf)
        for angle in np.linspace(0.0, np.pi, WAVE_DIRECTIONS, endpoint=False):
            n = np.array([np.cos(angle), np.sin(angle)])
            q = np.einsum("iJkLn,J,L->ikn", moduli, n, n)
            mean, half = 0.5 * (q[0, 0] + q[1, 1]), 0.5 * (q[0, 0] - q[1, 1])
            least = np.minimum(least, mean - np.hypot(half, 0.5 * (q[0, 1] + q[1, 0])))
        return least / self.mu


def gradient_of(derivatives: FloatArray) -> FloatArray:
    """Displacement gradient (4, n) from ``derivatives`` (n, 3 or more, 2): value, d/dX, d/dY, ..."""
    return np.asarray(derivatives[:, 1:3].transpose(2, 1, 0).reshape(4, -1))


def determinant(gradient: FloatArray) -> FloatArray:
    """det F - 1 (n,) in the plane for a displacement ``gradient`` (4, n), accurate for small ones."""
    xx, xy, yx, yy = gradient
    return np.asarray(xx + yy + xx * yy - xy * yx)


def green(gradient: FloatArray) -> FloatArray:
    """Green-Lagrange strains xx, yy, xy (3, n) for a displacement ``gradient`` (4, n)."""
    xx, xy, yx, yy = gradient
    return np.stack(
        [xx + 0.5 * (xx**2 + yx**2), yy + 0.5 * (xy**2 + yy**2), 0.5 * (xy + yx + xx * xy + yx * yy)]
    )


def cauchy_stress(law: Law, gradient: FloatArray, stretch: FloatArray | None = None) -> FloatArray:
    """Cauchy stresses xx, yy, xy (3, n) at a displacement ``gradient`` (4, n) and thermal ``stretch``
    (n,)."""
    stress = law.stress(gradient, stretch)
    f = gradient + np.array([1.0, 0.0, 0.0, 1.0])[:, None]
    volume = (1.0 + determinant(gradient)) * law.across(gradient, stretch)
    xx, xy = stress[0] * f[0] + stress[1] * f[1], stress[0] * f[2] + stress[1] * f[3]
    yy = stress[2] * f[2] + stress[3] * f[3]
    return np.stack([xx, yy, xy]) / volume


def stretches(gradient: FloatArray) -> FloatArray:
    """In-plane principal stretches (2, n), the larger first."""
    xx, yy, xy = 2.0 * green(gradient)
    mean, half = 1.0 + 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    return np.asarray(np.sqrt(np.stack([mean + half, np.maximum(mean - half, 0.0)])))
