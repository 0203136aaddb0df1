"""The contact problem condensed on its own unknowns.

The bulk is linear, so with the load factors f, the candidates' pressures p, the tractions t of contacts with
friction, and the unknown rigid motions q of platens, obstacles and loose bodies::

    gap     h = h0 + H f + C q + A_nn p + A_nt t
    slip    s = S f + D q + A_tn p + A_tt t
    balance 0 = B f + G q + F_n p + F_t t           (one row per unknown motion)

p acts on the slave along the master's outward normal, t along the tangent, the normal turned by -90 degrees;
s is the slip of the slave relative to the master along it. The matrices A are the compliance. Each body is
factorised once; of the solutions to its columns only the functionals needed are found. Both are left out
where a memo has the functionals already.

A scene that is its own mirror image has symmetric pressures, and its bodies answer to the symmetric part of
each: half to a node's pressure, half to that of its image. Twice that on the node's own side and nothing on
the other is the same for symmetric pressures, and leaves the compliance positive for others.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property, partial

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.balance import Forces, balance_of_movers, body_imbalance, reported_forces
from mlsanm_cli.contact.dense import scales
from mlsanm_cli.contact.linear_map import Columns, LinearMap
from mlsanm_cli.contact.observation import Observation, observe, used_columns
from mlsanm_cli.contact.offsets import of_fits, of_obstacles
from mlsanm_cli.contact.pairing import Pairing
from mlsanm_cli.contact.short_waves import resolved
from mlsanm_cli.contact.sources import body_sources
from mlsanm_cli.mechanics.probes import Probe, stress_of_expansion
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.memo import AFRESH, Memo, digest
from mlsanm_cli.values import dataclass

EVEN = 1e-9
"""Gaps that differ by less than this part of the spacing are equal."""
ROUND_OFF = 1e-9


@dataclass(frozen=True)
class Condensed:
    """All that the contact laws need to know.

    ``spans[contact]`` are the places of its candidates among the pressures (m,), ``weight`` (m,) their
    surface lengths, ``modulus`` (m,) the contact modulus E* there. ``tangential[contact]`` are the places of
    a contact with friction among the tractions (n,); ``rubbing`` (n,) are the numbers of these nodes among
    the pressures, ``friction`` (n,) their coefficients. ``gap`` maps to the candidates' gaps (m,), ``slip``
    to the slips (n,), ``watched`` to the gaps of paired nodes that are no candidates, ``balance`` to what the
    movers lack (k,). ``beyond`` (m + n, m + n) is what of the gaps and slips the displacements' own do not
    tell (:func:`resolved`).

    ``forces`` maps each load and support to its force (2,) on its body, ``contact_forces`` each contact to
    its force (2,) on the slave; ``imbalance`` holds the sum of forces on each body (2 per body). ``probes``
    maps each probe to its displacement and stress (5,). ``solves`` counts columns. ``content`` is a digest of
    all but the coefficients of friction.
    """

    pairings: tuple[Pairing, ...]
    spans: Mapping[str, slice]
    weight: FloatArray
    modulus: FloatArray
    tangential: Mapping[str, slice]
    rubbing: IntArray
    friction: FloatArray
    gap: LinearMap
    slip: LinearMap
    watched: LinearMap
    balance: LinearMap
    beyond: FloatArray
    forces: Mapping[str, LinearMap]
    contact_forces: Mapping[str, LinearMap]
    imbalance: LinearMap
    sources: Mapping[str, sparse.csc_array]
    solutions: Mapping[str, FloatArray]
    solves: int
    content: str
    probes: Mapping[str, LinearMap] = field(default_factory=dict)

    @cached_property
    def whole(self) -> FloatArray:
        """Gaps, slips and lacking balance (m + n + k) per pressure, traction and motion."""
        parts = (self.gap, self.slip, self.balance)
        return np.block([[part.pressure, part.traction, part.motion] for part in parts])

    @cached_property
    def softest(self) -> float:
        """The largest gap that a unit pressure makes anywhere, 0 without candidates."""
        return float(np.abs(self.gap.pressure).max(initial=0.0))

    @cached_property
    def scaled(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Factors on the rows and columns of :attr:`whole`, and the transpose of it multiplied by them."""
        rows, columns = scales(self.whole, len(self.gap.constant) + len(self.slip.constant))
        return rows, columns, np.ascontiguousarray((rows[:, None] * (self.whole * columns)).T)

    def touched(self, f: FloatArray, q: FloatArray, p: FloatArray, t: FloatArray) -> dict[str, BoolArray]:
        """Per contact, which paired nodes (w,) are no candidates and yet overlap in one state."""
        overlap = self.watched(f, q, p, t) < 0.0
        masks, first = {}, 0
        for pairing in self.pairings:
            left_out = np.flatnonzero(~pairing.candidate)
            mask = np.zeros(len(pairing.position), dtype=bool)
            mask[left_out] = overlap[first : first + len(left_out)]
            first += len(left_out)
            masks[pairing.name] = mask
        return masks

    def source(
        self, body: str, f: FloatArray, q: FloatArray, p: FloatArray, t: FloatArray
    ) -> sparse.csc_array:
        """Right-hand side (r, 1) of a body in one state."""
        return sparse.csc_array((self.sources[body] @ np.concatenate([f, q, p, t]))[:, None])

    def overlap(self, gap: FloatArray) -> bool:
        """Whether some ``gap`` (m,) is negative by more than surfaces drawn touching may have it."""
        return bool((gap < -EVEN * self.weight).any())

    def closest(self, gap: FloatArray) -> BoolArray:
        """The nodes (m,) with the smallest ``gap`` (m,) of every contact, enough to hold all that moves
        rigidly, if possible."""
        ordered = {name: np.sort(gap[span]) for name, span in self.spans.items()}
        chosen = np.zeros(len(gap), dtype=bool)
        for count in 2 ** np.arange(len(gap).bit_length() + 1):
            for name, span in self.spans.items():
                widest = ordered[name][:count].max(initial=-np.inf)
                chosen[span] |= gap[span] <= widest + EVEN * self.weight[span]
            held = np.concatenate([self.gap.motion[chosen], self.balance.motion])
            size = np.abs(held).max(axis=0, initial=0.0)
            if np.linalg.matrix_rank(held / np.where(size > 0.0, size, 1.0), ROUND_OFF) == held.shape[1]:
                break
        return chosen

    def solution(
        self, scene: Scene, body: str, unknowns: Sequence[FloatArray]
    ) -> tuple[FloatArray, sparse.csc_array]:
        """Solution (2N, 1) of a body's elastic system in a state f, q, p, t, and its right-hand side (r, 1).

        One solve; none where there is no contact, since ``solutions`` (2n, loads + motions) of so few columns
        are kept.
        """
        f, q, p, t = unknowns
        source = self.source(body, f, q, p, t)
        if body in self.solutions:
            return (self.solutions[body] @ np.concatenate([f, q, p, t]))[:, None], source
        return scene.bodies[body].system.solve(source), source

    def displacement(self, scene: Scene, body: str, unknowns: Sequence[FloatArray]) -> FloatArray:
        """Displacements (N, 2) of all nodes of a body in a state f, q, p, t, ghosts included and last."""
        solution = self.solution(scene, body, unknowns)[0][:, 0]
        return (solution + scene.loose_patterns(body) @ unknowns[1]).reshape(-1, 2)

    def checked_displacements(
        self,
        scene: Scene,
        body: str,
        states: Sequence[Sequence[FloatArray]],
        start: FloatArray | None = None,
    ) -> tuple[list[FloatArray], FloatArray]:
        """The same in several states, and what solving the body's elastic system once more is worth in each
        (c,), relatively: what it changed, or of solutions that are kept would change.

        They are solved for together, from a ``start`` (2N, 1) if a solution near them is known.
        """
        system, patterns = scene.bodies[body].system, scene.loose_patterns(body)
        stacked = [self.source(body, *state) for state in states]
        sources = sparse.csc_array(sparse.hstack(stacked, format="csc"))
        if body in self.solutions:
            solution = np.hstack([self.solution(scene, body, state)[0] for state in states])
            worth = system.residual(sources, solution)
        else:
            solution, worth = system.checked(sources, start)
        moved = [patterns @ state[1] for state in states]
        return [(solution[:, k] + one).reshape(-1, 2) for k, one in enumerate(moved)], worth


