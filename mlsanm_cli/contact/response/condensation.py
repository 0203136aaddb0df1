"""Static condensation: the bodies' responses to their drivers, reduced to the functionals of
:class:`Condensed`.

Equation (11) of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import AnyArray, FloatArray, IntArray
from mlsanm_cli.contact.geometry.clusters import Chain
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.geometry.surface_response import SurfaceResponse
from mlsanm_cli.contact.response.balance import ForceSums, wall_forces
from mlsanm_cli.contact.response.basis import Drivers, spans
from mlsanm_cli.contact.response.bonds import bind
from mlsanm_cli.contact.response.compressed import (
    COMPRESSED_CONTACT,
    COMPRESSED_TOTAL,
    Compressed,
    LinearMap,
    as_array,
    stack,
)
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.contact_fields import NearFields
from mlsanm_cli.contact.response.eigenstress import Eigenstresses, flowing, narrowed, widened
from mlsanm_cli.contact.response.nodal import correct_short_waves
from mlsanm_cli.contact.response.responses import BodyResponses, used_columns, without_coefficients
from mlsanm_cli.mechanics.near_field import as_complex
from mlsanm_cli.mechanics.scene import Probe, Scene
from mlsanm_cli.memo import NO_CACHE, Memo, digest
from mlsanm_cli.roundoff import ROUND_OFF


def condense(
    scene: Scene, pairings: tuple[Pairing, ...], memo: Memo = NO_CACHE, responses: BodyResponses | None = None
) -> Condensed:
    """Condense the scene on the candidates of ``pairings``, with known ``responses`` of the bodies if given.
    Positive friction coefficients enter none of the matrices, so that all share what is stored."""
    content = digest(scene, without_coefficients(pairings))

    def made() -> Condensed:
        known = responses or BodyResponses.of(scene, pairings, memo)
        known = replace(known, drivers=replace(known.drivers, pairings=pairings))
        if not flowing(scene):
            return _condensed(scene, content, known)
        loads = len(scene.loads)
        wide = _condensed(widened(scene, len(known.observed)), content, known.widened(loads))
        return replace(narrowed(wide, loads), eigen=Eigenstresses.of(known, wide))

    kept = memo.value("condensed", content, made)
    loose = tuple(pairing for pairing in pairings if not pairing.bonded)
    drivers = replace(kept.drivers, pairings=pairings)
    return replace(kept, pairings=loose, drivers=drivers, friction=_friction(loose))


def _condensed(scene: Scene, content: str, responses: BodyResponses) -> Condensed:
    drivers, sources = responses.drivers, responses.sources
    pairings, counts = drivers.pairings, drivers.counts
    seen = {key: responses.observed[own] for key, own in responses.places.items()}
    rows = {
        one.name: np.split(seen["contact", one.name], [drivers.bases[one.name].samples]) for one in pairings
    }
    weight = _joined([one.weight[one.candidate] for one in pairings])
    means = {name: basis.means for name, basis in drivers.bases.items()}
    # Compliances are compressed for many unknowns, all of them pressures on grids.
    most = max((one.count for one in pairings), default=0)
    many = most > COMPRESSED_CONTACT or counts[2] > COMPRESSED_TOTAL
    if many and not any(one.nodal or one.friction for one in pairings):
        smooth = np.concatenate([means[name](0) @ samples for name, (samples, _) in rows.items()])
        gap, slip = _compressed_gap(scene, drivers, smooth, weight), LinearMap.zeros(0, counts)
    else:
        moved = {one.name: drivers.by_unknowns(rows[one.name][0]) for one in pairings}
        gap = stack([moved[one.name].combined(means[one.name](0)) for one in pairings], counts)
        slip = stack([moved[one.name].combined(means[one.name](1)) for one in drivers.frictional], counts)
        for pairing in pairings:
            _add_singular(gap, scene, drivers, pairing, 0)
        for pairing in drivers.frictional:
            _add_singular(slip, scene, drivers, pairing, 1)
    watched = stack([drivers.by_unknowns(rows[one.name][1]) for one in pairings], counts)
    places = spans(rows, [len(beyond) for _, beyond in rows.values()])
    for pairing in pairings:
        own, chosen = drivers.spans[pairing.name], pairing.candidate
        for linear, span, points in ((gap, own, chosen), (watched, places[pairing.name], ~chosen)):
            _add_obstacle(linear, span, scene, pairing, pairing.normal[points])
            if pairing.interference:
                linear.load[span, scene.loads.index(pairing.name)] -= pairing.interference
        if pairing.friction:
            _add_obstacle(slip, drivers.tangential[pairing.name], scene, pairing, pairing.tangent[chosen])
    gap = gap.shifted(_joined([one.gap[one.candidate] for one in pairings]))
    watched = watched.shifted(_joined([one.gap[~one.candidate] for one in pairings]))
    half_planes = dict[str, FloatArray]()
    for pairing in pairings:
        # 1/E* (m, 2, 2) along normal and tangent; obstacles are rigid.
        axes = pairing.normal[pairing.candidate], pairing.tangent[pairing.candidate]
        materials = [scene.bodies[body].model.material for body in pairing.bodies]
        table = [[sum(one.contact_compliance(a, b) for one in materials) for b in axes] for a in axes]
        half_planes[pairing.name] = np.moveaxis(np.array(table), -1, 0)
    _without_tractions(scene, gap, slip, drivers)
    gap, slip, beyond = correct_short_waves(gap, slip, drivers, half_planes)
    forces = ForceSums(
        scene,
        drivers,
        sources,
        wall_forces(scene, drivers, {key: rows for (kind, key), rows in seen.items() if kind == "held"}),
        {where: drivers.by_unknowns(rows) for (kind, where), rows in seen.items() if kind == "spring"},
    )
    balance, bonds = forces.balance(), bind(scene, drivers, gap, slip)
    loose = replace(drivers, pairings=tuple(one for one in pairings if not one.bonded))
    if bonds.pairings:
        free = _numbers([drivers.spans[one.name] for one in loose.pairings])
        sliding = _numbers([drivers.tangential[one.name] for one in loose.frictional])
        kept = np.append(free, len(gap.constant) + sliding)
        gap, slip, beyond = gap.take(free), slip.take(sliding), sparse.csr_array(beyond[kept][:, kept])
        watched = watched.take(_numbers([places[one.name] for one in loose.pairings]))
    effects = np.concatenate([bonds.acting(one) for one in (gap, slip, balance)])
    probes = {one.name: _seen_by_probe(scene, drivers, one, seen["probe", one.name]) for one in scene.probes}
    quantities = forces.quantities() | {"probe": probes}
    return Condensed(
        pairings=loose.pairings,
        spans=loose.spans,
        weight=_joined([one.weight[one.candidate] for one in loose.pairings]),
        around=_joined([one.around[one.candidate] for one in loose.pairings]),
        half_plane=np.concatenate([np.zeros((0, 2, 2)), *(half_planes[one.name] for one in loose.pairings)]),
        tangential=loose.tangential,
        friction_nodes=_numbers([loose.spans[pairing.name] for pairing in loose.frictional]),
        friction=_friction(loose.pairings),
        gap=bonds.reduced(gap),
        slip=bonds.reduced(slip),
        watched=bonds.reduced(watched),
        balance=bonds.reduced(balance),
        beyond=beyond,
        quantities={
            kind: {key: bonds.reduced(one) for key, one in each.items()} for kind, each in quantities.items()
        },
        bonds=replace(bonds, effects=effects),
        sources=sources,
        solutions=responses.solutions,
        solves=sum(len(used_columns(source)) for source in sources.values()),
        content=content,
        drivers=drivers,
    )


def _add_obstacle(
    linear: LinearMap, rows: slice, scene: Scene, pairing: Pairing, direction: FloatArray
) -> None:
    """Add the motions of a contact's obstacle against ``direction`` (r, 2) to gaps or slips."""
    for constraint, motion, by in scene.motions:
        if not constraint.bodies and constraint.name == pairing.name:
            change = np.outer(direction @ motion.direction[:2], by)
            by_loads, by_motions = np.split(change, [linear.load.shape[1]], axis=1)
            linear.load[rows] -= by_loads
            linear.motion[rows] -= by_motions


