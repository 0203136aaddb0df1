"""Static condensation: the bodies' responses to their drivers, reduced to the functionals of
:class:`Condensed`.

Equation (11) of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import AnyArray, FloatArray, IntArray
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.response.balance import ForceSums
from mlsanm_cli.contact.response.basis import Drivers, spans
from mlsanm_cli.contact.response.bonds import bind
from mlsanm_cli.contact.response.compressed import COMPRESSED_CONTACT, COMPRESSED_TOTAL
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.eigenstress import Eigenstresses, flowing, narrowed, widened
from mlsanm_cli.contact.response.linear_map import LinearMap, stack
from mlsanm_cli.contact.response.near_field_response import (
    add_singular,
    compressed_gap,
    seen_by_probe,
    wall_forces,
)
from mlsanm_cli.contact.response.nodal import correct_short_waves
from mlsanm_cli.contact.response.responses import BodyResponses, used_columns, without_coefficients
from mlsanm_cli.mechanics.scene import Scene
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
        gap, slip = compressed_gap(scene, drivers, smooth, weight), LinearMap.zeros(0, counts)
    else:
        moved = {one.name: drivers.by_unknowns(rows[one.name][0]) for one in pairings}
        gap = stack([moved[one.name].combined(means[one.name](0)) for one in pairings], counts)
        slip = stack([moved[one.name].combined(means[one.name](1)) for one in drivers.frictional], counts)
        for pairing in pairings:
            add_singular(gap, scene, drivers, pairing, 0)
        for pairing in drivers.frictional:
            add_singular(slip, scene, drivers, pairing, 1)
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
    probes = {one.name: seen_by_probe(scene, drivers, one, seen["probe", one.name]) for one in scene.probes}
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
