"""When a body that a force pushes along its contacts is held by nothing there."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.contact_status import ContactStatus
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.errors import NumericalError

MAX_NORMAL_SHARE = 0.2
"""Largest normal component of the motion of a platen that is resisted by friction."""
WEDGE_SHARE = 0.02
"""Normal component above which a motion that closes the whole contact drives a wedge: round patches have both
signs."""
MIN_CLOSING = 0.01
"""Part of the approach of the bodies below which sliding carries no load."""
SLIDING_RATIO = 100.0
"""Sliding so many times faster than everything else is driven by a load."""
ROUND_OFF = 1e-9


class SlidingError(NumericalError):
    """All of a contact slips and nothing else carries the load: there is no state beyond this one."""

    def __init__(self, fraction: float, where: str = "") -> None:
        super().__init__(
            f"the contact slides as a whole{where}",
            "prescribe the displacement instead of the force to continue",
        )
        self.fraction = fraction


def slides_freely(condensed: Condensed, sets: ContactStatus, rates: FloatArray | None = None) -> bool:
    """Whether some motion of force-controlled platens runs along slipping contacts alone.

    It may be any combination of their unknown motions, so that directions of axes mean nothing. It moves no
    sticking node and hardly opens or closes closed ones, in the mean over a contact still less; contacts that
    it does not move have no say. Where the ``rates`` (k,) of a state that slips so are known it has to be
    what these close contacts by, or by far the fastest: a shaft that settles in a groove slips on both sides
    and may turn as well, but nothing turns it.
    """
    free = np.flatnonzero(~condensed.balance.motion.any(axis=1))
    slipping = sets.slip_sign != 0.0
    if not slipping.any() or not len(free):
        return False
    size = np.sqrt(condensed.weight)[:, None]
    across = (size * condensed.gap.motion[:, free])[sets.closed]
    tangential = size[condensed.friction_nodes] * condensed.slip.motion[:, free]
    largest = np.sqrt((across**2).sum(axis=0) + (tangential**2).sum(axis=0))
    units = np.diag(1.0 / np.where(largest > 0.0, largest, 1.0))
    motions = units @ _unmoved(tangential[sets.stuck] @ units)
    if not motions.size:
        return False
    both = np.vstack([across, tangential[slipping]])
    seen = both @ motions
    if motions.shape[1] == 1:
        parts = (seen**2)[:, 0]
        if parts[: len(across)].sum() >= MAX_NORMAL_SHARE**2 * parts.sum():
            return False
    left, values, _ = np.linalg.svd(seen, full_matrices=False)
    left = left[:, values > ROUND_OFF]
    moving = left[: len(across)]
    if not len(moving):
        return bool(moving.shape[1])
    # The eigenvalues are squares of the parts of orthonormal motions that go across.
    parts, directions = np.linalg.eigh(moving.T @ moving)
    little = directions[:, parts < MAX_NORMAL_SHARE**2]
    if not little.size:
        return False
    _, means, right = np.linalg.svd(_closed_of_each(condensed, sets) @ (moving @ little))
    along = little @ right[np.append(means, np.zeros(len(right) - len(means))) < WEDGE_SHARE].T
    if rates is None or not along.size:
        return bool(along.size)
    whole = both @ rates[free]
    slid = left @ (along @ (along.T @ (left.T @ whole)))
    closed = len(across)
    by_sliding = np.linalg.norm(slid[:closed]) > MIN_CLOSING * np.linalg.norm(whole[:closed])
    return bool(by_sliding or np.linalg.norm(slid) > SLIDING_RATIO * np.linalg.norm(whole - slid))


def _closed_of_each(condensed: Condensed, sets: ContactStatus) -> FloatArray:
    """Rows of unit size (c, closed) that take the mean over the closed nodes of each contact."""
    root = np.sqrt(condensed.weight)
    rows = np.zeros((len(condensed.spans), len(root)))
    for row, span in zip(rows, condensed.spans.values(), strict=True):
        own = np.where(sets.closed[span], root[span], 0.0)
        row[span] = own / (np.linalg.norm(own) or 1.0)
    return rows[:, sets.closed]


def _unmoved(rows: FloatArray) -> FloatArray:
    """An orthonormal basis (k, d) of the motions that the ``rows`` (r, k) do not see."""
    if not len(rows):
        return np.eye(rows.shape[1])
    # Their triangle has the same singular values, and is much smaller.
    _, values, right = np.linalg.svd(np.linalg.qr(rows, mode="r"))
    seen = int((values > ROUND_OFF).sum())
    basis: FloatArray = right[seen:].T
    return basis
