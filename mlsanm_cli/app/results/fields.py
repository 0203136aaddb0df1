"""Fields of a stored run at nodes and any points; pictures of bodies and of values along lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.app.results.choice import Choice
from mlsanm_cli.app.results.curves import position_words, run_names
from mlsanm_cli.app.results.marks import boundary_nodes, marks_at
from mlsanm_cli.app.results.path_lookup import Level, displacement_at, level_at, pressures_at
from mlsanm_cli.app.scene.assemble import mls_settings
from mlsanm_cli.app.scene.loads import temperature_of
from mlsanm_cli.app.scene.materials import materials
from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.case import Case, Place, Temperature
from mlsanm_cli.cloud.cloud import imaged, with_images
from mlsanm_cli.cloud.membership import boundary_chords, inside_body
from mlsanm_cli.cloud.sight import tips_of, triangulate, visibility_criterion
from mlsanm_cli.contact.geometry.profile import THRESHOLD
from mlsanm_cli.errors import RunError
from mlsanm_cli.io import schema
from mlsanm_cli.io.plots.cloud import BodyPicture, CloudBody, Window
from mlsanm_cli.io.plots.curves import Curve, Panel, Picture
from mlsanm_cli.io.run_reader import Dataset, RunData, SavedState
from mlsanm_cli.mechanics.body_model import enough_neighbors, enriched_tips
from mlsanm_cli.mechanics.elasticity import point_rows, von_mises
from mlsanm_cli.mechanics.laws.law import gradient_of
from mlsanm_cli.mechanics.material import PlaneMaterial
from mlsanm_cli.operators.stencil_weights import Stencils
from mlsanm_cli.operators.stencils import build_stencils
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, FINE_ROUND_OFF

SCALARS = schema.scalars(schema.FIELDS)
Quantities = Mapping[str, FloatArray]
"""Displacement (n, 2), stress (n, 3), von Mises stress (n,) and others by name."""


def saved_state(run: RunData, position: float | None) -> SavedState:
    """The state saved at a position, by default the last one. RunError where none is."""
    if position is None and run.states:
        return run.states[-1]
    wanted = max(run["path/position"].tolist(), default=0.0) if position is None else position
    for state in run.states:
        if abs(state.position - wanted) <= FINE_ROUND_OFF * max(abs(wanted), 1.0):
            return state
    places = ", ".join(f"{state.position:g}" for state in run.states) or "(none)"
    raise RunError(f"fields are saved at position {places}, not at {wanted:g}", "name it in output.at")


def nodal(run: RunData, case: Case, state: SavedState, body: str) -> Quantities:
    """The saved quantities of a body at its nodes, and von Mises stress if it follows from stresses."""
    fields = dict(state.bodies[body])
    heated = any(isinstance(load, Temperature) and load.owner == body for load in case.load)
    if "von_mises" not in fields and "stress" in fields and not (heated or run.is_finite):
        stress, material = fields["stress"], _material(case, body)
        if material.revolved:
            stress = np.column_stack([stress, fields["stress_zz"]])
        fields["von_mises"] = von_mises(stress, material.out_of_plane_stress(stress))
    if np.isnan(fields.get("von_mises", 0.0)).any():
        # Unknown: out of plane for a plane stiffness, and where a deformation is not invertible.
        del fields["von_mises"]
    return {"displacement": np.zeros_like(run.bodies[body].points), **fields}


def scalar(quantities: Quantities, name: str) -> FloatArray:
    """A scalar (n,) of quantities. Raises RunError if it is not one of them."""
    chosen = SCALARS[name]
    if chosen.quantity not in quantities:
        hint = "add the field that it is computed from to output.fields and run again"
        raise RunError(f"{chosen.label} was not saved", hint)
    values = quantities[chosen.quantity]
    if chosen.component is not None:
        return values[:, chosen.component]
    return values if values.ndim == 1 else np.hypot(*values.T)


def fields_at(
    run: RunData, case: Case, body: str, points: FloatArray, levels: Sequence[Level]
) -> Iterator[tuple[Quantities, str]]:
    """Displacement, stress and von Mises stress of a body at ``points`` (e, 2), at finite strain of Cauchy's
    stress, and their origin, at levels with saved displacements: values and derivatives of the local
    polynomials of the run's degree, fitted to the nodal displacements. Raises RunError for points outside."""
    saved = [displacement_at(run, level, body) for level in levels]
    stencils = _stencils_at(run, case, body, points)
    nodes, material = run.bodies[body].points, _material(case, body)
    of_nodes = partial(_stencils_at, run, case, body, nodes)
    if run.is_finite:
        from mlsanm_cli.app.finite.fields import fields_at
        from mlsanm_cli.app.scene.materials import laws_of

        law = laws_of(case)[body]
        at_nodes = of_nodes() if law.nested else None
        for level, (displacement, how) in zip(levels, saved, strict=True):
            degrees, mean = _degrees(case, body, level, points), None
            if at_nodes is not None:
                gradient = gradient_of(at_nodes.derivatives(displacement))
                nodal = law.mean(gradient, _degrees(case, body, level, nodes))[0]
                mean = stencils.derivatives(nodal[:, None])[:, 0, 0]
            yield fields_at(law, stencils.derivatives(displacement), degrees, mean), how
        return
    rows = point_rows(stencils, material, of_nodes)
    for level, (displacement, how) in zip(levels, saved, strict=True):
        values = (rows @ displacement.ravel()).reshape(-1, len(points)).T
        stress = values[:, 2:] - _degrees(case, body, level, points)[:, None] * material.stress_of_expansion
        yield with_mises(case, body, level, points, values[:, :2], stress), how


