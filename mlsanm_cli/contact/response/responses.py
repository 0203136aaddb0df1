"""Responses of the bodies to their drivers, seen by all functionals needed or reported for a scene: motions
of contacts' samples and gaps watched beyond them, reactions of held surfaces, probes, forces of springs.

Each body is factorised once, and only the functionals of its solutions are computed. Both are skipped if the
memo holds the functionals already.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.geometry.surface_response import SurfaceResponse
from mlsanm_cli.contact.response.basis import Drivers, spans
from mlsanm_cli.contact.response.nodal import relative_rows
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.corner import Forces
from mlsanm_cli.mechanics.near_field import as_complex, by_component
from mlsanm_cli.mechanics.remainder import reaction_of, spring_pull_of
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.memo import NO_CACHE, Arrays, Memo
from mlsanm_cli.operators.stencil_weights import nodal_rows
from mlsanm_cli.records import dataclass

Functional: TypeAlias = tuple[str, Any]
"""Kind and subject: "contact" with its name, "held" and "spring" with body and surface, "probe" with its
name."""


@dataclass(frozen=True)
class BodyResponses:
    """Responses of a scene's bodies to their ``sources`` (r, drivers): ``observed`` (rows, drivers) by the
    functionals at ``places`` of the rows, and without contact the ``solutions`` (n, drivers)."""

    scene: Scene
    drivers: Drivers
    places: Mapping[Functional, slice]
    sources: Mapping[str, sparse.csc_array]
    observed: FloatArray
    solutions: Mapping[str, FloatArray]

    @classmethod
    def of(cls, scene: Scene, pairings: tuple[Pairing, ...], memo: Memo = NO_CACHE) -> BodyResponses:
        """Compute the responses, near fields included; once for all positive friction coefficients."""

        def made() -> BodyResponses:
            drivers = Drivers(len(scene.loads), len(scene.unknown_motions), pairings)
            bodies, counts = scene.bodies.items(), dict[Functional, int]()
            for pairing in drivers.pairings:
                watched = len(pairing.position) - pairing.count
                counts["contact", pairing.name] = drivers.bases[pairing.name].samples + watched
            counts |= {("held", (name, surface)): 3 for name, body in bodies for surface in body.restrained}
            for probe in scene.probes:
                # Displacement and stress.
                counts["probe", probe.name] = 2 + len(scene.bodies[probe.body].model.material.stiffness)
            counts |= {
                ("spring", (name, surface)): 3 for name, body in bodies for surface in body.soft_springs
            }
            places = spans(counts, counts.values())
            sources = {name: _sources(scene, name, drivers) for name in scene.bodies}
            observed, solutions = _observe(scene, drivers, places, sources, memo)
            observed += _near_fields(scene, drivers, places, len(observed))
            return cls(scene, drivers, places, sources, observed, solutions)

        return memo.value("responses", (scene, without_coefficients(pairings)), made)

    def widened(self, loads: int) -> BodyResponses:
        """The responses with all functionals as further drivers after the ``loads``."""
        count, place = len(self.observed), [loads] * len(self.observed)
        observed = np.insert(self.observed, place, np.eye(count), axis=1)
        solutions = {name: np.insert(one, place, 0.0, axis=1) for name, one in self.solutions.items()}
        sources = {}
        for name, one in self.sources.items():
            nothing = sparse.csc_array((one.shape[0], count))
            sources[name] = sparse.csc_array(sparse.hstack([one[:, :loads], nothing, one[:, loads:]]))
        drivers = replace(self.drivers, loads=loads + count)
        return replace(self, drivers=drivers, observed=observed, solutions=solutions, sources=sources)

    def smooth(self, pairing: Pairing) -> FloatArray:
        """Smooth part of the response (2k, 2k) of a contact's samples to forces there."""
        seen = self.observed[self.places["contact", pairing.name]]
        return seen[: 2 * pairing.grid.count, self.drivers.of_samples(pairing)]


