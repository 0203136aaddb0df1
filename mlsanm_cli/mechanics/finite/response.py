"""Series of F and P at points, filled order by order: responses of the laws to deformation and thermal
stretch.

A series of a field with spatial derivatives (jet) is an array (K + 1, j, n): coefficients of orders 0 to K at
n points; j = 1 for values only, j = 3 for value, d/dX and d/dY. Products within one order follow Leibniz'
rule.

Equations (19) and (21) of docs/method.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from mlsanm_cli.arrays import FloatArray

if TYPE_CHECKING:
    from mlsanm_cli.mechanics.finite.law import Law

Kind = Literal["saint-venant-kirchhoff", "neo-hookean"]
COFACTOR = ((3, 1.0), (2, -1.0), (1, -1.0), (0, 1.0))
"""Component of F and sign for each component of det(F) F^-T in the plane."""
ITERATIONS = 60


def cauchy(
    one: FloatArray, other: FloatArray, order: int, first: int = 0, last: int | None = None
) -> FloatArray:
    """Contribution (j, n) of the orders ``first`` to ``last`` (default all) of ``one`` (K + 1, j, n) to the
    coefficient of ``order`` of its product with ``other`` (K + 1, j, n)."""
    end = order if last is None else last
    low = one[first : end + 1]
    high = other[order - end : order - first + 1][::-1]
    return added_products(low, high)


def added_products(low: FloatArray, high: FloatArray) -> FloatArray:
    """Sum over the first axis of products of jets ``low`` and ``high`` (k, j, n): (j, n)."""
    result = np.empty(low.shape[1:])
    result[0] = np.einsum("kn,kn->n", low[:, 0], high[:, 0])
    if low.shape[1] > 1:
        result[1:] = np.einsum("kjn,kn->jn", low[:, 1:], high[:, 0])
        result[1:] += np.einsum("kn,kjn->jn", low[:, 0], high[:, 1:])
    return result


def times(one: FloatArray, other: FloatArray) -> FloatArray:
    """Product of two jets (j, n)."""
    return added_products(one[None], other[None])


def inverse(one: FloatArray) -> FloatArray:
    """Reciprocal of a jet (j, n)."""
    result = np.empty_like(one)
    result[0] = 1.0 / one[0]
    result[1:] = -one[1:] * result[0] ** 2
    return result


def weighted(series: FloatArray, order: int) -> FloatArray:
    """The ``series`` (K + 1, j, n) up to ``order``, each coefficient times its order: a d/da."""
    return series[: order + 1] * np.arange(order + 1.0)[:, None, None]


class _Series:
    """Series of F and P at points, filled order by order: both are (4, K + 1, j, n)."""

    def __init__(self, law: Law, shape: tuple[int, ...]) -> None:
        self.law = law
        self.gradient = np.zeros((4, *shape))
        self.stress = np.zeros((4, *shape))

    def _deform(self, order: int, gradient: FloatArray | None) -> None:
        """Set ``order`` of the displacement gradient (4, j, n), None if unknown."""
        self.gradient[:, order] = 0.0 if gradient is None else gradient
        if not order:
            self.gradient[[0, 3], 0, 0] += 1.0


class Logarithm:
    """A series of positive ``values`` with their reciprocal ``over`` and their ``log``, all (K + 1, j, n)."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.values, self.over, self.log = (np.zeros(shape) for _ in range(3))

    def put(self, order: int, values: FloatArray | float) -> None:
        """Set ``order`` of the values (j, n)."""
        self.values[order] = values
        if order:
            rest = cauchy(self.values, self.over, order, 1)
            self.over[order] = -times(self.over[0], rest)
            moving = weighted(self.values, order)
            self.log[order] = cauchy(moving, self.over[: order + 1], order, 1) / order
        else:
            self.over[0] = inverse(self.values[0])
            self.log[0, 0] = np.log(self.values[0, 0])
            self.log[0, 1:] = self.values[0, 1:] * self.over[0, 0]


class Kirchhoff(_Series):
    """The Saint Venant-Kirchhoff law."""

    def __init__(self, law: Law, shape: tuple[int, ...]) -> None:
        super().__init__(law, shape)
        self._second, self._thin = np.zeros((3, *shape)), np.zeros(shape)
        self._lam = law.lam if law.plane == "strain" else 2.0 * law.lam * law.mu / (law.lam + 2.0 * law.mu)

    def thin(self, order: int, warm: Logarithm) -> None:
        """Set the out-of-plane Green-Lagrange strain."""
        self._thin[order] = 0.5 * cauchy(warm.over, warm.over, order)
        if not order:
            self._thin[0, 0] -= 0.5

    def across(self) -> FloatArray:
        """Out-of-plane stretch (n,) in plane stress."""
        law, (xx, xy, yx, yy) = self.law, self.gradient[:, 0, 0]
        strain = 0.5 * (xx**2 + xy**2 + yx**2 + yy**2) - 1.0
        square = 1.0 - 2.0 * law.lam / (law.lam + 2.0 * law.mu) * strain
        return np.asarray(np.sqrt(np.maximum(square, 0.0)))

    def put(self, order: int, gradient: FloatArray | None, _: FloatArray | None = None) -> None:
        """Set ``order`` of the displacement gradient (4, j, n), None if unknown, and compute P."""
        self._deform(order, gradient)
        f, s, mu = self.gradient, self._second, self.law.mu
        xx = 0.5 * (cauchy(f[0], f[0], order) + cauchy(f[2], f[2], order))
        yy = 0.5 * (cauchy(f[1], f[1], order) + cauchy(f[3], f[3], order))
        xy = 0.5 * (cauchy(f[0], f[1], order) + cauchy(f[2], f[3], order))
        if not order:
            xx[0] -= 0.5
            yy[0] -= 0.5
        for place, strain in enumerate((xx, yy)):
            s[place, order] = self._lam * (xx + yy + self._thin[order]) + 2.0 * mu * strain
        s[2, order] = 2.0 * mu * xy
        for line in (0, 2):
            self.stress[line, order] = cauchy(f[line], s[0], order) + cauchy(f[line + 1], s[2], order)
            self.stress[line + 1, order] = cauchy(f[line], s[2], order) + cauchy(f[line + 1], s[1], order)