def _singular(scene: Scene, pairing: Pairing) -> tuple[list[SurfaceResponse], FloatArray, FloatArray]:
    """The responses of a contact's bodies, and their tensors L and T (2, 2) summed."""
    kernels = [(scene.bodies[body].model.kernel, slave) for body, slave, _ in pairing.sides]
    responses, log, turn = [SurfaceResponse.of(pairing.grid, *each) for each in kernels], *np.zeros((2, 2, 2))
    for response in responses:
        log, turn = log + response.tensors[0], turn + response.tensors[1]
    return responses, log, turn


def _add_singular(linear: LinearMap, scene: Scene, drivers: Drivers, pairing: Pairing, which: int) -> None:
    """Add to a contact's gaps (``which`` 0) or slips (1) the singular part of the response to its own
    pressures and tractions: none of nodal ones."""
    if pairing.nodal:
        return
    grid, (responses, log, turn) = pairing.grid, _singular(scene, pairing)
    rows = (drivers.spans, drivers.tangential)[which][pairing.name]
    for other, part in enumerate(drivers.columns(linear, pairing.name)):
        total = grid.singular_integrals(log, turn, which, other)
        terms = (term for one in responses for term in one.corner_terms(which, other))
        for seen, compliance, acting in terms:
            total += seen @ compliance @ acting.T
        if grid.evened[other]:
            total = total @ grid.deviation(np.eye(len(total)), other)
        part[rows] += (1.0 / grid.hats.weight[:, None]) * total


