"""Hyperelastic laws in the plane: first Piola-Kirchhoff stress P by the deformation gradient F, as series.

With Lame's constants lam and mu (of small strains), E = (F^T F - 1)/2 and J = det F in three dimensions::

    saint-venant-kirchhoff    P = F S,  S = lam tr(E) 1 + 2 mu E
    neo-hookean               P = mu F + (lam ln J - mu) F^-T

In plane strain the stretch across the plane is 1. In plane stress it is what leaves no stress there: S is
linear in E with lam* = 2 lam mu / (lam + 2 mu) in place of lam; and the square of the stretch, theta, solves
mu (theta - 1) + lam ln(J_2 sqrt(theta)) = 0, J_2 = det F in the plane, so that P = mu F - mu theta F^-T.

Components go 11, 12, 21, 22. Bonet and Wood, Nonlinear Continuum Mechanics for Finite Element Analysis,
sections 6.4 and 6.5.

Equations (23) and (24) of docs/method.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.finite.jets import cauchy, inverse, times, weighted

Kind = Literal["saint-venant-kirchhoff", "neo-hookean"]
COFACTOR = ((3, 1.0), (2, -1.0), (1, -1.0), (0, 1.0))
"""Which component of F, with which sign, is each one of det(F) F^-T in the plane."""
ITERATIONS = 60
DIRECTIONS = 24
"""Directions over half a turn in which waves are tried."""


@dataclass(frozen=True)
class Law:
    """A law of one of two kinds with Lame's constants ``lam``, ``mu`` in ``plane`` "strain" or "stress"."""

    kind: Kind
    lam: float
    mu: float
    plane: str

    @classmethod
    def isotropic(cls, kind: Kind, modulus: float, poisson: float, plane: str) -> Law:
        """By Young's ``modulus`` and ``poisson`` ratio."""
        lam = modulus * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)) if poisson < 0.5 else np.inf
        return cls(kind, lam, 0.5 * modulus / (1.0 + poisson), plane)

    def series(self, orders: int, jets: int, points: int) -> Response:
        """Empty series of so many ``orders`` beyond the state itself at so many ``points``, with ``jets`` of
        1 (values) or 3 (with derivatives in space)."""
        shape = (orders + 1, jets, points)
        make = _Neo if self.kind == "neo-hookean" else _Kirchhoff
        return make(self, shape)

    def stress(self, gradient: FloatArray) -> FloatArray:
        """P (4, n) by the displacement ``gradient`` (4, n)."""
        response = self.series(0, 1, gradient.shape[1])
        response.put(0, gradient[:, None])
        return np.asarray(response.stress[:, 0, 0])

    def moduli(self, gradient: FloatArray) -> FloatArray:
        """dP/dF (4, 4, n) at a displacement ``gradient`` (4, n)."""
        response = self.series(1, 1, gradient.shape[1])
        response.put(0, gradient[:, None])
        found = np.empty((4, 4, gradient.shape[1]))
        for component in range(4):
            unit = np.zeros((4, 1, gradient.shape[1]))
            unit[component] = 1.0
            response.put(1, unit)
            found[:, component] = response.stress[:, 1, 0]
        return found

    def across(self, gradient: FloatArray) -> FloatArray:
        """The stretch (n,) across the plane."""
        if self.plane == "strain":
            return np.ones(gradient.shape[1])
        if self.kind == "neo-hookean":
            response = self.series(0, 1, gradient.shape[1])
            response.put(0, gradient[:, None])
            assert isinstance(response, _Neo)
            return np.asarray(np.sqrt(response.theta[0, 0]))
        strain = green(gradient)
        square = 1.0 - 2.0 * self.lam / (self.lam + 2.0 * self.mu) * (strain[0] + strain[1])
        return np.asarray(np.sqrt(np.maximum(square, 0.0)))

    def stress_across(self, gradient: FloatArray) -> FloatArray:
        """Cauchy's stress (n,) across the plane."""
        if self.plane == "stress":
            return np.zeros(gradient.shape[1])
        volume = 1.0 + determinant(gradient)
        if self.kind == "neo-hookean":
            return np.asarray(self.lam * np.log(volume) / volume)
        strain = green(gradient)
        return np.asarray(self.lam * (strain[0] + strain[1]) / volume)

    def ellipticity(self, gradient: FloatArray) -> FloatArray:
        """The least eigenvalue (n,) over mu of the acoustic tensor A_iJkL N_J N_L over all directions N: a
        solid that loses waves in one of them (value <= 0) has no unique state any more."""
        moduli = self.moduli(gradient).reshape(2, 2, 2, 2, -1)
        least = np.full(gradient.shape[1], np.inf)
        for angle in np.linspace(0.0, np.pi, DIRECTIONS, endpoint=False):
            n = np.array([np.cos(angle), np.sin(angle)])
            q = np.einsum("iJkLn,J,L->ikn", moduli, n, n)
            mean, half = 0.5 * (q[0, 0] + q[1, 1]), 0.5 * (q[0, 0] - q[1, 1])
            least = np.minimum(least, mean - np.hypot(half, 0.5 * (q[0, 1] + q[1, 0])))
        return least / self.mu


