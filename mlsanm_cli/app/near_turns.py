"""By how much bodies that move turn the directions in which contacts press, to first order.

Directions vary along a contact as the normals of the flatter surface do, which the other one is pressed to.
As bodies turn and move along each other the patch moves on the more curved one to where its normal has the
direction of the pressures: so it is for all small rigid motions of both, if the normals are those drawn.
"""

from __future__ import annotations

import numpy as np

from mlsanm_cli.contact.active_set import ExactState
from mlsanm_cli.contact.condensed import Condensed
from mlsanm_cli.contact.near import Near

ASIDE = 0.01
"""Curvatures are looked at over this part of the range on both sides."""


def turns(condensed: Condensed, state: ExactState) -> dict[str, float]:
    """Angles in radian, counter-clockwise, by which directions turn of contacts that touch in one patch."""
    found = {}
    for pairing in condensed.pairings:
        span = condensed.spans[pairing.name]
        closed = np.flatnonzero(state.active[span])
        if pairing.near is None or not len(closed) or closed[-1] - closed[0] >= len(closed):
            continue
        share = pairing.near.hats.weight * state.pressure[span]
        if share.sum() > 0.0:
            found[pairing.name] = _turn(pairing.near, float(share @ pairing.near.hats.place / share.sum()))
    return found


def _turn(near: Near, middle: float) -> float:
    """The angle at the ``middle`` of a patch from the normal of the flatter surface to the more curved."""
    aside = ASIDE * (near.last - near.first)
    base = near.facing.slave_first
    s = np.array([middle, middle - aside, middle + aside])
    place, inward = near.facing.side(s, base)
    there, outward = near.facing.side(s, not base)
    bends = [
        abs(np.angle(one[2] / one[1])) / abs(at[2] - at[1]) for at, one in ((place, inward), (there, outward))
    ]
    return float(np.angle(inward[0] / -outward[0])) if bends[0] > bends[1] else 0.0
