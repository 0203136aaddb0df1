"""The contact problem condensed to its own unknowns.

The bulk is linear. With the load factors f, the candidates' pressures p, the tractions t of contacts with
friction, and the unknown rigid motions q of platens, obstacles and floating bodies::

    gap     h = h0 + H f + C q + A_nn p + A_nt t
    slip    s = S f + D q + A_tn p + A_tt t
    balance 0 = B f + G q + F_n p + F_t t           (one row per unknown motion)

p acts on the slave along the master's outward normal, t along the tangent, the normal rotated by -90 degrees;
s is the slip of the slave relative to the master along it. Equation (11) of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.complementarity.problem import Problem
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.response.basis import Drivers, spans
from mlsanm_cli.contact.response.bonds import Bonds
from mlsanm_cli.contact.response.compressed import Bordered, LinearMap, Multiplier, compressed, largest
from mlsanm_cli.contact.response.contact_fields import NearFields
from mlsanm_cli.mechanics.near_field import as_complex
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.memo import Memo
from mlsanm_cli.operators.system import residual_of
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF

if TYPE_CHECKING:
    from mlsanm_cli.contact.response.eigenstress import Eigenstresses

SPARSE_SHARE = 0.3
"""Share of entries that are not zero below which products with a sparse matrix are the faster ones."""
MAX_KEPT, MAX_KEPT_UNKNOWNS = 50, 5000
"""Numbers of sets of points for which near fields are kept, and of unknowns of their contacts."""


@dataclass(frozen=True)
class Condensed:
    """Everything the contact laws need.

    ``pairings`` are the contacts with a contact law; those of ``bonds`` are eliminated. Of every contact,
    ``spans`` and, with friction, ``tangential`` are the ranges among the pressures (m,) and tractions (n,);
    ``friction_nodes`` (n,) are the indices of nodes with friction among the pressures, ``friction`` (n,)
    their coefficients. ``weight`` (m,) are surface lengths, ``around`` (m,) circumferences in bodies of
    revolution, else 1, ``half_plane`` (m, 2, 2) 1/E* along normal and tangent. ``watched`` maps to the gaps
    of points that are no candidates, ``balance`` to the force imbalance of the rigid constraints (k,), with
    moments about their centres. ``beyond`` (m + n, m + n) is the part of gaps and slips not due to
    displacements (:func:`correct_short_waves`), ``quantities`` the maps of other results by kind and subject
    (:meth:`ForceSums.quantities`, and "probe" displacement and stress of each probe). ``solves`` counts
    columns, ``content`` is a digest of everything but friction coefficients, ``kept`` are near fields at
    points of the bodies, ``inner`` right-hand sides (r,) and solutions (2N,) by eigenstresses ``eigen``.
    """

    pairings: tuple[Pairing, ...]
    spans: Mapping[str, slice]
    weight: FloatArray
    around: FloatArray
    half_plane: FloatArray
    tangential: Mapping[str, slice]
    friction_nodes: IntArray
    friction: FloatArray
    gap: LinearMap
    slip: LinearMap
    watched: LinearMap
    balance: LinearMap
    beyond: sparse.csr_array
    quantities: Mapping[str, Mapping[Any, LinearMap]]
    sources: Mapping[str, sparse.csc_array]
    solutions: Mapping[str, FloatArray]
    solves: int
    content: str
    bonds: Bonds = field(default_factory=Bonds.none)
    drivers: Drivers = field(default_factory=lambda: Drivers(0, 0, ()))
    kept: Memo = field(default_factory=partial(Memo, MAX_KEPT))
    inner: Mapping[str, tuple[FloatArray, FloatArray]] = field(default_factory=dict)
    eigen: Eigenstresses | None = None

    @property
    def reported(self) -> tuple[Pairing, ...]:
        """All contacts, including bonded ones, in the order of the case."""
        return self.drivers.pairings

    @property
    def on_grids(self) -> tuple[Pairing, ...]:
        """The contacts with a contact law and a contact grid."""
        return tuple(pairing for pairing in self.pairings if not pairing.nodal)

    @property
    def nodal(self) -> tuple[Pairing, ...]:
        """The contacts with a contact law and nodal pressures."""
        return tuple(pairing for pairing in self.pairings if pairing.nodal)

    def pairing_of(self, name: str) -> Pairing:
        """The contact with a contact law called ``name``."""
        return next(pairing for pairing in self.pairings if pairing.name == name)

    @cached_property
    def whole(self) -> FloatArray:
        """Gaps, slips and force imbalance (m + n + k) per pressure, traction and motion."""
        parts = (self.gap, self.slip, self.balance)
        return np.block([[part.pressure, part.traction, part.motion] for part in parts])

    @cached_property
    def blocks(self) -> Multiplier:
        """:attr:`whole` for products: sparse if many contacts have no body in common."""
        own = compressed(self.gap.pressure)
        if own is not None:
            return Bordered(own, self.gap.motion, self.balance.pressure, self.balance.motion)
        filled = np.count_nonzero(self.whole)
        found: Any = sparse.csr_array if filled < SPARSE_SHARE * self.whole.size else np.asarray
        few: Multiplier = found(self.whole)
        return few

    def elastic_gap(self, pressure: FloatArray) -> float:
        """Largest gap caused by pressures (m,) on any candidate."""
        return float(np.abs(self.gap.pressure @ pressure).max(initial=0.0))

    @cached_property
    def largest_compliance(self) -> float:
        """Largest gap due to a unit pressure, 0 without candidates."""
        return largest(self.gap.pressure)

    @cached_property
    def gap_round_off(self) -> float:
        """Round-off of the gaps, which are differences of coordinates."""
        lengths = [self.gap.constant, *(pairing.points for pairing in self.pairings)]
        size = max(float(np.abs(one).max(initial=0.0)) for one in lengths)
        return 4.0 * float(np.finfo(float).eps) * size

    @cached_property
    def problem(self) -> Problem:
        """The complementarity problem of the scene, scaled."""
        return Problem.of(self.whole, self.friction_nodes, self.friction, len(self.weight), self.blocks)

    @cached_property
    def frictionless(self) -> Problem:
        """The same without tractions and slips."""
        gap, balance = self.gap, self.balance
        parts = [[np.asarray(part.pressure), part.motion] for part in (gap, balance)]
        return Problem.of(np.block(parts), self.friction_nodes[:0], self.friction[:0], len(self.weight))

    def unscaled_rows(self, factors: FloatArray, rates: bool = False) -> FloatArray:
        """Gaps, slips and force imbalance (m + n + k,) without pressures, tractions and motions at load
        ``factors`` (L,), or only their change with these."""
        parts = (self.gap, self.slip, self.balance)
        return np.concatenate([part.load @ factors + (0.0 if rates else part.constant) for part in parts])

    def free_rows(self, factors: FloatArray, rates: bool = False) -> FloatArray:
        """The same scaled as in :attr:`problem`."""
        return self.problem.rows * self.unscaled_rows(factors, rates)

    def touched(
        self, f: FloatArray, q: FloatArray, p: FloatArray, t: FloatArray, shift: FloatArray | float = 0.0
    ) -> dict[str, BoolArray]:
        """Mask (w,) per contact of nodes that overlap, after a ``shift`` (w,), without being candidates."""
        overlap, masks = self.watched(f, q, p, t) + shift < 0.0, dict[str, BoolArray]()
        for pairing in self.pairings:
            masks[pairing.name] = ~pairing.candidate
            masks[pairing.name][~pairing.candidate] = overlap[self.watched_of(pairing.name)]
        return masks

    def cut(self, pressure: FloatArray) -> list[str]:
        """Contacts with a ``pressure`` (m,) at the end of a grid that is not the end of a surface."""
        found, closed = [], pressure > ROUND_OFF * pressure.max(initial=0.0)
        for pairing in self.on_grids:
            ends = closed[self.spans[pairing.name]][[0, -1]]
            if (ends & ~np.array(pairing.grid.hats.whole)).any():
                found.append(pairing.name)
        return found

    def watched_of(self, name: str) -> slice:
        """Range of a contact's paired nodes that are no candidates, among those of all contacts."""
        counts = [int((~one.candidate).sum()) for one in self.pairings]
        return spans([one.name for one in self.pairings], counts)[name]

    def source(
        self, body: str, f: FloatArray, q: FloatArray, p: FloatArray, t: FloatArray
    ) -> sparse.csc_array:
        """Right-hand side (r, 1) of a body in one state."""
        source = self.sources[body] @ self.drive((f, q, p, t))
        own = self.inner[body][0] if body in self.inner else 0.0
        return sparse.csc_array((source + own)[:, None])

    def drive(self, unknowns: Sequence[FloatArray]) -> FloatArray:
        """The drivers (drivers,) of one state."""
        return np.asarray(self.drivers.matrix @ self.bonds.whole(unknowns))

    @property
    def areas(self) -> FloatArray:
        """Areas (m,) on which the pressures act, of the full turn or per unit thickness."""
        return self.weight * self.around

    def overlap(self, gap: FloatArray) -> bool:
        """Whether some ``gap`` (m,) is negative beyond the tolerance of surfaces drawn touching."""
        return bool((gap < -ROUND_OFF * self.weight).any())

    def closest(self, gap: FloatArray) -> BoolArray:
        """Mask (m,) of nodes with the smallest ``gap`` (m,), enough to hold all rigid motions if possible."""
        chosen = np.zeros(len(gap), dtype=bool)
        held = np.vstack([self.gap.motion, self.slip.motion, self.balance.motion])
        size = np.abs(held).max(axis=0, initial=0.0)
        held, still = held / np.where(size > 0.0, size, 1.0), np.ones(held.shape[1], dtype=bool)
        most = np.linalg.matrix_rank(held, ROUND_OFF)
        for count in 2 ** np.arange(len(gap).bit_length() + 1):
            for span in self.spans.values():
                widest = np.sort(gap[span])[:count].max(initial=-np.inf)
                chosen[span] |= gap[span] <= widest + ROUND_OFF * self.weight[span]
            rows = np.concatenate([chosen, chosen[self.friction_nodes], still])
            if np.linalg.matrix_rank(held[rows], ROUND_OFF) == most:
                break
        return chosen

    def solution(
        self, scene: Scene, body: str, unknowns: Sequence[FloatArray]
    ) -> tuple[FloatArray, sparse.csc_array]:
        """Solution (2N, 1) of a body's elastic system in a state f, q, p, t, and its right-hand side (r, 1):
        one solve; none without contact, as the ``solutions`` (2N, drivers) are stored then."""
        source = self.source(body, *unknowns)
        if body in self.solutions:
            own = self.inner[body][1] if body in self.inner else 0.0
            return (self.solutions[body] @ self.drive(unknowns) + own)[:, None], source
        return scene.bodies[body].system.solve(source), source

    def displacement(self, scene: Scene, body: str, unknowns: Sequence[FloatArray]) -> FloatArray:
        """Displacements (N, 2) of all nodes of a body in a state f, q, p, t."""
        solution = self.solution(scene, body, unknowns)[0][:, 0]
        rest = (solution + scene.floating_patterns(body) @ unknowns[1]).reshape(-1, 2)
        return np.asarray(rest + self.contact_fields(scene, body, unknowns)[0])

    def contact_fields(
        self, scene: Scene, body: str, unknowns: Sequence[FloatArray], points: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Displacements (e, 2) and stresses (e, 3 | 4) of the near fields at ``points`` (e, 2) of a body, or
        at its nodes, in a state f, q, p, t. The elastic system gives the rest of both."""
        model = scene.bodies[body].model
        seen = model.cloud.points if points is None else points
        displacement, stress = np.zeros((len(seen), 2)), np.zeros((len(seen), len(model.material.stiffness)))
        for pairing in self.drivers.on_grids:
            if body not in pairing.bodies:
                continue
            pressure, traction = self.contact_values(pairing, unknowns)
            if not (pressure.any() or traction.any()):
                continue
            for slave, sign in pairing.sides_of(body):
                side, count = (pairing.grid, model.kernel, slave), len(self.reported)
                make = partial(NearFields.at, *side, as_complex(seen), count)
                few = len(pressure) <= MAX_KEPT_UNKNOWNS
                fields = self.kept.value(pairing.name, (slave, seen), make) if few else make()
                moved, stressed = fields(pressure[:, None], traction[:, None])
                displacement, stress = displacement + sign * moved[:, :, 0], stress + sign * stressed[:, :, 0]
        return displacement, stress

    def contact_values(
        self, pairing: Pairing, unknowns: Sequence[FloatArray]
    ) -> tuple[FloatArray, FloatArray]:
        """Pressures and tractions (m,) of one contact's candidates, bonded or not."""
        if pairing.bonded:
            return self.bonds.values(pairing.name, unknowns)
        _, _, pressures, tractions = unknowns
        pressure = pressures[self.spans[pairing.name]]
        if pairing.name not in self.tangential:
            return pressure, np.zeros_like(pressure)
        return pressure, tractions[self.tangential[pairing.name]]

    def checked_displacements(
        self, scene: Scene, body: str, states: Sequence[Sequence[FloatArray]]
    ) -> tuple[list[FloatArray], FloatArray]:
        """Elastic displacements in several states, and relative changes (c,) by one more refinement."""
        system, patterns = scene.bodies[body].system, scene.floating_patterns(body)
        stacked = [self.source(body, *state) for state in states]
        sources = sparse.csc_array(sparse.hstack(stacked, format="csc"))
        if body in self.solutions:
            solution = np.hstack([self.solution(scene, body, state)[0] for state in states])
        else:
            solution = system.solve(sources)
        both = zip(solution.T, states, strict=True)
        moved = [(own + patterns @ state[1]).reshape(-1, 2) for own, state in both]
        return moved, residual_of(system, sources, solution)
