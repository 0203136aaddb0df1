"""Functionals of the bodies' responses to contact and loads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.response.drivers import Drivers
from mlsanm_cli.contact.response.functionals import (
    gap_rows,
    reaction_rows,
    sampled_rows,
    slip_rows,
    spring_rows,
)
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.probes import ROWS, probe_rows
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.memo import Arrays, Memo, digest

Surface: TypeAlias = tuple[str, str]
"""Body and name."""


@dataclass(frozen=True)
class Observed:
    """Functionals by kind, as in :class:`ResponseFunctionals`; ``gaps`` and ``slips`` by contact."""

    gaps: Mapping[str, FloatArray]
    slips: Mapping[str, FloatArray]
    held: Mapping[Surface, FloatArray]
    probes: list[FloatArray]
    sprung: Mapping[Surface, FloatArray]


@dataclass(frozen=True)
class ResponseFunctionals:
    """Functionals in this order: gaps of nodes, or sampled motions of contact grids, of the ``pairings``;
    slips of the ``frictional`` contacts with nodal pressures; reactions of ``held`` surfaces; probes of the
    scene; forces of ``sprung`` surfaces."""

    scene: Scene
    pairings: tuple[Pairing, ...]
    frictional: tuple[Pairing, ...]
    held: tuple[Surface, ...]
    sprung: tuple[Surface, ...]

    @classmethod
    def of(cls, scene: Scene, pairings: tuple[Pairing, ...]) -> ResponseFunctionals:
        """All functionals needed or reported for the contact problem of a scene."""
        rough = tuple(pairing for pairing in pairings if pairing.friction and pairing.grid is None)
        held = tuple((name, s) for name, body in scene.bodies.items() for s in body.gripped)
        sprung = tuple((name, s) for name, body in scene.bodies.items() for s in body.soft_springs)
        return cls(scene, pairings, rough, held, sprung)

    @property
    def counts(self) -> list[int]:
        """Numbers of rows of every contact's gaps and slips, every held surface, probe and sprung surface."""
        gaps = [_rows_of(pairing) for pairing in self.pairings]
        slips = [len(pairing.position) for pairing in self.frictional]
        pulls = [3] * len(self.sprung)
        return [*gaps, *slips, *(3 for _ in self.held), *(ROWS for _ in self.scene.probes), *pulls]

    @property
    def of_stress(self) -> slice:
        """Rows of held surfaces, which are computed from stresses and need the free expansion subtracted."""
        counts, first = self.counts, len(self.pairings) + len(self.frictional)
        return slice(sum(counts[:first]), sum(counts[: first + len(self.held)]))

    def rows(self, name: str) -> sparse.csr_array:
        """All functionals (sum of counts, n) of the unknowns of one body."""
        scene, body = self.scene, self.scene.bodies[name]
        gaps = [
            gap_rows(body, name, (pairing,))
            if pairing.grid is None
            else sampled_rows(body, name, pairing, pairing.normal)
            for pairing in self.pairings
        ]
        slips = [slip_rows(body, name, (pairing,)) for pairing in self.frictional]
        reactions = [
            reaction_rows(body, surface, scene.center(owner, surface)) if owner == name else None
            for owner, surface in self.held
        ]
        probed = [probe_rows(body.model, p.point) if p.body == name else None for p in scene.probes]
        pulls = [spring_rows(body, surface) if owner == name else None for owner, surface in self.sprung]
        blocks = [
            sparse.csr_array((count, body.model.unknowns)) if block is None else block
            for count, block in zip(self.counts, [*gaps, *slips, *reactions, *probed, *pulls], strict=True)
        ]
        return sparse.csr_array(
            sparse.vstack([sparse.csr_array((0, body.model.unknowns)), *blocks], format="csr")
        )

    def parted(self, observed: FloatArray) -> Observed:
        """Split ``observed`` (sum of counts, c) by kind."""
        parts = np.split(observed, np.cumsum(self.counts)[:-1]) if self.counts else []

        def taken(count: int) -> list[FloatArray]:
            some, parts[:] = parts[:count], parts[count:]
            return some

        gaps = dict(zip((p.name for p in self.pairings), taken(len(self.pairings)), strict=True))
        slips = dict(zip((p.name for p in self.frictional), taken(len(self.frictional)), strict=True))
        held = dict(zip(self.held, taken(len(self.held)), strict=True))
        probes = taken(len(self.scene.probes))
        return Observed(
            gaps, slips, held, probes, dict(zip(self.sprung, taken(len(self.sprung)), strict=True))
        )


