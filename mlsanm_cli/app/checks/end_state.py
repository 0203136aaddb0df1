"""Warnings of the last state of a run: pressures before any load or where a surface ends, large rotations."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mlsanm_cli.app.scene.contact_pairs import shape_of
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Contact
from mlsanm_cli.cloud.cloud import continuations
from mlsanm_cli.contact.geometry.obstacles import Chain
from mlsanm_cli.contact.geometry.profile import regular_peak
from mlsanm_cli.contact.laws.contact_status import STICK, ContactStatus
from mlsanm_cli.mechanics.scene import FloatingBody
from mlsanm_cli.roundoff import ROUND_OFF
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.direction_updates import moment_error, turned_by_loads, turns
from mlsanm_cli.solve.state import State

END_DISTANCE = 0.75
"""Distance from an end, in spacings, within which nodes belong to it."""
MIN_PRESSURE_SHARE = 0.2
"""Part of the mean pressure above which an end is pressed."""
MAX_PRESSURE = 0.5
"""Pressure over the contact modulus E* above which no elastic surfaces carry it: the peak of Hertz' line
contact is half of E* where it is as wide as its cylinder."""


def tip_warnings(built: CondensedScene, state: State) -> Iterator[str]:
    """Warnings of peak pressures off the ends of contacts that no material carries, as at a rigid tip."""
    for pairing in built.condensed.pairings:
        pressure = state.pressure[built.condensed.spans[pairing.name]]
        chosen = np.flatnonzero(pairing.candidate)
        at = chosen[[int(np.argmax(pressure))]] if len(chosen) else chosen
        materials = [built.scene.bodies[name].model.material for name in pairing.bodies]
        compliance = sum(float(one.contact_compliance(pairing.normal[at]).sum()) for one in materials)
        peak = regular_peak(pairing.arc[chosen], pressure)
        if peak * compliance > MAX_PRESSURE:
            x, y = pairing.points[at[0]].tolist()
            yield (
                f"contact {pairing.name}: the peak pressure {peak:.3g} near ({x:.6g}, {y:.6g}) is "
                f"{peak * compliance:.3g} times the contact modulus, which no material carries; at a sharp "
                f"tip or edge it is unbounded and depends on the grid: judge by forces, or round the tip; "
                f"elsewhere check the units of the moduli against those of the loads"
            )


def end_warnings(built: CondensedScene, state: State) -> Iterator[str]:
    """Warnings with the boundaries to add to contacts: the end node carries the pressure of the rest."""
    contacts = {contact.name: contact for contact in built.case.contact}
    for pairing in built.condensed.pairings:
        contact, span = contacts[pairing.name], built.condensed.spans[pairing.name]
        pressure, weight, closed = state.pressure[span], built.condensed.weight[span], state.closed[span]
        if not closed.any():
            continue
        mean = float(weight @ pressure) / float(weight[closed].sum())
        for (body, slave, _), side in zip(pairing.sides, contact.sides, strict=True):
            elastic = built.scene.bodies[body]
            cloud = elastic.model.cloud
            places = (pairing.points if slave else pairing.partner)[pairing.candidate]
            surface = pairing.surface_of(slave)
            for place, name in continuations(cloud, surface):
                node, beyond = surface.index[place], name.partition("/")[0]
                end, close = cloud.points[node], END_DISTANCE * cloud.spacing[node]
                tips = np.concatenate([_bonded_nodes(built, body), _obstacle_corners(contact)])
                held = elastic.held.get(name) == (True, True)
                if held or (np.hypot(*(tips - end).T) <= close).any():
                    continue
                near = np.hypot(*(places - end).T) <= close
                if (closed & near & (pressure > MIN_PRESSURE_SHARE * mean)).any():
                    listed = ", ".join(f'"{one}"' for one in (*side.boundaries, f"{body}.{beyond}"))
                    yield (
                        f"contact {pairing.name} is pressed up to the end of {side.label} near "
                        f"({end[0]:.6g}, {end[1]:.6g}), where {body}.{beyond} continues without a corner "
                        f"and should carry a part of the pressure: add it to the contact, as in "
                        f"contact.{pairing.name}.{'slave' if slave else 'master'} = [{listed}]"
                    )


def _bonded_nodes(built: CondensedScene, body: str) -> FloatArray:
    """Nodes (n, 2) of a body on bonds, which may begin at the end of a surface, as at a crack tip."""
    bonds = built.condensed.bonds.pairings
    slaves = [one.points for one in bonds if one.slave_body == body]
    masters = [one.partner for one in bonds if one.master_body == body]
    return np.concatenate([np.zeros((0, 2)), *slaves, *masters])


def _obstacle_corners(contact: Contact) -> FloatArray:
    """Corners (n, 2) of the obstacle of a contact, as those of a punch."""
    shape = None if contact.obstacle is None else shape_of(contact.obstacle)
    return shape.points[~shape.smooth] if isinstance(shape, Chain) else np.zeros((0, 2))


MIN_INITIAL_PRESSURE = 0.01
"""Pressures before any load, relative to those at the end of the path, above which there is a warning."""


def overlap_warnings(built: CondensedScene, first: State, last: State) -> Iterator[str]:
    """Warnings of contacts with pressures in the ``first`` state of a path, where all loads are zero."""
    given = {contact.name for contact in built.case.contact if contact.gap != 0.0}
    if first.position > 0.0:
        return
    for pairing in built.condensed.pairings:
        span = built.condensed.spans[pairing.name]
        before, after = (float(state.pressure[span].max(initial=0.0)) for state in (first, last))
        gap, partner = pairing.gap[pairing.candidate], pairing.partner[pairing.candidate]
        overlaps = (gap < -ROUND_OFF * np.abs(partner).max(initial=0.0)).any()
        if pairing.name in given or not before > MIN_INITIAL_PRESSURE * after or not overlaps:
            continue
        deepest = int(np.argmin(gap))
        x, y = partner[deepest]
        yield (
            f"contact {pairing.name}: the surfaces overlap as drawn, by {-gap[deepest]:.3g} near "
            f"({x:.6g}, {y:.6g}), and press on each other with up to {before:.4g} before any load; draw them "
            f"touching, or give contact.{pairing.name}.interference if they are a press fit"
        )


def idle_note(built: CondensedScene, state: State) -> str:
    """Note of the bodies held by contact only that no contact loads ("" if there are none)."""
    least = ROUND_OFF * float(state.pressure.max(initial=0.0))
    loaded = {
        body
        for pairing in built.condensed.pairings
        for body in pairing.bodies
        if (state.pressure[built.condensed.spans[pairing.name]] > least).any()
    }
    free = {one.body for one, _ in built.scene.unknown_motions if isinstance(one, FloatingBody)}
    idle = sorted(free - loaded)
    if not idle:
        return ""
    return (
        f"no contact loads body {', '.join(idle)} at the end: what nothing resists or drives stays in place"
    )


TURN_WARNING = 0.01
"""Rotation of contacts (radian) above which there is a warning if a motion along them is fixed: the same part
of the contact force would act in this direction."""
MAX_MOMENT_ERROR = 0.03
"""Part of the rotation due to the motion of forces above which there is a warning."""
MAX_LIMIT_ERROR = 0.01
"""Part of a limit load due to the motion of forces above which there is a warning."""


def check_held(built: CondensedScene) -> str:
    """Warning if surfaces have rotated so far that contact forces act along a motion without stiffness that
    is fixed at 0 ("" otherwise)."""
    along = [motion for motion in built.scene.held_motions if not any(way[2] for way in motion.values())]
    held = {body for motion in along for body in motion}
    if not held or not built.ends:
        return ""
    turned = turns(built.scene, built.condensed, built.ends[-1])
    worst, where = 0.0, ""
    for pairing in built.condensed.pairings:
        bodies = held & set(pairing.bodies)
        if pairing.grid is None or pairing.name not in turned or not bodies:
            continue
        angle = abs(turned[pairing.name] - pairing.grid.facing.turn)
        if angle > max(worst, TURN_WARNING):
            worst, where = angle, " and ".join(sorted(bodies))
    if not where:
        return ""
    return (
        f"the contact surfaces of {where} have rotated so far that {100.0 * worst:.2g} % of the contact "
        f"force acts along a motion without stiffness that is fixed at 0; add a [[support]] in that "
        f"direction, or friction to the contact"
    )


def check_rolling(built: CondensedScene, state: State) -> str:
    """Warning if forces at their displaced positions would rotate a body much farther ("" otherwise).
    NumericalError if loads rotate a body without resistance."""
    nodes = built.condensed.friction_nodes
    stuck = state.status[nodes] == STICK
    sign = np.where(state.closed[nodes] & ~stuck, np.sign(state.traction), 0.0)
    sets = ContactStatus(state.closed, stuck, sign)
    turned = turned_by_loads(built.scene, built.condensed, state.unknowns[1:], sets)
    if turned is not None and turned.error:
        # Where all nodes slip, as in a disk that settles in a groove, nothing resists a rotation further.
        turned = turned_by_loads(built.scene, built.condensed, state.unknowns[1:], sets.resting(nodes))
    if turned is None or turned.share < MAX_MOMENT_ERROR:
        return ""
    if turned.error:
        raise turned.error
    return (
        f"{turned.names} rotates by {np.degrees(turned.angle):.2g} degrees, and would rotate "
        f"{1.0 / (1.0 - turned.share):.3g} times as far with forces at their displaced positions; "
        f"{turned.hint}"
    )


def check_limit(built: CondensedScene, state: State) -> str:
    """Warning if a limit load close to a state is too large, as contacts of a rotated body have not moved
    along its surface ("" otherwise)."""
    turned = moment_error(built.scene, built.condensed, *state.unknowns[1:])
    if turned is None or turned.share < MAX_LIMIT_ERROR:
        return ""
    return (
        f"{turned.names} has rotated by {np.degrees(turned.angle):.2g} degrees without its contacts moving "
        f"along its surface: the moment at the limit is up to {100.0 * turned.share:.2g} % too large; use "
        f'model.strain = "finite", or stiffer materials'
    )
