"""The three problems every program solves, and how a profile is judged. Imports numpy only."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

YOUNG, POISSON = 210e3, 0.3  # plane strain
RADIUS = 1.0  # of the half-cylinder, whose centre is at (0, RADIUS)
HALF_SIDE = 2.0  # the block is [-2, 2] x [-2, 0]
HALF_WIDTH = 0.05  # half the width of contact, by Hertz's formula
FORCE = 226.566  # on the platen, downwards
FRICTION = 0.3
SHEAR = 0.5 * FRICTION * FORCE  # on the same platen, to the right
STICK = HALF_WIDTH * 0.5**0.5  # half the width that sticks under SHEAR, by Cattaneo and Mindlin

PATCH_FORCE, PATCH_PRESSURE = 200.0, 100.0  # the blocks are 2 wide

REFERENCE = Path(__file__).parent / "reference"


@dataclass(frozen=True)
class Profile:
    """Values at ``x``, ascending, joined linearly; zero outside."""

    x: Array
    values: Array

    def even(self) -> Profile:
        """The part even about x = 0."""
        x = np.unique(np.concatenate([self.x, -self.x]))
        return Profile(x, 0.5 * (self.at(x) + self.at(-x)))

    def at(self, x: Array) -> Array:
        return np.interp(x, self.x, self.values, 0.0, 0.0)


def difference(profile: Profile, reference: Profile) -> float:
    """L2 norm of the difference over the L2 norm of the reference; exact for piecewise linear profiles."""
    x = np.unique(np.concatenate([profile.x, reference.x]))

    def norm(values: Array) -> float:
        left, right = values[:-1], values[1:]
        return float(np.sqrt(np.sum(np.diff(x) * (left**2 + left * right + right**2) / 3.0)))

    return norm(profile.at(x) - reference.at(x)) / norm(reference.at(x))


def write_profile(path: str | Path, x: Array, columns: dict[str, Array]) -> None:
    """One CSV file: x and the named columns, as the programs write it at their end."""
    np.savetxt(
        path,
        np.column_stack([x, *columns.values()]),
        delimiter=",",
        header=",".join(["x", *columns]),
        comments="",
    )


def read_profile(path: str | Path, column: str) -> Profile:
    """A column of a CSV file with a header, ours or a run directory's interface.csv."""
    with open(path) as file:
        names = file.readline().strip().split(",")
        keep = (names.index("x"), names.index(column))
        table = np.loadtxt(file, delimiter=",", usecols=keep, ndmin=2)
    order = np.argsort(table[:, 0])
    return Profile(table[order, 0], table[order, 1])


def path(problem: str, levels: int) -> list[tuple[float, float]]:
    """Resultants of the tractions (towards +x) and pressures on the slave, at every load level.

    hertz, patch: pressed. slip: pressed, then sheared; each in half of the levels, at least one.
    history: pressed, sheared, unloaded, reversed; each in a quarter of the levels.
    """
    stages = {
        "hertz": [(0.0, FORCE)],
        "patch": [(0.0, PATCH_FORCE)],
        "slip": [(0.0, FORCE), (-SHEAR, FORCE)],
        "history": [(0.0, FORCE), (-SHEAR, FORCE), (0.0, FORCE), (SHEAR, FORCE)],
    }[problem]
    each = max(1, levels // len(stages))
    forces: list[tuple[float, float]] = []
    last = (0.0, 0.0)
    for goal in stages:
        parts = np.linspace(last, goal, each + 1)[1:]
        forces += [(float(x), float(y)) for x, y in parts]
        last = goal
    return forces
