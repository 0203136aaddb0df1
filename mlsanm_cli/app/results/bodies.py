"""Deformed bodies as pictures: the field shown, the deformation scale, the detail around a contact."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mlsanm_cli.app.results.curves import position_words
from mlsanm_cli.app.results.fields import SCALARS, default_scalar, nodal, scalar, triangles_of
from mlsanm_cli.app.results.marks import marks_at
from mlsanm_cli.app.results.path_lookup import pressures_at
from mlsanm_cli.case import Case
from mlsanm_cli.contact.geometry.profile import THRESHOLD
from mlsanm_cli.io.plots.cloud import BodyPicture, CloudBody
from mlsanm_cli.io.run_reader import RunData, SavedState

MAX_SHOWN_DISPLACEMENT = 0.05
"""Largest displacement shown, relative to the size of the scene."""
MAX_OVERLAP = 0.003
"""Largest overlap of touching surfaces due to enlarged displacements, relative to the size of the detail."""
DETAIL_HALF_WIDTHS = 2.5
"""Extent of the detail on both sides of the middle of the contact, in its half-widths."""
MAX_DETAIL = 0.5
"""Part of the scene above which a contact needs no detail."""


def bodies_picture(run: RunData, case: Case, state: SavedState, field: str | None) -> BodyPicture:
    """All bodies in a saved state, coloured by a field, with displacements enlarged to be seen, and the
    contact with the highest pressure as a detail. Raises RunError if the field was not saved."""
    bodies, label, rest = [], "", 0.0
    for name, body in run.bodies.items():
        quantities = nodal(run, case, state, name)
        chosen = field or default_scalar(quantities)
        label = case.units.label(SCALARS[chosen].label, SCALARS[chosen].unit)
        rest = SCALARS[chosen].rest
        values, moved = scalar(quantities, chosen), quantities["displacement"]
        bodies.append(CloudBody(body.points, moved, values, triangles_of(body)))
    scale = automatic_scale(run, bodies)
    return BodyPicture(
        bodies,
        label,
        position_words(run, case, state.position),
        scale,
        marks_at(run, case, state, scale),
        case.units.length,
        contact_window(run, state.position, bodies, scale),
        rest,
    )


def automatic_scale(run: RunData, bodies: Sequence[CloudBody]) -> float:
    """1, 2 or 5 times a power of ten by which displacements are multiplied to be seen; never below 1.
    Surfaces that met after closing a gap overlap in a picture by (scale - 1) times that gap, so scenes with
    curved contacts are drawn nearly to scale."""
    largest = max(float(np.hypot(*body.displacement.T).max(initial=0.0)) for body in bodies)
    if run.is_finite or largest == 0.0:
        return 1.0
    limit = MAX_SHOWN_DISPLACEMENT * _size(bodies) / largest
    for contact in run.contacts.values():
        loaded = contact.pressure[-1] > THRESHOLD * contact.pressure[-1].max(initial=0.0)
        if not loaded.any():
            continue
        closed_gap = float(contact.gap[0][loaded].max())
        detail = DETAIL_HALF_WIDTHS * float(np.ptp(contact.points[loaded], axis=0).max())
        if closed_gap > 0.0:
            limit = min(limit, 1.0 + MAX_OVERLAP * detail / closed_gap)
    if limit < 2.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(limit))
    return float(power * max(digit for digit in (1.0, 2.0, 5.0) if digit * power <= limit))


def contact_window(
    run: RunData, position: float, bodies: Sequence[CloudBody], scale: float
) -> tuple[float, float, float, float] | None:
    """The square (x0, x1, y0, y1) around the highest contact pressure; None if it is most of the scene. Its
    middle has moved as the node nearest to it is drawn, with displacements ``scale`` times as large."""
    if not run.contacts:
        return None
    pressures = pressures_at(run, position)
    name = max(pressures, key=lambda n: float(pressures[n].max(initial=0.0)))
    pressure = pressures[name]
    loaded = run.contacts[name].points[pressure > THRESHOLD * pressure.max(initial=0.0)]
    if len(loaded) < 2 or pressure.max() <= 0.0:
        return None
    low, high = loaded.min(axis=0), loaded.max(axis=0)
    half = DETAIL_HALF_WIDTHS * 0.5 * float((high - low).max())
    if not 0.0 < 2.0 * half <= MAX_DETAIL * _size(bodies):
        return None
    middle = 0.5 * (low + high)
    distances = [np.hypot(*(body.points - middle).T) for body in bodies]
    nearest = int(np.argmin([distance.min() for distance in distances]))
    x, y = (middle + scale * bodies[nearest].displacement[distances[nearest].argmin()]).tolist()
    return x - half, x + half, y - half, y + half


def _size(bodies: Sequence[CloudBody]) -> float:
    points = np.concatenate([body.points for body in bodies])
    return float(np.ptp(points, axis=0).max())
