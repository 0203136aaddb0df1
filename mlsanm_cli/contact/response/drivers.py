"""Drivers of the bodies, and their dependence on the unknowns of the contact problem.

Drivers are load factors, motions, nodal pressures and tractions, and forces x and y at the samples of contact
grids (:mod:`mlsanm_cli.contact.geometry.contact_grid`), which represent all pressures and tractions there.
They are ordered like the unknowns, forces x with pressures and forces y with tractions.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.response.compressed import Compressed, as_array
from mlsanm_cli.contact.response.linear_map import Columns, LinearMap


def spans(names: Iterable[str], counts: Sequence[int]) -> dict[str, slice]:
    """Ranges of every contact's nodes in the concatenation of all contacts."""
    ends = np.cumsum([0, *counts]).tolist()
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
    def normal_drivers(self) -> dict[str, slice]:
        """Range of every contact among the drivers that are pressures or forces x."""
        return spans([pairing.name for pairing in self.pairings], [_count(one) for one in self.pairings])

    @cached_property
    def tangential_drivers(self) -> dict[str, slice]:
        """The same among tractions or forces y."""
        return spans([pairing.name for pairing in self.alongside], [_count(one) for one in self.alongside])

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

    def places(self, pairing: Pairing) -> slice:
        """Range of a contact's pressures, or forces x, among all drivers."""
        own, first = self.normal_drivers[pairing.name], self.loads + self.motions
        return slice(first + own.start, first + own.stop)

    def tangential_places(self, pairing: Pairing) -> slice:
        """Range of a contact's tractions, or forces y, among all drivers."""
        own = self.tangential_drivers[pairing.name]
        first = self.loads + self.motions + self.columns.pressures
        return slice(first + own.start, first + own.stop)

    def of_samples(self, pairing: Pairing) -> IntArray:
        """Indices (2k,) of the forces, x then y, at a contact grid's samples, among all drivers."""
        assert pairing.grid is not None
        own = np.arange(pairing.grid.count)
        return np.concatenate([self.places(pairing).start + own, self.tangential_places(pairing).start + own])

    @property
    def means(self) -> IntArray:
        """Indices of the mean forces x and y of contacts that cover their surfaces, among all drivers."""
        covering = [one for one in self.pairings if one.grid is not None and one.grid.covers]
        places = [(self.places(one).stop - 1, self.tangential_places(one).stop - 1) for one in covering]
        return np.array(places, dtype=np.int64).ravel()

    def compressed(self, rows: FloatArray, weight: FloatArray, constant: FloatArray) -> LinearMap:
        """Functionals ``rows`` (r, drivers) in terms of the unknowns, compressed, for frictionless contacts
        on grids; ``weight`` (r,) are the weights of the rows."""
        columns, unknowns = self.columns, self.unknowns
        right = np.zeros((columns.pressures + columns.tractions, unknowns.pressures))
        first = columns.motion_places.stop
        for pairing in self.pairings:
            assert pairing.grid is not None
            both = np.split(pairing.grid.driver_matrices[0], 2)
            for places, part in zip((self.places, self.tangential_places), both, strict=True):
                own = places(pairing)
                right[own.start - first : own.stop - first, self.spans[pairing.name]] = part
        pressure = Compressed.product(rows[:, first:].copy(), right, weight)
        load, motion = rows[:, : self.loads], rows[:, self.loads : first]
        return LinearMap(constant, load, motion, as_array(pressure), np.zeros((len(rows), 0)))

    def by_unknowns(self, rows: FloatArray, constant: FloatArray | None = None) -> LinearMap:
        """Functionals ``rows`` (r, drivers) in terms of the unknowns."""
        result = self.unknowns.zeros(len(rows))
        result.load[:] = rows[:, : self.loads]
        result.motion[:] = rows[:, self.loads : self.loads + self.motions]
        for pairing in self.pairings:
            own, places = self.spans[pairing.name], self.places(pairing)
            if pairing.grid is None:
                result.pressure[:, own] = rows[:, places]
                if pairing.friction:
                    along = self.tangential_places(pairing)
                    result.traction[:, self.tangential[pairing.name]] = rows[:, along]
                continue
            both = np.hstack([rows[:, places], rows[:, self.tangential_places(pairing)]])
            normal, tangent = pairing.grid.driver_matrices
            result.pressure[:, own] = both @ normal
            if pairing.friction:
                result.traction[:, self.tangential[pairing.name]] = both @ tangent
        if constant is not None:
            result.constant[:] = constant
        return result

    def drive(self, f: FloatArray, q: FloatArray, p: FloatArray, t: FloatArray) -> FloatArray:
        """The drivers (drivers,) of one state."""
        total = np.zeros(self.columns.total)
        total[: self.loads], total[self.loads : self.loads + self.motions] = f, q
        for pairing in self.pairings:
            pressure = p[self.spans[pairing.name]]
            traction = t[self.tangential[pairing.name]] if pairing.friction else None
            if pairing.grid is None:
                total[self.places(pairing)] = pressure
                if traction is not None:
                    total[self.tangential_places(pairing)] = traction
                continue
            normal, tangent = pairing.grid.driver_matrices
            forces = normal @ pressure if traction is None else normal @ pressure + tangent @ traction
            total[self.places(pairing)], total[self.tangential_places(pairing)] = np.split(forces, 2)
        return total


def _count(pairing: Pairing) -> int:
    return int(pairing.candidate.sum()) if pairing.grid is None else pairing.grid.drivers
