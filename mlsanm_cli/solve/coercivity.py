"""Coercivity estimates of a scene: of contacts in the states at the ends of stages, and of bodies without
contact."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from mlsanm_cli.arrays import BoolArray
from mlsanm_cli.contact.geometry.pairing import Pairing, spacing_ratio
from mlsanm_cli.contact.laws.contact_state import ContactState
from mlsanm_cli.contact.response.coercivity import contact_stability, stiffness_ratio
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.errors import UnstableError
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.mechanics.stability import bulk_stability
from mlsanm_cli.memo import Memo, digest
from mlsanm_cli.solve.state import CONTACT_LIMIT

BULK_LIMIT = 0.03
"""Smallest accepted estimate of a body."""
EQUAL_SPACING_RATIO = 1.5
"""Ratio of facing spacings below which they are not the cause of instability."""


def check_coercivity(scene: Scene, condensed: Condensed, ends: Sequence[ContactState], memo: Memo) -> float:
    """Smallest coercivity estimate of a scene. UnstableError if one is below its limit: results would be
    invalid. Contacts are checked on the nodes that touch in one of the states ``ends``, bodies without such a
    contact by themselves."""
    closed = np.any([state.closed for state in ends], axis=0) if ends else np.zeros(0, dtype=bool)
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


def stability_limit(ends: Sequence[ContactState]) -> float:
    """Limit of :func:`check_coercivity` for a scene whose contacts touch as in the states ``ends``."""
    return CONTACT_LIMIT if any(state.closed.any() for state in ends) else BULK_LIMIT


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
