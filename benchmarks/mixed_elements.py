"""Nearly incompressible rubber in contact against mixed finite elements: forces and largest pressures.

    python benchmarks/mixed_elements.py [--scene block ring O-ring] [--fine 2] [--nu 0.49 0.499 0.4999]

A block under a rigid cylinder, a ring and an O-ring (a disk) between rigid plates, without friction, of the
neo-Hookean law W = mu/2 (I1 - 3) - mu ln J + lam/2 (ln J)^2 in plane strain. The elements have nine nodes for
displacements and three discontinuous pressures each (Boffi, Brezzi and Fortin 2013, Mixed Finite Element
Methods and Applications, section 8.6.3), contact is by augmented penalties at the Gauss points of sides.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

import mlsanm_cli as mlsanm

Array = NDArray[np.float64]
Gap = Callable[[Array, float], tuple[Array, Array]]
E = 2.6
GAUSS = np.polynomial.legendre.leggauss(3)
AUGMENTED, TOLERANCE, MOST = 8, 1e-9, 30


def shape_functions(s: Array) -> tuple[Array, Array]:
    """Quadratic functions (..., 3) on [-1, 1] and their derivatives."""
    values = np.stack([0.5 * s * (s - 1.0), 1.0 - s**2, 0.5 * s * (s + 1.0)], axis=-1)
    return values, np.stack([s - 0.5, -2.0 * s, s + 0.5], axis=-1)


@dataclass(frozen=True)
class Solid:
    """Nine-node elements on a grid of ``nodes`` (2a + 1, 2b + 1, 2), with Lame's constants ``lam``, ``mu``;
    ``held`` (n, 2) are fixed components, ``pressed`` the numbers of the nodes along the side in contact."""

    nodes: Array
    lam: float
    mu: float
    held: NDArray[np.bool_]
    pressed: NDArray[np.int64]

    def element_nodes(self) -> NDArray[np.int64]:
        """Nodes (e, 9) of all elements."""
        rows, columns = self.nodes.shape[:2]
        number = np.arange(rows * columns).reshape(rows, columns)
        parts = [number[i : rows - 2 + i : 2, j : columns - 2 + j : 2] for i in range(3) for j in range(3)]
        return np.stack(parts, axis=-1).reshape(-1, 9)

    def solve(self, gap: Gap, steps: Array) -> tuple[float, float]:
        """Force and largest pressure per deformed length at the last of the ``steps``."""
        x, elements = self.nodes.reshape(-1, 2), self.element_nodes()
        count, cells = len(x), len(elements)
        dofs = (2 * elements[:, :, None] + [0, 1]).reshape(cells, 18)
        pressures = 2 * count + 3 * np.arange(cells)[:, None] + np.arange(3)
        grid = np.stack(np.meshgrid(*[GAUSS[0]] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
        weights = np.outer(GAUSS[1], GAUSS[1]).ravel()
        one, d_one = shape_functions(grid[:, 0])
        two, d_two = shape_functions(grid[:, 1])
        local = np.stack(
            [np.einsum("gi,gj->gij", d_one, two), np.einsum("gi,gj->gij", one, d_two)], axis=-1
        ).reshape(-1, 9, 2)
        jacobian = np.einsum("gak,eac->egck", local, x[elements])
        measure = np.abs(np.linalg.det(jacobian)) * weights
        slope = np.einsum("gak,egkc->egac", local, np.linalg.inv(jacobian))
        modes = np.concatenate([np.ones((len(grid), 1)), grid], axis=1)
        free = np.concatenate([~self.held.ravel(), np.ones(3 * cells, dtype=bool)])
        state, penalty = np.zeros(2 * count + 3 * cells), 30.0 * self.mu / self._edge()
        side = Side.of(x, self.pressed)
        multipliers = np.zeros(side.count)
        for amount in steps:
            for _ in range(AUGMENTED if amount == steps[-1] else 2):
                for _ in range(MOST):
                    rest, matrix = self._bulk(state, dofs, pressures, slope, measure, modes)
                    more, tangent = side.forces(state[: 2 * count], gap, amount, multipliers, penalty)
                    rest[: 2 * count] += more
                    matrix = (matrix + tangent_padded(tangent, len(state)))[free][:, free]
                    change = splu(sparse.csc_matrix(matrix)).solve(-rest[free])
                    state[free] += change
                    if np.abs(change[: 2 * count // 2]).max() < TOLERANCE:
                        break
                opening = side.gaps(state[: 2 * count], gap, amount)[0]
                multipliers = np.maximum(multipliers - penalty * opening, 0.0)
        return side.result(state[: 2 * count], multipliers, gap, float(steps[-1]))

    def _edge(self) -> float:
        x = self.nodes.reshape(-1, 2)[self.pressed]
        return float(np.median(np.hypot(*np.diff(x[::2], axis=0).T)))

    def _bulk(
        self, state: Array, dofs: Any, pressures: Any, slope: Array, measure: Array, modes: Array
    ) -> tuple[Array, sparse.csr_array]:
        """Residual of equilibrium and of p = lam ln(J) / J, over lam, and its derivative."""
        u, p = state[dofs].reshape(len(dofs), 9, 2), state[pressures] @ modes.T
        f = np.eye(2) + np.einsum("eac,egak->egck", u, slope)
        volume = np.linalg.det(f)
        cofactor = np.stack(
            [np.stack([f[..., 1, 1], -f[..., 1, 0]], -1), np.stack([-f[..., 0, 1], f[..., 0, 0]], -1)], -2
        )
        inverse = cofactor / volume[..., None, None]
        stress = self.mu * (f - inverse) + p[..., None, None] * cofactor
        eye = np.eye(2)
        moduli = self.mu * np.einsum("ik,JL->iJkL", eye, eye) + self.mu * np.einsum(
            "egiL,egkJ->egiJkL", inverse, inverse
        )
        flip = np.zeros((2, 2, 2, 2))
        flip[0, 0, 1, 1] = flip[1, 1, 0, 0] = 1.0
        flip[0, 1, 1, 0] = flip[1, 0, 0, 1] = -1.0
        moduli = moduli + p[..., None, None, None, None] * flip
        law, rate = np.log(volume) / volume, (1.0 - np.log(volume)) / volume**2
        force = np.einsum("egiJ,egaJ,eg->eai", stress, slope, measure).reshape(len(dofs), 18)
        area = np.einsum("egiJ,egaJ->egai", cofactor, slope).reshape(*measure.shape, 18)
        constraint = np.einsum("eg,gm,eg->em", law - p / self.lam, modes, measure)
        k_uu = np.einsum("egaJ,egiJkL,egbL,eg->eaibk", slope, moduli, slope, measure).reshape(-1, 18, 18)
        k_up = np.einsum("egd,gm,eg->edm", area, modes, measure)
        k_pu = np.einsum("gm,egd,eg->emd", modes, area, measure * rate)
        k_pp = -np.einsum("gm,gn,eg->emn", modes, modes, measure) / self.lam
        rest = np.zeros(len(state))
        np.add.at(rest, dofs, force)
        np.add.at(rest, pressures, constraint)
        every = np.concatenate([dofs, pressures], axis=1)
        blocks = np.concatenate(
            [np.concatenate([k_uu, k_up], axis=2), np.concatenate([k_pu, k_pp], axis=2)], axis=1
        )
        row, column = np.repeat(every, 21, axis=1), np.tile(every, (1, 21))
        entries = (blocks.ravel(), (row.ravel(), column.ravel()))
        return rest, sparse.csr_array(sparse.coo_array(entries, shape=(len(state), len(state))))


def tangent_padded(tangent: sparse.csr_array, size: int) -> sparse.csr_array:
    """The ``tangent`` in a matrix of ``size`` rows."""
    coo = tangent.tocoo()
    return sparse.csr_array(sparse.coo_array((coo.data, coo.coords), shape=(size, size)))


@dataclass(frozen=True)
class Side:
    """Gauss points of a side: interpolation ``values`` (g, n) of the nodes, reference ``lengths`` (g,) and
    tangents by ``slopes`` (g, n), per reference length."""

    values: sparse.csr_array
    slopes: sparse.csr_array
    lengths: Array
    places: Array

    @property
    def count(self) -> int:
        """Number of points."""
        return len(self.lengths)

    @classmethod
    def of(cls, x: Array, numbers: NDArray[np.int64]) -> Side:
        edges = np.stack([numbers[:-2:2], numbers[1:-1:2], numbers[2::2]], axis=1)
        value, rate = shape_functions(GAUSS[0])
        tangent = np.einsum("ga,eac->egc", rate, x[edges])
        speed = np.hypot(*tangent.reshape(-1, 2).T)
        row = np.repeat(np.arange(3 * len(edges)), 3)
        column = np.repeat(edges, 3, axis=0).reshape(len(edges), 3, 3).ravel()
        shape = (3 * len(edges), len(x))
        values = sparse.csr_array((np.tile(value, (len(edges), 1)).ravel(), (row, column)), shape=shape)
        slopes = sparse.csr_array(
            ((np.tile(rate, (len(edges), 1)) / speed[:, None]).ravel(), (row, column)), shape=shape
        )
        return cls(values, slopes, speed * np.tile(GAUSS[1], len(edges)), x)

    def gaps(self, u: Array, gap: Gap, amount: float) -> tuple[Array, Array]:
        """Gaps (g,) and normals (g, 2)."""
        return gap(self.values @ (self.places + u.reshape(-1, 2)), amount)

    def forces(
        self, u: Array, gap: Gap, amount: float, multipliers: Array, penalty: float
    ) -> tuple[Array, sparse.csr_array]:
        """Minus the nodal forces of the pressures, and their derivative (without that of the normals)."""
        opening, normal = self.gaps(u, gap, amount)
        pressure = np.maximum(multipliers - penalty * opening, 0.0) * self.lengths
        rows = sparse.csr_array(
            sparse.hstack([sparse.diags_array(n) @ self.values for n in normal.T], format="csr")
        )
        order = np.arange(u.size).reshape(-1, 2).T.ravel()
        rows = rows[:, np.argsort(order)]
        active = penalty * self.lengths * (pressure > 0.0)
        return -(rows.T @ pressure), sparse.csr_array(rows.T @ sparse.diags_array(active) @ rows)

    def result(self, u: Array, multipliers: Array, gap: Gap, amount: float) -> tuple[float, float]:
        """Vertical force, and the largest pressure per deformed length."""
        normal = self.gaps(u, gap, amount)[1]
        tangent = self.slopes @ (self.places + u.reshape(-1, 2))
        force = abs(float((multipliers * self.lengths) @ normal[:, 1]))
        # Means over elements: at the ends of a contact pressures oscillate from point to point.
        pressure = (multipliers / np.hypot(*tangent.T)).reshape(-1, 3) @ GAUSS[1] / 2.0
        return force, float(pressure.max())


def plane(height: float) -> Gap:
    """A plate above that moves down from ``height``."""
    return lambda x, d: (height - d - x[:, 1], np.tile([0.0, -1.0], (len(x), 1)))


def cylinder(radius: float, height: float) -> Gap:
    """A cylinder that touches the ``height`` from above and moves down."""

    def gap(x: Array, d: float) -> tuple[Array, Array]:
        away = x - np.array([0.0, height + radius - d])
        distance = np.hypot(*away.T)
        return distance - radius, away / distance[:, None]

    return gap


def block(fine: int) -> Array:
    """Half of a block 4 x 2, finer under the cylinder."""
    s, t = np.linspace(0.0, 1.0, 32 * fine + 1), np.linspace(0.0, 1.0, 28 * fine + 1)
    x, y = 0.6 * s + 1.4 * s**4, 2.0 - (0.7 * (1.0 - t) + 1.3 * (1.0 - t) ** 3)
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)


def ring(fine: int) -> Array:
    """A quarter of a ring of radii 0.6 and 1."""
    angle = 0.5 * np.pi * (1.0 - np.linspace(0.0, 1.0, 48 * fine + 1) ** 1.3)
    radius = np.linspace(0.6, 1.0, 12 * fine + 1)
    return np.asarray(radius[None, :, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)[:, None])


def disk(fine: int) -> Array:
    """A quarter of a disk of radius 1, image of a square."""
    s = np.linspace(0.0, 1.0, 32 * fine + 1)
    u, v = np.meshgrid(s, s, indexing="ij")
    return np.stack([u * np.sqrt(1.0 - 0.5 * v**2), v * np.sqrt(1.0 - 0.5 * u**2)], axis=-1)


SCENES: dict[str, tuple[Callable[[int], Array], Gap, float, str]] = {
    "block": (
        block,
        cylinder(1.0, 2.0),
        0.3,
        """spacing = 0.25
