"""Sides of bodies at finite strain that touch something, and their nominal tractions as loads of the body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.finite.loads import Loads


@dataclass(frozen=True)
class Side:
    """The ``nodes`` (c,) of a ``surface`` of a ``body``, at ``places`` (c, 2) before loading, there with
    outward normals ``outward`` (c, 2), at ``arc`` (c,) along it; ``weight`` (c,) is the length each stands
    for. ``around`` is the length of a closed surface, and None of others. ``held`` (c,) tells which nodes
    have a component of their displacement given."""

    body: str
    surface: str
    nodes: IntArray
    places: FloatArray
    outward: FloatArray
    weight: FloatArray
    arc: FloatArray
    around: float | None
    held: BoolArray

    @classmethod
    def of(cls, body: str, points: FloatArray, surface: Surface, held: BoolArray) -> Side:
        """By the body's nodes (n, 2), of which some are ``held`` (n,), and the surface."""
        around = surface.curve.length if surface.curve.closed else None
        places = points[surface.index]
        args = (surface.normal, surface.weight, surface.arc_length, around)
        return cls(body, surface.name, surface.index, places, *args, held[surface.index])

    @property
    def count(self) -> int:
        """Number of nodes (c)."""
        return len(self.nodes)


def with_sides(loads: Loads, body: ElasticBody, sides: Sequence[Side]) -> Loads:
    """The ``loads`` and, behind them, unit tractions x and y at every node of the body's ``sides`` in turn,
    per length before loading and linear between the nodes."""
    more = 2 * sum(one.count for one in sides)
    if not more:
        return loads
    first, loads = loads.count, with_more(loads, more)
    sources, tractions = loads.sources, dict(loads.tractions)
    for side in sides:
        halves = Halves.of(body.model.cloud.surfaces[side.surface], FINE)
        shape = (len(halves.arc), 2, loads.count)
        hats, every = tractions.setdefault(side.surface, np.zeros(shape)), np.arange(len(halves.arc))
        for component in (0, 1):
            columns = first + 2 * np.arange(side.count) + component
            sources[body.condition_rows(side.surface, component), columns] = 1.0
            hats[every, component, columns[halves.own]] += halves.share
            hats[every, component, columns[halves.other]] += 1.0 - halves.share
        first += 2 * side.count
    return replace(loads, tractions=tractions)


def with_more(loads: Loads, more: int) -> Loads:
    """The ``loads`` and, behind them, so many ``more`` that do nothing yet."""
    sources = np.hstack([loads.sources, np.zeros((len(loads.sources), more))])
    tractions = {name: _wider(given, more) for name, given in loads.tractions.items()}
    force = None if loads.force is None else _wider(loads.force, more)
    return replace(loads, count=loads.count + more, sources=sources, tractions=tractions, force=force)


def _wider(values: FloatArray, more: int) -> FloatArray:
    """``values`` (e, 2, L) with nothing for ``more`` loads."""
    return np.concatenate([values, np.zeros((*values.shape[:2], more))], axis=2)
