"""Problems with known answers, in the form the continuation layer asks for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation.problem import SingularTangentError, Tangent
from mlsanm_cli.continuation.series import Branch
from tests.contact.friction import strip_compliance


def first_at(pieces: Sequence[Branch], lam: float) -> tuple[FloatArray, float]:
    """The unknowns and the load factor where a path, given piece by piece, first reaches ``lam``."""
    crossings = ((piece, piece.first_crossing(lam)) for piece in pieces)
    return next(piece.evaluate(a) for piece, a in crossings if a is not None)


class DenseTangent:
    """LU factors of a small dense matrix."""

    def __init__(self, matrix: FloatArray) -> None:
        self._lu, self._pivots, info = dgetrf(matrix)
        if info > 0:
            raise SingularTangentError("singular matrix")

    def solve(self, rhs: FloatArray) -> FloatArray:
        solution, _ = dgetrs(self._lu, self._pivots, rhs)
        return np.asarray(solution)


def convolution(left: FloatArray, right: FloatArray) -> FloatArray:
    """Return sum_{j=1}^{k-1} left_j right_{k-j} for coefficients 0..k-1."""
    return np.asarray(np.einsum("j...,j...->...", left[1:], right[:0:-1]))


class Known:
    """The common part: ``residual`` R(x, lam) of slope ``matrix``, with a load factor that is subtracted."""

    def __init__(self, *scale: float) -> None:
        self.size, self.scale = len(scale), np.array(scale)

    def residual(self, x: FloatArray, lam: float) -> FloatArray:
        raise NotImplementedError

    def matrix(self, x: FloatArray) -> FloatArray:
        raise NotImplementedError

    def tangent(self, x: FloatArray, lam: float) -> Tangent:
        return DenseTangent(np.atleast_2d(self.matrix(x)))

    def load_derivative(self, x: FloatArray, lam: float) -> FloatArray:
        return np.asarray(-np.eye(self.size)[0])

    def admissible(self, x: FloatArray, lam: float) -> bool:
        return True


class Scalar(Known):
    """R(x, lam) = sum_i c_i x^i - lam (one unknown): x(lam) is the inverse of a polynomial."""

    def __init__(self, *coefficients: float) -> None:
        super().__init__(1.0)
        self.polynomial = np.polynomial.Polynomial(coefficients)

    def residual(self, x: FloatArray, lam: float) -> FloatArray:
        return np.asarray(self.polynomial(x) - lam)

    def matrix(self, x: FloatArray) -> FloatArray:
        return np.asarray(self.polynomial.deriv()(x))

    def series_rhs(self, x: FloatArray, lam: FloatArray) -> FloatArray:
        order = lam.size
        power = np.polynomial.Polynomial([1.0])
        total = 0.0
        for coefficient in self.polynomial.coef:
            if order <= power.degree():
                total += coefficient * power.coef[order]
            power = power * np.polynomial.Polynomial(x[:, 0])
        return -np.array([total])


class Truss(Scalar):
    """Shallow two-bar (von Mises) truss: apex at height w, unloaded at 1, lam = (1 - w^2) w / 2.

    Snaps through between the folds w = 1/sqrt(3) and w = -1/sqrt(3).
    """

    def __init__(self) -> None:
        super().__init__(0.0, 0.5, 0.0, -0.5)

    def load(self, w: float) -> float:
        return float(self.polynomial(w))


class Yielding(Known):
    """y = lam and y z = eta in units of its ``scale``: z is hardly held where y is small."""

    def __init__(self, eta: float, scale: float) -> None:
        super().__init__(1.0, scale)
        self.eta = eta

    def residual(self, x: FloatArray, lam: float) -> FloatArray:
        return np.array([x[0] - lam, x[0] * x[1] - self.eta])

    def matrix(self, x: FloatArray) -> FloatArray:
        return np.array([[1.0, 0.0], [x[1], x[0]]])

    def series_rhs(self, x: FloatArray, lam: FloatArray) -> FloatArray:
        return np.array([0.0, -convolution(x[:, 0], x[:, 1])])


class Circle(Known):
    """x^2 + lam^2 = 1, one unknown; folds at lam = -1 and 1."""

    def __init__(self) -> None:
        super().__init__(1.0)

    def residual(self, x: FloatArray, lam: float) -> FloatArray:
        return x * x + lam * lam - 1.0

    def matrix(self, x: FloatArray) -> FloatArray:
        return 2.0 * x

    def load_derivative(self, x: FloatArray, lam: float) -> FloatArray:
        return np.array([2.0 * lam])

    def series_rhs(self, x: FloatArray, lam: FloatArray) -> FloatArray:
        return np.asarray(-convolution(x, x) - convolution(lam, lam))


class Contact(Known):
    """(p + eta) h = eta opening and h = gap + lam push + A p for pressures and gaps (p, h), in units of
    ``pressure`` and ``length``."""

    def __init__(
        self,
        compliance: FloatArray,
        gap: FloatArray,
        push: FloatArray,
        eta: float,
        opening: float = 1.0,
        pressure: float = 1.0,
        length: float = 1.0,
    ) -> None:
        super().__init__(*np.repeat([pressure, length], len(gap)))
        self.compliance, self.gap, self.push = compliance, gap, push
        self.eta, self.opening = eta, opening
        self.pressure, self.length = pressure, length

    @property
    def guess(self) -> FloatArray:
        """Unknowns without load: no pressure, every gap opened."""
        return np.concatenate([0.0 * self.gap, self.gap + self.opening])

    def residual(self, x: FloatArray, lam: float) -> FloatArray:
        p, h = np.split(x, 2)
        products = ((p + self.eta) * h - self.eta * self.opening) / (self.pressure * self.length)
        gaps = (self.gap + lam * self.push + self.compliance @ p - h) / self.length
        return np.concatenate([products, gaps])

    def matrix(self, x: FloatArray) -> FloatArray:
        p, h = np.split(x, 2)
        products = np.hstack([np.diag(h), np.diag(p + self.eta)]) / (self.pressure * self.length)
        gaps = np.hstack([self.compliance, -np.eye(len(p))]) / self.length
        return np.vstack([products, gaps])

    def load_derivative(self, x: FloatArray, lam: float) -> FloatArray:
        return np.concatenate([0.0 * self.push, self.push / self.length])

    def series_rhs(self, x: FloatArray, lam: FloatArray) -> FloatArray:
        products = convolution(*np.split(x, 2, axis=1)) / (self.pressure * self.length)
        return np.concatenate([-products, 0.0 * products])

    def admissible(self, x: FloatArray, lam: float) -> bool:
        p, h = np.split(x, 2)
        return bool(h.min() > 0.0 and p.min() > -self.eta)


def hertz(m: int, eta: float) -> Contact:
    """A cylinder of radius 1 pushed into a half-plane (E* = 1) up to a half-width of 0.05; ``eta`` is
    relative to the peak pressure."""
    half, width = 0.05, 0.15 / m
    peak, depth = 0.5 * half, 0.5 * half**2
    x: FloatArray = (np.arange(m, dtype=np.float64) + 0.5) * width - 1.5 * half
    compliance, gap = strip_compliance(x, width), 0.5 * x**2
    approach = gap + compliance @ (peak * np.sqrt(np.maximum(0.0, 1.0 - (x / half) ** 2)))
    return Contact(compliance, gap, np.full(m, -approach[m // 2]), eta * peak, depth, peak, depth)


def random_contact(m: int, eta: float, seed: int) -> Contact:
    """Random well-conditioned compliance and random loads."""
    rng = np.random.default_rng(seed)
    factor = rng.normal(size=(m, m)) / np.sqrt(m)
    compliance = factor @ factor.T + 0.3 * np.eye(m)
    return Contact(compliance, rng.uniform(0.05, 1.0, m), rng.normal(size=m) * 2.0 - 0.5, eta)
