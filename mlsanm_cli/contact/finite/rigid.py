"""A side of a body at finite strain against a rigid obstacle: gaps, normals, and what turns with them.

The unknowns are nominal pressures p_j >= 0, per length before loading, at the nodes of the slave: the
traction p n acts along the obstacle's normal n where the node is now, so that neither the slave's normal nor
its stretch is in the equations, and p_j w_j dg_j is work.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.geometry.obstacles import Round, Shape


@dataclass(frozen=True)
class RigidContact:
    """The contact ``name`` of the ``nodes`` (c,), at ``places`` (c, 2) before loading with outward normals
    ``outward`` (c, 2), ``weight`` (c,) the length each stands for and ``arc`` (c,) along the slave
    ``surface``. The obstacle's ``shape`` moves by ``motion`` (2, L) times the load factors."""

    name: str
    surface: str
    nodes: IntArray
    places: FloatArray
    outward: FloatArray
    weight: FloatArray
    arc: FloatArray
    shape: Shape
    motion: FloatArray

    @property
    def count(self) -> int:
        """Number of nodes (c)."""
        return len(self.nodes)

    def gaps(self, displacement: FloatArray, factors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Gaps (c,) and the obstacle's normals (c, 2) in a state of nodal ``displacement`` (2N,) and load
        ``factors`` (L,)."""
        at = self._seen(displacement, factors)
        partner, normal = self.shape.closest(at, self.outward)
        return ((at - partner) * normal).sum(axis=1), normal

    def bending(self, displacement: FloatArray, factors: FloatArray) -> FloatArray:
        """What multiplies a node's motion along the obstacle to turn its normal (c,): 1 over the distance
        from the centre, 0 above straight sides."""
        if not isinstance(self.shape, Round):
            return np.zeros(self.count)
        away = np.hypot(*(self._seen(displacement, factors) - np.array(self.shape.center)).T)
        return np.asarray((-1.0 if self.shape.inside else 1.0) / away)

    def _seen(self, displacement: FloatArray, factors: FloatArray) -> FloatArray:
        """The nodes (c, 2) as the obstacle sees them, which has moved itself."""
        moved = self.places + displacement.reshape(-1, 2)[self.nodes]
        return np.asarray(moved - self.motion @ factors)
