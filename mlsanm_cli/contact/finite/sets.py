"""Status of nodes (open, stick, slip) in one linearised step. Equation (22) of docs/method.md."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.complementarity.basis import Ray
from mlsanm_cli.contact.complementarity.problem import OPEN, SLIP, STICK, ContactStatus, Problem
from mlsanm_cli.contact.complementarity.solution import solve
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class NodeSets:
    """``status`` (c,) of all nodes, OPEN, STICK or SLIP, and the ``slip_sign`` of friction on slipping nodes;
    closed nodes without friction slip with sign 0."""

    status: NDArray[np.int8]
    slip_sign: FloatArray

    @property
    def closed(self) -> BoolArray:
        """Mask (c,) of closed nodes."""
        return np.asarray(self.status != OPEN)

    def same(self, other: NodeSets) -> bool:
        """Whether both are equal."""
        return bool((self.status == other.status).all() and (self.slip_sign == other.slip_sign).all())


def settled(
    matrix: FloatArray, free: FloatArray, now: FloatArray, friction: FloatArray, start: NodeSets
) -> tuple[FloatArray, NodeSets]:
    """Changes (2c + d,) of pressures, shears and free motions that satisfy all conditions, and the status.

    Gaps and slips (c,) and the force imbalance (d,) are ``free`` (2c + d,) plus ``matrix`` (2c + d, 2c + d)
    times the changes from the unknowns ``now``; ``friction`` are the coefficients (c,). Raises NumericalError
    if there is no state.
    """
    count, nodes = len(friction), np.flatnonzero(friction > 0.0)
    kept = np.concatenate([np.arange(count), count + nodes, np.arange(2 * count, len(free))])
    problem = Problem.of(matrix[np.ix_(kept, kept)], nodes, friction[nodes], count)
    stuck, sign = (start.status == STICK)[nodes], start.slip_sign[nodes]
    slides = start.closed[nodes] & ~stuck
    status = ContactStatus(start.closed, stuck, np.where(slides, np.where(sign < 0.0, -1.0, 1.0), 0.0))
    try:
        found = solve(problem, problem.rows * (free - matrix @ now)[kept], status)
    except Ray as error:
        raise NumericalError(
            "no contact state satisfies a linearised step", "the loads may move bodies that nothing holds"
        ) from error
    change = -now
    change[kept] += problem.columns * found.x
    whole, slip_sign = np.where(found.status.closed, SLIP, OPEN).astype(np.int8), np.zeros(count)
    whole[nodes[found.status.stuck]] = STICK
    slip_sign[nodes] = found.status.slip_sign
    return change, NodeSets(whole, slip_sign)
