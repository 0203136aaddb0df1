"""Drivers of the bodies: load factors, motions, and those of every contact's discretisation
(:mod:`mlsanm_cli.contact.response.basis`), in this order."""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.response.basis import Basis, basis_of
from mlsanm_cli.contact.response.linear_map import Counts, LinearMap
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
    def on_grids(self) -> tuple[Pairing, ...]:
        """The contacts with contact grids."""
        return tuple(pairing for pairing in self.pairings if not pairing.nodal)

    @cached_property
    def bases(self) -> dict[str, Basis]:
        """The discretisation of every contact."""
        return {pairing.name: basis_of(pairing) for pairing in self.pairings}

    @cached_property
    def spans(self) -> dict[str, slice]:
        """Range of every contact among the unknown pressures."""
        return spans([one.name for one in self.pairings], [one.count for one in self.pairings])

    @cached_property
    def tangential(self) -> dict[str, slice]:
        """Range of every frictional contact among the unknown tractions."""
        return spans([one.name for one in self.frictional], [one.count for one in self.frictional])

    @cached_property
    def counts(self) -> Counts:
        """Numbers of the unknowns."""
        pressures, tractions = (sum(p.count for p in some) for some in (self.pairings, self.frictional))
        return self.loads, self.motions, pressures, tractions

    @cached_property
    def places(self) -> dict[str, slice]:
        """Range of every contact among the drivers."""
        counts = [basis.drivers for basis in self.bases.values()]
        return spans(self.bases, counts, self.loads + self.motions)

    @property
    def total(self) -> int:
        """Number of all drivers."""
        return self.loads + self.motions + sum(basis.drivers for basis in self.bases.values())

    def of_samples(self, pairing: Pairing) -> slice:
        """The forces (2k,), x then y, at a contact grid's samples among the drivers."""
        first = self.places[pairing.name].start
        return slice(first, first + 2 * pairing.grid.count)

    @property
    def means(self) -> IntArray:
        """Indices of the mean tractions x and y of contacts that cover their surfaces."""
        covering = [self.of_samples(one).stop for one in self.on_grids if one.grid.covers]
        return (np.array(covering, dtype=np.int64)[:, None] + np.arange(2)).ravel()

    @cached_property
    def matrix(self) -> sparse.csr_array:
        """The drivers (drivers, unknowns) per unit of every unknown."""
        rubbing = [one.name for one in self.frictional]
        first = sparse.eye_array(self.loads + self.motions)
        rows: list[list[Any]] = [[first, *[None] * (len(self.bases) + len(rubbing))]]
        for name, basis in self.bases.items():
            pressures = [basis.by_values(0) if one == name else None for one in self.bases]
            tractions = [basis.by_values(1) if one == name else None for one in rubbing]
            rows.append([None, *pressures, *tractions])
        return sparse.csr_array(sparse.block_array(rows, format="csr"))

    def by_unknowns(self, rows: FloatArray) -> LinearMap:
        """Functionals ``rows`` (r, drivers) in terms of the unknowns."""
        return LinearMap.of_rows(np.ascontiguousarray(rows @ self.matrix), self.counts)
