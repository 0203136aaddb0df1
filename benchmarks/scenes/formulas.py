"""Formulas for the figures of expected.toml."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad


def hertz(force: float, modulus: float, radius: float) -> float:
    """Peak pressure of a line contact of relative ``modulus`` and ``radius``."""
    return float(np.sqrt(force * modulus / (np.pi * radius)))


def westergaard(modulus: float, height: float, mean: float) -> float:
    """Peak pressure of waves of length 1 and of that height, under a mean pressure."""
    return 2.0 * float(np.sqrt(0.5 * mean * np.pi * modulus * height))


def shrink_pressure() -> float:
    """Of a brass ring on a solid steel shaft in plane stress, by Lame."""
    ring = ((33.0**2 + 31.0**2) / (33.0**2 - 31.0**2) + 0.35) / 112e3
    return 0.024 / (31.0 * (ring + 0.7 / 210e3))


def shaft_pressure() -> float:
    """Of a bronze ring shrunk on a solid steel shaft in plane strain, by Lame."""
    ring, shaft = ((E / (1.0 - nu**2), nu / (1.0 - nu)) for E, nu in ((105e3, 0.34), (206e3, 0.29)))
    ratio = (32.0**2 + 25.0**2) / (32.0**2 - 25.0**2)
    return 0.03 / (25.0 * ((ratio + ring[1]) / ring[0] + (1.0 - shaft[1]) / shaft[0]))


def bimetal_force() -> float:
    """Of two bonded layers 1 thick on a stop at 58, 0.4 from their top face; heated by 50."""
    free = 0.5 * 0.75 * 1e-5 * 50.0 * 58.0**2 + 0.5 * 36e-6 * 50.0 * 2.0
    return 3.0 * 70e3 * 2.0**3 / 12.0 * (free - 0.4) / 58.0**3


def leaf_springs() -> tuple[float, float, float]:
    """Forces between three leaves 60, 45 and 30 long and 2 thick, loaded by 20 at the tip of the longest, and
    that tip's displacement."""
    stiffness, load = 210e3 / 0.91 * 2.0**3 / 12.0, 20.0

    def bent(force_at: float, seen_at: float) -> float:
        near, far = sorted((force_at, seen_at))
        return near**2 * (3.0 * far - near) / (6.0 * stiffness)

    tips = [[2.0 * bent(45.0, 45.0), -bent(30.0, 45.0)], [-bent(45.0, 30.0), 2.0 * bent(30.0, 30.0)]]
    one, two = np.linalg.solve(tips, [load * bent(60.0, 45.0), 0.0])
    return float(one), float(two), float(one) * bent(45.0, 60.0) - load * bent(60.0, 60.0)


def ladder_climb() -> float:
    """Load at 0.85 of a ladder's length (its lower side) at which it slips: friction 0.4, weight 10."""
    along = np.array([-0.5, 0.5 * np.sqrt(3.0)])
    high, arm = 3.0 + 94.0 * along[1], 0.25 * 94.0
    at = 0.85 * 94.0 * 0.5 - 3.0 * along[1]
    return float(10.0 * (0.4 * high - arm) / (at - 0.4 * high))


def shear_loop() -> float:
    """Work dissipated in a cycle of the shear of a half-disk, as the difference of two normal contacts."""
    modulus, friction = 70e3 / (1.0 - 0.33**2) / 2.0, 0.4
    load = np.pi * 1.2**2 * modulus / (4.0 * 40.0)
    shear = 0.6 * friction * load

    def approach(force: float) -> float:
        """Up to what is linear in the force, which makes no loop."""
        return float(-(force * np.log(force) - force) / (np.pi * modulus))

    def shift(force: float) -> float:
        return friction * (approach(load) - approach(load - force / friction))

    return abs(float(8.0 * quad(shift, 0.0, shear)[0] - 4.0 * shear * shift(shear)))


@dataclass(frozen=True)
class Rough:
    """Largest pressure, and the number of parts that touch."""

    peak: float
    patches: int


@cache
def rough_contact(name: str, modulus: float, mean: float, points: int = 1200) -> Rough:
    """Contact of a scene's rigid profile, mirrored at both ends, on a half-plane of plane modulus E/(1-nu²).

    The half-plane answers a pressure cos(k x) by a surface displacement 2 cos(k x) / (modulus k); a
    primal-dual active set.
    """
    case = tomllib.loads((Path(__file__).parent / "cases" / f"{name}.toml").read_text())
    profile: NDArray[np.float64] = np.array(case["contact"][0]["obstacle"]["points"])
    long = profile[-1, 0] - profile[0, 0]
    x = (np.arange(points) + 0.5) * long / points
    gap = np.interp(x, profile[:, 0], profile[:, 1])
    waves = np.pi * np.arange(1, points) / long
    shapes = np.cos(np.outer(x, waves))
    compliance = (shapes * (2.0 / (modulus * waves)) * (2.0 / points)) @ shapes.T
    closed = gap < np.quantile(gap, 0.2)
    for _ in range(400):
        j = np.flatnonzero(closed)
        matrix = np.block(
            [[compliance[np.ix_(j, j)], -np.ones((len(j), 1))], [np.ones((1, len(j))), np.zeros((1, 1))]]
        )
        found = np.linalg.solve(matrix, np.concatenate([-gap[j], [mean * points]]))
        pressure = np.zeros(points)
        pressure[j] = found[:-1]
        overlap = compliance @ pressure + gap - found[-1]
        new = np.where(closed, pressure > 0.0, overlap < -1e-12)
        if np.array_equal(new, closed):
            break
        closed = new
    else:
        raise RuntimeError("the contact of the rough profile has not been found")
    touching = np.concatenate([[False], closed, [False]])
    return Rough(float(pressure.max()), int((touching[1:] & ~touching[:-1]).sum()))
