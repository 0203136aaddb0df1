"""Drivers of the bodies, and their dependence on the unknowns of the contact problem.

Drivers are load factors, motions, nodal pressures and tractions, and forces x and y at the samples of contact
grids (:mod:`mlsanm_cli.contact.geometry.contact_grid`), which represent all pressures and tractions there.
They are ordered like the unknowns, forces x with pressures and forces y with tractions.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import replace
from functools import cached_property
from typing import Literal, TypeVar

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.geometry.surface_response import pin_displacements
from mlsanm_cli.contact.response.compressed import Compressed, as_array
from mlsanm_cli.contact.response.linear_map import Columns, LinearMap
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.records import dataclass

Key = TypeVar("Key", bound=Hashable)


def spans(names: Iterable[Key], counts: Iterable[int], first: int = 0) -> dict[Key, slice]:
    """Ranges of every contact's nodes in the concatenation of all contacts, from ``first`` on."""
    ends = np.cumsum([first, *counts]).tolist()
    return {name: slice(a, b) for name, a, b in zip(names, ends[:-1], ends[1:], strict=True)}


@dataclass(frozen=True)
class Drivers:
    """The drivers of ``pairings``, with the numbers of ``loads`` and unknown ``motions``."""

    loads: int
    motions: int
    pairings: tuple[Pairing, ...]

    @property
    def frictional(self) -> tuple[Pairing, ...]:
        """The contacts with friction."""
        return tuple(pairing for pairing in self.pairings if pairing.friction)

    @property
    def alongside(self) -> tuple[Pairing, ...]:
        """The contacts with drivers among the tractions."""
        return tuple(pairing for pairing in self.pairings if pairing.friction or pairing.grid is not None)

    @cached_property
    def spans(self) -> dict[str, slice]:
        """Range of every contact among the unknown pressures."""
        counts = [int(pairing.candidate.sum()) for pairing in self.pairings]
        return spans([pairing.name for pairing in self.pairings], counts)

    @cached_property
    def tangential(self) -> dict[str, slice]:
        """Range of every frictional contact among the unknown tractions."""
        counts = [int(pairing.candidate.sum()) for pairing in self.frictional]
        return spans([pairing.name for pairing in self.frictional], counts)

    @cached_property
    def unknowns(self) -> Columns:
        """The columns of the unknowns."""
        counts = [sum(int(one.candidate.sum()) for one in some) for some in (self.pairings, self.frictional)]
        return Columns(self.loads, self.motions, counts[0], counts[1])

    @cached_property
    def columns(self) -> Columns:
        """The columns of the drivers."""
        counts = [sum(_count(one) for one in some) for some in (self.pairings, self.alongside)]
        return Columns(self.loads, self.motions, counts[0], counts[1])

    @cached_property
    def places(self) -> dict[str, slice]:
        """Range of every contact's pressures, or forces x, among all drivers."""
        counts = [_count(one) for one in self.pairings]
        return spans([one.name for one in self.pairings], counts, self.loads + self.motions)

    @cached_property
    def tangential_places(self) -> dict[str, slice]:
        """Range of every contact's tractions, or forces y, among all drivers."""
        counts, first = [_count(one) for one in self.alongside], self.columns.total - self.columns.tractions
        return spans([one.name for one in self.alongside], counts, first)

    def of_samples(self, pairing: Pairing) -> IntArray:
        """Indices (2k,) of the forces, x then y, at a contact grid's samples, among all drivers."""
        assert pairing.grid is not None
        both = self.places[pairing.name], self.tangential_places[pairing.name]
        return np.concatenate([own.start + np.arange(pairing.grid.count) for own in both])

    @property
    def means(self) -> IntArray:
        """Indices of the mean forces x and y of contacts that cover their surfaces, among all drivers."""
        covering = [one.name for one in self.pairings if one.grid is not None and one.grid.covers]
        counts = {one.name: one.grid.count for one in self.pairings if one.grid is not None}
        both = [
            [spans[name].start + counts[name] for spans in (self.places, self.tangential_places)]
            for name in covering
        ]
        return np.array(both, dtype=np.int64).ravel()

    @cached_property
    def matrix(self) -> sparse.csr_array:
        """The drivers (drivers, unknowns) per unit of every unknown."""
        few, unknowns = self.loads + self.motions, self.unknowns
        entries = [(0, 0, np.eye(few))]
        for pairing in self.pairings:
            name, grid = pairing.name, pairing.grid
            columns = [few + self.spans[name].start]
            if pairing.friction:
                columns.append(few + unknowns.pressures + self.tangential[name].start)
            rows = self.places[name].start, self.tangential_places.get(name, slice(0)).start
            if grid is None:
                unit = np.eye(int(pairing.candidate.sum()))
                entries += [(row, column, unit) for row, column in zip(rows, columns, strict=False)]
                continue
            for which, (column, block) in enumerate(zip(columns, grid.driver_matrices, strict=False)):
                for row, part, moved in zip(
                    rows, np.split(block, 2), np.split(pin_displacements(grid, which), 2), strict=True
                ):
                    entries += [(row, column, part), (row + len(part), column, moved)]
        found = [np.nonzero(block) for _, _, block in entries]
        each = list(zip(entries, found, strict=True))
        coordinates = (
            np.concatenate([row + i for (row, _, _), (i, _) in each]),
            np.concatenate([column + j for (_, column, _), (_, j) in each]),
        )
        values = np.concatenate([block[place] for (_, _, block), place in each])
        return sparse.csr_array((values, coordinates), shape=(self.columns.total, unknowns.total))

    def compressed(self, rows: FloatArray, weight: FloatArray, constant: FloatArray) -> LinearMap:
        """Functionals ``rows`` (r, drivers) in terms of the unknowns, compressed, for frictionless contacts
        on grids; ``weight`` (r,) are the weights of the rows."""
        first = self.columns.motion_places.stop
        few = self.unknowns.split(rows[:, :first] @ self.matrix[:first], constant)
        right = self.matrix[first:, first:].toarray()
        return replace(few, pressure=as_array(Compressed.product(rows[:, first:].copy(), right, weight)))

    def by_unknowns(self, rows: FloatArray) -> LinearMap:
        """Functionals ``rows`` (r, drivers) in terms of the unknowns."""
        return self.unknowns.split(np.ascontiguousarray(rows @ self.matrix))

    def drive(self, f: FloatArray, q: FloatArray, p: FloatArray, t: FloatArray) -> FloatArray:
        """The drivers (drivers,) of one state."""
        return np.asarray(self.matrix @ np.concatenate([f, q, p, t]))