def without_coefficients(pairings: tuple[Pairing, ...]) -> list[Pairing]:
    """The pairings without values of friction coefficients."""
    return [one if one.bonded else replace(one, friction=float(one.friction > 0.0)) for one in pairings]


def used_columns(source: sparse.csc_array) -> IntArray:
    """Indices of the columns with entries."""
    return np.flatnonzero(np.diff(source.indptr))


def functional_rows(
    scene: Scene, drivers: Drivers, places: Mapping[Functional, slice], name: str
) -> sparse.csr_array:
    """All functionals (rows, n) of the unknowns of one body."""
    body, found = scene.bodies[name], dict[Functional, sparse.csr_array]()
    for pairing in drivers.pairings:
        beyond = relative_rows(body, name, pairing, pairing.normal, np.flatnonzero(~pairing.candidate))
        seen = drivers.bases[pairing.name].rows(body, name)
        found["contact", pairing.name] = sparse.vstack([seen, beyond])
    for surface in body.restrained:
        found["held", (name, surface)] = body.reaction_rows(surface, scene.center(name, surface))
    for probe in scene.probes:
        if probe.body == name:
            found["probe", probe.name] = body.model.probe_rows(probe.point)
    nodes = len(body.model.cloud.points)
    for surface, springs in body.soft_springs.items():
        # Force x, y and moment about the origin of the springs on their body.
        index, total = body.model.cloud.surfaces[surface].index, sparse.csr_array((3, 2 * nodes))
        for component, spring in enumerate(springs):
            along = body.resultants()[:, body.condition_rows(surface, component)]
            total = total - spring * (along @ nodal_rows(index, component, nodes))
        found["spring", (name, surface)] = total
    blocks = [
        found.get(key, sparse.csr_array((place.stop - place.start, body.model.unknowns)))
        for key, place in places.items()
    ]
    nothing = sparse.csr_array((0, body.model.unknowns))
    return sparse.csr_array(sparse.vstack([nothing, *blocks], format="csr"))


def _sources(scene: Scene, name: str, drivers: Drivers) -> sparse.csc_array:
    """All right-hand sides (rows, drivers) of one body; columns that do not act on it are empty."""
    body = scene.bodies[name]
    cloud = body.model.cloud
    few = np.zeros((body.rows, drivers.loads + drivers.motions))
    acting: list[Any] = [*scene.surface_loads, *scene.body_forces, *scene.heatings]
    for load in acting:
        if load.body == name:
            few[:, load.number] += load.source(body)
    for platen, motion, by in scene.motions:
        for surface in platen.surfaces_of(name):
            pattern = motion.pattern(cloud.points[cloud.surfaces[surface].index], platen.center)
            few += np.outer(body.source(surface, pattern, held=True), by)
    centred = any(name in motion for motion in scene.held_motions)
    by_contacts = [basis.sources(body, name, centred) for basis in drivers.bases.values()]
    return sparse.csc_array(sparse.hstack([sparse.csc_array(few), *by_contacts], format="csc"))


