"""Stability of equilibrium: the least resistance k of bodies to small motions v, K v = k v, K being the
second variation of the energy, with unit mass per undeformed area. Rows of least squares are no forces, so
that only the inverse of K is known: the displacement S f by a body force f. Its largest eigenvalues 1/k
belong to the softest motions, stable or not; some steps of Arnoldi's method find them (Arnoldi 1951,
doi:10.1090/qam/42792). Equation (31) of docs/method.md."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

ARNOLDI_STEPS = 12
"""Solutions for the softest motions: eigenvalues of S fall at least as 1, 1/4, 1/9, ..., those of bending
as their squares."""
CONVERGED = 0.01
"""Largest residual of an eigenvalue of S, over itself, of a motion that counts."""
NEUTRAL = 0.005
"""Resistance of motions that are neutral, over that of stresses to rotations that vary over the largest
extent of the bodies (stress over extent squared): the bar for critical loads. Frictionless wheels and shafts
turn freely but for errors of the clouds."""


@dataclass(frozen=True, eq=False)
class SoftMotion:
    """The motion of least ``resistance`` k, of stress per squared length; ``motion`` (2N,) has a largest
    component of 1. ``unstable`` is the number of motions with negative resistance."""

    resistance: float
    motion: FloatArray
    unstable: int

    @property
    def stable(self) -> bool:
        """Whether every motion is resisted."""
        return not self.unstable

    def part_in(self, displacement: FloatArray) -> float:
        """Cosine of the motion and a ``displacement`` (2N,); zero up to round-off."""
        size = float(np.linalg.norm(self.motion) * np.linalg.norm(displacement))
        part = float(self.motion @ displacement)
        return part / size if abs(part) > COARSE_ROUND_OFF * size else 0.0


STILL = SoftMotion(np.inf, np.zeros(0), 0)
"""Of bodies without stress."""


Loaded: TypeAlias = tuple[FiniteBody, FloatArray, FloatArray]
"""A body with its displacement (2n,) and load factors (L,)."""


def softest_motion(displaced: Callable[[FloatArray], FloatArray], bodies: Sequence[Loaded]) -> SoftMotion:
    """The softest motion of ``bodies``, which body forces (2N,) per undeformed area have ``displaced``."""
    clouds = [body.elastic.model.cloud for body, *_ in bodies]
    stresses = [body.stress(displacement, factors) for body, displacement, factors in bodies]
    areas = np.repeat(np.concatenate([cloud.areas for cloud in clouds]), 2)
    root = np.sqrt(areas)
    # A force with parts of all long waves: cubic polynomials with irregular coefficients.
    coefficients, first = np.random.default_rng(0).normal(size=(10, 2)), []
    for cloud in clouds:
        x, y = ((cloud.points - cloud.points.mean(axis=0)) / np.ptp(cloud.points, axis=0).max()).T
        powers = np.stack([x**i * y ** (k - i) for k in range(4) for i in range(k + 1)], axis=1)
        first.append((powers @ coefficients).ravel())
    basis, upper = [root * np.concatenate(first)], np.zeros((ARNOLDI_STEPS + 1, ARNOLDI_STEPS))
    basis[0] /= np.linalg.norm(basis[0])
    for step in range(ARNOLDI_STEPS):
        found = root * displaced(basis[-1] / root)
        for _ in range(2):
            for number, known in enumerate(basis):
                part = known @ found
                upper[number, step] += part
                found = found - part * known
        upper[step + 1, step] = np.linalg.norm(found)
        if not upper[step + 1, step] > np.finfo(float).eps * np.abs(upper[: step + 1, step]).max():
            upper = upper[: step + 2, : step + 1]
            break
        basis.append(found / upper[step + 1, step])
    last = upper.shape[1]
    values, vectors = np.linalg.eig(upper[:last])
    left = np.abs(upper[last, last - 1] * vectors[-1])
    extent = max(float(np.ptp(cloud.points, axis=0).max()) for cloud in clouds)
    neutral = NEUTRAL * max(float(np.abs(stress).max()) for stress in stresses) / extent**2
    unstable, least, ends = 0, STILL, np.cumsum([body.unknowns for body, *_ in bodies])[:-1]
    sure = (left <= CONVERGED * np.abs(values)) & (np.abs(values) > 0.0)
    for own in np.flatnonzero(sure).tolist():
        resistance = float((1.0 / values[own]).real)
        motion = np.array(basis[:last]).T @ vectors[:, own].real / root
        motion = motion / motion[np.argmax(np.abs(motion))]
        if resistance < -neutral:
            # Bodies can lose this energy if their stress gives back at least half of what the strains take,
            # or these take next to nothing. In short waves next to contacts, where the fields of clouds and
            # those of pressures differ, they do not.
            energy = -resistance * float(areas @ motion**2)
            parts = zip(bodies, stresses, np.split(motion, ends), strict=True)
            energies = [_energies(*one[:2], stress, part) for one, stress, part in parts]
            elastic, geometric = np.sum(energies, axis=0)
            if elastic > max(-2.0 * geometric, 0.5 * energy):
                continue
            unstable += 1
        if resistance < least.resistance:
            least = SoftMotion(resistance, motion, 0)
    return SoftMotion(least.resistance, least.motion, unstable)


def _energies(
    body: FiniteBody, displacement: FloatArray, stress: FloatArray, motion: FloatArray
) -> FloatArray:
    """Twice the energies (2,) of the strain of a ``motion`` (2n,), by the shear modulus alone, the least
    there is, and of the ``stress`` (4, n) on its rotations."""
    f = body.gradient(displacement).T.reshape(-1, 2, 2) + np.eye(2)
    slope = body.gradient(motion).T.reshape(-1, 2, 2)
    strain = np.swapaxes(f, 1, 2) @ slope
    strain = 0.5 * (strain + np.swapaxes(strain, 1, 2))
    second = np.linalg.solve(f, stress.T.reshape(-1, 2, 2))
    elastic = 2.0 * body.elastic.model.material.shear * (strain**2).sum(axis=(1, 2))
    geometric = np.einsum("niJ,nJK,niK->n", slope, second, slope)
    return np.array([elastic, geometric]) @ body.elastic.model.cloud.areas


def rows_of_force(body: FiniteBody, force: FloatArray) -> FloatArray:
    """Residual (r,) of a body's rows by a body force (2N,)."""
    found = np.zeros(body.elastic.rows)
    found[: len(force)] = force.reshape(-1, 2).T.ravel()
    found[body.node_rows :] = -body.elastic.pieces.of_force(force.reshape(-1, 2))
    return found