def _compressed_gap(scene: Scene, drivers: Drivers, rows: FloatArray, weight: FloatArray) -> LinearMap:
    """Gaps (m,) of all contacts from their smooth functionals ``rows`` (m, drivers), with the singular parts;
    the compliance is compressed. Of frictionless contacts on grids, with the ``weight`` (m,) of hats."""
    first = drivers.loads + drivers.motions
    few = LinearMap.of_rows(rows[:, :first] @ drivers.matrix[:first], drivers.counts)
    right = drivers.matrix[first:, first:].toarray()
    total = Compressed.product(rows[:, first:].copy(), right, weight)
    for pairing in drivers.pairings:
        grid, (responses, log, turn) = pairing.grid, _singular(scene, pairing)
        near, far = grid.singular_chains(log, turn)
        cornered: list[Chain] = [
            (seen, compliance, sparse.csr_array(acting.T))
            for response in responses
            for seen, compliance, acting in response.corner_terms(0, 0)
        ]
        if grid.covers:
            even = np.ones(pairing.count)
            evenly = near @ even
            for chain in (*far, *cornered):
                evenly += reduce(lambda right, one: one @ right, reversed(chain), even)
            cornered.append((-evenly[:, None], grid.mean_weights[None]))
        total = total.plus(near, far, cornered, drivers.spans[pairing.name].start, grid.hats.place)
    return replace(few, pressure=as_array(total))


def _seen_by_probe(scene: Scene, drivers: Drivers, probe: Probe, rows: FloatArray) -> LinearMap:
    """Displacement and stress of a probe, near fields included and without thermal stress from free
    expansion, from its functionals ``rows`` (r, drivers)."""
    model, rows = scene.bodies[probe.body].model, rows.copy()
    free = model.material.stress_of_expansion
    for heating in scene.heated(probe.body):
        rows[-len(free) :, heating.number] -= free * heating.field.at(probe.point)
    linear = drivers.by_unknowns(rows)
    for pairing in drivers.on_grids:
        parts = drivers.columns(linear, pairing.name)
        unit, nothing = np.eye(pairing.count), np.zeros((pairing.count,) * 2)
        for slave, sign in pairing.sides_of(probe.body):
            fields = NearFields.at(pairing.grid, model.kernel, slave, as_complex(probe.point))
            for part, values in zip(parts, ((unit, nothing), (nothing, unit)), strict=False):
                part += sign * np.concatenate([field[0] for field in fields(*values)])
    return linear


def _without_tractions(scene: Scene, gap: LinearMap, slip: LinearMap, drivers: Drivers) -> None:
    """Remove slips and tractions at planes of symmetry, unless an obstacle moves across them, from gaps and
    slips: such a traction has the only entry of its row and of its column."""
    still = np.zeros(len(slip.constant), dtype=bool)
    for pairing in drivers.frictional:
        if pairing.nodal or not pairing.grid.mirrored:
            continue
        planes = [plane.along for plane in pairing.grid.mirrors if plane is not None]
        across = np.array([[-along.imag, along.real, 1.0] for along in planes])
        moved = any(
            (np.abs(across * motion.direction) > ROUND_OFF).any()
            for constraint, motion, by in scene.motions
            if not constraint.bodies and constraint.name == pairing.name and by.any()
        )
        still[drivers.tangential[pairing.name]] = pairing.grid.untracted & (not moved)
    if still.any():
        own = slip.traction[still, still].copy()
        for part in slip.parts:
            part[still] = 0.0
        gap.traction[:, still] = slip.traction[:, still] = 0.0
        slip.traction[still, still] = own


def _friction(pairings: tuple[Pairing, ...]) -> FloatArray:
    """Friction coefficients (n,) of the frictional contacts."""
    return _joined([np.full(one.count, one.friction) for one in pairings if one.friction])


def _joined(parts: Sequence[AnyArray]) -> AnyArray:
    """Concatenation of arrays, perhaps of none."""
    return np.concatenate([np.zeros(0), *parts])


def _numbers(spans: list[slice]) -> IntArray:
    return _joined([np.arange(span.start, span.stop) for span in spans]).astype(np.int64)
