"""Coercivity of bodies and contacts: the resistance of a contact to every pressure that its nodes can carry.
Equation (12) of docs/method.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.geometry.pairing import Pairing, spacing_ratio
from mlsanm_cli.contact.response.compressed import compressed, null_space
from mlsanm_cli.errors import UnstableError
from mlsanm_cli.mechanics.body import bulk_stability
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.memo import Memo, digest
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

if TYPE_CHECKING:
    from mlsanm_cli.contact.response.condensed import Condensed

CONTACT_LIMIT, BULK_LIMIT = 0.15, 0.03
"""Smallest accepted estimates of a contact and of a body."""
EQUAL_SPACING_RATIO = 1.5
"""Ratio of facing spacings below which they are not the cause of instability."""
BLOCK, BLOCKS = 300, 8
"""Candidates per block where there are many, and least number of blocks examined."""


def check_coercivity(scene: Scene, condensed: Condensed, closed: BoolArray, memo: Memo) -> float:
    """Smallest coercivity estimate of a scene. UnstableError if one is below its limit: results would be
    invalid. Contacts are checked on nodes ``closed`` (m,) in some state, bodies without such a contact by
    themselves."""
    estimates = contact_coercivity(scene, condensed, closed, memo)
    touching = {one for pairing in condensed.pairings if pairing.name in estimates for one in pairing.bodies}
    bulk = dict[str, float]()
    for name, body in scene.bodies.items():
        if name in touching:
            continue
        key = digest(body.model.content, body.equations.content)
        bulk[name] = value = memo.value("stability", key, partial(bulk_stability, body))
        if not value >= BULK_LIMIT:
            raise UnstableError(
                f"the discrete equations of body {name} amplify errors "
                f"(stability {value:.2g}, below {BULK_LIMIT:g})",
                f"use another body.{name}.seed, or a more even cloud (lower growth)",
                value,
            )
    return min((estimates or bulk).values())


def contact_coercivity(scene: Scene, condensed: Condensed, closed: BoolArray, memo: Memo) -> dict[str, float]:
    """Estimates of all contacts with ``closed`` nodes (m,). UnstableError if one is too small."""
    loose = {one.name for one in scene.rigid_constraints if one.floats}
    names, estimates = [name for name in scene.bodies if name in loose], dict[str, float]()
    for pairing in condensed.pairings:
        span, own = condensed.spans[pairing.name], np.zeros_like(closed)
        own[span] = closed[span]
        if not own.any():
            continue
        # Closed nodes between two other ones, if there are any: modes of the last nodes at a corner of the
        # slave are local, and affect neither the patch test nor punches.
        inner = own.copy()
        inner[1:] &= own[:-1]
        inner[:-1] &= own[1:]
        inner[[0, -1]] = False
        bearing = inner if inner.any() else own
        make = partial(contact_stability, condensed, bearing, names)
        value = memo.value("contact stability", digest(condensed.content, bearing, names), make)
        if not value >= CONTACT_LIMIT:
            raise UnstableError(
                f"contact {pairing.name} has almost no stiffness against pressures that alternate from node "
                f"to node (stability {value:.2g}, below {CONTACT_LIMIT:g})",
                _contact_hint(scene, pairing),
                value,
            )
        estimates[pairing.name] = value
    return estimates


def _contact_hint(scene: Scene, pairing: Pairing) -> str:
    """Hint with the most likely cause of an unstable contact."""
    slave, master = pairing.slave_body, pairing.master_body
    models = {body: elastic.model for body, elastic in scene.bodies.items()}
    ratio = stiffness_ratio(pairing, models)
    if ratio > 2.0:
        return (
            f"{slave}, the slave, is {ratio:.3g} times stiffer than {master}: swap slave and master, or make "
            f"body.{master}.spacing finer than the slave's there"
        )
    if any(model.settings.degree != 2 for model in models.values()):
        return "use mls.degree = 2, or more even clouds (lower growth, or another seed)"
    clouds = {body: model.cloud for body, model in models.items()}
    unlike = spacing_ratio(pairing, clouds) if pairing.master else 1.0
    if unlike < EQUAL_SPACING_RATIO:
        return (
            f"use another body.{slave}.seed, a more even cloud (lower growth), or larger spacings along the "
            "contact, which flexible bodies need"
        )
    return (
        f"spacings that face each other differ by a factor of {unlike:.3g}: bring those of "
        f"{' and '.join(pairing.names)} closer together"
    )


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
    weight: FloatArray,
    half_plane: FloatArray,
    compliance: FloatArray,
    unbalanced: FloatArray | None = None,
    constrained: bool = False,
) -> float:
    """Smallest Rayleigh quotient of p^T sym(W A) p and 2/pi p^T W K W p: A the ``compliance`` (m, m), W the
    ``weight`` (m,), K = 1/E* of a ``half_plane`` (m, m), which couples normal and tangential parts at a node.

    The denominator is the energy on a half-plane of a pressure of alternating sign from node to node, the one
    it resists least (Johnson, Contact Mechanics, 1985, section 13.2: a wave of length l displaces the surface
    by p l / (pi E*)). Sound discretisations reach 0.3 to 1.5 for any spacing, grading and units; near zero or
    below, pressures oscillate freely. Only pressures without ``unbalanced`` (r, m) forces count.

    A body may yield to dead loads but not to the prescribed gaps: ``constrained``, it is 1 over the largest
    modulus of an eigenvalue of the inverse. Beyond a critical dead load eigenvalues of the compliance have
    become negative through infinity, those of the inverse through zero.
    """
    scale = np.linalg.inv(np.linalg.cholesky(2.0 / np.pi * half_plane)).T
    relative = scale.T @ (compliance / weight) @ scale
    if unbalanced is not None and len(unbalanced):
        rows = (unbalanced / weight) @ scale
        sizes = np.linalg.norm(rows, axis=1, keepdims=True)
        free = null_space(rows / np.where(sizes > 0.0, sizes, 1.0))
        relative = free.T @ relative @ free
    if not relative.size:
        return np.inf
    if not constrained:
        return float(np.linalg.eigvalsh(0.5 * (relative + relative.T))[0])
    if np.linalg.cond(relative) > 1.0 / np.finfo(float).eps:
        return 0.0
    inverse = np.linalg.inv(relative)
    return float(1.0 / np.abs(np.linalg.eigvalsh(0.5 * (inverse + inverse.T))).max())


def stiffness_ratio(pairing: Pairing, models: Mapping[str, BodyModel]) -> float:
    """Ratio of the slave's to the master's stiffness; 0 for an obstacle."""
    soft = [models[body].material.contact_compliance(pairing.normal).mean() for body in pairing.bodies]
    return float(sum(master / soft[0] for master in soft[1:]))