class Response:
    """Series of F and P at points, filled order by order: both are (4, K + 1, j, n)."""

    def __init__(self, law: Law, shape: tuple[int, int, int]) -> None:
        self.law = law
        self.gradient = np.zeros((4, *shape))
        self.stress = np.zeros((4, *shape))

    def put(self, order: int, gradient: FloatArray | None) -> None:
        """Set ``order`` of the displacement gradient (4, j, n), None for nothing yet, and find P there."""
        self.gradient[:, order] = 0.0 if gradient is None else gradient
        if not order:
            self.gradient[[0, 3], 0, 0] += 1.0
        self._respond(order)

    def _respond(self, order: int) -> None:
        raise NotImplementedError

    def _product(self, one: FloatArray, other: FloatArray, order: int) -> FloatArray:
        return cauchy(one, other, order)


class _Kirchhoff(Response):
    def __init__(self, law: Law, shape: tuple[int, int, int]) -> None:
        super().__init__(law, shape)
        self._second = np.zeros((3, *shape))
        self._lam = law.lam if law.plane == "strain" else 2.0 * law.lam * law.mu / (law.lam + 2.0 * law.mu)

    def _respond(self, order: int) -> None:
        f, s, mu = self.gradient, self._second, self.law.mu
        xx = 0.5 * (cauchy(f[0], f[0], order) + cauchy(f[2], f[2], order))
        yy = 0.5 * (cauchy(f[1], f[1], order) + cauchy(f[3], f[3], order))
        xy = 0.5 * (cauchy(f[0], f[1], order) + cauchy(f[2], f[3], order))
        if not order:
            xx[0] -= 0.5
            yy[0] -= 0.5
        for place, strain in enumerate((xx, yy)):
            s[place, order] = self._lam * (xx + yy) + 2.0 * mu * strain
        s[2, order] = 2.0 * mu * xy
        for line in (0, 2):
            self.stress[line, order] = cauchy(f[line], s[0], order) + cauchy(f[line + 1], s[2], order)
            self.stress[line + 1, order] = cauchy(f[line], s[2], order) + cauchy(f[line + 1], s[1], order)