def with_mises(
    case: Case, body: str, level: Level, points: FloatArray, displacement: FloatArray, stress: FloatArray
) -> Quantities:
    """Displacement (e, 2), stress (e, 3 | 4) and von Mises stress at ``points`` (e, 2) at small strain."""
    across = _material(case, body).out_of_plane_stress(stress, _degrees(case, body, level, points))
    found = {"displacement": displacement, "stress": stress[:, :3], "von_mises": von_mises(stress, across)}
    return found | {"stress_zz": across} if case.model.revolved else found


def inside(body: Dataset, points: FloatArray) -> BoolArray:
    """Mask (e,) of ``points`` (e, 2) that are in a body or, to the digits of cases, on its boundary."""
    boundary = body.boundary
    return inside_body(body.points, boundary.index, boundary.normal, boundary.name, points, COARSE_ROUND_OFF)


def boundary_edges(body: Dataset) -> IntArray:
    """Pairs (b, 2) of neighbours along a body's boundary, loop by loop."""
    index: IntArray = body.boundary.index
    return index[boundary_chords(index, body.boundary.name)]


def triangles_of(body: Dataset) -> IntArray:
    """Triangles (t, 3) of a stored body's points that fill it."""
    edges = boundary_edges(body)
    return triangulate(body.points, edges, visibility_criterion(body.points, edges))


def _stencils_at(run: RunData, case: Case, body: str, points: FloatArray) -> Stencils:
    """Stencils of value and first derivatives at ``points`` (e, 2) over the stored nodes."""
    data = run.bodies[body]
    outside = ~inside(data, points)
    if outside.any():
        x, y = points[outside][0]
        message = f'({x:g}, {y:g}) lies outside body "{body}"'
        raise RunError(message, "give coordinates of the undeformed body")
    material = _material(case, body)
    settings = mls_settings(case)
    if "degree" in data:
        settings = replace(settings, degree=int(data.degree))
    settings = enough_neighbors(settings, material)
    edges = boundary_edges(data)
    corners = tips_of(data.points, data.boundary.index, data.boundary.normal, data.boundary.name)
    tips, sight = enriched_tips(corners, material, settings), visibility_criterion(data.points, edges)
    nodes, own = data.points, imaged(data.points, edges) if case.model.revolved else None
    if own is not None:
        nodes = with_images(nodes, own)
        sight = None if sight is None else replace(sight, points=nodes)
    return build_stencils(nodes, cKDTree(nodes), points, 1, settings, sight, tips=tips, own=own)


def _material(case: Case, body: str) -> PlaneMaterial:
    return materials(case)[next(described.material for described in case.body if described.name == body)]


def _degrees(case: Case, body: str, level: Level, points: FloatArray) -> FloatArray:
    """Temperature change (e,) of the body at ``points`` (e, 2)."""
    total = np.zeros(len(points))
    for load, factor in zip(case.load, level.factors, strict=True):
        if isinstance(load, Temperature) and load.owner == body:
            total += factor * temperature_of(load).at(points)
    return total


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
    bodies = []
    for name, body in run.bodies.items():
        quantities = nodal(run, case, state, name)
        shown = field or ("von_mises" if "von_mises" in quantities else "displacement")
        values, moved = scalar(quantities, shown), quantities["displacement"]
        bodies.append(CloudBody(body.points, moved, values, triangles_of(body)))
    scale, label = automatic_scale(run, bodies), case.units.label(SCALARS[shown].label, SCALARS[shown].unit)
    title, unit = position_words(run, case, state.position), case.units.length
    marks, detail = marks_at(run, case, state, scale), contact_window(run, state.position, bodies, scale)
    return BodyPicture(bodies, label, title, scale, marks, unit, detail, SCALARS[shown].rest)


def automatic_scale(run: RunData, bodies: Sequence[CloudBody]) -> float:
    """1, 2 or 5 times a power of ten by which displacements are multiplied to be seen. Surfaces that met
    after closing a gap then overlap by (scale - 1) times that gap, which limits it."""
    largest = max(float(np.hypot(*body.displacement.T).max(initial=0.0)) for body in bodies)
    if run.is_finite or largest == 0.0:
        return 1.0
    limit = MAX_SHOWN_DISPLACEMENT * _size(bodies) / largest
    for contact in run.contacts.values():
        loaded = contact.pressure[-1] > THRESHOLD * contact.pressure[-1].max(initial=0.0)
        closed_gap = float(contact.gap[0][loaded].max(initial=0.0))
        if closed_gap > 0.0:
            detail = DETAIL_HALF_WIDTHS * float(np.ptp(contact.points[loaded], axis=0).max())
            limit = min(limit, 1.0 + MAX_OVERLAP * detail / closed_gap)
    limit = max(limit, 1.0)
    power = 10.0 ** np.floor(np.log10(limit))
    return float(power * max(digit for digit in (1.0, 2.0, 5.0) if digit * power <= limit))


def contact_window(run: RunData, position: float, bodies: Sequence[CloudBody], scale: float) -> Window | None:
    """The square (x0, x1, y0, y1) around the highest pressure as drawn; None if it is most of the scene."""
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
    """A field along a boundary, ``block.top``, or a line, ``X,Y:X,Y``. Raises RunError for others."""
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
    panel = Panel(curves, distance, units.label(label, SCALARS[field].unit))
    return Picture([panel], title, "best" if len(curves) > 1 else "")


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
