"""Sharp corners of bodies that touch with both of their sides."""

from __future__ import annotations

import math

import numpy as np

from mlsanm_cli.app.scene.contact_ranges import facing_of
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.cloud.joined import corners_of
from mlsanm_cli.contact.geometry.facing import Facing
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

SAMPLES = 400
ASIDE = 0.01
"""Distance from a corner at which its sides are looked at, relative to the surface."""
MAX_OPENING = math.sin(math.radians(60.0))
"""Gap over distance from the corner above which a side stays open."""


def check_tips(case: Case, pairings: tuple[Pairing, ...]) -> None:
    """CaseError if a surface touches first at a corner within itself from which both of its sides open
    slowly: a contact grid ends at the corner, and what the other side carries would be missed."""
    problems = []
    for pairing in pairings:
        sides = zip((pairing.slave, pairing.master), pairing.bodies, ("slave", "master"), strict=False)
        for surface, body, role in () if pairing.bonded else sides:
            corners = np.zeros(0) if surface is None else corners_of(surface.curve)
            for place in surface.curve.points(corners) if surface is not None and len(corners) else ():
                if _is_tip(facing_of(case, pairing), place):
                    x, y = place
                    message = (
                        f"body {body} touches with its sharp corner at ({x:.6g}, {y:.6g}), on both sides of "
                        "which pressures would be unbounded"
                    )
                    hint = (
                        f"give it a radius, as by body.{body}.shape.rounding, and add the name of the "
                        f"arc to contact.{pairing.name}.{role}"
                    )
                    problems.append(CaseProblem(f"contact.{pairing.name}", message, hint=hint))
    if problems:
        raise CaseError(tuple(problems))


def _is_tip(facing: Facing, place: FloatArray) -> bool:
    base, size = facing.base, facing.base.length
    at = float(facing.locate(place[None])[0])
    if not (base.closed or ASIDE * size < abs(at) < (1.0 - ASIDE) * size):
        return False
    tip, *sides = facing.gap(np.array([at, at - ASIDE * size, at + ASIDE * size]))
    opening = (np.array(sides) - tip) / (ASIDE * size)
    sign = 1.0 if facing.slave_first else -1.0
    least = float(facing.gap(sign * np.linspace(0.0, size, SAMPLES)).min())
    return bool(
        tip <= least + COARSE_ROUND_OFF * size
        and opening.min() > COARSE_ROUND_OFF
        and opening.max() < MAX_OPENING
    )