shape = { kind = "rectangle", x = [0.0, 2.0], y = [0.0, 2.0] }
refine = [{ at = [0.0, 2.0], spacing = 0.04, radius = 0.75, growth = 0.15 }]
[[support]]
boundary = "solid.bottom"
ux = 0.0
uy = 0.0
[[support]]
boundary = "solid.left"
ux = 0.0
[[contact]]
name = "press"
slave = "solid.top"
obstacle = { kind = "disk", center = [0.0, 3.0], radius = 1.0 }
""",
    ),
    "ring": (
        ring,
        plane(1.0),
        0.4,
        """spacing = 0.03
shape = { kind = "sector", center = [0.0, 0.0], radii = [0.6, 1.0], angles = [0.0, 90.0] }
[[support]]
boundary = "solid.start"
uy = 0.0
[[support]]
boundary = "solid.end"
ux = 0.0
[[contact]]
name = "press"
slave = "solid.outer"
obstacle = { kind = "plane", point = [0.0, 1.0], normal = [0.0, -1.0] }
""",
    ),
    "O-ring": (
        disk,
        plane(1.0),
        0.3,
        """spacing = 0.06
shape = { kind = "half-disk", center = [0.0, 0.0], radius = 1.0, side = "upper" }
[[support]]
boundary = "solid.flat"
uy = 0.0
[[support]]
body = "solid"
near = [0.0, 0.0]
ux = 0.0
[[contact]]
name = "press"
slave = "solid.arc"
obstacle = { kind = "plane", point = [0.0, 1.0], normal = [0.0, -1.0] }
""",
    ),
}
"""Grid of the elements, obstacle, its way down, and the rest of the case. The O-ring is not halved there."""


def by_elements(name: str, poisson: float, fine: int) -> tuple[float, float]:
    """Force and largest pressure by elements."""
    make, gap, depth, _ = SCENES[name]
    grid = make(fine)
    x, number = grid.reshape(-1, 2), np.arange(grid.size // 2).reshape(grid.shape[:2])
    held = np.abs(x) < 1e-9
    pressed = number[:, -1]
    if name == "block":
        held[:, 0] |= held[:, 1]
    if name == "O-ring":
        pressed = np.concatenate([number[:, -1], number[-1, -2::-1]])
    lam, mu = E * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)), 0.5 * E / (1.0 + poisson)
    return Solid(grid, lam, mu, held, pressed).solve(gap, depth * np.linspace(0.0, 1.0, 9)[1:])


def by_mlsanm(name: str, poisson: float) -> tuple[float, float]:
    """The same by a run."""
    *_, depth, rest = SCENES[name]
    text = f"""format = 1
