"""Kinematics of a contact in a state: gaps, directions and slips of the slave's nodes, and their
derivatives."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.records import dataclass

NO_GAP = 1e300
"""Gap of a node that faces nothing."""


@dataclass(frozen=True)
class Meeting:
    """Kinematics at the slave's nodes (c,).

    ``facing`` (c,) marks nodes opposite to the master; ``gap`` (c,); the master's outward ``normal`` (c, 2)
    and the ``tangent`` (c, 2), the normal rotated by -90 degrees; ``place`` (c,), the closest point as a
    reference arc length of the master; ``slip`` (c,) along the tangent relative to an earlier place.

    Derivatives by the s displacements (2s,) of the slave's nodes, then the master's: ``d_gap``, ``d_slip``,
    ``d_turn`` (c, 2s), the last one for the rotation of the normal towards the tangent. ``carried`` (m, c)
    maps tractions at the slave's nodes to the master's m nodes, per reference length of either, and
    ``carried_moved`` (T) (2m, 2s) is the derivative for slave tractions T (c, 2).
    """

    facing: BoolArray
    gap: FloatArray
    normal: FloatArray
    tangent: FloatArray
    place: FloatArray
    slip: FloatArray
    d_gap: sparse.csr_array
    d_slip: sparse.csr_array
    d_turn: sparse.csr_array
    carried: sparse.csr_array
    carried_moved: Callable[[FloatArray], sparse.csr_array]

    def tractions(self, pressure: FloatArray, friction: FloatArray) -> FloatArray:
        """Nominal tractions (s, 2) of both sides for the slave's pressures and friction (c,)."""
        on_slave = pressure[:, None] * self.normal + friction[:, None] * self.tangent
        return np.concatenate([on_slave, -(self.carried @ on_slave)])

    def columns(self, directions: FloatArray) -> sparse.csr_array:
        """Tractions (2s, c) of both sides per unit along ``directions`` (c, 2) on the slave."""
        count, (line, column) = len(directions), self.carried.tocoo().coords
        x, y = (-self.carried.data * along[column] for along in directions.T)
        nodes = np.arange(count)
        rows = np.concatenate([2 * nodes, 2 * nodes + 1, 2 * (count + line), 2 * (count + line) + 1])
        columns = np.concatenate([nodes, nodes, column, column])
        entries = (np.concatenate([*directions.T, x, y]), (rows, columns))
        return sparse.csr_array(entries, shape=(2 * (count + self.carried.shape[0]), count))

    def turning(self, pressure: FloatArray, friction: FloatArray) -> sparse.csr_array:
        """Derivative (2s, 2s) of the tractions by the displacements."""
        across = pressure[:, None] * self.tangent - friction[:, None] * self.normal
        found = self.columns(across) @ self.d_turn
        if self.carried.shape[0]:
            moved = self.carried_moved(self.tractions(pressure, friction)[: len(pressure)])
            none = sparse.csr_array((found.shape[0] - moved.shape[0], found.shape[1]))
            found = found - sparse.vstack([none, moved], format="csr")
        return sparse.csr_array(found)


def by_component(rows: sparse.csr_array, directions: FloatArray) -> sparse.csr_array:
    """Rows (c, m) of a scalar as rows (c, 2m) of the component along ``directions`` (c, 2)."""
    found = rows.tocoo()
    line, column = found.coords
    entries = (
        np.concatenate([found.data * directions[line, 0], found.data * directions[line, 1]]),
        (np.tile(line, 2), np.concatenate([2 * column, 2 * column + 1])),
    )
    return sparse.csr_array(entries, shape=(rows.shape[0], 2 * rows.shape[1]))
