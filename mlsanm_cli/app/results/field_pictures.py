"""Fields as pictures: deformed bodies coloured by one, and its values along boundaries and straight lines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mlsanm_cli.app.results.choice import Choice
from mlsanm_cli.app.results.curves import curves_picture, position_words, run_names
from mlsanm_cli.app.results.fields import (
    SCALARS,
    default_scalar,
    fields_at,
    inside,
    nodal,
    saved_state,
    scalar,
    triangles_of,
)
from mlsanm_cli.app.results.marks import boundary_nodes, marks_at
from mlsanm_cli.app.results.path_lookup import level_at, pressures_at
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, Place
from mlsanm_cli.contact.geometry.profile import THRESHOLD
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.plots.cloud import BodyPicture, CloudBody
from mlsanm_cli.io.plots.curves import Curve, Picture
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
    title, unit = position_words(run, case, state.position), case.units.length
    marks, detail = marks_at(run, case, state, scale), contact_window(run, state.position, bodies, scale)
    return BodyPicture(bodies, label, title, scale, marks, unit, detail, rest)


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


def line_picture(runs: Sequence[RunData], cases: Sequence[Case], choice: Choice) -> Picture:
    """A field along a boundary such as ``block.top``, or along the straight line ``X,Y:X,Y``, at saved
    positions. Raises RunError for an invalid line, and for one that crosses no body."""
    assert choice.along is not None
    field, straight, curves = choice.field or "von_mises", ":" in choice.along, []
    for run, case, name in zip(runs, cases, run_names(runs), strict=True):
        for position in choice.at or (saved_state(run, None).position,):
            words = [name] if len(runs) > 1 else []
            words += [f"position {position:.4g}"] if len(choice.at) > 1 or len(runs) == 1 else []
            along = _on_line if straight else _on_boundary
            for where, x, y in along(run, case, choice.along, field, position):
                curves.append(Curve(x, y, ", ".join([*words, where] if where else words)))
    units, label = cases[0].units, SCALARS[field].label
    distance = units.label("distance along the line" if straight else "arc length", "length")
    title = f"{label[0].upper()}{label[1:]} along {choice.along}"
    return curves_picture(curves, distance, units.label(label, SCALARS[field].unit), title)


Along = Iterator[tuple[str, FloatArray, FloatArray]]
"""Name of a body, "" of a single one, distances (k,) along a line and values (k,)."""


def _on_line(run: RunData, case: Case, line: str, field: str, position: float) -> Along:
    """The values of every body crossed, nan outside it."""
    try:
        first, last = (np.array([float(part) for part in end.split(",")]) for end in line.split(":"))
        if first.shape != (2,) or last.shape != (2,) or not np.isfinite([first, last]).all():
            raise ValueError
    except ValueError:
        message = f'"{line}" is neither a boundary nor a line'
        raise RunError(message, "as in --along block.top or --along 0,0:0,-1") from None
    share = np.linspace(0.0, 1.0, 301)
    points, level = first + share[:, None] * (last - first), level_at(run, position)
    within = {name: inside(body, points) for name, body in run.bodies.items()}
    crossed = {name: mask for name, mask in within.items() if mask.sum() > 1}
    if not crossed:
        raise RunError(f"the line {line} crosses no body", "give coordinates of the undeformed bodies")
    for name, mask in crossed.items():
        ((seen, _),) = fields_at(run, case, name, points[mask], [level])
        values = np.full(len(points), np.nan)
        values[mask] = scalar(seen, field)
        yield name if len(crossed) > 1 else "", share * float(np.hypot(*(last - first))), values


def _on_boundary(run: RunData, case: Case, boundary: str, field: str, position: float) -> Along:
    """The values at the nodes of a boundary."""
    name, _, edge = boundary.partition(".")
    body = run.bodies.get(name)
    pieces = [] if body is None else [piece.partition("/")[0] for piece in body.boundary.name]
    if body is None or edge not in pieces:
        known = ", ".join(f"{name}.{edge}" for edge in dict.fromkeys(pieces)) or ", ".join(run.bodies)
        raise RunError(f'there is no boundary "{boundary}"', f"there are: {known}")
    index, _ = boundary_nodes(body, Place((boundary,)))
    values = scalar(nodal(run, case, saved_state(run, position), name), field)
    steps = np.hypot(*np.diff(body.points[index], axis=0).T)
    yield "", np.concatenate([[0.0], np.cumsum(steps)]), values[index]