class Neo(_Series):
    """The compressible neo-Hookean law."""

    def __init__(self, law: Law, shape: tuple[int, ...]) -> None:
        super().__init__(law, shape)
        self._volume = Logarithm(shape)
        self._factor, self._theta, self._theta_log, self._thin = (np.zeros(shape) for _ in range(4))

    def thin(self, order: int, warm: Logarithm) -> None:
        """Set the logarithm of the out-of-plane stretch, part of that of the volume."""
        self._thin[order] = -warm.log[order]

    def across(self) -> FloatArray:
        """Out-of-plane stretch (n,) in plane stress."""
        return np.asarray(np.sqrt(self._theta[0, 0]))

    def put(self, order: int, gradient: FloatArray | None, _: FloatArray | None = None) -> None:
        """Set ``order`` of the displacement gradient (4, j, n), None if unknown, and compute P."""
        self._deform(order, gradient)
        f, law = self.gradient, self.law
        self._volume.put(order, cauchy(f[0], f[3], order) - cauchy(f[1], f[2], order))
        if law.plane == "strain":
            pressure = law.lam * (self._volume.log[: order + 1] + self._thin[: order + 1])
            pressure[0, 0] -= law.mu
        else:
            self._stretch(order)
            pressure = -law.mu * self._theta[: order + 1]
        self._factor[order] = cauchy(pressure, self._volume.over[: order + 1], order)
        for place, (other, sign) in enumerate(COFACTOR):
            self.stress[place, order] = law.mu * f[place, order] + sign * cauchy(
                f[other], self._factor, order
            )

    def _stretch(self, order: int) -> None:
        """Squared out-of-plane stretch theta and its logarithm M: mu (theta - 1) + lam (L + M/2) = 0 and
        a theta' = theta a M'."""
        lam, mu, theta, log = self.law.lam, self.law.mu, self._theta, self._theta_log
        volume = self._volume.log
        if not order:
            m = np.zeros(theta.shape[-1])
            for _ in range(ITERATIONS):
                excess = mu * np.expm1(m) + lam * (volume[0, 0] + 0.5 * m)
                m -= excess / (mu * np.exp(m) + 0.5 * lam)
            log[0, 0], theta[0, 0] = m, np.exp(m)
            theta[0, 1:] = -lam * volume[0, 1:] / (mu + 0.5 * lam / theta[0, 0])
            log[0, 1:] = theta[0, 1:] / theta[0, 0]
            return
        over = inverse(theta[0])
        rest = cauchy(weighted(log, order), theta[: order + 1], order, 1, order - 1) / order
        slope = 0.5 * lam * over
        slope[0] += mu
        known = 0.5 * lam * times(over, rest) - lam * volume[order]
        theta[order] = times(inverse(slope), known)
        log[order] = times(over, theta[order] - rest)


class Warm(_Series):
    """The response of a ``cold`` law to the deformation relative to a thermal stretch."""

    def __init__(self, cold: Kirchhoff | Neo, shape: tuple[int, ...]) -> None:
        super().__init__(cold.law, shape)
        self._cold, self._warm, self._square = cold, Logarithm(shape), np.zeros(shape)

    def put(self, order: int, gradient: FloatArray | None, stretch: FloatArray | None = None) -> None:
        """Set ``order`` of the displacement gradient (4, j, n), None if unknown, and of the thermal
        ``stretch`` (j, n), zero if None, and compute P."""
        self._deform(order, gradient)
        warm = self._warm
        warm.put(order, 0.0 if stretch is None else stretch)
        self._square[order] = cauchy(warm.values, warm.values, order)
        if self.law.plane == "strain":
            self._cold.thin(order, warm)
        elastic = np.stack([cauchy(one, warm.over, order) for one in self.gradient])
        if not order:
            elastic[[0, 3], 0] -= 1.0
        self._cold.put(order, elastic)
        for place, one in enumerate(self._cold.stress):
            self.stress[place, order] = cauchy(self._square, one, order)

    def across(self) -> FloatArray:
        """Out-of-plane stretch (n,) in plane stress."""
        return np.asarray(self._warm.values[0, 0] * self._cold.across())


Response: TypeAlias = Kirchhoff | Neo | Warm
