"""Surfaces that overlap initially without a given interference, and so are in contact without a load."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import State

MIN_INITIAL_PRESSURE = 0.01
"""Pressures before any load, relative to those at the end of the path, above which there is a warning."""
ROUND_OFF = 1e-9
"""Overlaps below this part of the coordinates are zero: regularised laws have pressures at zero gap."""


def overlap_warnings(built: CondensedScene, first: State, last: State) -> Iterator[str]:
    """Warnings of contacts with pressures in the ``first`` state of a path, where all loads are zero."""
    given = {contact.name for contact in built.case.contact if contact.gap != 0.0}
    if first.position > 0.0:
        return
    for pairing in built.condensed.pairings:
        span = built.condensed.spans[pairing.name]
        before, after = (float(state.pressure[span].max(initial=0.0)) for state in (first, last))
        gap, partner = pairing.gap[pairing.candidate], pairing.partner[pairing.candidate]
        overlaps = (gap < -ROUND_OFF * np.abs(partner).max(initial=0.0)).any()
        if pairing.name in given or not before > MIN_INITIAL_PRESSURE * after or not overlaps:
            continue
        deepest = int(np.argmin(gap))
        x, y = partner[deepest]
        yield (
            f"contact {pairing.name}: the surfaces overlap as drawn, by {-gap[deepest]:.3g} near "
            f"({x:.6g}, {y:.6g}), and press on each other with up to {before:.4g} before any load; draw them "
            f"touching, or give contact.{pairing.name}.interference if they are a press fit"
        )
