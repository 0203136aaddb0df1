"""Checks of the contacts of a completed path at small strain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from mlsanm_cli.app.checks.check import Check
from mlsanm_cli.app.checks.ended import EnergyErrors
from mlsanm_cli.app.checks.energy import force_balance, force_mismatch
from mlsanm_cli.app.scene.contact_pairs import shape_of
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, Contact, finer_nodes
from mlsanm_cli.cloud.cloud import continuations
from mlsanm_cli.contact.geometry.obstacles import Chain
from mlsanm_cli.contact.geometry.pairing import spacing_ratio
from mlsanm_cli.contact.geometry.profile import regular_peak
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.fields import fields_of
from mlsanm_cli.solve.state import State

END_DISTANCE = 0.75
"""Distance from an end, in spacings, within which nodes belong to it."""


@dataclass(frozen=True)
class End:
    """A completed path at small strain: its ``first`` state, None if it was resumed, its ``last`` one, and
    the estimates of that."""

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


def pressed_spacings(end: End) -> Iterator[Check]:
    """Spacings of surfaces with nodal pressures in contact: pressures of too different ones look
    plausible."""
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
            known = _known_ends(built, body, contact)
            for end_node, name in continuations(cloud, surface):
                node, beyond = surface.index[end_node], name.partition("/")[0]
                tip, close = cloud.points[node], END_DISTANCE * cloud.spacing[node]
                held = elastic.held.get(name) == (True, True)
                if held or (np.hypot(*(known - tip).T) <= close).any():
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


def _known_ends(built: CondensedScene, body: str, contact: Contact) -> FloatArray:
    """Points (n, 2) at which pressures may end: nodes of a body on bonds, as at a crack tip, and corners of
    the obstacle of a contact, as those of a punch."""
    bonds = built.condensed.bonds.pairings
    slaves = [one.points for one in bonds if one.slave_body == body]
    masters = [one.partner for one in bonds if one.master_body == body]
    shape = None if contact.obstacle is None else shape_of(contact.obstacle)
    corners = shape.points[~shape.smooth] if isinstance(shape, Chain) else np.zeros((0, 2))
    return np.concatenate([corners, *slaves, *masters])


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
    """Different forces on slave and master."""
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