def condense(scene: Scene, pairings: tuple[Pairing, ...], memo: Memo = AFRESH) -> Condensed:
    """Condense the scene on the candidates of ``pairings``.

    Coefficients of friction above 0 are in none of the matrices, so that all of them share what is kept.
    """
    content = digest(
        scene, [replace(pairing, friction=float(pairing.friction > 0.0)) for pairing in pairings]
    )
    kept = memo.value("condensed", content, partial(_condensed, scene, pairings, content, memo))
    return replace(kept, pairings=pairings, friction=_friction(pairings))


def _condensed(scene: Scene, pairings: tuple[Pairing, ...], content: str, memo: Memo) -> Condensed:
    observation = Observation.of(scene, pairings)
    rough = observation.rough
    normal, tangential = _places(pairings), _places(rough)
    columns = Columns(len(scene.loads), len(scene.unknown_motions), _count(pairings), _count(rough))
    sources = {name: body_sources(scene, name, pairings, columns) for name in scene.bodies}
    like = columns.like(observation.images[1])
    observed, solutions = observe(observation, sources, columns, memo)
    seen = observation.parted(observed)

    candidate = _candidates(pairings)
    side = np.concatenate([np.zeros(0, dtype=np.int64), *(pairing.side for pairing in pairings)])
    gap = columns.split(seen.gaps, np.concatenate([[], *(pairing.gap for pairing in pairings)]))
    gap.pressure[:] *= 1.0 + np.outer(side, side[candidate])
    gap = gap + of_obstacles(scene, pairings, columns, "normal") + of_fits(scene, pairings, columns)
    weight = np.concatenate([[], *(pairing.weight[pairing.candidate] for pairing in pairings)])
    forces = Forces(
        scene,
        pairings,
        normal,
        tangential,
        columns,
        sources,
        {where: columns.split(rows) for where, rows in seen.held.items()},
        {where: columns.split(rows) for where, rows in seen.sprung.items()},
    )
    modulus = 1.0 / np.concatenate([[], *(_softness(scene, p, p.normal) for p in pairings)])
    gap, watched = gap.take(candidate), gap.take(~candidate)
    slip = columns.split(seen.slips) + of_obstacles(scene, rough, columns, "tangent")
    slip = slip.take(_candidates(rough))
    along = {pairing.name: _softness(scene, pairing, pairing.tangent) for pairing in rough}
    gap, slip, beyond = resolved(gap, slip, rough, normal, tangential, along)
    rubbing = _numbers([normal[pairing.name] for pairing in rough])
    return Condensed(
        pairings=pairings,
        spans=normal,
        weight=weight,
        modulus=modulus,
        tangential=tangential,
        rubbing=rubbing,
        friction=_friction(pairings),
        gap=gap,
        slip=slip,
        watched=watched,
        balance=balance_of_movers(forces),
        beyond=beyond,
        forces=reported_forces(forces),
        contact_forces={
            pairing.name: forces.contact(pairing, pairing.slave_body).take(slice(0, 2))
            for pairing in pairings
        },
        imbalance=body_imbalance(forces),
        sources=sources,
        solutions=solutions,
        solves=sum(len(np.unique(like[used_columns(source)])) for source in sources.values()),
        content=content,
        probes={
            probe.name: _seen(scene, probe, columns, rows)
            for probe, rows in zip(scene.probes, seen.probes, strict=True)
        },
    )


