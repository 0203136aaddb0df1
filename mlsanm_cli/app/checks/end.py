"""Checks of a completed path at small strain, those of contacts apart."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from mlsanm_cli.app.checks.check import Check
from mlsanm_cli.app.checks.end_contacts import (
    End,
    contact_end,
    initial_overlap,
    law_gap,
    peak_pressure,
    pressed_spacings,
    transfer,
)
from mlsanm_cli.app.checks.ended import COMMON, displacement_estimate, force_estimate, pressure_estimate
from mlsanm_cli.app.checks.limits import level
from mlsanm_cli.app.checks.states import body_rotation
from mlsanm_cli.case import finer_nodes
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.roundoff import ROUND_OFF
from mlsanm_cli.solve.coercivity import stability_limit
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.direction_updates import moment_error, turns
from mlsanm_cli.solve.state import State


def stability(end: End) -> Iterator[Check]:
    """Coercivity of the contacts, without which no path begins."""
    message = "the discretised contact is not coercive"
    yield Check("stability", end.built.stability, message, fails=stability_limit(end.built.ends))


def linear_residual(end: End) -> Iterator[Check]:
    """Error of the linear systems of the bodies."""
    message = f"linear-solver error {end.linear_residual:.2g} exceeds {level('linear_residual'):g}"
    hint = "make the spacings more equal, use a lower mls.degree, or a Poisson's ratio less close to 0.5"
    yield Check("linear_residual", end.linear_residual, message, hint)


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
    """Estimated errors of the largest stresses on free boundaries."""
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
    if not held or not built.ends:
        return
    turned = turns(built.scene, built.condensed, built.ends[-1])
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


def no_pressure(end: End) -> Iterator[Check]:
    """Scenes whose contacts all stay open."""
    none = float(bool(end.case.touching) and end.built.stays_open)
    message = "no contact carries any pressure at the end of any stage"
    yield Check("no_pressure", none, message, "check the direction and size of the loads")


# The strain comes before the checks that fail for inconsistent units, so that the warning names the cause.
END: Sequence[Callable[[End], Iterator[Check]]] = (
    *(stability, linear_residual, pressed_spacings, initial_overlap, contact_end, peak_pressure),
    *(strain, transfer, *COMMON, peak_stress, law_gap, held_motion),
    lambda end: body_rotation(end.built, end.last),
    no_pressure,
)
"""Checks of a completed path at small strain."""


def limit_load(built: CondensedScene, state: State) -> Iterator[Check]:
    """A limit load close to a ``state`` that is too large, as the contacts of a rotated body have not moved
    along its surface."""
    turned = moment_error(built.scene, built.condensed, *state.unknowns[1:])
    if turned is None:
        return
    message = f"{turned.names} turns round and round: a mechanism, which limits no load at small strain"
    if abs(turned.angle) <= math.pi:
        angle, share = np.degrees(turned.angle), 100.0 * turned.share
        message = (
            f"{turned.names} has rotated by {angle:.2g} degrees without its contacts moving along its "
            f"surface: the moment at the limit is up to {share:.2g} % too large"
        )
    hint = 'use model.strain = "finite", or stiffer materials'
    yield Check("limit_load", turned.share, message, hint, turned.names)


def idle_note(built: CondensedScene, state: State) -> str:
    """Note of the bodies held by contact only that no contact loads ("" if there are none)."""
    least = ROUND_OFF * float(state.pressure.max(initial=0.0))
    loaded = {
        body
        for pairing in built.condensed.pairings
        for body in pairing.bodies
        if (state.pressure[built.condensed.spans[pairing.name]] > least).any()
    }
    idle = sorted({one.name for one, _ in built.scene.unknown_motions if one.floats} - loaded)
    stays = "at the end: what nothing resists or drives stays in place"
    return f"no contact loads body {', '.join(idle)} {stays}" if idle else ""


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
    """Limit of the estimated error of pressures: the lower one for frictionless contacts with contact grids,
    whose errors are those of bodies that are too coarse."""
    return "rough_pressure_error" if pairing.nodal or pairing.friction else "pressure_error"


def estimate_limits(condensed: Condensed) -> dict[str, Any]:
    """The levels at which a run warns of estimated errors, for summary.json."""
    displacement = level("displacement_error")
    return {
        "displacement": displacement,
        "pressure": {one.name: level(pressure_limit(one)) for one in condensed.pairings},
        "force": {one.name: level("force_error") for one in condensed.pairings},
        "probes": dict.fromkeys(condensed.quantities["probe"], displacement),
    }
