"""Scales and parameters of the regularised contact laws, from the exact states of a contact scene. Equation
(13) of docs/method.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.active_set import ExactState
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.errors import NumericalError


@dataclass(frozen=True)
class Regularization:
    """Parameters ``eta`` (m,), pressures, and ``delta`` (m,), lengths, of the hyperbolic law, and reference
    values of pressure, gap, force and motion.

    With friction also a reference ``slip``, the asperities' ``stick_compliance`` (n,), length per traction,
    and the pressures ``threshold`` (n,) above which friction acts.
    """

    eta: FloatArray
    delta: FloatArray
    pressure: float
    gap: float
    force: FloatArray
    motion: FloatArray
    slip: float = 0.0
    stick_compliance: FloatArray = field(default_factory=lambda: np.zeros(0))
    threshold: FloatArray = field(default_factory=lambda: np.zeros(0))


MAX_GAP_RATIO = 10.0
"""Upper bound of the law's length in elastic gaps, for nodes with large initial gaps; the lower bound is
1."""


FRICTION_FACTOR = 0.15
"""The law's length with friction, in elastic gaps: tractions depend on how nodes have closed."""
FRICTION_THRESHOLD = 10.0
"""Friction acts where the pressure exceeds this times the law's eta."""
MIN_SHARE = 0.01
"""Least reference pressure of a contact over the scene's, below which the tolerance resolves nothing."""


def regularize(
    condensed: Condensed,
    states: Sequence[ExactState],
    eta: float | FloatArray,
    stick: float | FloatArray = 0.0,
) -> Regularization:
    """The hyperbolic law with ``eta`` relative to each contact's largest pressure in the exact ``states``.

    Nodes with large initial gaps get a longer length and a smaller eta: the law pulls with up to eta beyond
    its length, and hundreds of candidates around a body would together pull by some percent of the load. The
    product of both, which determines the gap under a pressure, is unchanged.

    ``stick`` is the slip of an asperity at its friction limit, relative to the largest slip in its contact
    that friction at its limit everywhere would cause in those states. ``eta`` and ``stick`` are scalars or
    arrays (m,) and (n,).

    Every length is proportional to the elastic change of the gap in those states: neither units nor the size
    of a load affect the relative result. Raises NumericalError if no state has any pressure.
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
    """Largest of the values (r,) in each contact, at least ``least``, repeated for its nodes (r,)."""
    largest = np.full(len(values), least)
    for span in spans.values():
        largest[span] = max(float(values[span].max(initial=0.0)), least)
    return largest
