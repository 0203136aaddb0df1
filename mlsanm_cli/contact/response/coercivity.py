"""Stability certificate of a contact: does the compliance resist every pressure its nodes can carry?

Equation (11) of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.response.compressed import compressed
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.mechanics.body_model import BodyModel

ROUND_OFF = 1e-9
WINDOW, MIN_WINDOWS = 300, 8
"""Number of adjacent candidates that are evaluated together in large contacts, and least number of such
windows."""
BALANCE_TOLERANCE = 1e-6
"""Force imbalance, relative to the forces, below which it is round-off, as for a body with supports."""


def contact_stability(condensed: Condensed, chosen: BoolArray, loose: Sequence[int] = ()) -> float:
    """Smallest resistance to pressures, and with friction tractions, on the ``chosen`` candidates (m,), of
    bodies of which those with the numbers ``loose`` are held by contact alone.

    See :func:`relative_resistance`. Nodes that never touch have no say: the outermost candidates, whose
    pressure only half arrives on the master, resist little and bear nothing. Of many candidates some rows are
    looked at: pressures that are resisted least change from node to node.
    """
    kept = np.flatnonzero(chosen)
    if compressed(condensed.gap.pressure) is None or len(kept) <= WINDOW:
        return _stability(condensed, kept, loose)
    rows = np.array_split(kept, -(-len(kept) // WINDOW))
    finest = int(np.argmin([condensed.weight[row].min() for row in rows]))
    some = {finest, *np.linspace(0, len(rows) - 1, MIN_WINDOWS).astype(int).tolist()}
    return min(_stability(condensed, rows[number], loose) for number in some)


def _stability(condensed: Condensed, kept: IntArray, loose: Sequence[int]) -> float:
    """The same for the candidates of some numbers."""
    chosen = np.isin(np.arange(len(condensed.weight)), kept)
    friction_nodes = np.flatnonzero(chosen[condensed.friction_nodes])
    gap, slip = condensed.gap, condensed.slip
    compliance = np.block(
        [
            [gap.pressure[np.ix_(kept, kept)], gap.traction[np.ix_(kept, friction_nodes)]],
            [
                slip.pressure[np.ix_(friction_nodes, kept)],
                slip.traction[np.ix_(friction_nodes, friction_nodes)],
            ],
        ]
    )
    place = np.concatenate([kept, condensed.friction_nodes[friction_nodes]])
    unbalanced = np.zeros((0, len(place)))
    if any(pairing.grid is not None for pairing in condensed.pairings):
        # Displacements in closed form of bodies that nothing holds count from anywhere, also where symmetry
        # forbids what would balance them.
        rows = [2 * body + component for body in loose for component in (0, 1)]
        parts = [
            np.hstack([one.pressure[:, kept], one.traction[:, friction_nodes]])
            for one in (condensed.balance, condensed.imbalance.take(np.array(rows, dtype=np.int64)))
        ]
        size = np.linalg.norm(condensed.weight[place])
        parts[1] = parts[1][np.linalg.norm(parts[1], axis=1) > BALANCE_TOLERANCE * size]
        unbalanced = np.concatenate(parts)
    # Normal and tangent of a material with a grain answer unlike, and to each other.
    way = np.repeat([0, 1], [len(kept), len(friction_nodes)])
    half_plane = np.where(place[:, None] == place, condensed.half_plane[place, way][:, way], 0.0)
    return relative_resistance(condensed.weight[place], half_plane, compliance, unbalanced)


def relative_resistance(
    weight: FloatArray, half_plane: FloatArray, compliance: FloatArray, unbalanced: FloatArray | None = None
) -> float:
    """Smallest quotient of p^T sym(W A) p, A the ``compliance`` (m, m) and W the ``weight`` (m,), and of
    2/pi p^T W K W p, K being 1/E* of a ``half_plane`` (m, m): with normal and tangential parts for a place
    that has both, diagonal else.

    The latter is what a half-plane has for a pressure that changes sign from node to node, the one it resists
    least (Johnson, Contact Mechanics, 1985, section 13.2: a wave of length l moves the surface by p l /
    (pi E*)). Sound discretisations reach 0.3 to 1.5 whatever the spacing, its grading and the units; where it
    is nearly zero or negative, pressures oscillate from node to node at will. Only pressures that have
    nothing ``unbalanced`` (r, m) are looked at.
    """
    relative = _relative(weight, half_plane, compliance, unbalanced)
    relative = 0.5 * (relative + relative.T)
    return float(np.linalg.eigvalsh(relative)[0]) if relative.size else np.inf


def constrained_resistance(
    weight: FloatArray, half_plane: FloatArray, compliance: FloatArray, unbalanced: FloatArray
) -> float:
    """The same of a body that may give way to dead pressures, but not to the gaps that they keep closed: 1
    over the largest size of a quotient of the inverse.

    Under pressures beyond its shear modulus, or as a column between plates, a body would sway if they were
    dead: its compliance then has negative eigenvalues that have come through infinity, and its inverse ones
    that have come through zero. What cannot resist pressures that change from node to node has a compliance
    near zero, and a large inverse.
    """
    relative = _relative(weight, half_plane, compliance, unbalanced)
    if not relative.size:
        return np.inf
    try:
        inverse = np.linalg.inv(relative)
    except np.linalg.LinAlgError:
        return 0.0
    values = np.linalg.eigvalsh(0.5 * (inverse + inverse.T))
    return float(1.0 / np.abs(values).max())


def _relative(
    weight: FloatArray, half_plane: FloatArray, compliance: FloatArray, unbalanced: FloatArray | None
) -> FloatArray:
    """The ``compliance`` over that of a half-plane, for what has nothing ``unbalanced``."""
    scale = np.linalg.inv(np.linalg.cholesky(2.0 / np.pi * half_plane)).T
    relative = scale.T @ (compliance / weight) @ scale
    if unbalanced is not None and len(unbalanced):
        free = _balanced((unbalanced / weight) @ scale)
        relative = free.T @ relative @ free
    return np.asarray(relative)


def _balanced(unbalanced: FloatArray) -> FloatArray:
    """An orthonormal basis (m, d) of all that has nothing ``unbalanced`` (r, m): forces and moments, each of
    its own unit."""
    sizes = np.linalg.norm(unbalanced, axis=1, keepdims=True)
    _, values, right = np.linalg.svd(unbalanced / np.where(sizes > 0.0, sizes, 1.0))
    basis: FloatArray = right[int((values > ROUND_OFF).sum()) :].T
    return basis


def stiffness_ratio(pairing: Pairing, models: Mapping[str, BodyModel]) -> float:
    """How many times stiffer the slave is than the master; 0 on an obstacle."""
    slave, *masters = (
        models[body].material.contact_compliance(pairing.normal).mean() for body in pairing.bodies
    )
    return float(sum(master / slave for master in masters))
