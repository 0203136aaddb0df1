"""Results of a Newton step for bodies and contacts at finite strain, and the quantities it is computed
from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.finite.meeting import Meeting
from mlsanm_cli.contact.finite.sets import NodeSets
from mlsanm_cli.contact.response.coercivity import constrained_resistance
from mlsanm_cli.mechanics.finite.projector import Factorised

if TYPE_CHECKING:
    from mlsanm_cli.contact.finite.exact import ExactContact


@dataclass(frozen=True)
class Done:
    """Result of an iteration: updates of displacements, pressures, friction and ``free`` motions, and
    ``sets`` of all nodes.

    ``chosen`` (k,) are the nodes that might touch, with their ``compliance`` (k, k), gaps per pressure of
    fixed direction: the resistance of the body itself, without load stiffness. Pressures with ``unbalanced``
    (d, k) forces on floating bodies are excluded from the stability. ``used`` can be reused nearby.
    """

    du: FloatArray
    dp: FloatArray
    dq: FloatArray
    free: FloatArray
    traction: FloatArray
    sets: NodeSets
    chosen: IntArray
    compliance: FloatArray
    unbalanced: FloatArray
    solves: int
    settled: bool
    used: Used

    def stability(self, pressing: ExactContact, met: Sequence[Meeting]) -> float:
        """Least resistance of a contact with closed nodes, at closed nodes between two others, to pressures
        that oscillate from node to node; held nodes are excluded."""
        least = np.inf
        number = np.full(len(self.sets.status), -1, dtype=np.int64)
        number[self.chosen] = np.arange(len(self.chosen))
        for contact, one, here in zip(pressing.contacts, met, pressing.places, strict=True):
            own = self.sets.closed[here] & ~contact.slave.held
            inner = own[1:-1] & own[:-2] & own[2:]
            some = 1 + np.flatnonzero(inner) if inner.any() else np.flatnonzero(own)
            soft = sum(
                pressing.projectors[side.body].body.elastic.model.material.contact_compliance(
                    one.normal[some]
                )
                for side in contact.sides
            )
            place = number[here][some]
            part = self.compliance[np.ix_(place, place)]
            weight = contact.slave.weight[some]
            resistance = constrained_resistance(weight, np.diag(soft), part, self.unbalanced[:, place])
            least = min(least, resistance)
        return least


@dataclass(frozen=True)
class Used:
    """The bodies' ``factorised`` derivatives, and their ``answers`` to the ``touched`` (t,) tractions."""

    factorised: Mapping[str, Factorised]
    touched: IntArray
    answers: Mapping[str, Responses]


@dataclass(frozen=True)
class Responses:
    """Displacements of a body due to its ``own`` (k,) of the touched tractions, (2n, k), and its free
    ``moves`` (d,), (2n, d); ``pieces`` (3k, k + d) is the direct imbalance of pieces by both."""

    own: IntArray
    by_traction: FloatArray
    moves: IntArray
    by_motion: FloatArray
    pieces: sparse.csr_array


@dataclass(frozen=True)
class Imbalance:
    """Force imbalance ``now`` (d,), and its derivatives by touched tractions (d, t) and by free motions (d,
    d)."""

    now: FloatArray
    by_traction: FloatArray
    by_motion: FloatArray
