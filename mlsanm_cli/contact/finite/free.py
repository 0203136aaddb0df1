"""Motions at finite strain that are not given: of bodies that only contact holds, of obstacles under forces.

They are unknown load factors behind those of the case. A loose body is pinned at as many nodes as it has
free motions, and the pins move as the factors say; the forces on it, and their moment, have to vanish
together, and so do the pins' reactions. An obstacle's factors move it, and what presses it balances its
force.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.finite.body import BodySeries, FiniteBody


@dataclass(frozen=True)
class LooseMotions:
    """The free ``components`` of a ``body``: 0 (x), 1 (y), 2 (rotation, as a length: over its ``size``)."""

    body: str
    components: tuple[int, ...]
    size: float

    @property
    def count(self) -> int:
        """How many there are (d)."""
        return len(self.components)

    def sums(self, body: FiniteBody, series: BodySeries) -> sparse.csr_array:
        """Rows (d, 3k) that add up what the body's pieces lack to forces and moment on the whole of it, about
        the middle of them where they are."""
        pieces, count = body.elastic.pieces, body.count
        _, _, middle = series.state()
        arm = (middle - middle.mean(axis=1, keepdims=True)) / self.size
        none, ones = np.zeros(count), np.ones(count)
        turned = [-arm[1], arm[0], pieces.size / self.size * ones]
        every = [np.concatenate(row) for row in ([ones, none, none], [none, ones, none], turned)]
        return sparse.csr_array(np.array([every[component] for component in self.components]))


@dataclass(frozen=True)
class DrivenObstacle:
    """A ``component`` of the motion of the obstacle of the contact number ``contact``, of the unknown number
    ``number``, under a ``force`` (L,) per load factor."""

    contact: int
    component: int
    number: int
    force: FloatArray
