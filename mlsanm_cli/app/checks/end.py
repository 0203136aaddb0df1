"""Checks of a completed path at small strain."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from mlsanm_cli.app.checks.check import Check, level
from mlsanm_cli.app.checks.energy import (
    COMMON,
    EnergyErrors,
    displacement_estimate,
    force_balance,
    force_estimate,
    force_mismatch,
    pressure_estimate,
)
from mlsanm_cli.app.checks.states import body_rotation
from mlsanm_cli.app.scene.contact_pairs import shape_of
from mlsanm_cli.case import Case, finer_nodes
from mlsanm_cli.cloud.cloud import continuations
from mlsanm_cli.contact.geometry.obstacles import Chain
from mlsanm_cli.contact.geometry.pairing import Pairing, spacing_ratio
from mlsanm_cli.contact.geometry.profile import regular_peak
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.direction_updates import moment_error, turns
from mlsanm_cli.solve.fields import fields_of
from mlsanm_cli.solve.state import State

END_DISTANCE = 0.75
"""Distance from an end, in spacings, within which nodes belong to it."""


@dataclass(frozen=True)
class End:
    """A completed path at small strain, with estimates of its last state; the first is None if resumed."""

    built: CondensedScene
    first: State | None
    last: State
    linear_residual: float
    energies: EnergyErrors
    peaks: Mapping[str, Mapping[str, Any]]

    @property
    def case(self) -> Case:
        return self.built.case

    @cached_property
    def imbalance(self) -> Mapping[str, float]:
        """Missing force of every body over the largest force on it."""
        return force_balance(self.built, self.last)


def solution(end: End) -> Iterator[Check]:
    """Coercivity of the contact, and the linear solver."""
    message, stable = "the discretised contact is not coercive", end.built.stability_limit
    yield Check("stability", end.built.stability, message, fails=stable)
    message = f"linear-solver error {end.linear_residual:.2g} exceeds {level('linear_residual'):g}"
    hint = "make the spacings more equal, use a lower mls.degree, or a Poisson's ratio less close to 0.5"
    yield Check("linear_residual", end.linear_residual, message, hint)


def pressed_spacings(end: End) -> Iterator[Check]:
    """Spacings of surfaces with nodal pressures in contact: of too different ones they look plausible."""
    clouds = {name: body.model.cloud for name, body in end.built.scene.bodies.items()}
    for pairing in end.built.condensed.nodal:
        closed, place = np.zeros_like(pairing.candidate), f"contact {pairing.name}"
        closed[pairing.candidate] = end.last.closed[end.built.condensed.spans[pairing.name]]
        ratio = spacing_ratio(replace(pairing, candidate=closed), clouds)
        message = f"{place}: spacings of the surfaces in contact differ by a factor of {ratio:.3g}"
        hint = f"bring the spacings of {' and '.join(pairing.names)} closer together where they touch"
        yield Check("pressed_spacings", ratio, message, hint, place)


def initial_overlap(end: End) -> Iterator[Check]:
    """Pressures before any load of surfaces that are drawn overlapping."""
    given = {contact.name for contact in end.case.contact if contact.gap != 0.0}
    if end.first is None or end.first.position > 0.0:
        return
    for pairing in end.built.condensed.pairings:
        span, name = end.built.condensed.spans[pairing.name], pairing.name
        before, after = (float(state.pressure[span].max(initial=0.0)) for state in (end.first, end.last))
        gap, partner = pairing.gap[pairing.candidate], pairing.partner[pairing.candidate]
        overlaps = (gap < -ROUND_OFF * np.abs(partner).max(initial=0.0)).any()
        if name in given or not before > 0.0 or not overlaps:
            continue
        x, y = partner[int(np.argmin(gap))]
        message = (
            f"contact {name}: the surfaces overlap as drawn, by {-gap.min():.3g} near "
            f"({x:.6g}, {y:.6g}), and press on each other with up to {before:.4g} before any load"
        )
        hint = f"draw them touching, or give contact.{name}.interference if they are a press fit"
        share = before / after if after > 0.0 else np.inf
        yield Check("initial_overlap", share, message, hint, f"contact {name}")


def contact_end(end: End) -> Iterator[Check]:
    """Pressures at ends of contacts where the boundary continues: they are those of the rest of it."""
    built, state = end.built, end.last
    contacts = {contact.name: contact for contact in end.case.contact}
    for pairing in built.condensed.pairings:
        contact, span = contacts[pairing.name], built.condensed.spans[pairing.name]
        pressure, weight, closed = state.pressure[span], built.condensed.weight[span], state.closed[span]
        if not closed.any():
            continue
        mean = float(weight @ pressure) / float(weight[closed].sum())
        for (body, slave, _), side in zip(pairing.sides, contact.sides, strict=True):
            elastic, surface = built.scene.bodies[body], pairing.surface_of(slave)
            cloud = elastic.model.cloud
            places = (pairing.points if slave else pairing.partner)[pairing.candidate]
            # Pressures may end at bonds, as at a crack tip, and at corners of obstacles, as those of a punch.
            bonds = built.condensed.bonds.pairings
            known = [one.points for one in bonds if one.slave_body == body]
            known += [one.partner for one in bonds if one.master_body == body]
            shape = None if contact.obstacle is None else shape_of(contact.obstacle)
            known += [shape.points[~shape.smooth]] if isinstance(shape, Chain) else []
            for end_node, name in continuations(cloud, surface):
                node, beyond = surface.index[end_node], name.partition("/")[0]
                tip, close = cloud.points[node], END_DISTANCE * cloud.spacing[node]
                held = elastic.held.get(name) == (True, True)
                if held or any((np.hypot(*(ends - tip).T) <= close).any() for ends in known):
                    continue
                near = closed & (np.hypot(*(places - tip).T) <= close)
                share = float(pressure[near].max(initial=0.0)) / mean if mean > 0.0 else 0.0
                place = f"({tip[0]:.6g}, {tip[1]:.6g})"
                message = (
                    f"contact {pairing.name} is pressed up to the end of {side.label} near {place}, where "
                    f"{body}.{beyond} continues without a corner and should carry a part of the pressure"
                )
                listed = ", ".join(f'"{one}"' for one in (*side.boundaries, f"{body}.{beyond}"))
                role = "slave" if slave else "master"
                hint = f"add it to the contact, as in contact.{pairing.name}.{role} = [{listed}]"
                yield Check("contact_end", share, message, hint, f"contact {pairing.name} at {place}")


def peak_pressure(end: End) -> Iterator[Check]:
    """Peak pressures off the ends of contacts that no material carries, as at a rigid tip."""
    built = end.built
    for pairing in built.condensed.pairings:
        chosen, place = np.flatnonzero(pairing.candidate), f"contact {pairing.name}"
        if not len(chosen):
            continue
        pressure = end.last.pressure[built.condensed.spans[pairing.name]]
        at = chosen[[int(np.argmax(pressure))]]
        materials = [built.scene.bodies[name].model.material for name in pairing.bodies]
        compliance = sum(float(one.contact_compliance(pairing.normal[at]).sum()) for one in materials)
        peak = regular_peak(pairing.arc[chosen], pressure)
        x, y = pairing.points[at[0]].tolist()
        message = (
            f"{place}: the peak pressure {peak:.3g} near ({x:.6g}, {y:.6g}) is {peak * compliance:.3g} "
            f"times the contact modulus, which no material carries"
        )
        hint = (
            "at a sharp tip or edge it is unbounded and depends on the grid: judge by forces, or round the "
            "tip; elsewhere check the units of the moduli against those of the loads"
        )
        yield Check("peak_pressure", peak * compliance, message, hint, place)


def transfer(end: End) -> Iterator[Check]:
    mismatches = force_mismatch(end.built, end.last)
    for pairing in end.built.condensed.pairings:
        lost, place = mismatches[pairing.name], f"contact {pairing.name}"
        keys = " and ".join(f"body.{body}.spacing" for body in pairing.bodies)
        message = f"{place}: the forces on slave and master differ by {100.0 * lost:.2g} %"
        finer = finer_nodes(end.case, pairing.bodies)
        hint = f"bring {keys} closer together where they touch, or {finer}"
        yield Check("force_mismatch", lost, message, hint, place)


def law_gap(end: End) -> Iterator[Check]:
    """Gaps below the pressures of the regularised law, on which bodies float: the exact law has none."""
    built, last = end.built, end.last
    if not end.case.is_regularized or built.follows_exactly:
        return
    fields, _ = fields_of(built, [last], stress=False)[0]
    for pairing in built.condensed.pairings:
        span, place = built.condensed.spans[pairing.name], f"contact {pairing.name}"
        force = built.condensed.weight[span] * last.pressure[span]
        largest = max(float(np.abs(fields[body]["displacement"]).max()) for body in pairing.bodies)
        if not force.any() or largest == 0.0:
            continue
        part = float(force @ last.gap[span] / force.sum()) / largest
        message = (
            f"{place}: its surfaces press on each other across a gap of {100 * part:.2g} % of their bodies' "
            f"largest displacement, which the regularised law leaves between them"
        )
        hint = 'use contact.regularization.law = "exact", or a lower contact.regularization.eta'
        yield Check("law_gap", part, message, hint, place)


def strain(end: End) -> Iterator[Check]:
    """Bodies strained beyond the validity of a linear model."""
    materials = {body.name: body.material for body in end.case.body}
    for body, largest in end.energies.strains.items():
        message = (
            f"body {body} is strained or rotated by {100.0 * largest:.3g} %, but the linear model is valid "
            f"for a few percent only"
        )
        hint = (
            f'use model.strain = "finite" if it bends so far, else check the units of '
            f"material.{materials[body]} against those of the loads"
        )
        yield Check("strain", largest, message, hint, f"body {body}")


def peak_stress(end: End) -> Iterator[Check]:
    for body, peak in end.peaks.items():
        (x, y), error = peak["place"], peak["error"]
        message = (
            f"body {body}: the peak stress on its boundary, {peak['stress']:.4g} (von Mises) near "
            f"({x:.6g}, {y:.6g}), is estimated to be off by {100 * error:.2g} %"
        )
        hint = f"{finer_nodes(end.case, [body], 'refine')} there"
        yield Check("peak_stress", error, message, hint, f"body {body}")


def held_motion(end: End) -> Iterator[Check]:
    """Rotated surfaces whose contact forces act along a motion without stiffness that is fixed at 0."""
    built = end.built
    along = [motion for motion in built.scene.held_motions if not any(way[2] for way in motion.values())]
    held = {body for motion in along for body in motion}
    turned = turns(built.scene, built.condensed, built.ends[-1]) if held and built.ends else {}
    angles = [
        (abs(turned[pairing.name] - pairing.grid.facing.turn), sorted(held & set(pairing.bodies)))
        for pairing in built.condensed.on_grids
        if pairing.name in turned and held & set(pairing.bodies)
    ]
    if angles:
        angle, bodies = max(angles)
        message = (
            f"the contact surfaces of {' and '.join(bodies)} have rotated so far that {100.0 * angle:.2g} % "
            f"of the contact force acts along a motion without stiffness that is fixed at 0"
        )
        hint = "add a [[support]] in that direction, or friction to the contact"
        yield Check("held_motion", angle, message, hint)


def carried(end: End) -> Iterator[Check]:
    """Rotation by the loads, and contacts without any pressure."""
    yield from body_rotation(end.built, end.last)
    none = float(bool(end.case.touching) and end.built.stays_open)
    message = "no contact carries any pressure at the end of any stage"
    yield Check("no_pressure", none, message, "check the direction and size of the loads")


# The strain comes before the checks that fail for inconsistent units, so that the warning names the cause.
END: Sequence[Callable[[End], Iterator[Check]]] = (
    *(solution, pressed_spacings, initial_overlap, contact_end, peak_pressure),
    *(strain, transfer, *COMMON, peak_stress, law_gap, held_motion, carried),
)
"""Checks of a completed path at small strain."""


def limit_load(built: CondensedScene, state: State) -> Iterator[Check]:
    """A limit load close to a ``state`` that is too large, as contacts do not follow rotated surfaces."""
    turned = moment_error(built.scene, built.condensed, state.unknowns)
    if turned is None:
        return
    message = f"{turned.names} turns round and round: a mechanism, which limits no load at small strain"
    if abs(turned.angle) <= np.pi:
        message = (
            f"{turned.names} has rotated by {np.degrees(turned.angle):.2g} degrees without its contacts "
            f"moving along its surface: the moment at the limit is up to {100.0 * turned.share:.2g} % "
            "too large"
        )
    hint = 'use model.strain = "finite", or stiffer materials'
    yield Check("limit_load", turned.share, message, hint, turned.names)


def idle_note(built: CondensedScene, state: State) -> str:
    """Note of the bodies held by contact only that no contact loads ("" if there are none)."""
    least = ROUND_OFF * float(state.pressure.max(initial=0.0))
    idle = {one.name for one, _ in built.scene.unknown_motions if one.floats}
    for pairing in built.condensed.pairings:
        if (state.pressure[built.condensed.spans[pairing.name]] > least).any():
            idle -= set(pairing.bodies)
    stays = "at the end: what nothing resists or drives stays in place"
    return f"no contact loads body {', '.join(sorted(idle))} {stays}" if idle else ""


def estimates(built: CondensedScene, figures: Mapping[str, Any], missing: str) -> Iterator[Check]:
    """Estimated errors at small strain, or why they are ``missing``."""
    case = built.case
    if figures["displacement"] is None and missing:
        yield Check("missing_estimates", 1.0, f"errors are not estimated: {missing}")
        return
    yield from displacement_estimate(case, figures)
    for pairing in built.condensed.pairings:
        name, bodies = pairing.name, pairing.bodies
        if name in figures.get("force", {}):
            yield force_estimate("force_error", case, name, built.scene.bodies, figures["force"][name])
        finer = f" and a smaller contact.{name}.accuracy" if pairing.friction and not pairing.nodal else ""
        error = figures["pressure"].get(name)
        yield from pressure_estimate(pressure_limit(pairing), case, name, bodies, error, finer)


def pressure_limit(pairing: Pairing) -> str:
    """The limit of the error of pressures: frictionless ones on grids show that bodies are too coarse."""
    return "rough_pressure_error" if pairing.nodal or pairing.friction else "pressure_error"
