"""How far an increment of bodies in contact may go: limits of slips and motions."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.finite.exact import FiniteContactState
from mlsanm_cli.contact.finite.pair import RigidContact
from mlsanm_cli.contact.geometry.obstacles import Round
from mlsanm_cli.roundoff import COARSE_ROUND_OFF
from mlsanm_cli.solve.condensed_scene import factors_at

MAX_SLIP = 0.2
"""Largest slip in an increment with friction, relative to the width of the contact, unless all nodes slide in
the same direction before and after it, which has no history."""
MAX_WORK_CHANGE = 0.2
"""Largest difference of the dissipated work by pressures at the end of an increment and by mean ones, whose
error is of second order, relative to the work up to the end of the stage at the present rate."""
MAX_APPROACH = 0.5
"""Largest motion of a node towards a possible partner in an increment: its gap plus this part of the thinner
body or disk, so that contact is not missed. No body moves further than this part of the smallest."""


def excess(
    scene: FiniteScene,
    now: FiniteContactState,
    found: FiniteContactState,
    position: float,
    reached: float,
    work: FloatArray | None,
) -> float:
    """Slips, work and motions in an increment from ``now`` at a ``position`` to the state ``found`` over
    their limits: the largest ratio. ``work`` (c,) is that dissipated before, None if it does not matter."""
    ratios = [0.0]
    for contact, here, _ in scene.contacts.each:
        closed = found.sets.closed[here] | now.sets.closed[here]
        if contact.friction and closed.any() and not slides(now, found, here):
            width = float(contact.slave.weight[closed].sum())
            ratios.append(float(np.abs(found.slip[here][closed]).max()) / (MAX_SLIP * width))
    if work is not None:
        weight, part = scene.contacts.weight, (reached - position) / (int(position) + 1.0 - position)
        pressures = found.pressure, 0.5 * (found.pressure + now.pressure)
        last, mean = (dissipated(scene, now, found, one) for one in pressures)
        ahead = float(weight @ (work + mean / part))
        change = float(weight @ np.abs(last - mean))
        ratios.append(change / (MAX_WORK_CHANGE * ahead) if ahead > 0.0 else 0.0)
    sizes = {name: np.ptp(body.elastic.model.cloud.points, axis=0) for name, body in scene.bodies.items()}
    moved = np.abs(found.displacement - now.displacement).max()
    ratios.append(float(moved / (MAX_APPROACH * min(size.max() for size in sizes.values()))))
    before, after = (
        np.append(factors_at(scene.stages, at), one.free) for at, one in ((position, now), (reached, found))
    )
    for contact, here, own in scene.contacts.each:
        place = now.place[here]
        then = contact.apart(now.surface[own].reshape(-1, 2), before, place)
        way = np.hypot(*(contact.apart(found.surface[own].reshape(-1, 2), after, place) - then).T)
        thin = min(sizes[side.body].min() for side in contact.sides)
        gap = np.minimum(now.gap[here], sizes[contact.slave.body].max())
        if isinstance(contact, RigidContact) and isinstance(contact.shape, Round):
            thin = min(thin, contact.shape.radius)
        ratios.append(float((way / (np.maximum(gap, 0.0) + MAX_APPROACH * thin)).max()))
    return max(ratios)


def dissipated(
    scene: FiniteScene, now: FiniteContactState, found: FiniteContactState, pressure: FloatArray
) -> FloatArray:
    """Work (c,) per length that friction dissipates in an increment under ``pressure`` (c,): nodes slip at
    the limit of friction only, whatever they carried before. Those that enter or leave the contact count with
    the slip of the increment under half of the pressure that they have in it."""
    closed = found.sets.closed | now.sets.closed
    way = np.abs(np.where(found.sets.stuck, found.slip, found.dragged))
    return np.asarray(np.where(closed, scene.contacts.friction * pressure * way, 0.0))


def slides(now: FiniteContactState, found: FiniteContactState, here: slice) -> bool:
    """Whether all closed nodes of a contact slide in one direction before and after the increment."""
    senses, least = [], COARSE_ROUND_OFF * float(found.pressure[here].max())
    for state in (now, found):
        # Nodes without pressure have no history of friction.
        closed, sense, sets = state.pressure[here] > least, state.sets.slip_sign[here], state.sets
        slips = sets.closed[here] & ~sets.stuck[here]
        senses += np.where(slips[closed], sense[closed], 0.0).tolist()
    return len(set(senses)) == 1 and senses[0] != 0.0
