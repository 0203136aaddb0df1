"""Static condensation: the bodies' responses to their drivers, reduced to the functionals of
:class:`Condensed`.

Each body is factorised once, and only the functionals of its solutions are computed. Both are skipped if the
memo holds the functionals already.

Equation (11) of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.response.balance import (
    CondensedForces,
    balance_of_constraints,
    body_imbalance,
    body_sums,
    holding_forces,
    moments_of_plates,
    reported_forces,
)
from mlsanm_cli.contact.response.bonds import bind
from mlsanm_cli.contact.response.compressed import COMPRESSED_CONTACT, COMPRESSED_TOTAL
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.drivers import Drivers, of_fits, of_obstacles
from mlsanm_cli.contact.response.eigenstress import Eigenstresses, flowing, narrowed, widened
from mlsanm_cli.contact.response.linear_map import LinearMap, stack
from mlsanm_cli.contact.response.load_vectors import body_load_vectors
from mlsanm_cli.contact.response.near_field_response import add_fields, near_field_response, with_singular
from mlsanm_cli.contact.response.observation import ResponseFunctionals, observe, used_columns
from mlsanm_cli.contact.response.short_waves import correct_short_waves
from mlsanm_cli.contact.response.walls import wall_forces
from mlsanm_cli.mechanics.probes import Probe, stress_of_expansion
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.memo import NO_CACHE, Memo, digest
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF


@dataclass(frozen=True)
class BodyResponses:
    """Responses of a scene's bodies to their ``sources`` (r, drivers): ``observed`` (rows, drivers) by the
    functionals ``observation``, and without contact the ``solutions`` (n, drivers). Of contact grids only the
    samples matter."""

    observation: ResponseFunctionals
    sources: Mapping[str, sparse.csc_array]
    observed: FloatArray
    solutions: Mapping[str, FloatArray]

    @classmethod
    def of(cls, scene: Scene, pairings: tuple[Pairing, ...], memo: Memo = NO_CACHE) -> BodyResponses:
        """Compute the responses, near fields included; once for all positive friction coefficients, as in
        :func:`condense`."""

        def made() -> BodyResponses:
            observation, drivers = ResponseFunctionals(scene, pairings), _drivers(scene, pairings)
            columns = drivers.columns
            sources = {name: body_load_vectors(scene, name, pairings, columns) for name in scene.bodies}
            observed, solutions = observe(observation, sources, drivers, memo)
            if any(pairing.grid is not None for pairing in pairings):
                observed += near_field_response(observation, drivers)
            return cls(observation, sources, observed, solutions)

        return memo.value("responses", digest(scene, _without_coefficients(pairings)), made)

    def widened(self, loads: int) -> BodyResponses:
        """The responses with all functionals as further drivers after the ``loads``."""
        count, place = self.observation.count, [loads] * self.observation.count
        observed = np.insert(self.observed, place, np.eye(count), axis=1)
        solutions = {name: np.insert(one, place, 0.0, axis=1) for name, one in self.solutions.items()}
        sources = {}
        for name, one in self.sources.items():
            nothing = sparse.csc_array((one.shape[0], count))
            sources[name] = sparse.csc_array(sparse.hstack([one[:, :loads], nothing, one[:, loads:]]))
        return replace(self, observed=observed, solutions=solutions, sources=sources)

    def smooth(self, pairing: Pairing) -> FloatArray:
        """Smooth part of the response (2k, 2k) of a contact's samples to forces there."""
        grid, drivers = pairing.grid, _drivers(self.observation.scene, self.observation.pairings)
        assert grid is not None
        seen = self.observed[self.observation.places["gap", pairing.name]]
        return seen[: 2 * grid.count, drivers.of_samples(pairing)]


def condense(
    scene: Scene, pairings: tuple[Pairing, ...], memo: Memo = NO_CACHE, responses: BodyResponses | None = None
) -> Condensed:
    """Condense the scene on the candidates of ``pairings``, with known ``responses`` of the bodies if given.
    Positive friction coefficients enter none of the matrices, so that all share what is stored."""
    content = digest(scene, _without_coefficients(pairings))

    def made() -> Condensed:
        known = responses or BodyResponses.of(scene, pairings, memo)
        if not flowing(scene):
            return _condensed(scene, pairings, content, known)
        loads, more = len(scene.loads), known.observation.count
        wide = _condensed(widened(scene, more), pairings, content, known.widened(loads))
        eigen = Eigenstresses.of(known.observation, wide)
        return replace(narrowed(wide, loads), eigen=eigen)

    kept = memo.value("condensed", content, made)
    drivers, loose = replace(kept.drivers, pairings=pairings), _with_law(pairings)
    return replace(kept, pairings=loose, drivers=drivers, friction=_friction(loose))


def _with_law(pairings: tuple[Pairing, ...]) -> tuple[Pairing, ...]:
    """The contacts with a contact law."""
    return tuple(pairing for pairing in pairings if not pairing.bonded)


def _without_coefficients(pairings: tuple[Pairing, ...]) -> list[Pairing]:
    """The pairings without values of friction coefficients."""
    return [
        pairing if pairing.bonded else replace(pairing, friction=float(pairing.friction > 0.0))
        for pairing in pairings
    ]


