"""Von Mises plasticity at small strain, with isotropic hardening, Prager's kinematic hardening, or both.

With the deviator s of the stress, the plastic strain e and its accumulated amount a::

    q = sqrt(3/2 |s - x|^2) <= Y(a)        x = 2/3 H e            da = sqrt(2/3 |de|^2)

and de along s - x, implicitly at the end of an increment (closest-point return; Simo and Hughes 1998,
Computational Inelasticity, ISBN 9780387975207, sections 3.3 and 3.4). The flow stress is
Y = table(a) + h a + K a^n; H is the slope of the stress over the plastic strain by kinematic hardening.

Strains and stresses (n, 4) are xx, yy, zz, xy, shear strains are doubled. In plane stress the strain zz is
the one without stress zz. Equation (31) of docs/method.md.
"""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.laws.law import SaintVenantKirchhoff
from mlsanm_cli.mechanics.material import PlaneMaterial
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import FINE_ROUND_OFF, LAST_DIGITS

DIRECT, SHEAR = slice(0, 3), 3
ZZ = 2
HISTORY = 5
"""Columns of a history: the plastic strain, and its accumulated amount."""
MOST = 100
"""Bisections and Newton steps of a root in double precision."""


@dataclass(frozen=True)
class Hardening:
    """Flow stress Y over the accumulated plastic strain a: linear between the rows of ``table`` (k, 2),
    strains and stresses, constant beyond, plus ``slope`` a + ``strength`` a^``exponent``; ``kinematic`` is
    Prager's slope."""

    table: FloatArray
    slope: float = 0.0
    strength: float = 0.0
    exponent: float = 1.0
    kinematic: float = 0.0

    def flow(self, amount: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Flow stress and its derivative (n,) at an ``amount`` (n,) of plastic strain."""
        at, stress = self.table.T
        slopes = np.append(np.diff(stress) / np.diff(at), 0.0)
        place = np.maximum(np.searchsorted(at, amount, side="right") - 1, 0)
        value = np.interp(amount, at, stress) + self.slope * amount
        slope = slopes[place] + self.slope
        if self.strength:
            # The slope at zero is infinite, which no increment ends at.
            least = np.maximum(amount, LAST_DIGITS)
            value = value + self.strength * amount**self.exponent
            slope = slope + self.strength * self.exponent * least ** (self.exponent - 1.0)
        return value, slope


@dataclass(frozen=True)
class VonMises(SaintVenantKirchhoff):
    """An isotropic ``linear`` material that yields."""

    hardening: Hardening
    name = "von-mises"

    @property
    def _poisson(self) -> float:
        """Poisson's ratio."""
        ratio = float(self.linear.stiffness[0, 1] / self.linear.stiffness[0, 0])
        return ratio if self.plane == "stress" else ratio / (1.0 + ratio)

    @property
    def _bulk(self) -> float:
        """Bulk modulus."""
        nu = self._poisson
        return 2.0 / 3.0 * self.linear.shear * (1.0 + nu) / (1.0 - 2.0 * nu)

    @property
    def yield_stress(self) -> float:
        """Flow stress without plastic strain."""
        return float(self.hardening.flow(np.zeros(1))[0][0])

    def hardens(self, history: FloatArray) -> bool:
        """Whether flow or back stress increases at all points of a ``history`` (n, 5) that have flowed."""
        amount = history[:, 4]
        return bool(self.hardening.kinematic or (self.hardening.flow(amount[amount > 0.0])[1] > 0.0).all())

    def elastic_strain(self, stress: FloatArray) -> FloatArray:
        """Strains (n, 4) that cause a ``stress`` (n, 4)."""
        mean = stress[:, DIRECT].mean(axis=1)[:, None] * np.array([1.0, 1.0, 1.0, 0.0])
        shear = 0.5 * (stress - mean) * np.array([1.0, 1.0, 1.0, 2.0]) / self.linear.shear
        return np.asarray(shear + mean / (3.0 * self._bulk))

    def update(self, strain: FloatArray, history: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Stress (n, 4), consistent tangent (n, 4, 4) and history (n, 5) at the end of an increment to
        ``strain`` (n, 4) from a ``history``; elastic strains only."""
        if self.plane != "stress":
            return self._returned(strain, history)
        strain, least = strain.copy(), FINE_ROUND_OFF * self.yield_stress
        nu, elastic = self._poisson, strain - history[:, :4]
        strain[:, ZZ] = history[:, ZZ] - nu / (1.0 - nu) * (elastic[:, 0] + elastic[:, 1])
        for _ in range(MOST):
            stress, tangent, after = self._returned(strain, history)
            if np.abs(stress[:, ZZ]).max(initial=0.0) <= least:
                break
            strain[:, ZZ] -= stress[:, ZZ] / tangent[:, ZZ, ZZ]
        across, along = tangent[:, :, ZZ, None], tangent[:, None, ZZ]
        return stress, tangent - across * along / tangent[:, None, None, ZZ, ZZ], after

    def equivalent(self, stress: FloatArray, history: FloatArray) -> FloatArray:
        """The stress q (n,) that is compared with the flow stress."""
        return self._measure(stress, history)[0]

    def _measure(self, stress: FloatArray, history: FloatArray) -> tuple[FloatArray, FloatArray]:
        """q (n,) and the deviator s - x over it (n, 4)."""
        relative = stress - stress[:, DIRECT].mean(axis=1)[:, None] * np.array([1.0, 1.0, 1.0, 0.0])
        back = 2.0 / 3.0 * self.hardening.kinematic * np.array([1.0, 1.0, 1.0, 0.5])
        deviator = relative - back * history[:, :4]
        square = (deviator[:, DIRECT] ** 2).sum(axis=1) + 2.0 * deviator[:, SHEAR] ** 2
        q = np.sqrt(1.5 * square)
        return q, deviator / np.where(q > 0.0, q, 1.0)[:, None]

    def _returned(self, strain: FloatArray, history: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """As `update`, with all four strains given."""
        mu, bulk, even = self.linear.shear, self._bulk, np.array([1.0, 1.0, 1.0, 0.0])
        elastic = strain - history[:, :4]
        volume = elastic[:, DIRECT].sum(axis=1)[:, None] * even
        stress = 2.0 * mu * elastic * np.array([1.0, 1.0, 1.0, 0.5]) + (bulk - 2.0 / 3.0 * mu) * volume
        q, normal = self._measure(stress, history)
        stiff, before = 3.0 * mu + self.hardening.kinematic, history[:, 4]
        amount, slope, flow = np.zeros(len(q)), np.zeros(len(q)), self.hardening.flow(before)[0]
        # Plastic strain of the increment: the root of q - stiff x - Y(before + x), by Newton's method in
        # brackets.
        on = np.flatnonzero(q > (1.0 + FINE_ROUND_OFF) * flow)
        low, high = np.zeros(len(on)), (q - flow)[on] / stiff
        x = 0.5 * high
        for _ in range(MOST if len(on) else 0):
            flow, slope_on = self.hardening.flow(before[on] + x)
            left = q[on] - stiff * x - flow
            low, high = np.where(left > 0.0, x, low), np.where(left > 0.0, high, x)
            new = x + left / (stiff + slope_on)
            new = np.where((new < low) | (new > high), 0.5 * (low + high), new)
            done, x = np.abs(new - x) <= LAST_DIGITS * high, new
            if done.all():
                break
        amount[on], slope[on] = x, self.hardening.flow(before[on] + x)[1]
        after = history.copy()
        after[:, :4] += 1.5 * amount[:, None] * normal * np.array([1.0, 1.0, 1.0, 2.0])
        after[:, 4] += amount
        # Perfectly elastic points have no normal part.
        left = 1.0 - 3.0 * mu * amount / np.where(q > 0.0, q, 1.0)
        along = np.where(amount > 0.0, 3.0 * mu / (stiff + slope) - (1.0 - left), 0.0)
        identity = np.diag([1.0, 1.0, 1.0, 0.5]) - np.outer(even, even) / 3.0
        tangent = 2.0 * mu * left[:, None, None] * identity + bulk * np.outer(even, even)
        tangent -= 3.0 * mu * along[:, None, None] * normal[:, :, None] * normal[:, None, :]
        return stress - 3.0 * mu * amount[:, None] * normal, tangent, after


def plastic_stress(material: PlaneMaterial, history: FloatArray) -> FloatArray:
    """Eigenstress C e (n, 3) of the plastic strains in a ``history``."""
    return np.asarray(history[:, [0, 1, 3]] @ material.stiffness + history[:, ZZ, None] * material.coupling)
