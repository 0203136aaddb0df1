"""Contact patches: where contact begins and ends along a surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.geometry.pairing import Pairing


@dataclass(frozen=True)
class Patch:
    """One run of closed nodes: ``middle`` (2,), ``half_width`` and the ``edges`` (0 to 2, 2) where it opens.

    An end of the patch at an end of the surface is no edge, as it does not move with the load. ``spacing`` is
    the node spacing in the middle, ``uncertainty`` (0 to 2,) the distance between the last closed and the
    first open node at each edge, ``apart`` (0 to 2,) the initial gap there, ``finest`` the factor by which
    its edges may be coarser than usual.
    """

    middle: FloatArray
    half_width: float
    spacing: float
    edges: FloatArray
    uncertainty: FloatArray
    apart: FloatArray
    finest: float = 1.0


def contact_patches(pairing: Pairing, closed: BoolArray) -> list[Patch]:
    """Patches of one contact with closed candidates ``closed`` (m,)."""
    arc = pairing.arc[pairing.candidate]
    spacing = pairing.spacing[pairing.candidate]
    steps = np.diff(np.concatenate([[False], closed, [False]]).astype(np.int64))
    patches = []
    for first, after in zip(np.flatnonzero(steps == 1), np.flatnonzero(steps == -1), strict=True):
        last = after - 1
        ends, edges, uncertainty = [arc[first], arc[last]], [], []
        if first > 0:
            ends[0] = 0.5 * (arc[first - 1] + arc[first])
            edges.append(ends[0])
            uncertainty.append(arc[first] - arc[first - 1])
        if after < len(arc):
            ends[1] = 0.5 * (arc[last] + arc[after])
            edges.append(ends[1])
            uncertainty.append(arc[after] - arc[last])
        middle = 0.5 * (ends[0] + ends[1])
        nearest = int(np.argmin(np.abs(arc - middle)))
        patches.append(
            Patch(
                middle=_on_slave(pairing, np.array([middle]))[0],
                half_width=0.5 * float(ends[1] - ends[0]),
                spacing=float(spacing[nearest]),
                edges=_on_slave(pairing, np.array(edges)),
                uncertainty=np.array(uncertainty),
                apart=np.interp(edges, arc, pairing.gap[pairing.candidate]),
            )
        )
    return patches


def _on_slave(pairing: Pairing, arc: FloatArray) -> FloatArray:
    """Points (n, 2) of the slave at arc lengths (n,), which may continue past the start of a closed curve."""
    curve = pairing.slave.curve
    return curve.points(np.mod(arc, curve.length) if curve.closed else arc)
