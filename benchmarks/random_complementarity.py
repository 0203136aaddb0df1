"""Random small contact problems with friction, solved and compared with an enumeration of all statuses.

One to four nodes, up to four with friction of 0 to 1.5, up to three motions: fixed bodies, floating ones,
degenerate starts, redundant rows, rigid bodies without compliance. A problem without a
state must end with a ray.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.complementarity.basis import Ray
from mlsanm_cli.contact.complementarity.problem import ContactStatus, Problem
from mlsanm_cli.contact.complementarity.solution import solve

KINDS = ("fixed", "floating", "degenerate", "redundant", "rigid")
FRICTION = (0.0, 0.2, 0.5, 1.0, 1.5)


@dataclass(frozen=True)
class Example:
    """Rows ``matrix`` x + ``free`` (N,) of ``m`` gaps, slips of ``nodes`` (n,) with ``friction``, and
    balances."""

    matrix: FloatArray
    free: FloatArray
    nodes: IntArray
    friction: FloatArray
    m: int

    @property
    def contacts(self) -> int:
        """Number of gaps and slips."""
        return self.m + len(self.nodes)

    @classmethod
    def random(cls, rng: np.random.Generator, kind: str) -> Example:
        """An example of one of the KINDS."""
        m = int(rng.integers(1, 5))
        n = int(rng.integers(0, m + 1))
        k = {"fixed": 0, "rigid": 3}.get(kind, int(rng.integers(0, 4)))
        count, nodes = m + n, np.sort(rng.choice(m, n, replace=False))
        friction, matrix = rng.choice(FRICTION, n), np.zeros((m + n + k, m + n + k))
        root, arms = rng.normal(size=(count, count)), rng.normal(size=(count, k))
        elastic = root @ root.T + 0.3 * np.eye(count)
        if kind == "rigid":
            elastic = 1e-3 * np.eye(count) * (rng.random() < 0.5)
        if kind == "redundant" and m > 1:
            elastic, arms[1] = 1e-2 * np.eye(count), arms[0]
        matrix[:count, :count], matrix[:count, count:], matrix[count:, :count] = elastic, arms, -arms.T
        if kind != "rigid" and rng.random() < 0.3:
            matrix[count:, count:] = np.diag(rng.random(k))
        free = rng.normal(size=m + n + k)
        if kind == "degenerate":
            free[:count] = np.where(rng.random(count) < 0.6, 0.0, free[:count])
        if rng.random() < 0.8:  # loads that can be carried
            pressure = rng.random(m)
            traction = rng.uniform(-1.0, 1.0, n) * friction * pressure[nodes]
            free[count:] = -matrix[count:, :count] @ np.concatenate([pressure, traction])
        return cls(matrix, free, nodes, friction, m)

    def accepts(self, x: FloatArray, tolerance: float) -> bool:
        """Whether unknowns satisfy all conditions."""
        m, count, w = self.m, self.contacts, self.matrix @ x + self.free
        pressure, traction, gap, slip = x[:m], x[m:count], w[:m], w[m:count]
        force = tolerance * (1.0 + np.abs(x[:count]).max(initial=0.0))
        length = tolerance * (1.0 + np.abs(w).max(initial=0.0)) + 1e-3 * np.abs(self.matrix).max() * force
        limit = self.friction * pressure[self.nodes]
        slides = np.abs(slip) > length
        return bool(
            (pressure >= -force).all()
            and (gap >= -length).all()
            and ((np.abs(pressure) <= force) | (np.abs(gap) <= length)).all()
            and (np.abs(traction) <= limit + force).all()
            and (np.abs(w[count:]) <= length).all()
            and (~slides | (np.abs(traction + np.sign(slip) * limit) <= 2.0 * force)).all()
        )

    def states(self) -> list[FloatArray]:
        """The states of all statuses; of those with singular equations the ones of least norm."""
        own = {int(node): number for number, node in enumerate(self.nodes)}
        kinds = ["os+-" if node in own and self.friction[own[node]] > 0.0 else "oc" for node in range(self.m)]
        found: list[FloatArray] = []
        for status in itertools.product(*kinds):
            matrix, rhs = self.matrix.copy(), -self.free
            for node, kind in enumerate(status):
                if kind == "o":
                    matrix[node], rhs[node] = np.eye(len(rhs))[node], 0.0
                if node in own and kind != "s":
                    row, side = self.m + own[node], {"+": 1.0, "-": -1.0}.get(kind, 0.0)
                    matrix[row], rhs[row] = np.eye(len(rhs))[row], 0.0
                    matrix[row, node] -= side * self.friction[own[node]]
            x = np.asarray(np.linalg.lstsq(matrix, rhs, rcond=1e-10)[0], dtype=np.float64)
            solved = np.abs(matrix @ x - rhs).max() <= 1e-8 * (1.0 + np.abs(rhs).max())
            if solved and self.accepts(x, 1e-8):
                found.append(x)
        return found

    def solved(self, rng: np.random.Generator) -> FloatArray | None:
        """The unknowns found from a random status, None for a ray."""
        problem = Problem.of(self.matrix, self.nodes, self.friction, self.m)
        closed = rng.random(self.m) < 0.5
        sign = np.where(closed[self.nodes], rng.choice((-1.0, 1.0), len(self.nodes)), 0.0)
        start = ContactStatus(closed, np.zeros(len(self.nodes), dtype=bool), sign)
        try:
            return solve(problem, problem.rows * self.free, start).x * problem.columns
        except Ray:
            return None
