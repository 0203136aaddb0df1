"""The contact problem condensed on its own unknowns.

The bulk is linear, so with the load factors f, the candidates' pressures p and the unknown platen motions q::

    gap     h = h0 + H f + C q + A p
    balance 0 = B f + G q + F p           (one row per unknown motion)

A is the compliance. Each body is factorised once; every column costs one block solve, of which only the
functionals needed are kept.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.balance import Forces, body_imbalance, platen_balance, reported_forces
from mlsanm_cli.contact.linear_map import Columns, LinearMap
from mlsanm_cli.contact.observers import gap_rows, reaction_rows
from mlsanm_cli.contact.pairing import Pairing
from mlsanm_cli.contact.sources import body_sources
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.operators.system import solve_blocks


@dataclass(frozen=True)
class Condensed:
    """All that the contact laws need to know.

    ``spans[contact]`` are the places of its candidates among the pressures (m,), ``weight`` (m,) their
    surface lengths, ``modulus`` (m,) the contact modulus E* there. ``gap`` maps to the candidates' gaps (m,),
    ``watched`` to the gaps of paired nodes that are no candidates, ``balance`` to what the platens lack (k,).
    ``forces`` maps each load and support to its force (2,) on its body, ``contact_forces`` each contact to
    its force (2,) on the slave; ``imbalance`` holds the sum of forces on each body (2 per body). ``solves``
    counts columns.
    """

    pairings: tuple[Pairing, ...]
    spans: Mapping[str, slice]
    weight: FloatArray
    modulus: FloatArray
    gap: LinearMap
    watched: LinearMap
    balance: LinearMap
    forces: Mapping[str, LinearMap]
    contact_forces: Mapping[str, LinearMap]
    imbalance: LinearMap
    sources: Mapping[str, sparse.csc_array]
    solutions: Mapping[str, FloatArray]
    solves: int

    def touched(self, f: FloatArray, q: FloatArray, p: FloatArray) -> dict[str, BoolArray]:
        """Per contact, which paired nodes (w,) are no candidates and yet overlap in one state."""
        overlap = self.watched(f, q, p) < 0.0
        masks, first = {}, 0
        for pairing in self.pairings:
            left_out = np.flatnonzero(~pairing.candidate)
            mask = np.zeros(len(pairing.position), dtype=bool)
            mask[left_out] = overlap[first : first + len(left_out)]
            first += len(left_out)
            masks[pairing.name] = mask
        return masks

    def displacement(
        self, scene: Scene, body: str, f: FloatArray, q: FloatArray, p: FloatArray
    ) -> tuple[FloatArray, float]:
        """Displacements (N, 2) of all nodes of a body in one state, ghosts included and last, and the
        residual of its elastic system.

        One back-substitution; none where there is no contact, since ``solutions`` (2n, loads + motions) of so
        few columns are kept.
        """
        unknowns = np.concatenate([f, q, p])
        source = sparse.csc_array((self.sources[body] @ unknowns)[:, None])
        system = scene.bodies[body].system
        if body in self.solutions:
            solution = (self.solutions[body] @ unknowns)[:, None]
        else:
            solution = system.solve(source)
        return solution.reshape(-1, 2), system.residual(source, solution)


def condense(scene: Scene, pairings: tuple[Pairing, ...]) -> Condensed:
    """Condense the scene on the candidates of ``pairings``."""
    counts = [int(pairing.candidate.sum()) for pairing in pairings]
    columns = Columns(len(scene.loads), len(scene.unknown_motions), sum(counts))
    ends = np.cumsum([0, *counts])
    spans = {
        pair.name: slice(int(a), int(b)) for pair, a, b in zip(pairings, ends[:-1], ends[1:], strict=True)
    }
    held = [(name, surface) for name, body in scene.bodies.items() for surface in body.held]

    paired = sum(len(pairing.position) for pairing in pairings)
    observed = np.zeros((paired + 3 * len(held), columns.total))
    sources, solutions = {}, {}
    solves = 0
    for name, body in scene.bodies.items():
        sources[name] = body_sources(scene, name, pairings, spans, columns)
        empty = sparse.csr_array((3, body.model.unknowns))
        reactions = [
            reaction_rows(body, surface, scene.center(owner, surface)) if owner == name else empty
            for owner, surface in held
        ]
        rows = sparse.csr_array(sparse.vstack([gap_rows(body, name, pairings), *reactions], format="csr"))
        used = np.flatnonzero(np.diff(sources[name].indptr))
        kept = np.zeros((rows.shape[1], columns.total if not pairings else 0))
        for block, solution in solve_blocks(body.system, sources[name][:, used]):
            observed[:, used[block]] += rows @ solution
            if not pairings:
                kept[:, used[block]] = solution
        if not pairings:
            solutions[name] = kept
        solves += len(used)

    candidate = np.concatenate([np.zeros(0, dtype=bool), *(pairing.candidate for pairing in pairings)])
    gap = columns.split(observed[:paired], np.concatenate([[], *(pairing.gap for pairing in pairings)]))
    weight = np.concatenate([[], *(pairing.weight[pairing.candidate] for pairing in pairings)])
    forces = Forces(
        scene,
        pairings,
        spans,
        columns,
        {where: columns.split(observed[paired + 3 * i : paired + 3 * i + 3]) for i, where in enumerate(held)},
    )
    modulus = np.concatenate([[], *(np.full(int(p.candidate.sum()), _modulus(scene, p)) for p in pairings)])
    return Condensed(
        pairings=pairings,
        spans=spans,
        weight=weight,
        modulus=modulus,
        gap=gap.take(candidate),
        watched=gap.take(~candidate),
        balance=platen_balance(forces),
        forces=reported_forces(forces),
        contact_forces={pairing.name: forces.contact(pairing).take(slice(0, 2)) for pairing in pairings},
        imbalance=body_imbalance(forces),
        sources=sources,
        solutions=solutions,
        solves=solves,
    )


def _modulus(scene: Scene, pairing: Pairing) -> float:
    """Contact modulus E* of a pair of bodies: 1/E* is the sum of 1/E'."""
    bodies = (scene.bodies[name] for name in (pairing.slave_body, pairing.master_body))
    return 1.0 / sum(1.0 / body.model.material.contact_modulus for body in bodies)