[model]
plane = "strain"
strain = "finite"
[material.rubber]
E = {E}
nu = {poisson}
law = "neo-hookean"
[[load]]
name = "down"
kind = "obstacle"
obstacle = "press"
uy = {-depth}
[[body]]
name = "solid"
material = "rubber"
{rest}"""
    with tempfile.TemporaryDirectory() as folder:
        case = Path(folder) / "case.toml"
        case.write_text(text)
        contact = mlsanm.run(case, out=Path(folder) / "run").summary["contacts"]["press"]
    share = 2.0 if name == "O-ring" else 1.0
    return abs(contact["force"][1]) / share, contact["peak_pressure"]


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--scene", nargs="+", choices=SCENES, default=list(SCENES))
    parser.add_argument("--nu", nargs="+", type=float, default=[0.49, 0.499, 0.4999])
    parser.add_argument("--fine", type=int, default=1, help="subdivision of the elements")
    options = parser.parse_args()
    print(f"{'scene':8} {'nu':7} {'elements: force, pressure':26} {'mlsanm':20} differences (%)")
    for scene in options.scene:
        for value in options.nu:
            exact, found = by_elements(scene, value, options.fine), by_mlsanm(scene, value)
            off = [100.0 * (one / other - 1.0) for one, other in zip(found, exact, strict=True)]
            figures = "  ".join(f"{number:9.5f}" for number in (*exact, *found))
            print(f"{scene:8} {value:<7} {figures}  {off[0]:+.2f} {off[1]:+.2f}", flush=True)
