"""Outlines that several tests of clouds share."""

from __future__ import annotations

from mlsanm_cli.cloud.curves import Outline, Segment


def polygon(*corners: tuple[float, float]) -> Outline:
    """Straight sides side0, side1 and so on from corner to corner."""
    sides = tuple(map(Segment, corners, (*corners[1:], corners[0])))
    return Outline(tuple(f"side{k}" for k in range(len(sides))), sides)