def _observe(
    scene: Scene,
    drivers: Drivers,
    places: Mapping[Functional, slice],
    sources: Mapping[str, sparse.csc_array],
    memo: Memo,
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Functionals (rows, drivers) of the bodies' responses to their ``sources`` (r, drivers) and motions;
    without contact also the responses (n, drivers) themselves."""
    motions, quick = slice(drivers.loads, drivers.loads + drivers.motions), bool(drivers.pairings)
    observed = np.zeros((max((place.stop for place in places.values()), default=0), drivers.total))
    solutions = {}
    # Memory peaks while the last factor is built, so the smallest body comes last.
    for name, body in sorted(scene.bodies.items(), key=lambda item: -item[1].model.unknowns):
        rows = functional_rows(scene, drivers, places, name)
        # Reactions are computed from stresses, of which free expansion has none.
        for heating in scene.heated(name):
            for surface in body.restrained:
                expansion = heating.reaction(body, surface, scene.center(name, surface))
                observed[places["held", (name, surface)], heating.number] -= expansion
        used = used_columns(sources[name])
        solved = np.zeros((rows.shape[1], 0 if quick else drivers.total))
        # Loads separately: when their magnitudes change, the other responses remain valid. Loads, motions and
        # mean tractions are few and solved for accurately, as patch tests depend on them.
        acting = used < motions.start
        moving = (used < motions.stop) & ~acting | np.isin(used, drivers.means)
        for chosen, mixed in ((acting, False), (moving, False), (~acting & ~moving, quick)):
            some = used[chosen]
            if len(some):
                response = _solved(body, sources[name][:, some], rows, mixed, memo)
                observed[:, some] += response["observed"]
                if not quick:
                    solved[:, some] = response["solution"]
        if not quick:
            solutions[name] = solved
        observed[:, motions] += rows @ scene.floating_patterns(name)
    return observed, solutions


def _solved(
    body: ElasticBody, sources: sparse.csc_array, rows: sparse.csr_array, quick: bool, memo: Memo
) -> Arrays:
    """Functionals ``rows`` (o, n) of the responses to ``sources`` (r, c): (o, c); unless ``quick`` (accuracy
    for functionals only) also the responses (n, c)."""

    def solve() -> Arrays:
        if quick:
            return {"observed": body.system.functionals(rows, sources), "solution": np.zeros((0, 0))}
        solution = body.system.solve(sources)
        return {"observed": np.asarray(rows @ solution), "solution": solution}

    return memo.value("answers", (body.equations.content, sources, rows, quick), solve)


def _near_fields(scene: Scene, drivers: Drivers, places: Mapping[Functional, slice], rows: int) -> FloatArray:
    """Near-field part of all functionals (rows, drivers), except singular parts and probes."""
    total = np.zeros((rows, drivers.total))
    for pairing in drivers.on_grids:
        columns = drivers.of_samples(pairing)
        for body, slave, sign in pairing.sides:
            elastic = scene.bodies[body]
            forces = SurfaceResponse.of(pairing.grid, elastic.model.kernel, slave).forces
            seen: dict[Functional, FloatArray] = {
                ("contact", one.name): _on_contact(scene, one, pairing, body, forces, slave)
                for one in drivers.pairings
                if body in one.bodies
            }
            for surface in elastic.restrained:
                reaction = reaction_of(elastic, surface, scene.center(body, surface), forces)
                seen["held", (body, surface)] = reaction
            for surface in elastic.soft_springs:
                seen["spring", (body, surface)] = spring_pull_of(elastic, surface, forces)
            for key, values in seen.items():
                total[places[key], columns] += sign * values
    return total


def _on_contact(
    scene: Scene, seen: Pairing, by: Pairing, body: str, forces: Forces, slave: bool
) -> FloatArray:
    """Motions of the samples of the contact ``seen``, and of points watched beyond, due to forces at the
    samples of contact ``by``, perhaps the same one, through the near field in one body."""
    found, kernel = list[FloatArray](), scene.bodies[body].model.kernel
    ways = [(seen.normal, ~seen.candidate)]
    if seen.nodal:
        along = (seen.normal, seen.tangent) if seen.friction else (seen.normal,)
        ways = [*((way, seen.candidate) for way in along), *ways]
    else:
        total = np.zeros((2 * seen.grid.count, 2 * len(forces.place)))
        for is_slave, sign in seen.sides_of(body):
            if seen.name == by.name and is_slave == slave:
                moved = SurfaceResponse.of(seen.grid, kernel, slave).smooth()
            else:
                moved = forces.displacement(seen.grid.facing.side(seen.grid.samples, is_slave)[0])
            total += sign * by_component(moved)
        found.append(total)
    for direction, chosen in ways:
        total = np.zeros((int(chosen.sum()), 2 * len(forces.place)))
        for is_slave, sign in seen.sides_of(body):
            moved = forces.displacement(as_complex((seen.points if is_slave else seen.partner)[chosen]))
            total += sign * np.einsum("ec,ekcd->edk", direction[chosen], moved).reshape(total.shape)
        found.append(total)
    return np.concatenate(found)
