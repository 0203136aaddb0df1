"""Reference magnitudes of a contact scene, from its exact states, and the law made from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.active_set import ExactState
from mlsanm_cli.contact.laws.regularization import Regularization
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.errors import NumericalError

MAX_GAP_RATIO = 10.0
"""Largest reference length of the law over the elastic gap of the scene, unless the initial gap is larger."""


FRICTION_FACTOR = 0.15
"""Reference length of the law over that without friction: tractions depend on how nodes have closed."""
FRICTION_THRESHOLD = 10.0
"""Friction starts at pressures above this multiple of eta."""
MIN_SHARE = 0.01
"""Least reference pressure of a contact over that of the scene, whose tolerance resolves no less."""


def regularize(
    condensed: Condensed,
    states: Sequence[ExactState],
    eta: float | FloatArray,
    stick: float | FloatArray = 0.0,
) -> Regularization:
    """The hyperbolic law with ``eta`` relative to every contact's largest pressure in the exact ``states``.

    Nodes drawn farther apart than MAX_GAP_RATIO elastic gaps have the longer length and the smaller eta: the
    law pulls with up to eta beyond its length, and hundreds of candidates all around a body would together
    pull by some percent of the load. The product of both, which determines the gap under a pressure, is the
    same.

    ``stick``, of all or of each node with friction (n,), is the slip of an asperity at its friction limit,
    relative to the largest slip in its contact that friction at its limit everywhere would cause in those
    states. ``eta`` is that of all or of each candidate (m,).

    Every length in it is proportional to the elastic change of the gap in those states, so that neither units
    nor the size of a load change the relative result. Raises NumericalError when no state has any pressure.
    """
    pressure = max(float(state.pressure.max(initial=0.0)) for state in states)
    if pressure <= 0.0:
        raise NumericalError(
            "no contact carries any pressure at the end of a stage, so the hyperbolic law has no scale",
            'check the direction of the loads, or use contact.regularization.law = "exact"',
        )
    elastic = max(float(np.abs(condensed.gap.pressure @ state.pressure).max()) for state in states)
    gap = 0.1 * elastic
    apart = np.zeros(len(condensed.weight))
    for pairing in condensed.pairings:
        initial = pairing.gap[pairing.candidate]
        apart[condensed.spans[pairing.name]] = initial - initial.min(initial=np.inf)
    wide = np.maximum(apart / (MAX_GAP_RATIO * gap), 1.0)
    frictional = len(condensed.friction_nodes) > 0
    delta = (
        np.full(len(apart), FRICTION_FACTOR * gap) if frictional else np.clip(apart, gap, MAX_GAP_RATIO * gap)
    )
    forces = [
        np.abs(condensed.balance.pressure) @ np.abs(state.pressure)
        + np.abs(condensed.balance.traction) @ np.abs(state.traction)
        for state in states
    ]
    force = np.array(forces).max(axis=0)
    limits = [condensed.friction * np.abs(state.pressure[condensed.friction_nodes]) for state in states]
    slips = np.max([np.abs(condensed.slip.traction @ limit) for limit in limits], axis=0)
    slip = float(slips.max(initial=0.0))
    own = _largest(
        condensed.spans, np.max([state.pressure for state in states], axis=0), MIN_SHARE * pressure
    )
    own_slip = _largest(condensed.tangential, slips, MIN_SHARE * slip)
    small = eta * own
    motion = np.array([np.abs(state.motion) for state in states]).max(axis=0)
    return Regularization(
        eta=small / wide,
        delta=delta * wide,
        pressure=pressure,
        gap=gap,
        force=np.where(force > 0.0, force, 1.0),
        motion=np.where(motion > 0.0, motion, elastic),
        slip=slip,
        threshold=FRICTION_THRESHOLD * small[condensed.friction_nodes],
        stick_compliance=stick * own_slip / (condensed.friction * own[condensed.friction_nodes]),
    )


def _largest(spans: Mapping[str, slice], values: FloatArray, least: float) -> FloatArray:
    """The largest of the values (r,) of every contact, at least ``least``, at each of its places."""
    largest = np.full(len(values), least)
    for span in spans.values():
        largest[span] = max(float(values[span].max(initial=0.0)), least)
    return largest
