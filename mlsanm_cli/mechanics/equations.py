"""Square schemes: selection of as many equations as unknowns from a body's rows.

The rows are those of :mod:`mlsanm_cli.mechanics.body`. "Collocation" uses equilibrium inside and boundary
conditions on the boundary, "ghost" also equilibrium at boundary nodes with a ghost. At a corner a component
held by one of the surfaces stays held, otherwise both tractions are added: separately they would impose the
shear stress twice and make the matrix singular. Scales: equilibrium h^2/E, traction h/E, displacement 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.mechanics.springs import FREE, NO_SPRING, Springs


@dataclass(frozen=True)
class RowTable:
    """Positions of a body's rows: ``surfaces[name]`` is the first of a surface's conditions (x of its b
    nodes, then y), ``nodes`` the first of single held nodes; ``modulus`` and ``springs`` scale tractions."""

    surfaces: Mapping[str, int]
    nodes: int
    total: int
    modulus: float
    springs: Springs

    def moduli(self, surface: str, component: int, length: FloatArray) -> FloatArray:
        """Scale (b,) of the tractions of a surface's nodes: modulus plus spring stiffness times ``length``
        (b,)."""
        return np.asarray(self.modulus + self.springs.get(surface, NO_SPRING)[component] * length)


def choose_equations(
    cloud: Cloud,
    held: Mapping[str, tuple[bool, bool]],
    held_nodes: Sequence[tuple[int, int]],
    rows: RowTable,
    ghosts: IntArray,
) -> sparse.csr_array:
    """Matrix (2N, r) that combines the rows to equations, in the order of the unknowns. ``ghosts`` (g,) are
    the boundary nodes with a ghost; ghosts are the last unknowns."""
    count = len(cloud.points)
    equation_of = np.arange(count)
    equation_of[ghosts] = count + np.arange(len(ghosts))
    balanced = np.union1d(np.setdiff1d(np.arange(count), cloud.boundary_nodes), ghosts)
    single = np.zeros((count, 2), dtype=bool)
    for node, component in held_nodes:
        single[node, component] = True

    parts: list[tuple[IntArray, IntArray, FloatArray]] = []
    for component in (0, 1):
        kept = balanced[~single[balanced, component]]
        scale = cloud.spacing[kept] ** 2 / rows.modulus
        parts.append((2 * kept + component, component * count + kept, scale))
        # A single held node replaces its equilibrium, or its traction if it has no equilibrium.
        taken = single[:, component] & (equation_of < count)
        # Held surfaces first: at a corner the held component replaces the other surface's traction.
        for name in sorted(cloud.surfaces, key=lambda one: not held.get(one, FREE)[component]):
            index = cloud.surfaces[name].index
            holds = held.get(name, FREE)[component]
            free = np.flatnonzero(~taken[index])
            at = index[free]
            if holds:
                taken[at] = True
            first = rows.surfaces[name] + component * len(index)
            length = cloud.spacing[at]
            scale = np.ones(len(at)) if holds else length / rows.moduli(name, component, length)
            parts.append((2 * equation_of[at] + component, first + free, scale))
    for number, (node, component) in enumerate(held_nodes):
        parts.append((np.array([2 * node + component]), np.array([rows.nodes + number]), np.ones(1)))
    equation, row, factor = (np.concatenate(column) for column in zip(*parts, strict=True))
    return sparse.csr_array((factor, (equation, row)), shape=(2 * (count + len(ghosts)), rows.total))
