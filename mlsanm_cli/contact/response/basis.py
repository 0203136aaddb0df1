"""Discretisations of contacts: how nodal pressures and tractions act on bodies and observe their motions.

Of a contact with m nodes, pressures (and, with friction, tractions) are represented by *drivers* of the
bodies, whose motions are observed by *samples*; both are linear in the nodal values. On contact grids the
drivers are forces x and y at the samples, which represent all pressures and tractions there through the near
field (:mod:`mlsanm_cli.contact.geometry.contact_grid`); pressures at the nodes of a surface are drivers
themselves (:mod:`mlsanm_cli.contact.response.nodal`). The drivers of a scene are load factors, motions, and
those of every contact, in this order.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from functools import cached_property
from typing import Any, TypeAlias, TypeVar

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.geometry.surface_response import SurfaceResponse
from mlsanm_cli.contact.response.compressed import Counts, LinearMap
from mlsanm_cli.contact.response.nodal import NodalBasis
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.near_field import Isotropic, as_real
from mlsanm_cli.mechanics.remainder import remainder_sources
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF

Key = TypeVar("Key", bound=Hashable)
SHORTEST_WAVE = 6.0
"""Wavelength in spacings, in the middle of a contact, of the highest polynomial."""
LEAST_ORDER = 6
"""Order up to which polynomials are kept on contacts shorter than that."""


class GridBasis:
    """A contact on a contact grid. Its ``drivers`` are forces x and y at the ``samples``, then if it covers
    the surfaces the mean traction x and y, then displacements x and y of pins."""

    def __init__(self, pairing: Pairing) -> None:
        self._pairing, self._grid = pairing, pairing.grid
        self.samples = 2 * self._grid.count
        self.drivers = self.samples + 2 * (self._grid.covers + len(self._grid.pinned))

    def by_values(self, which: int) -> Any:
        """The drivers (d, m) of unit pressures (``which`` 0) or tractions (1)."""
        grid, unit = self._grid, np.eye(self._pairing.count)
        if not (grid.covers or grid.pinned):
            return grid.spreads[which]
        deviation = grid.deviation(unit, which)
        blocks = [grid.spreads[which] @ deviation]
        if grid.covers:
            blocks.append(np.outer(grid.evened[which] * grid.directions[which][0], grid.mean_weights))
        if grid.pinned:
            # Pins stay where they are: what the samples do not represent moves them back.
            acting, moved = grid.hats.at_places(grid.directions[which]), []
            for pin in grid.pinned:
                response = SurfaceResponse.of(grid, pin.kernel, pin.slave)
                singular = response.singular(np.array([pin.place]))[0]
                moved.append(-np.einsum("mcd,md->cm", singular, acting))
            blocks += list(np.array(moved).transpose(1, 0, 2) @ deviation)
        return np.concatenate(blocks)

    def means(self, which: int) -> Any:
        """Gaps (``which`` 0) or slips (1) at the nodes by unit motions of the samples (m, s)."""
        return self._grid.means[which]

    def rows(self, body: ElasticBody, name: str, lost: bool = False) -> sparse.csr_array:
        """Motions of the samples (s, 2N) by displacements of a body, or what is ``lost`` of them by
        smoothing: in isotropic bodies away from corners, as remainders are less smooth elsewhere."""
        grid, model = self._grid, body.model
        total = sparse.csr_array((self.samples, model.unknowns))
        for slave, sign in self._pairing.sides_of(name):
            points, fitted = as_real(grid.facing.side(grid.samples, slave)[0]), None
            if isinstance(model.kernel, Isotropic) and not grid.corners_of(slave):
                spacing = float(model.cloud.spacing[model.cloud.tree.query(points)[1]].min())
                fitted = smoothing(grid, points, spacing)
            if lost and fitted is None:
                continue
            along = [model.values_along(points, axis) for axis in grid.axes]
            if fitted is not None:
                taken = [np.eye(grid.count) - one if lost else one for one in fitted]
                along = [sparse.csr_array(one @ rows) for one, rows in zip(taken, along, strict=True)]
            back = [[sparse.diags_array(axis[:, c]) for axis in grid.axes] for c in (0, 1)]
            along = [sparse.csr_array(a @ along[0] + b @ along[1]) for a, b in back]
            total = sparse.csr_array(total + sign * sparse.csr_array(sparse.vstack(along, format="csr")))
        return total

    def sources(self, body: ElasticBody, name: str, centred: bool) -> sparse.csc_array:
        """Right-hand sides (r, d) of a body for unit drivers: for forces those of the remainders of their
        near fields. ``centred`` where motions are held."""
        grid, total = self._grid, np.zeros((body.rows, self.drivers))
        for slave, sign in self._pairing.sides_of(name):
            pins = [(number, pin) for number, pin in enumerate(grid.pinned) if pin.slave == slave]
            response = SurfaceResponse.of(grid, body.model.kernel, slave)
            held = {pin.node: response.smooth(np.array([pin.place]))[0] for _, pin in pins}
            total[:, : self.samples] += sign * remainder_sources(body, response.forces, centred, held)
            if grid.covers:
                surface = self._pairing.surface_of(slave)
                for component, axis in enumerate(np.eye(2)):
                    along = np.tile(axis, (len(surface.index), 1))
                    total[:, self.samples + component] += sign * body.source(surface.name, along, held=False)
            for number, pin in pins:
                for component, row in body.pin_rows(pin.node):
                    place = number + component * len(grid.pinned)
                    total[row, self.samples + 2 * grid.covers + place] += sign
        return sparse.csc_array(total)

    def resultants(self, body: ElasticBody, name: str, sources: sparse.csc_array) -> list[FloatArray]:
        """Force x, y and moment about the origin (3, m) on a body by unit pressures, and tractions."""
        return self._grid.resultants(name == self._pairing.slave_body)


Basis: TypeAlias = GridBasis | NodalBasis
"""They have the same methods."""


def basis_of(pairing: Pairing) -> Basis:
    """The discretisation of a contact."""
    return NodalBasis(pairing) if pairing.nodal else GridBasis(pairing)


def changes(
    body: ElasticBody, name: str, pairing: Pairing, displacement: FloatArray, lost: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Changes of a contact's gaps and slips (m,) at its nodes by the ``displacement`` (N, 2) of body
    ``name``, or what is ``lost`` of them by smoothing."""
    basis = basis_of(pairing)
    samples = basis.rows(body, name, lost) @ displacement.ravel()
    return basis.means(0) @ samples, basis.means(1) @ samples


