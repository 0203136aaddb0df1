"""Warnings of relative sliding beyond the validity of small displacements.

At small strain contact partners are those of the undeformed state. If they slide by a considerable part of
the contact's width, other points touch, and pressures are reported at points that have moved.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from mlsanm_cli.app.output import recording
from mlsanm_cli.app.output.lines import obstacle_shift
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import PlaneObstacle
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.functionals import platen_displacements, slave_points
from mlsanm_cli.solve.state import State
from mlsanm_cli.startup import cKDTree

MAX_SLIDE = 0.25
"""Sliding distance over the contact's width above which there is a warning: the pressure of a half-cylinder
dragged by half of the contact's half-width is displaced by as much."""


def large_slides(
    built: CondensedScene, state: State, clouds: Mapping[str, Cloud], displacements: Mapping[str, FloatArray]
) -> Iterator[tuple[str, str]]:
    """Names of contacts whose sides slide too far in a state, with a warning for each; ``displacements``
    (n, 2) are those of all bodies at the points of ``clouds``."""
    obstacles = {contact.name: contact.obstacle for contact in built.case.contact}
    moved = platen_displacements(built, state)
    for pairing in built.condensed.pairings:
        # Sliding along a plane changes nothing.
        if isinstance(obstacles.get(pairing.name), PlaneObstacle):
            continue
        chosen = pairing.candidate
        closed = recording.contact_record(built, pairing, state).pressure > 0.0
        if not closed.any():
            continue
        own = _at(slave_points(built, pairing)[closed], pairing.slave_body, clouds, displacements)
        if pairing.master_body is None:
            other = np.tile(obstacle_shift(built.case, pairing.name, moved), (len(own), 1))
        else:
            partner = pairing.partner[chosen][closed]
            other = _at(partner, pairing.master_body, clouds, displacements)
        slid = float(np.abs(((own - other) * pairing.tangent[chosen][closed]).sum(axis=1)).max())
        width = float(pairing.weight[chosen][closed].sum())
        if slid > MAX_SLIDE * width:
            yield (
                pairing.name,
                f"the surfaces of contact {pairing.name} slide along each other by {slid:.3g} at position "
                f"{state.position:.6g}, but the contact is only {width:.3g} wide: at small strain pressures "
                f"act on the points that faced each other initially, an error of this distance on one side; "
                f'set model.strain = "finite" (material law "saint-venant-kirchhoff" extends the same '
                f"elasticity)",
            )


def _at(
    points: FloatArray, body: str, clouds: Mapping[str, Cloud], displacements: Mapping[str, FloatArray]
) -> FloatArray:
    """Displacements (e, 2) of a body at the nodes closest to ``points`` (e, 2)."""
    _, found = nearest(cKDTree(clouds[body].points), points, 1)
    return displacements[body][found.reshape(-1)]
