"""Coercivity of contacts: resistance to every pressure nodes can carry. Equation (12) of docs/method.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.response.compressed import compressed, null_space
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

if TYPE_CHECKING:
    from mlsanm_cli.contact.response.condensed import Condensed

BLOCK, BLOCKS = 300, 8
"""Candidates per block where there are many, and least number of blocks examined."""


def contact_stability(condensed: Condensed, chosen: BoolArray, loose: Sequence[str] = ()) -> float:
    """Smallest resistance to pressures, and with friction tractions, on the ``chosen`` candidates (m,), see
    :func:`relative_resistance`; the bodies ``loose`` are held by contact only. For many candidates only some
    blocks are examined: the least-resisted pressures oscillate from node to node."""
    kept = np.flatnonzero(chosen)
    if compressed(condensed.gap.pressure) is not None and len(kept) > BLOCK:
        rows = np.array_split(kept, -(-len(kept) // BLOCK))
        finest = int(np.argmin([condensed.weight[row].min() for row in rows]))
        some = {finest, *np.linspace(0, len(rows) - 1, BLOCKS).astype(int).tolist()}
        numbers = np.arange(len(chosen))
        return min(contact_stability(condensed, np.isin(numbers, rows[one]), loose) for one in some)
    friction_nodes = np.flatnonzero(np.isin(condensed.friction_nodes, kept))
    gap, slip = condensed.gap, condensed.slip
    both = ((gap, kept), (slip, friction_nodes))
    compliance = np.block(
        [[one.pressure[np.ix_(rows, kept)], one.traction[np.ix_(rows, friction_nodes)]] for one, rows in both]
    )
    place = np.concatenate([kept, condensed.friction_nodes[friction_nodes]])
    root = np.sqrt(condensed.around[place])
    compliance *= root[:, None] / root
    unbalanced = np.zeros((0, len(place)))
    if condensed.on_grids:
        # Near-field displacements of floating bodies have an arbitrary rigid part, even where symmetry
        # forbids balancing forces: restrict to balanced pressures.
        sums = [condensed.quantities["imbalance"][name] for name in loose]
        balance, *forces = (
            np.hstack([one.pressure[:, kept], one.traction[:, friction_nodes]])
            for one in (condensed.balance, *sums)
        )
        size = np.linalg.norm(condensed.weight[place])
        acting = [one[np.linalg.norm(one, axis=1) > COARSE_ROUND_OFF * size] for one in forces]
        unbalanced = np.concatenate([balance, *acting])
    # In anisotropic materials normal and tangential compliances differ and couple.
    way = np.repeat([0, 1], [len(kept), len(friction_nodes)])
    half_plane = np.where(place[:, None] == place, condensed.half_plane[place, way][:, way], 0.0)
    return relative_resistance(condensed.weight[place], half_plane, compliance, unbalanced)


def relative_resistance(
    weight: FloatArray, half_plane: FloatArray, compliance: FloatArray, unbalanced: FloatArray | None = None
) -> float:
    """Smallest Rayleigh quotient of p^T sym(W A) p and 2/pi p^T W K W p: A the ``compliance`` (m, m), W the
    ``weight`` (m,), K = 1/E* of a ``half_plane`` (m, m), which couples normal and tangential parts at a node.

    The denominator is the energy on a half-plane of a pressure of alternating sign from node to node, the one
    it resists least (Johnson, Contact Mechanics, 1985, section 13.2: a wave of length l displaces the surface
    by p l / (pi E*)). Sound discretisations reach 0.3 to 1.5 for any spacing, grading and units; near zero or
    below, pressures oscillate freely. Only pressures without ``unbalanced`` (r, m) forces count.
    """
    relative = _relative(weight, half_plane, compliance, unbalanced)
    return float(np.linalg.eigvalsh(0.5 * (relative + relative.T))[0]) if relative.size else np.inf


def constrained_resistance(
    weight: FloatArray, half_plane: FloatArray, compliance: FloatArray, unbalanced: FloatArray
) -> float:
    """:func:`relative_resistance` of a body that may yield to dead loads but not to the prescribed gaps: 1
    over the largest modulus of an eigenvalue of the inverse. Beyond a critical dead load eigenvalues of the
    compliance have become negative through infinity, those of the inverse through zero."""
    relative = _relative(weight, half_plane, compliance, unbalanced)
    if not relative.size:
        return np.inf
    if np.linalg.cond(relative) > 1.0 / np.finfo(float).eps:
        return 0.0
    inverse = np.linalg.inv(relative)
    return float(1.0 / np.abs(np.linalg.eigvalsh(0.5 * (inverse + inverse.T))).max())


def _relative(
    weight: FloatArray, half_plane: FloatArray, compliance: FloatArray, unbalanced: FloatArray | None
) -> FloatArray:
    """The ``compliance`` relative to that of a half-plane, restricted to balanced pressures."""
    scale = np.linalg.inv(np.linalg.cholesky(2.0 / np.pi * half_plane)).T
    relative = scale.T @ (compliance / weight) @ scale
    if unbalanced is not None and len(unbalanced):
        rows = (unbalanced / weight) @ scale
        sizes = np.linalg.norm(rows, axis=1, keepdims=True)
        free = null_space(rows / np.where(sizes > 0.0, sizes, 1.0))
        relative = free.T @ relative @ free
    return np.asarray(relative)


def stiffness_ratio(pairing: Pairing, models: Mapping[str, BodyModel]) -> float:
    """Ratio of the slave's to the master's stiffness; 0 for an obstacle."""
    slave, *masters = (
        models[body].material.contact_compliance(pairing.normal).mean() for body in pairing.bodies
    )
    return float(sum(master / slave for master in masters))
