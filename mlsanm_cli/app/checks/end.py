"""Checks of a completed path: those of either strain, and those at small strain."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from mlsanm_cli.app.checks.check import Check
from mlsanm_cli.app.checks.ended import (
    COMMON,
    EnergyErrors,
    displacement_estimate,
    force_estimate,
    pressure_estimate,
)
from mlsanm_cli.app.checks.energy import force_balance, force_mismatch
from mlsanm_cli.app.checks.limits import LIMITS, level
from mlsanm_cli.app.checks.states import body_rotation
from mlsanm_cli.app.scene.contact_pairs import shape_of
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, Contact, finer_nodes
from mlsanm_cli.cloud.cloud import continuations
from mlsanm_cli.contact.geometry.obstacles import Chain
from mlsanm_cli.contact.geometry.pairing import Pairing, spacing_ratio
from mlsanm_cli.contact.geometry.profile import regular_peak
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF
from mlsanm_cli.solve.coercivity import stability_limit
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.direction_updates import moment_error, turns
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


def stability(end: End) -> Iterator[Check]:
    """Coercivity of the contacts, without which no path begins."""
    message = "the discretised contact is not coercive"
    yield Check("stability", end.built.stability, message, fails=stability_limit(end.built.ends))


def linear_residual(end: End) -> Iterator[Check]:
    """Error of the linear systems of the bodies."""
    yield Check(
        "linear_residual",
        end.linear_residual,
        f"linear-solver error {end.linear_residual:.2g} exceeds {level('linear_residual'):g}",
        "make the spacings more equal, use a lower mls.degree, or a Poisson's ratio less close to 0.5",
    )


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


def strain(end: End) -> Iterator[Check]:
    """Bodies strained beyond the validity of a linear model."""
    materials = {body.name: body.material for body in end.case.body}
    for body, largest in end.energies.strains.items():
        yield Check(
            "strain",
            largest,
            f"body {body} is strained or rotated by {100.0 * largest:.3g} %, but the linear model is valid "
            f"for a few percent only",
            f"check the units of material.{materials[body]} against those of the loads",
            f"body {body}",
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


def peak_stress(end: End) -> Iterator[Check]:
    """Estimated errors of the largest stresses on free boundaries."""
    for body, peak in end.peaks.items():
        (x, y), error = peak["place"], peak["error"]
        yield Check(
            "peak_stress",
            error,
            f"body {body}: the peak stress on its boundary, {peak['stress']:.4g} (von Mises) near "
            f"({x:.6g}, {y:.6g}), is estimated to be off by {100 * error:.2g} %",
            f"{finer_nodes(end.case, [body], 'refine')} there",
            f"body {body}",
        )


def held_motion(end: End) -> Iterator[Check]:
    """Rotated surfaces whose contact forces act along a motion without stiffness that is fixed at 0."""
    built = end.built
    along = [motion for motion in built.scene.held_motions if not any(way[2] for way in motion.values())]
    held = {body for motion in along for body in motion}
    if not held or not built.ends:
        return
    turned = turns(built.scene, built.condensed, built.ends[-1])
    angles = [
        (abs(turned[pairing.name] - pairing.grid.facing.turn), sorted(held & set(pairing.bodies)))
        for pairing in built.condensed.pairings
        if pairing.grid is not None and pairing.name in turned and held & set(pairing.bodies)
    ]
    if angles:
        angle, bodies = max(angles)
        yield Check(
            "held_motion",
            angle,
            f"the contact surfaces of {' and '.join(bodies)} have rotated so far that {100.0 * angle:.2g} % "
            f"of the contact force acts along a motion without stiffness that is fixed at 0",
            "add a [[support]] in that direction, or friction to the contact",
        )


def no_pressure(end: End) -> Iterator[Check]:
    """Scenes whose contacts all stay open."""
    yield Check(
        "no_pressure",
        float(bool(end.case.touching) and end.built.stays_open),
        "no contact carries any pressure at the end of any stage",
        "check the direction and size of the loads",
    )


# The strain comes before the checks that fail for inconsistent units, so that the warning names the cause.
END: Sequence[Callable[[End], Iterator[Check]]] = (
    *(
        stability,
        linear_residual,
        pressed_spacings,
        initial_overlap,
        contact_end,
        peak_pressure,
        strain,
        transfer,
    ),
    *COMMON,
    *(peak_stress, held_motion, lambda end: body_rotation(end.built, end.last)),
    no_pressure,
)
"""Checks of a completed path at small strain."""


def checks_of(end: End) -> Iterator[Check]:
    """All checks of a completed path at small strain."""
    for check in END:
        yield from check(end)


def limit_load(built: CondensedScene, state: State) -> Iterator[Check]:
    """A limit load close to a ``state`` that is too large, as the contacts of a rotated body have not moved
    along its surface."""
    turned = moment_error(built.scene, built.condensed, *state.unknowns[1:])
    if turned is not None:
        yield Check(
            "limit_load",
            turned.share,
            f"{turned.names} has rotated by {np.degrees(turned.angle):.2g} degrees without its contacts "
            f"moving along its surface: the moment at the limit is up to {100.0 * turned.share:.2g} % too "
            f"large",
            'use model.strain = "finite", or stiffer materials',
            turned.names,
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
    free = {one.name for one, _ in built.scene.unknown_motions if one.floats}
    idle = sorted(free - loaded)
    if not idle:
        return ""
    return (
        f"no contact loads body {', '.join(idle)} at the end: what nothing resists or drives stays in place"
    )


def estimates(built: CondensedScene, figures: Mapping[str, Any], missing: str) -> Iterator[Check]:
    """Estimated errors at small strain, or why they are ``missing``."""
    if figures["displacement"] is None and missing:
        yield Check("missing_estimates", 1.0, f"errors are not estimated: {missing}")
        return
    yield from displacement_estimate(built.case, figures)
    for pairing in built.condensed.pairings:
        name = pairing.name
        if name in figures.get("force", {}):
            yield force_estimate("force_error", built.case, name, built.scene.bodies, figures["force"][name])
        finer = f" and a smaller contact.{name}.accuracy" if pairing.grid and pairing.friction else ""
        yield from pressure_estimate(
            pressure_limit(pairing), built.case, name, pairing.bodies, figures["pressure"].get(name), finer
        )


def pressure_limit(pairing: Pairing) -> str:
    """Limit of the estimated error of pressures: the lower one for frictionless contacts with contact grids,
    whose errors are those of bodies that are too coarse."""
    smooth = pairing.grid is not None and not pairing.friction
    return "pressure_error" if smooth else "rough_pressure_error"


def limits(case: Case, built: CondensedScene | None) -> dict[str, Any]:
    """The levels at which a run at small strain fails, for summary.json; ``stability`` is a lower one,
    ``error_estimate`` and ``estimates`` are those at which it warns."""
    names = ("linear_residual", "force_balance", "force_mismatch", "energy_error")
    found: dict[str, Any] = {"residual": case.solver.tolerance}
    found |= {name: LIMITS[name].fails for name in names}
    found["error_estimate"] = level("rough_pressure_error")
    if built is None:
        return found
    displacement, pairings = level("displacement_error"), built.condensed.pairings
    estimates = {
        "displacement": displacement,
        "pressure": {one.name: level(pressure_limit(one)) for one in pairings},
        "force": {one.name: level("force_error") for one in pairings},
        "probes": dict.fromkeys(built.condensed.probes, displacement),
    }
    return found | {"stability": stability_limit(built.ends), "estimates": estimates}