def _rows_of(pairing: Pairing) -> int:
    """Number of rows of a contact's gaps, or of its samples and watched nodes."""
    if pairing.grid is None:
        return len(pairing.position)
    return 2 * pairing.grid.count + int((~pairing.candidate).sum())


def observe(
    observation: ResponseFunctionals, sources: Mapping[str, sparse.csc_array], drivers: Drivers, memo: Memo
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Functionals (sum of counts, total) of the bodies' responses to their ``sources`` (r, total) and
    motions; without contact also the responses (n, total) themselves."""
    columns, means = drivers.columns, drivers.means
    scene, quick = observation.scene, bool(observation.pairings)
    observed = np.zeros((sum(observation.counts), columns.total))
    solutions = {}
    # Memory peaks while the last factor is built, so the smallest body comes last.
    for name, body in sorted(scene.bodies.items(), key=lambda item: -item[1].model.unknowns):
        rows = observation.rows(name)
        observed[observation.of_stress, : columns.loads] -= _expansion(observation, name)
        used = used_columns(sources[name])
        solved = np.zeros((rows.shape[1], 0 if quick else columns.total))
        # Loads separately: when their magnitudes change, the other responses remain valid. Loads, motions and
        # mean tractions are few and solved for accurately, as patch tests depend on them.
        acting, mean = used < columns.loads, np.isin(used, means)
        moving = (used < columns.motion_places.stop) & ~acting | mean
        for chosen, mixed in ((acting, False), (moving, False), (~acting & ~moving, quick)):
            some = used[chosen]
            response = _observed_response(body, sources[name][:, some], rows, mixed, memo)
            observed[:, some] += response["observed"]
            if not quick:
                solved[:, some] = response["solution"]
        if not quick:
            solutions[name] = solved
        observed[:, columns.motion_places] += rows @ scene.floating_patterns(name)
    return observed, solutions


def _expansion(observation: ResponseFunctionals, name: str) -> FloatArray:
    """Free-expansion part of the reactions of held surfaces (3 per surface, L) of one body."""
    scene = observation.scene
    found = np.zeros((len(observation.held), 3, len(scene.loads)))
    for heating in scene.heated(name):
        for place, (owner, surface) in enumerate(observation.held):
            if owner == name:
                center = scene.center(owner, surface)
                found[place, :, heating.number] += heating.reaction(scene.bodies[name], surface, center)
    return found.reshape(-1, len(scene.loads))


def used_columns(source: sparse.csc_array) -> IntArray:
    """Indices of the columns with entries."""
    return np.flatnonzero(np.diff(source.indptr))


def _observed_response(
    body: ElasticBody, sources: sparse.csc_array, rows: sparse.csr_array, quick: bool, memo: Memo
) -> Arrays:
    """Functionals ``rows`` (o, n) of the responses to ``sources`` (r, c): (o, c); unless ``quick`` (accuracy
    for functionals only) also the responses (n, c)."""

    def solve() -> Arrays:
        if quick:
            return {"observed": body.system.functionals(rows, sources), "solution": np.zeros((0, 0))}
        solution = body.system.solve(sources)
        return {"observed": np.asarray(rows @ solution), "solution": solution}

    if not sources.shape[1]:
        return {"observed": np.zeros((rows.shape[0], 0)), "solution": np.zeros((rows.shape[1], 0))}
    return memo.value("answers", digest(body.equations.content, sources, rows, quick), solve)
