"""Force-controlled motions along slipping contacts that nothing resists, found from the rates of a state.

Where contacts are curved, sliding as a whole is no ray of the contact problem: pairs of places and directions
are those drawn, and a motion along them opens and closes nodes.
"""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.laws.contact_state import ContactState
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.dense import null_space
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, ROUND_OFF

MAX_NORMAL_SHARE = 0.2
"""Motions with a smaller normal part at the contact are resisted by friction only."""
WEDGE_SHARE = 0.02
"""Motions whose mean normal part over a contact is larger close it like a wedge."""
MIN_CLOSING = 0.01
"""Sliding below this fraction of the normal approach is negligible."""
MIN_DRIVE = 0.5
"""Sliding that tractions of several contacts balance, apart from less than this part, is not driven."""
SLIDING_RATIO = 100.0
"""Sliding this many times as fast as everything else is driven by the load."""


def slides_freely(condensed: Condensed, rates: ContactState) -> bool:
    """Whether the ``rates`` of a slipping state are a motion of force-controlled constraints along slipping
    contacts only.

    It may be any combination of unknown motions, so that the result does not depend on axes. It moves no
    sticking node, and closed nodes hardly in normal direction, even less in the mean over a contact; contacts
    that it does not move are ignored. It must also dominate the approach of the surfaces or be by far the
    fastest, and driven: a shaft that settles in a groove slips on both sides and could rotate, but its
    tractions balance each other. In a hollow it must be by far the fastest: a pin in a hook that bends slips
    everywhere, and climbs the hollow until that holds it.
    """
    free = np.flatnonzero(~condensed.balance.motion.any(axis=1))
    slipping, closed, root = rates.status.slip_sign != 0.0, rates.closed, np.sqrt(condensed.weight)
    if not slipping.any() or not len(free):
        return False
    across = (root[:, None] * condensed.gap.motion[:, free])[closed]
    tangential = root[condensed.friction_nodes, None] * condensed.slip.motion[:, free]
    largest = np.sqrt((across**2).sum(axis=0) + (tangential**2).sum(axis=0))
    units = np.diag(1.0 / np.where(largest > 0.0, largest, 1.0))
    motions = units @ null_space(tangential[rates.status.stuck] @ units)
    if not motions.size:
        return False
    both = np.vstack([across, tangential[slipping]])
    seen = both @ motions
    if motions.shape[1] == 1:
        parts = (seen**2)[:, 0]
        if parts[: len(across)].sum() >= MAX_NORMAL_SHARE**2 * parts.sum():
            return False
    left, values, modes = np.linalg.svd(seen, full_matrices=False)
    kept = values > ROUND_OFF
    left, modes = left[:, kept], modes[kept].T / values[kept]
    moving = left[: len(across)]
    if not len(moving):
        return bool(moving.shape[1])
    # Eigenvalues: squared normal parts of orthonormal motions.
    parts, directions = np.linalg.eigh(moving.T @ moving)
    little = directions[:, parts < MAX_NORMAL_SHARE**2]
    if not little.size:
        return False
    # Unit rows that average over the closed nodes of each contact.
    mean = np.zeros((len(condensed.spans), len(root)))
    for row, span in zip(mean, condensed.spans.values(), strict=True):
        own = np.where(closed[span], root[span], 0.0)
        row[span] = own / (np.linalg.norm(own) or 1.0)
    _, means, right = np.linalg.svd(mean[:, closed] @ (moving @ little))
    along = little @ right[np.append(means, np.zeros(len(right) - len(means))) < WEDGE_SHARE].T
    if not along.size:
        return False
    whole = both @ rates.motion[free]
    slid = left @ (along @ (along.T @ (left.T @ whole)))
    if np.linalg.norm(slid) > SLIDING_RATIO * np.linalg.norm(whole - slid):
        return True
    rising = along @ _not_in_hollows(condensed, closed, free, motions @ modes @ along)
    parts = rising.T @ (left.T @ whole)
    slid = left @ (rising @ parts)
    if np.linalg.norm(slid[: len(across)]) <= MIN_CLOSING * np.linalg.norm(whole[: len(across)]):
        return False
    # Changes of the loads or of one contact's tractions drive it, as its opposite pressures show, rather than
    # tractions of several contacts that balance.
    motion, balance = motions @ modes @ rising @ parts, condensed.balance
    pressed = float(motion @ balance.pressure[free] @ rates.pressure)
    sheared = [
        float(motion @ balance.traction[free][:, span] @ rates.traction[span])
        for span in condensed.tangential.values()
    ]
    loaded = abs(-pressed - sum(sheared))
    return abs(pressed) >= MIN_DRIVE * (loaded + sum(map(abs, sheared)))


def _not_in_hollows(
    condensed: Condensed, closed: BoolArray, free: IntArray, motions: FloatArray
) -> FloatArray:
    """Orthonormal combinations (d, e) of ``motions`` (f, d) of the ``free`` (f,) ones along which ``closed``
    (m,) contacts do not close ahead of the sliding body, as hollows do."""
    closing, scale = np.zeros((motions.shape[1], motions.shape[1])), 0.0
    for span in condensed.tangential.values():
        nodes = condensed.friction_nodes[span]
        weight = np.where(closed[nodes], condensed.weight[nodes], 0.0)
        if not weight.sum() > 0.0:
            continue
        place = np.cumsum(condensed.weight[nodes])
        lever = weight * (place - weight @ place / weight.sum())
        gaps = condensed.gap.motion[nodes][:, free] @ motions
        slips = condensed.slip.motion[span][:, free] @ motions
        # Gaps that shrink ahead of where the slave slides to: along its surface, as places are counted.
        closing -= np.outer(lever @ gaps, weight @ slips / weight.sum())
        scale += float(np.abs(lever).sum() * np.abs(slips).max(initial=0.0) ** 2)
    values, directions = np.linalg.eigh(0.5 * (closing + closing.T))
    return np.asarray(directions[:, values <= COARSE_ROUND_OFF * scale])
