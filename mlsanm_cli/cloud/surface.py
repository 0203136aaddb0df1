"""The nodes of one named boundary."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.cloud.joined import joined
from mlsanm_cli.memo import digest
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class Surface:
    """The nodes of one named boundary, in order along its curve. ``index`` (b,) are node numbers,
    ``arc_length`` (b,) their positions, ``normal`` (b, 2) the normals of this boundary alone: a corner node
    belongs to both boundaries that meet there, with the normal of each. ``weight`` (b,) is the surface length
    of a node (trapezoidal rule). A surface joined of several has these as ``parts``, on which boundary
    conditions act; at a corner between two parts its normal is their mean."""

    name: str
    curve: Curve
    index: IntArray
    arc_length: FloatArray
    normal: FloatArray
    parts: tuple[Surface, ...] = ()

    @property
    def members(self) -> tuple[tuple[Surface, IntArray], ...]:
        """The body's own surfaces this one consists of, and the positions of their nodes in ``index``."""
        found, first = [], 0
        for part in self.parts or (self,):
            found.append((part, (first + np.arange(len(part.index))) % len(self.index)))
            first += len(part.index) - 1
        return tuple(found)

    @cached_property
    def ends(self) -> FloatArray:
        """Arc lengths (k + 1,) of the ends of the k intervals between neighbouring nodes, closed curves
        included."""
        return np.append(self.arc_length, self.curve.length) if self.curve.closed else self.arc_length

    @cached_property
    def end_normals(self) -> FloatArray:
        """Normals (k, 2, 2) at both ends of the k intervals; at a corner between two parts, those of the part
        the interval belongs to."""
        if self.parts:
            return np.concatenate([part.end_normals for part in self.parts])
        after = np.roll(self.normal, -1, axis=0)
        return np.stack([self.normal, after], axis=1)[: len(self.index) - (not self.curve.closed)]

    @cached_property
    def content(self) -> str:
        """Digest of the nodes and of all that they need to know of their curve."""
        return digest(
            *(self.name, self.index, self.arc_length, self.normal), self.curve.closed, self.curve.length
        )

    @cached_property
    def weight(self) -> FloatArray:
        """Quadrature weights (b,) along the surface (trapezoidal rule)."""
        steps = np.diff(self.ends)
        if self.curve.closed:
            return np.asarray(0.5 * (steps + np.roll(steps, 1)))
        return np.asarray(0.5 * (np.append(steps, 0.0) + np.append(0.0, steps)))


def joined_surface(name: str, parts: Sequence[Surface], around: bool) -> Surface:
    """Concatenate surfaces; ``around`` if the last one ends where the first begins."""
    if len(parts) == 1:
        return parts[0]
    ends = np.cumsum([part.curve.length for part in parts])
    arc = [np.zeros(1)]
    index, normal = [parts[0].index[:1]], [parts[0].normal[:1].copy()]
    for part, end in zip(parts, ends, strict=True):
        arc.append(part.arc_length[1:] + end - part.curve.length)
        index.append(part.index[1:])
        normal[-1][-1:] = _between(normal[-1][-1:], part.normal[:1])
        normal.append(part.normal[1:].copy())
    places, nodes, normals = np.concatenate(arc), np.concatenate(index), np.concatenate(normal)
    if around:
        normals[:1] = _between(normals[-1:], normals[:1])
        places, nodes, normals = places[:-1], nodes[:-1], normals[:-1]
    curve = joined([part.curve for part in parts], around)
    return Surface(name, curve, nodes, places, normals, tuple(parts))


def _between(one: FloatArray, other: FloatArray) -> FloatArray:
    """Unit vector (1, 2) halfway between two."""
    mean = one + other
    return np.asarray(mean / np.hypot(*mean.T)[:, None])


def boundary_of(surfaces: Iterable[Surface]) -> tuple[IntArray, FloatArray, tuple[str, ...]]:
    """The nodes (b,) of surfaces, one after the other, their normals (b, 2) and the names of their
    surfaces."""
    listed = list(surfaces)
    index = np.concatenate([surface.index for surface in listed])
    normal = np.concatenate([surface.normal for surface in listed])
    return index, normal, tuple(surface.name for surface in listed for _ in surface.index)
