"""Unknown rigid motions at finite strain: of floating bodies, and of obstacles and plates under forces.

They are load factors after those of the case. A floating body is pinned at as many nodes as it has free
motions; the factors move the pins, in directions that rotate with the body. The resultant force and moment on
it must vanish, and so do the pins' reactions. Moments are taken about held nodes, as about a hinge. An
obstacle's factors move it, and contact tractions balance its force; a plate's factors move the sides bonded
to it, whose stress balances its force and its moment about its hinge.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.body_series import BodySeries
from mlsanm_cli.mechanics.finite.tangent import held_force
from mlsanm_cli.mechanics.rigid import ROTATION
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class LooseMotions:
    """The free ``components`` of a ``body``: 0 (x), 1 (y), 2 (rotation times its ``size``), the unknowns from
    ``number`` on. ``anchors`` are the (node, component) pairs held by supports, ``pins`` (p) those that hold
    the body, ``moves`` (p, d) their displacements per free motion."""

    body: str
    components: tuple[int, ...]
    number: int
    size: float
    anchors: tuple[tuple[int, int], ...]
    pins: tuple[tuple[int, int], ...]
    moves: FloatArray

    @property
    def count(self) -> int:
        """Number of free motions (d)."""
        return len(self.components)

    @property
    def numbers(self) -> IntArray:
        """Its unknowns (d,)."""
        return self.number + np.arange(self.count)

    def factors(self, body: FiniteBody, displacement: FloatArray) -> FloatArray:
        """Free motions (d,) for which the pins match the body's ``displacement`` (2N,)."""
        return np.asarray(np.linalg.solve(self.moves, body.pinned @ displacement))

    def sums(
        self, body: FiniteBody, series: BodySeries, displacement: FloatArray
    ) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Rows (d, 3k) that sum the imbalance of the pieces to force and moment on the body, and rows (d, 2N)
        of their derivative by the lever arms, at ``displacement`` (2N,)."""
        pieces, count = body.elastic.pieces, body.count
        _, _, middle = series.state()
        center = middle.mean(axis=1)
        # A node held in x reacts along x only: its moment vanishes about points on that line alone.
        for node, component in self.anchors:
            other = 1 - component
            center[other] = body.elastic.model.cloud.points[node, other] + displacement[2 * node + other]
        arm = (middle - center[:, None]) / self.size
        none, ones = np.zeros(count), np.ones(count)
        turned = [-arm[1], arm[0], pieces.size / self.size * ones]
        every = [np.concatenate(row) for row in ([ones, none, none], [none, ones, none], turned)]
        rows = sparse.csr_array(np.array([every[component] for component in self.components]))
        imbalance = series.rows(0)[-3 * count :].reshape(3, count)[:2] / self.size
        moving = np.zeros((len(self.components), len(displacement)))
        if ROTATION in self.components:
            own, pull = moving[self.components.index(ROTATION)], imbalance @ body.centers
            own[::2], own[1::2] = pull[1], -pull[0]
            for node, component in self.anchors:
                sign = 1.0 if component == 0 else -1.0
                own[2 * node + 1 - component] += sign * imbalance[component].sum()
        return rows, sparse.csr_array(moving)


@dataclass(frozen=True)
class DrivenObstacle:
    """Unknown motion ``number`` of the obstacle of contact number ``contact``: its ``component``, under a
    ``force`` (L,) per load factor."""

    contact: int
    component: int
    number: int
    force: FloatArray


@dataclass(frozen=True)
class Plate:
    """A rigid plate ``name`` bonded to ``surfaces`` of bodies, with its hinge at ``center`` (2,) as drawn;
    ``loads`` are those that move it.

    Its unknown ``components``, 0 (x), 1 (y), 2 (rotation times its ``size``), are the unknowns from
    ``number`` on, under ``force`` (k, L) per load factor. ``motion`` (3, L + d) is its displacement and
    rotation per load factor and free motion.
    """

    name: str
    surfaces: Mapping[str, tuple[str, ...]]
    loads: tuple[int, ...]
    center: FloatArray
    size: float
    components: tuple[int, ...]
    number: int
    force: FloatArray
    motion: FloatArray

    @property
    def numbers(self) -> IntArray:
        """Its unknowns (k,)."""
        return self.number + np.arange(len(self.components))

    def pulled(
        self, body: FiniteBody, name: str, displacement: FloatArray, factors: FloatArray
    ) -> tuple[FloatArray, sparse.csr_array]:
        """Force x, y and moment about the hinge (3,) on one body from its stress, and rows (3, 2N) of the
        derivative."""
        hinge = self.center + self.motion[:2] @ factors[: self.motion.shape[1]]
        return held_force(body, displacement, factors, self.surfaces[name], hinge)

    def unknown(self, values: FloatArray) -> FloatArray:
        """The entries of ``values`` (3, ...) for its unknowns (k, ...), moments over the plate's size."""
        chosen = list(self.components)
        scale = np.where(np.array(chosen) == ROTATION, 1.0 / self.size, 1.0)
        return np.asarray((values[chosen].T * scale).T)

    def arms(self, pull: FloatArray) -> FloatArray:
        """Derivative (3, L + d) of its moment by the position of the hinge, for the force ``pull`` (3,) on a
        body."""
        found = np.zeros_like(self.motion)
        found[2] = self.motion[1] * pull[0] - self.motion[0] * pull[1]
        return found

    def given(self, factors: FloatArray) -> FloatArray:
        """Force on it (k,) at load ``factors`` (L,), moments over its size."""
        whole = np.zeros(3)
        whole[list(self.components)] = self.force @ factors
        return self.unknown(whole)
