"""One elastic body: its discrete system, and the right-hand sides and functionals others work with.

Rows, in this order: equilibrium in x and y at every node, boundary nodes included; then, surface by surface,
the x and y conditions at each of its nodes, a displacement where the component is held and a traction where
it is not; then single held nodes. A corner node has the rows of both its surfaces.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.deferred import BodyEquations, Timed
from mlsanm_cli.mechanics.pieces import Pieces, reaction_rows
from mlsanm_cli.mechanics.rigid import RigidBodyModes
from mlsanm_cli.mechanics.springs import FREE, Held, Springs, gripped, soft
from mlsanm_cli.memo import digest
from mlsanm_cli.operators.system import LinearSystem


@dataclass(frozen=True)
class ElasticBody:
    """A body with its conditions chosen, and its system, factorised when it is first used.

    ``first_row[surface]`` is where the surface's rows begin: x for its b nodes, then y for its b nodes.
    ``held[surface]`` says for x and y whether these rows hold a displacement, ``springs[surface]`` what
    traction per displacement springs there pull back with, ``free`` which rigid motions nothing holds:
    ``system`` then answers to balanced loads, by displacements with the mean motions that the right-hand
    sides of as many rows from ``first_pin`` on say. ``rows`` counts all rows: behind those of the nodes are
    three for each of the k ``pieces``, whose right-hand sides are what the loads on it are beyond those that
    the nodes' right-hand sides stand for.
    ``equations`` are factorised within ``timed()``.
    ``held_nodes`` are the (node, component) pairs that supports hold one by one, whose rows follow those of
    the surfaces.
    """

    model: BodyModel
    held: Mapping[str, tuple[bool, bool]]
    springs: Springs
    free: RigidBodyModes
    first_row: Mapping[str, int]
    rows: int
    pieces: Pieces
    loads_on_pieces: Callable[[], sparse.csr_array]
    equations: BodyEquations
    timed: Timed = nullcontext
    held_nodes: tuple[tuple[int, int], ...] = ()

    @property
    def system(self) -> LinearSystem:
        """The factorised system; NumericalError where there is none."""
        return self.equations.factorised(self.timed)

    @property
    def content(self) -> str:
        """A digest of the body with its conditions."""
        chosen = [self.held, self.springs, self.free, self.first_row, self.rows]
        return digest(self.model.content, self.equations.content, chosen)

    @property
    def first_pin(self) -> int:
        """The row of the first free motion, behind those of the nodes that supports hold one by one."""
        return self.rows - 3 * self.pieces.count - len(self.free.components)

    def condition_rows(self, surface: str, component: int) -> IntArray:
        """Row numbers (b,) of a surface's conditions in x (0) or y (1)."""
        count = len(self.model.cloud.surfaces[surface].index)
        first = self.first_row[surface] + component * count
        return np.arange(first, first + count, dtype=np.int64)

    def source(
        self, surface: str, values: FloatArray, held: bool, between: FloatArray | None = None
    ) -> FloatArray:
        """Right-hand side (r,) that prescribes ``values`` (b, 2) on a surface.

        They go into the components that hold a displacement if ``held``, else into those that take a
        traction, which is linear between the nodes unless it is known ``between`` (g, 2) them, at the FINE
        points of the surface's halves.
        """
        source = np.zeros(self.rows)
        for component in (0, 1):
            if self.held.get(surface, (False, False))[component] == held:
                source[self.condition_rows(surface, component)] = values[:, component]
        if between is not None and not held:
            taken = ~np.array(self.gripped.get(surface, FREE))
            whole = self.pieces.of_traction(self.model.cloud.surfaces[surface], between * taken)
            source[self.rows - len(whole) :] = whole - self.loads @ source
        return source

    def force_source(self, force: FloatArray) -> FloatArray:
        """Right-hand side (r,) of a ``force`` (n, 2) per volume, linear between the nodes:
        div sigma = -force."""
        source = np.zeros(self.rows)
        source[: force.size] = -force.T.ravel()
        source[self.rows - 3 * self.pieces.count :] = self.pieces.of_force(force)
        return source

    @property
    def loads(self) -> sparse.csr_array:
        """Force and moment (3k, r) on the pieces by right-hand sides."""
        return self.loads_on_pieces()

    def resultants(self, center: tuple[float, float] = (0.0, 0.0)) -> sparse.csr_array:
        """Force x, force y and moment about a ``center`` (3, r) of right-hand sides on the body."""
        return sparse.csr_array(self.pieces.totals(center) @ self.loads)

    def reaction_rows(self, surface: str, center: tuple[float, float] = (0.0, 0.0)) -> sparse.csr_array:
        """Force x, y and moment about a ``center`` (3, 2N) of a held surface on the body."""
        where, inside = self.model.cloud.surfaces[surface], self.depth_of_reactions(surface)
        return reaction_rows(self.model, where, self.gripped[surface], center, inside)

    def depth_of_reactions(self, surface: str) -> float:
        """How many spacings inside the stress is taken for the force of a held surface.

        Square schemes have no rows of pieces, and their stress near held corners means little: it is taken
        a spacing inside, or two where both directions are held.
        """
        return float(sum(self.gripped[surface])) if self.model.settings.square else 0.0

    @cached_property
    def gripped(self) -> Held:
        """Components of surfaces that are held, or by springs as stiff as that."""
        return gripped(self.held, self.springs, self.model.cloud, self.model.material)

    @cached_property
    def soft_springs(self) -> Springs:
        """The springs that give way."""
        return soft(self.springs, self.model.cloud, self.model.material)
