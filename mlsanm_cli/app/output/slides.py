"""Surfaces that slide along each other further than small displacements allow.

At small strain every place in contact has its partner from before loading. Where both have moved on along
each other by a part of the contact's width, others meet, and pressures are reported at places that have
moved.
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

FAR = 0.25
"""Slides above this part of a contact's width are warned of: a half-cylinder dragged by half of the contact's
half-width has its pressure off by as much."""


def large_slides(
    built: CondensedScene, state: State, clouds: Mapping[str, Cloud], displacements: Mapping[str, FloatArray]
) -> Iterator[tuple[str, str]]:
    """Contacts by name whose sides slide too far in a state with the ``displacements`` (n, 2) of all bodies
    at the points of ``clouds``, and a warning of each."""
    obstacles = {contact.name: contact.obstacle for contact in built.case.contact}
    moved = platen_displacements(built, state)
    for pairing in built.condensed.pairings:
        # Nothing changes along a plane.
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
        if slid > FAR * width:
            yield (
                pairing.name,
                f"the surfaces of contact {pairing.name} slide along each other by {slid:.3g} at position "
                f"{state.position:.6g}, but the contact is only {width:.3g} wide: at small strain both are "
                f"pressed where they met as drawn, which on one of them is off by as much; set model.strain "
                f'= "finite" (material law "saint-venant-kirchhoff" extends the same elasticity)',
            )


def _at(
    points: FloatArray, body: str, clouds: Mapping[str, Cloud], displacements: Mapping[str, FloatArray]
) -> FloatArray:
    """Displacements (e, 2) of a body at the nodes closest to ``points`` (e, 2)."""
    _, found = nearest(cKDTree(clouds[body].points), points, 1)
    return displacements[body][found.reshape(-1)]
