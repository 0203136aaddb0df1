"""Equations of many closed places, solved by products with their compressed compliance.

The method is that of conjugate residuals for matrices that are nearly symmetric (GCR: Eisenstat, Elman and
Schultz 1983, doi:10.1137/0720023). Its directions serve all right-hand sides of one set. The inverse of the
compliance is approximated by that of every place and a few of its neighbours, from coarse to fine (Vecchia
1988, doi:10.1111/j.2517-6161.1988.tb01729.x).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.response.compressed import Compressed
from mlsanm_cli.contact.response.dense import SINGULAR, SingularSystemError
from mlsanm_cli.errors import NumericalError

NEIGHBOURS = np.array([-7, -5, -4, -3, -2, -1, 1, 3, 5, 7, 0])
"""The places on which the inverse is approximated, the place itself last: numbers times the largest power of
two that divides its own number, by which those of odd ones are left out."""
EXACT, MOST = 1e-13, 400
"""Part of the right-hand sides that is left, and products at most."""
ENOUGH = 1e-9
"""More than this part left is no solution."""


class ManyClosed:
    """The equations C p + M q = a, F p + G q = b of many closed places: their ``compliance`` (m, m) and the
    numbers of those ``closed`` (c,), and what motions do to gaps, and pressures and motions to forces.

    Raises SingularSystemError where bodies are loose.
    """

    def __init__(
        self,
        compliance: Compressed,
        closed: IntArray,
        moved: FloatArray,
        forces: FloatArray,
        stiffness: FloatArray,
    ) -> None:
        self._compliance, self._closed = compliance, closed
        self._weight = compliance.weight[closed]
        self._inverse = _about_inverse(compliance, closed)
        self._directions = list[tuple[FloatArray, FloatArray]]()
        self._forces = forces
        self._by_motion = (
            np.stack([self._own(column) for column in moved.T], axis=1) if moved.shape[1] else moved
        )
        self._reduced = stiffness - forces @ self._by_motion
        if len(stiffness):
            rows = np.abs(stiffness) + np.abs(forces) @ np.abs(self._by_motion)
            scale = np.maximum(rows.max(axis=1), np.finfo(float).tiny)
            if np.linalg.cond(self._reduced / scale[:, None]) > 1.0 / SINGULAR:
                raise SingularSystemError

    def solve(self, gap: FloatArray, force: FloatArray, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Pressures (c,) and motions (k,) for right-hand sides a and b, from pressures near them."""
        alone = start + self._own(gap - self._product(start))
        if not len(force):
            return alone, force
        motion = np.asarray(np.linalg.solve(self._reduced, force - self._forces @ alone), dtype=np.float64)
        return alone - self._by_motion @ motion, motion

    def _product(self, pressure: FloatArray) -> FloatArray:
        """The gaps (c,) that pressures (c,) make."""
        whole = np.zeros(self._compliance.shape[1])
        whole[self._closed] = pressure
        return np.asarray((self._compliance @ whole)[self._closed])

    def _own(self, gap: FloatArray) -> FloatArray:
        """The pressures (c,) that make gaps (c,)."""
        left = self._weight * gap
        size = aim = float(np.linalg.norm(left))
        total = np.zeros(len(left))
        for way, change in self._directions:
            part = change @ left
            total += part * way
            left = left - part * change
        for _ in range(MOST):
            aim = float(np.linalg.norm(left))
            if aim <= EXACT * size:
                break
            way = self._inverse.T @ (self._inverse @ left)
            change = self._weight * self._product(way)
            for before, caused in self._directions:
                part = caused @ change
                way, change = way - part * before, change - part * caused
            length = float(np.linalg.norm(change))
            if length == 0.0:
                break
            way, change = way / length, change / length
            self._directions.append((way, change))
            part = change @ left
            total += part * way
            left = left - part * change
        if not aim <= ENOUGH * size:
            raise NumericalError(
                "the pressures of a contact with many unknowns have not been found",
                "make contact.accuracy larger, which takes fewer unknowns",
            )
        return total


def _about_inverse(compliance: Compressed, closed: IntArray) -> sparse.csr_array:
    """A matrix (c, c) whose product with its transpose is about the inverse of the weighted compliance."""
    count = len(closed)
    rank = np.arange(1, count + 1)
    other = rank[:, None] + NEIGHBOURS * (rank & -rank)[:, None]
    there = (other >= 1) & (other <= count)
    other = np.where(there, other, rank[:, None]) - 1
    size = len(NEIGHBOURS)
    one, two = np.triu_indices(size)
    entries = compliance.weighted(closed[other[:, one].ravel()], closed[other[:, two].ravel()])
    local = np.zeros((count, size, size))
    local[:, one, two] = local[:, two, one] = entries.reshape(count, -1)
    local = np.where(there[:, :, None] & there[:, None, :], local, 0.0)
    local[:, np.arange(size), np.arange(size)] += ~there
    units = np.zeros((count, size, 1))
    units[:, -1] = 1.0
    rows = np.linalg.solve(local, units)[:, :, 0]
    rows = np.where(there, rows / np.sqrt(np.abs(rows[:, -1:])), 0.0)
    places = np.repeat(np.arange(count), size), other.ravel()
    return sparse.csr_array((rows.ravel(), places), shape=(count, count))
