"""Checks of the contacts of a completed path at small strain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from mlsanm_cli.app.checks.check import Check
from mlsanm_cli.app.checks.ended import (
    EnergyErrors,
)
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
    for pairing in end.built.condensed.pairings:
        if pairing.grid is not None:
            continue
        closed = np.zeros_like(pairing.candidate)
        closed[pairing.candidate] = end.last.closed[end.built.condensed.spans[pairing.name]]
        ratio = spacing_ratio(replace(pairing, candidate=closed), clouds)
        yield Check(
            "pressed_spacings",
            ratio,
            f"contact {pairing.name}: spacings of the surfaces in contact differ by a factor of {ratio:.3g}",
            f"bring the spacings of {' and '.join(pairing.names)} closer together where they touch",
            f"contact {pairing.name}",
        )


def initial_overlap(end: End) -> Iterator[Check]:
    """Pressures before any load of surfaces that are drawn overlapping."""
    given = {contact.name for contact in end.case.contact if contact.gap != 0.0}
    if end.first is None or end.first.position > 0.0:
        return
    for pairing in end.built.condensed.pairings:
        span = end.built.condensed.spans[pairing.name]
        before, after = (float(state.pressure[span].max(initial=0.0)) for state in (end.first, end.last))
        gap, partner = pairing.gap[pairing.candidate], pairing.partner[pairing.candidate]
        overlaps = (gap < -ROUND_OFF * np.abs(partner).max(initial=0.0)).any()
        if pairing.name in given or not before > 0.0 or not overlaps:
            continue
        deepest = int(np.argmin(gap))
        x, y = partner[deepest]
        yield Check(
            "initial_overlap",
            before / after if after > 0.0 else np.inf,
            f"contact {pairing.name}: the surfaces overlap as drawn, by {-gap[deepest]:.3g} near "
            f"({x:.6g}, {y:.6g}), and press on each other with up to {before:.4g} before any load",
            f"draw them touching, or give contact.{pairing.name}.interference if they are a press fit",
            f"contact {pairing.name}",
        )


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
            elastic = built.scene.bodies[body]
            cloud = elastic.model.cloud
            places = (pairing.points if slave else pairing.partner)[pairing.candidate]
            surface = pairing.surface_of(slave)
            for place, name in continuations(cloud, surface):
                node, beyond = surface.index[place], name.partition("/")[0]
                tip, close = cloud.points[node], END_DISTANCE * cloud.spacing[node]
                known = np.concatenate([_bonded_nodes(built, body), _obstacle_corners(contact)])
                held = elastic.held.get(name) == (True, True)
                if held or (np.hypot(*(known - tip).T) <= close).any():
                    continue
                near = closed & (np.hypot(*(places - tip).T) <= close)
                listed = ", ".join(f'"{one}"' for one in (*side.boundaries, f"{body}.{beyond}"))
                role = "slave" if slave else "master"
                yield Check(
                    "contact_end",
                    float(pressure[near].max(initial=0.0)) / mean if mean > 0.0 else 0.0,
                    f"contact {pairing.name} is pressed up to the end of {side.label} near "
                    f"({tip[0]:.6g}, {tip[1]:.6g}), where {body}.{beyond} continues without a corner and "
                    f"should carry a part of the pressure",
                    f"add it to the contact, as in contact.{pairing.name}.{role} = [{listed}]",
                    f"contact {pairing.name} at ({tip[0]:.6g}, {tip[1]:.6g})",
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


def peak_pressure(end: End) -> Iterator[Check]:
    """Peak pressures off the ends of contacts that no material carries, as at a rigid tip."""
    built = end.built
    for pairing in built.condensed.pairings:
        chosen = np.flatnonzero(pairing.candidate)
        if not len(chosen):
            continue
        pressure = end.last.pressure[built.condensed.spans[pairing.name]]
        at = chosen[[int(np.argmax(pressure))]]
        materials = [built.scene.bodies[name].model.material for name in pairing.bodies]
        compliance = sum(float(one.contact_compliance(pairing.normal[at]).sum()) for one in materials)
        peak = regular_peak(pairing.arc[chosen], pressure)
        x, y = pairing.points[at[0]].tolist()
        yield Check(
            "peak_pressure",
            peak * compliance,
            f"contact {pairing.name}: the peak pressure {peak:.3g} near ({x:.6g}, {y:.6g}) is "
            f"{peak * compliance:.3g} times the contact modulus, which no material carries",
            "at a sharp tip or edge it is unbounded and depends on the grid: judge by forces, or round the "
            "tip; elsewhere check the units of the moduli against those of the loads",
            f"contact {pairing.name}",
        )


def transfer(end: End) -> Iterator[Check]:
    """Different forces on slave and master."""
    mismatches = force_mismatch(end.built, end.last)
    for pairing in end.built.condensed.pairings:
        lost = mismatches[pairing.name]
        keys = " and ".join(f"body.{body}.spacing" for body in pairing.bodies)
        yield Check(
            "force_mismatch",
            lost,
            f"contact {pairing.name}: the forces on slave and master differ by {100.0 * lost:.2g} %",
            f"bring {keys} closer together where they touch, or {finer_nodes(end.case, pairing.bodies)}",
            f"contact {pairing.name}",
        )


def law_gap(end: End) -> Iterator[Check]:
    """Gaps below the pressures of the regularised law, on which bodies float: the exact law has none."""
    built, last = end.built, end.last
    if not end.case.is_regularized or built.follows_exactly:
        return
    fields, _ = fields_of(built, [last], stress=False)[0]
    for pairing in built.condensed.pairings:
        span = built.condensed.spans[pairing.name]
        force = built.condensed.weight[span] * last.pressure[span]
        largest = max(float(np.abs(fields[body]["displacement"]).max()) for body in pairing.bodies)
        if not force.any() or largest == 0.0:
            continue
        part = float(force @ last.gap[span] / force.sum()) / largest
        yield Check(
            "law_gap",
            part,
            f"contact {pairing.name}: its surfaces press on each other across a gap of {100 * part:.2g} % of "
            f"their bodies' largest displacement, which the regularised law leaves between them",
            'use contact.regularization.law = "exact", or a lower contact.regularization.eta',
            f"contact {pairing.name}",
        )