class _Neo(Response):
    def __init__(self, law: Law, shape: tuple[int, int, int]) -> None:
        super().__init__(law, shape)
        self._volume, self._over, self._log, self._factor = (np.zeros(shape) for _ in range(4))
        self.theta, self._theta_log = np.zeros(shape), np.zeros(shape)

    def _respond(self, order: int) -> None:
        f, law = self.gradient, self.law
        self._volume[order] = cauchy(f[0], f[3], order) - cauchy(f[1], f[2], order)
        if order:
            rest = cauchy(self._volume, self._over, order, 1)
            self._over[order] = -times(self._over[0], rest)
            moving = weighted(self._volume, order)
            self._log[order] = cauchy(moving, self._over[: order + 1], order, 1) / order
        else:
            self._over[0] = inverse(self._volume[0])
            self._log[0, 0] = np.log(self._volume[0, 0])
            self._log[0, 1:] = self._volume[0, 1:] * self._over[0, 0]
        if law.plane == "strain":
            pressure = law.lam * self._log[: order + 1]
            pressure[0, 0] -= law.mu
        else:
            self._stretch(order)
            pressure = -law.mu * self.theta[: order + 1]
        self._factor[order] = cauchy(pressure, self._over[: order + 1], order)
        for place, (other, sign) in enumerate(COFACTOR):
            self.stress[place, order] = law.mu * f[place, order] + sign * cauchy(
                f[other], self._factor, order
            )

    def _stretch(self, order: int) -> None:
        """The square of the stretch across the plane, and its logarithm M: mu (theta - 1) + lam (L + M/2) = 0
        and a theta' = theta a M'."""
        lam, mu, theta, log = self.law.lam, self.law.mu, self.theta, self._theta_log
        if not order:
            m = np.zeros(theta.shape[-1])
            for _ in range(ITERATIONS):
                excess = mu * np.expm1(m) + lam * (self._log[0, 0] + 0.5 * m)
                m -= excess / (mu * np.exp(m) + 0.5 * lam)
            log[0, 0], theta[0, 0] = m, np.exp(m)
            theta[0, 1:] = -lam * self._log[0, 1:] / (mu + 0.5 * lam / theta[0, 0])
            log[0, 1:] = theta[0, 1:] / theta[0, 0]
            return
        over = inverse(theta[0])
        rest = (
            cauchy(weighted(log, order), theta[: order + 1], order, 1, order - 1) / order
            if order > 1
            else 0.0
        )
        slope = 0.5 * lam * over
        slope[0] += mu
        known = -lam * self._log[order]
        if order > 1:
            known = known + 0.5 * lam * times(over, np.asarray(rest))
        theta[order] = times(inverse(slope), known)
        log[order] = times(over, theta[order] - rest)


def determinant(gradient: FloatArray) -> FloatArray:
    """det F - 1 (n,) in the plane by the displacement ``gradient`` (4, n), to all digits of small ones."""
    xx, xy, yx, yy = gradient
    return np.asarray(xx + yy + xx * yy - xy * yx)


def green(gradient: FloatArray) -> FloatArray:
    """Green's strains xx, yy, xy (3, n) by the displacement ``gradient`` (4, n)."""
    xx, xy, yx, yy = gradient
    return np.stack(
        [
            xx + 0.5 * (xx**2 + yx**2),
            yy + 0.5 * (xy**2 + yy**2),
            0.5 * (xy + yx + xx * xy + yx * yy),
        ]
    )


def cauchy_stress(law: Law, gradient: FloatArray) -> FloatArray:
    """Cauchy's stresses xx, yy, xy (3, n) by the displacement ``gradient`` (4, n)."""
    stress = law.stress(gradient)
    f = gradient + np.array([1.0, 0.0, 0.0, 1.0])[:, None]
    volume = (1.0 + determinant(gradient)) * law.across(gradient)
    xx, xy = stress[0] * f[0] + stress[1] * f[1], stress[0] * f[2] + stress[1] * f[3]
    yy = stress[2] * f[2] + stress[3] * f[3]
    return np.stack([xx, yy, xy]) / volume


def stretches(gradient: FloatArray) -> FloatArray:
    """The principal stretches (2, n) in the plane, the larger first."""
    xx, yy, xy = 2.0 * green(gradient)
    mean, half = 1.0 + 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    return np.asarray(np.sqrt(np.stack([mean + half, np.maximum(mean - half, 0.0)])))
