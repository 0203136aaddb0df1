"""Functionals of the bodies' responses to contact and loads."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.response.drivers import Drivers, spans
from mlsanm_cli.contact.response.functionals import relative_rows, sampled_rows, spring_rows
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.probes import probe_rows
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.memo import Arrays, Memo, digest
from mlsanm_cli.records import dataclass

Functional: TypeAlias = tuple[str, Any]
"""Kind and subject: "gap" and "slip" with a contact's name, "held" and "spring" with body and surface,
"probe" with its name."""


@dataclass(frozen=True)
class ResponseFunctionals:
    """All functionals needed or reported for the contact problem of a scene: gaps at nodes of the
    ``pairings``, or sampled motions of contact grids and gaps at nodes watched beyond them; slips of
    frictional contacts with nodal pressures; reactions of held surfaces; probes; forces of springs."""

    scene: Scene
    pairings: tuple[Pairing, ...]

    @property
    def frictional(self) -> tuple[Pairing, ...]:
        """The contacts with nodal pressures and friction."""
        return tuple(pairing for pairing in self.pairings if pairing.friction and pairing.grid is None)

    @cached_property
    def places(self) -> dict[Functional, slice]:
        """Range of rows of every functional."""
        counts: dict[Functional, int] = {}
        for pairing in self.pairings:
            beyond = 0 if pairing.grid is None else int((~pairing.candidate).sum())
            sampled = len(pairing.position) if pairing.grid is None else 2 * pairing.grid.count
            counts["gap", pairing.name] = sampled + beyond
        bodies = self.scene.bodies.items()
        counts |= {("slip", pairing.name): len(pairing.position) for pairing in self.frictional}
        counts |= {("held", (name, surface)): 3 for name, body in bodies for surface in body.restrained}
        for probe in self.scene.probes:
            # Displacement and stress.
            counts["probe", probe.name] = 2 + len(self.scene.bodies[probe.body].model.material.stiffness)
        counts |= {("spring", (name, surface)): 3 for name, body in bodies for surface in body.soft_springs}
        return spans(counts, counts.values())

    @property
    def count(self) -> int:
        """Number of all rows."""
        return max((place.stop for place in self.places.values()), default=0)

    def rows(self, name: str) -> sparse.csr_array:
        """All functionals (:attr:`count`, n) of the unknowns of one body."""
        scene, body = self.scene, self.scene.bodies[name]
        found: dict[Functional, sparse.csr_array] = {}
        for pairing in self.pairings:
            if pairing.grid is None:
                found["gap", pairing.name] = relative_rows(body, name, pairing, pairing.normal)
            else:
                watched = np.flatnonzero(~pairing.candidate)
                beyond = relative_rows(body, name, pairing, pairing.normal, watched)
                found["gap", pairing.name] = sparse.vstack([sampled_rows(body, name, pairing), beyond])
        for pairing in self.frictional:
            found["slip", pairing.name] = relative_rows(body, name, pairing, pairing.tangent)
        for surface in body.restrained:
            found["held", (name, surface)] = body.reaction_rows(surface, scene.center(name, surface))
        for probe in scene.probes:
            if probe.body == name:
                found["probe", probe.name] = probe_rows(body.model, probe.point)
        for surface in body.soft_springs:
            found["spring", (name, surface)] = spring_rows(body, surface)
        blocks = [
            found.get(key, sparse.csr_array((place.stop - place.start, body.model.unknowns)))
            for key, place in self.places.items()
        ]
        nothing = sparse.csr_array((0, body.model.unknowns))
        return sparse.csr_array(sparse.vstack([nothing, *blocks], format="csr"))


def observe(
    observation: ResponseFunctionals, sources: Mapping[str, sparse.csc_array], drivers: Drivers, memo: Memo
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Functionals (rows, total) of the bodies' responses to their ``sources`` (r, total) and
    motions; without contact also the responses (n, total) themselves."""
    columns, means = drivers.columns, drivers.means
    scene, quick = observation.scene, bool(observation.pairings)
    observed = np.zeros((observation.count, columns.total))
    solutions = {}
    # Memory peaks while the last factor is built, so the smallest body comes last.
    for name, body in sorted(scene.bodies.items(), key=lambda item: -item[1].model.unknowns):
        rows = observation.rows(name)
        # Reactions are computed from stresses, of which free expansion has none.
        for heating in scene.heated(name):
            for surface in body.restrained:
                expansion = heating.reaction(body, surface, scene.center(name, surface))
                observed[observation.places["held", (name, surface)], heating.number] -= expansion
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
