"""Where the knots of a contact have touched that come into contact within an increment."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray


def touching(
    length: FloatArray, before: BoolArray, now: BoolArray, around: bool
) -> tuple[FloatArray, IntArray]:
    """Parts (c,) of an increment after which knots of a ``length`` (c,) touch, 0 for those that were closed
    ``before`` it (c,) as well, and the open knots (c,) next to which they enter the contact, themselves if
    there are none. The ends of contact move evenly from where they were to where they are ``now`` (c,); the
    knots of a patch in which none was closed count as closed from the start. Contacts ``around`` a body
    continue from the last knot to the first."""
    count = len(length)
    part, beside = np.zeros(count), np.arange(count)
    if not (now & ~before).any() or now.all():
        return part, beside
    order = np.roll(np.arange(count), -int(np.argmin(now)) if around else 0)
    closed, known = now[order], (before & now)[order]
    ends = np.concatenate([[0.0], np.cumsum(length[order])])
    middle = 0.5 * (ends[1:] + ends[:-1])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], closed, [False]]).astype(np.int8)))
    for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        old = first + np.flatnonzero(known[first:last])
        if not len(old):
            continue
        low, high = int(old[0]), int(old[-1]) + 1
        sides = ((first, low, low, first, first - 1), (high, last, high, last, last))
        for begin, end, was, reached, outer in sides:
            some, open_knot = np.arange(begin, end), outer % count
            if len(some) and (around or open_knot == outer):
                part[order[some]] = (middle[some] - ends[was]) / (ends[reached] - ends[was])
                beside[order[some]] = order[open_knot]
    return part, beside