def smoothing(grid: ContactGrid, points: FloatArray, spacing: float) -> tuple[FloatArray, FloatArray] | None:
    """Projections (k, k) of values at a grid's samples ``points`` (k, 2) along its two axes onto functions
    resolved by nodes of some ``spacing``; rigid displacements, without planes all linear ones, stay exact.
    None if the samples resolve nothing more.

    Errors of least squares vary from node to node, and pressures amplify short waves. Displacements computed
    on a cloud, those of remainders and loads, are smooth: they are replaced by polynomials, around a closed
    surface by periodic functions, at planes of symmetry by even and by odd ones.
    """
    count, waves = grid.count, (grid.last - grid.first) / (SHORTEST_WAVE * spacing)
    if grid.hats.period is not None and not grid.mirrored:
        order = max(LEAST_ORDER, 2 * int(np.ceil(waves)))
    else:
        order = max(LEAST_ORDER, int(np.ceil((np.pi if grid.unfolding.period is None else 2.0) * waves)))
    if order >= count - 1:
        return None
    if grid.mirrored:
        # A body moves along one plane, and not at all between two at an angle.
        along = next(plane.along for plane in grid.mirrors if plane is not None)
        rigid = grid.axes @ np.array([along.real, along.imag])
        even, odd = zip(grid.unfolding.waves(order), rigid, strict=True)
        return _projection(even[0], even[1][:, None]), _projection(odd[0], odd[1][:, None])
    angle = np.pi * (np.arange(count) + 0.5) / count
    if grid.hats.period is None:
        known = np.cos(np.outer(angle, np.arange(order + 1)))
    else:
        turns = np.outer(np.pi * (1.0 - np.cos(angle)), np.arange(order // 2 + 1))
        known = np.hstack([np.cos(turns), np.sin(turns[:, 1:])])
    both = _projection(known, points - points.mean(axis=0))
    return both, both


def _projection(waves: FloatArray, extent: FloatArray) -> FloatArray:
    """Projection (k, k) onto ``waves`` (k, n) and what these lack of the columns of ``extent`` (k, c)."""
    waves = np.linalg.qr(waves)[0]
    more, size, _ = np.linalg.svd(extent - waves @ (waves.T @ extent), full_matrices=False)
    more = more[:, size > ROUND_OFF * np.linalg.norm(extent)]
    # Small remainders lose their orthogonality.
    shapes = np.linalg.qr(np.hstack([waves, more]))[0]
    return np.asarray(shapes @ shapes.T)


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

    def columns(self, linear: LinearMap, name: str) -> list[FloatArray]:
        """Views of a map's columns for the pressures and, with friction, the tractions of a contact."""
        pairs = ((linear.pressure, self.spans), (linear.traction, self.tangential))
        return [part[:, ranges[name]] for part, ranges in pairs if name in ranges]

    def by_unknowns(self, rows: FloatArray) -> LinearMap:
        """Functionals ``rows`` (r, drivers) in terms of the unknowns."""
        return LinearMap.of_rows(np.ascontiguousarray(rows @ self.matrix), self.counts)
