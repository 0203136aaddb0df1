"""Contact problems in the form the continuation layer asks for."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mlsanm_cli.continuation.problem import FloatArray, Tangent

from .problems import Counts, DenseTangent, convolution


@dataclass
class Contact:
    """Hyperbolic contact: (p + eta) h = eta delta, h = h0 + lam hl + A p + C q, F p + G q = lam P.

    Unknowns (p, h, q); pressures in units of ``p_ref``, gaps in units of ``h_ref``.
    """

    compliance: FloatArray
    h0: FloatArray
    hl: FloatArray
    motion: FloatArray
    balance: FloatArray
    stiffness: FloatArray
    force: FloatArray
    eta: float
    delta: FloatArray
    p_ref: float = 1.0
    h_ref: float = 1.0
    q_ref: float = 1.0
    counts: Counts = field(default_factory=Counts)

    def __post_init__(self) -> None:
        m, r = self.h0.size, self.force.size
        self.m, self.size = m, 2 * m + r
        self.scale = np.concatenate([np.full(m, self.p_ref), np.full(m, self.h_ref), np.full(r, self.q_ref)])
        self._linear = np.block([[self.compliance, self.motion], [self.balance, self.stiffness]])
        self._offset = np.concatenate([self.h0, np.zeros(r)])
        self._loaded = np.concatenate([self.hl, -self.force])
        # Rows: complementarity over p_ref h_ref, gaps over h_ref, balance over the total forces.
        self._row = np.concatenate([np.full(m, 1.0 / self.h_ref), 1.0 / np.abs(self.force)])

    def _split(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        return x[: self.m], x[self.m : 2 * self.m], x[2 * self.m :]

    def residual(self, x: FloatArray, lam: float) -> FloatArray:
        self.counts.residuals += 1
        p, h, q = self._split(x)
        products = ((p + self.eta) * h - self.eta * self.delta) / (self.p_ref * self.h_ref)
        rest = self._linear @ np.concatenate([p, q]) + self._offset + lam * self._loaded
        rest[: self.m] -= h
        return np.concatenate([products, rest * self._row])

    def tangent(self, x: FloatArray, lam: float) -> Tangent:
        self.counts.tangents += 1
        p, h, _ = self._split(x)
        return ContactTangent(self, p + self.eta, h)

    def load_derivative(self, x: FloatArray, lam: float) -> FloatArray:
        return np.concatenate([np.zeros(self.m), self._loaded * self._row])

    def series_rhs(self, x: FloatArray, lam: FloatArray) -> FloatArray:
        products = convolution(x[:, : self.m], x[:, self.m : 2 * self.m]) / (self.p_ref * self.h_ref)
        return np.concatenate([-products, np.zeros(self.size - self.m)])

    def admissible(self, x: FloatArray, lam: float) -> bool:
        return bool(x[self.m : 2 * self.m].min() > 0.0 and x[: self.m].min() > -self.eta)


class ContactTangent:
    """dR/dx with the gaps eliminated: (diag(h) + diag(p + eta) A) dp + diag(p + eta) C dq = ..."""

    def __init__(self, problem: Contact, stiffened: FloatArray, h: FloatArray) -> None:
        m = problem.m
        self._problem, self._stiffened = problem, stiffened
        matrix = np.array(problem._linear, order="F")
        matrix[:m] *= stiffened[:, None]
        matrix[np.arange(m), np.arange(m)] += h
        self._factors = DenseTangent(matrix, problem.counts)

    def solve(self, rhs: FloatArray) -> FloatArray:
        problem, m = self._problem, self._problem.m
        lower = rhs[m:] / problem._row
        reduced = lower.copy()
        reduced[:m] = self._stiffened * lower[:m] + rhs[:m] * (problem.p_ref * problem.h_ref)
        y = self._factors.solve(reduced)
        return np.concatenate([y[:m], problem._linear[:m] @ y - lower[:m], y[m:]])


def line_compliance(x: FloatArray, width: float, modulus: float, reference: float) -> FloatArray:
    """Return the normal surface displacement of a half-plane under constant pressures on strips.

    Flamant: u(x) = -(2/(pi E*)) int p(s) ln(|x - s|/reference) ds; entry (i, j): centre i, strip j.
    """
    distance = x[:, None] - x[None, :]

    def primitive(s: FloatArray) -> FloatArray:
        return s * np.log(np.abs(s) / reference) - s

    integral = primitive(distance + 0.5 * width) - primitive(distance - 0.5 * width)
    return np.asarray(-2.0 / (np.pi * modulus) * integral)


def hertz(m: int, eta: float, *, span: float = 1.5, cap: float = 1.0) -> tuple[Contact, float, FloatArray]:
    """Return the line contact of radius 1 with half-width 0.05 at lam = 1, its peak pressure and the strips.

    ``eta`` is relative to the peak pressure; the total force is prescribed and the approach q unknown.
    """
    radius, half, modulus = 1.0, 0.05, 1.0
    peak = half * modulus / (2.0 * radius)
    force = np.pi * half**2 * modulus / (4.0 * radius)
    width = 2.0 * span * half / m
    x: FloatArray = (np.arange(m, dtype=np.float64) + 0.5) * width - span * half
    h0 = x**2 / (2.0 * radius)
    depth = half**2 / (2.0 * radius)
    problem = Contact(
        compliance=line_compliance(x, width, modulus, 2.0),
        h0=h0,
        hl=np.zeros(m),
        motion=-np.ones((m, 1)),
        balance=np.full((1, m), width),
        stiffness=np.zeros((1, 1)),
        force=np.array([force]),
        eta=eta * peak,
        delta=np.full(m, cap * depth),
        p_ref=peak,
        h_ref=depth,
        q_ref=depth,
    )
    return problem, peak, x


def random_contact(m: int, eta: float, seed: int) -> Contact:
    """Return a contact problem without rigid motion: random well-conditioned compliance, random loads."""
    rng = np.random.default_rng(seed)
    factor = rng.normal(size=(m, m)) / np.sqrt(m)
    return Contact(
        compliance=factor @ factor.T + 0.3 * np.eye(m),
        h0=rng.uniform(0.05, 1.0, m),
        hl=rng.normal(size=m) * 2.0 - 0.5,
        motion=np.zeros((m, 0)),
        balance=np.zeros((0, m)),
        stiffness=np.zeros((0, 0)),
        force=np.zeros(0),
        eta=eta,
        delta=np.ones(m),
    )


def open_start(problem: Contact) -> FloatArray:
    """Return an admissible guess without load: no pressure, every gap opened by delta."""
    return np.concatenate(
        [np.zeros(problem.m), problem.h0 + problem.delta, -problem.delta[: problem.force.size]]
    )