def _drivers(scene: Scene, pairings: tuple[Pairing, ...]) -> Drivers:
    return Drivers(len(scene.loads), len(scene.unknown_motions), pairings)


def _condensed(
    scene: Scene, pairings: tuple[Pairing, ...], content: str, responses: BodyResponses
) -> Condensed:
    drivers, sources = _drivers(scene, pairings), responses.sources
    seen = {key: responses.observed[own] for key, own in responses.observation.places.items()}
    nodal = tuple(pairing for pairing in pairings if pairing.grid is None)
    candidate = _candidates(pairings)
    many = _many(pairings)
    gaps = [_gaps(scene, drivers, pairing, seen["gap", pairing.name], many) for pairing in pairings]
    gap = _shifted(stack(gaps, drivers.unknowns), of_obstacles(scene, pairings, drivers.unknowns, "normal"))
    gap = replace(gap, load=gap.load + of_fits(scene, pairings, drivers.unknowns))
    weight, around = (
        np.concatenate(
            [[], *(values[pairing.candidate] for values, pairing in zip(each, pairings, strict=True))]
        )
        for each in ([one.weight for one in pairings], [one.around for one in pairings])
    )
    forces = CondensedForces(
        scene,
        drivers,
        sources,
        wall_forces(scene, drivers, {key: rows for (kind, key), rows in seen.items() if kind == "held"}),
        {where: drivers.by_unknowns(rows) for (kind, where), rows in seen.items() if kind == "spring"},
    )
    half_plane = np.concatenate([np.zeros((0, 2, 2)), *(_half_plane(scene, one) for one in pairings)])
    gap, watched = gap.take(candidate), gap.take(~candidate)
    slips = [
        _moved(scene, drivers, one, seen["slip" if one.grid is None else "gap", one.name], 1)
        for one in drivers.frictional
    ]
    moved = of_obstacles(scene, drivers.frictional, drivers.unknowns, "tangent")
    slip = _shifted(stack(slips, drivers.unknowns), moved)
    slip = slip.take(_candidates(drivers.frictional))
    gap, slip = _without_tractions(scene, gap, slip, drivers)
    frictional = tuple(pairing for pairing in nodal if pairing.friction and not pairing.bonded)
    along = {pairing.name: _half_plane(scene, pairing)[:, 1, 1] for pairing in frictional}
    gap, slip, beyond = correct_short_waves(gap, slip, frictional, drivers.spans, drivers.tangential, along)
    bonds, loose = bind(scene, pairings, drivers, gap, slip), _drivers(scene, _with_law(pairings))
    reduced, free, sliding = bonds.reduced, ~_bonded_mask(drivers.pairings), ~_bonded_mask(drivers.frictional)
    unreduced = gap.take(free), slip.take(sliding), balance_of_constraints(forces)
    own_gap, own_slip, balance = map(reduced, unreduced)
    kept, looked_at = np.flatnonzero(np.concatenate([free, sliding])), ~_bonded_mask(pairings, watched=True)
    return Condensed(
        pairings=loose.pairings,
        spans=loose.spans,
        weight=weight[free],
        around=around[free],
        half_plane=half_plane[free],
        tangential=loose.tangential,
        friction_nodes=_numbers([loose.spans[pairing.name] for pairing in loose.frictional]),
        friction=_friction(loose.pairings),
        gap=own_gap,
        slip=own_slip,
        watched=reduced(watched.take(looked_at)),
        balance=balance,
        beyond=sparse.csr_array(beyond[kept][:, kept]) if bonds.pairings else beyond,
        forces={name: reduced(one) for name, one in reported_forces(forces).items()},
        contact_forces={
            pairing.name: reduced(forces.contact(pairing, pairing.slave_body).take(slice(0, 2)))
            for pairing in pairings
        },
        imbalance=reduced(body_imbalance(forces)),
        sums=reduced(body_sums(forces)),
        moments={name: reduced(one) for name, one in moments_of_plates(forces).items()},
        holding={where: reduced(one) for where, one in holding_forces(forces).items()},
        bonds=bonds,
        by_bonds=np.concatenate([bonds.acting(one) for one in unreduced]),
        sources=sources,
        solutions=responses.solutions,
        solves=sum(len(used_columns(source)) for source in sources.values()),
        content=content,
        probes={
            probe.name: reduced(_seen(scene, probe, drivers, seen["probe", probe.name]))
            for probe in scene.probes
        },
        drivers=drivers,
        mismatches={pairing.name: reduced(forces.mismatch(pairing)) for pairing in pairings},
    )


def _bonded_mask(pairings: tuple[Pairing, ...], watched: bool = False) -> BoolArray:
    """Mask of bonded contacts' candidates, or of their other paired points if ``watched``."""
    parts = [pairing.bonded & (pairing.candidate != watched) for pairing in pairings]
    counted = [part[pairing.candidate != watched] for part, pairing in zip(parts, pairings, strict=True)]
    return np.concatenate([np.zeros(0, dtype=bool), *counted])