def _count(pairing: Pairing) -> int:
    return int(pairing.candidate.sum()) if pairing.grid is None else pairing.grid.drivers


def of_obstacles(
    scene: Scene, pairings: tuple[Pairing, ...], columns: Columns, along: Literal["normal", "tangent"]
) -> tuple[FloatArray, FloatArray]:
    """Change of every paired node's gap (w,), or slip along the tangent, by obstacles' motions: per load
    factor (w, L) and per unknown motion (w, k)."""
    rows, count = _rows(pairings), sum(len(pairing.position) for pairing in pairings)
    total = np.zeros((count, columns.loads + columns.motions))
    for constraint, motion, by in scene.motions:
        if not constraint.bodies and constraint.name in rows:
            pairing, own = rows[constraint.name]
            direction = pairing.normal if along == "normal" else pairing.tangent
            total[own] -= np.outer(direction @ motion.direction[:2], by)
    return total[:, : columns.loads], total[:, columns.loads :]


def of_fits(scene: Scene, pairings: tuple[Pairing, ...], columns: Columns) -> FloatArray:
    """Change of every paired node's gap by interference per load factor (w, L)."""
    load = np.zeros((sum(len(pairing.position) for pairing in pairings), columns.loads))
    for pairing, own in _rows(pairings).values():
        if pairing.interference:
            load[own, scene.loads.index(pairing.name)] -= pairing.interference
    return load


def _rows(pairings: tuple[Pairing, ...]) -> dict[str, tuple[Pairing, slice]]:
    """Every contact, and the range of its paired nodes among those of all contacts."""
    found = spans([one.name for one in pairings], [len(one.position) for one in pairings])
    return {one.name: (one, found[one.name]) for one in pairings}