def _seen(scene: Scene, probe: Probe, columns: Columns, rows: FloatArray) -> LinearMap:
    """What a probe observes: displacement, and the stress of all but free expansion."""
    free = stress_of_expansion(scene.bodies[probe.body].model.material)
    rows[-len(free) :, : columns.loads] -= np.outer(free, scene.degrees(probe.body))
    return columns.split(rows)


def _softness(scene: Scene, pairing: Pairing, direction: FloatArray) -> FloatArray:
    """1/E* (m,) of a contact's bodies at its candidates, along ``direction`` (w, 2); obstacles are rigid."""
    chosen = direction[pairing.candidate]
    parts = [scene.bodies[body].model.material.softness(chosen) for body in pairing.bodies]
    return np.asarray(np.sum(parts, axis=0))


def _friction(pairings: tuple[Pairing, ...]) -> FloatArray:
    """Coefficients (n,) of the contacts that have friction."""
    return np.concatenate(
        [[], *(np.full(int(p.candidate.sum()), p.friction) for p in pairings if p.friction)]
    )


def _count(pairings: tuple[Pairing, ...]) -> int:
    return sum(int(pairing.candidate.sum()) for pairing in pairings)


def _places(pairings: tuple[Pairing, ...]) -> dict[str, slice]:
    return spans([pairing.name for pairing in pairings], [int(pair.candidate.sum()) for pair in pairings])


def _candidates(pairings: tuple[Pairing, ...]) -> BoolArray:
    return np.concatenate([np.zeros(0, dtype=bool), *(pairing.candidate for pairing in pairings)])


def _numbers(spans: list[slice]) -> IntArray:
    return np.concatenate([np.zeros(0, dtype=np.int64), *(np.arange(s.start, s.stop) for s in spans)])


def spans(names: Iterable[str], counts: Sequence[int]) -> dict[str, slice]:
    """Places of every contact's nodes when they are counted through all contacts."""
    ends = np.cumsum([0, *counts]).tolist()
    return {name: slice(a, b) for name, a, b in zip(names, ends[:-1], ends[1:], strict=True)}