def _without_tractions(
    scene: Scene, gap: LinearMap, slip: LinearMap, drivers: Drivers
) -> tuple[LinearMap, LinearMap]:
    """Gaps and slips without slips and tractions at planes of symmetry: such a traction has the only entry of
    its row and of its column."""
    still = np.concatenate([np.zeros(0, dtype=bool), *(_untracted(scene, one) for one in drivers.frictional)])
    if still.any():
        own = slip.traction[still, still].copy()
        for part in slip.parts:
            part[still] = 0.0
        gap.traction[:, still] = slip.traction[:, still] = 0.0
        slip.traction[still, still] = own
    return gap, slip


def _untracted(scene: Scene, pairing: Pairing) -> BoolArray:
    """Mask (m,) of a contact's candidates at planes of symmetry, unless its obstacle moves across them."""
    grid, none = pairing.grid, np.zeros(int(pairing.candidate.sum()), dtype=bool)
    if grid is None or not grid.mirrored:
        return none
    moves = [
        motion.direction
        for constraint, motion, by in scene.motions
        if not constraint.bodies and constraint.name == pairing.name and by.any()
    ]
    across = [np.array([-one.along.imag, one.along.real, 1.0]) for one in grid.mirrors if one is not None]
    symmetric = all((np.abs(one * way) <= ROUND_OFF).all() for one in across for way in moves)
    return grid.untracted if symmetric else none


def _many(pairings: tuple[Pairing, ...]) -> bool:
    """Whether compliances are compressed: for many unknowns, all of them pressures on grids."""
    counts = [int(pairing.candidate.sum()) for pairing in pairings]
    on_grids = all(one.grid is not None for one in pairings)
    many = max(counts, default=0) > COMPRESSED_CONTACT or sum(counts) > COMPRESSED_TOTAL
    return many and on_grids and not any(pairing.friction for pairing in pairings)


def _shifted(linear: LinearMap, by: tuple[FloatArray, FloatArray]) -> LinearMap:
    """Add terms of loads (r, L) and motions (r, k) to a map."""
    return replace(linear, load=linear.load + by[0], motion=linear.motion + by[1])


def _gaps(scene: Scene, drivers: Drivers, pairing: Pairing, seen: FloatArray, many: bool) -> LinearMap:
    """Gaps (w,) of a contact from their functionals ``seen``."""
    if many:
        result = drivers.compressed(_means(pairing, seen, 0), pairing.weight, pairing.gap)
        return with_singular(result, scene, drivers, pairing, 0)
    return replace(_moved(scene, drivers, pairing, seen, 0), constant=pairing.gap)


def _moved(scene: Scene, drivers: Drivers, pairing: Pairing, seen: FloatArray, which: int) -> LinearMap:
    """Changes of gaps (``which`` 0), or slips (1), of a contact (w,) from the functionals ``seen``."""
    result = drivers.by_unknowns(seen)
    if pairing.grid is None:
        return result
    means = LinearMap(*(_means(pairing, part, which) for part in result.parts))
    return with_singular(means, scene, drivers, pairing, which)


def _means(pairing: Pairing, seen: FloatArray, which: int) -> FloatArray:
    """Gaps, or slips, of a contact with a grid and of the nodes watched beyond it (w, ...)."""
    assert pairing.grid is not None
    means = pairing.grid.means[which]
    return np.concatenate([means @ seen[: means.shape[1]], seen[means.shape[1] :]])


def _seen(scene: Scene, probe: Probe, drivers: Drivers, rows: FloatArray) -> LinearMap:
    """Displacement and stress of a probe, without thermal stress from free expansion."""
    free = stress_of_expansion(scene.bodies[probe.body].model.material)
    rows = rows.copy()
    for heating in scene.heated(probe.body):
        rows[-len(free) :, heating.number] -= free * heating.field.at(probe.point)
    result = drivers.by_unknowns(rows)
    add_fields(result, drivers, scene, probe)
    return result


def _half_plane(scene: Scene, pairing: Pairing) -> FloatArray:
    """1/E* (m, 2, 2) of a contact's bodies at its candidates along normal and tangent; obstacles are
    rigid."""
    axes = pairing.normal[pairing.candidate], pairing.tangent[pairing.candidate]
    materials = [scene.bodies[body].model.material for body in pairing.bodies]
    rows = [[sum(one.contact_compliance(along, by) for one in materials) for by in axes] for along in axes]
    return np.moveaxis(np.array(rows), -1, 0)


def _friction(pairings: tuple[Pairing, ...]) -> FloatArray:
    """Friction coefficients (n,) of the frictional contacts."""
    return np.concatenate(
        [[], *(np.full(int(p.candidate.sum()), p.friction) for p in pairings if p.friction)]
    )


def _candidates(pairings: tuple[Pairing, ...]) -> BoolArray:
    return np.concatenate([np.zeros(0, dtype=bool), *(pairing.candidate for pairing in pairings)])


def _numbers(spans: list[slice]) -> IntArray:
    return np.concatenate([np.zeros(0, dtype=np.int64), *(np.arange(s.start, s.stop) for s in spans)])
