"""Fields of a stored run: at its nodes, and at any points of its bodies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.app.results.path_lookup import Level, displacement_at
from mlsanm_cli.app.scene.assemble import mls_settings
from mlsanm_cli.app.scene.loads import temperature_of
from mlsanm_cli.app.scene.materials import materials
from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.case import Case, Temperature
from mlsanm_cli.cloud.membership import boundary_chords, inside_body
from mlsanm_cli.cloud.revolution import imaged, with_images
from mlsanm_cli.cloud.sight import triangulate, visibility_criterion
from mlsanm_cli.cloud.tips import tips_of
from mlsanm_cli.errors import RunError
from mlsanm_cli.io import schema
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
    """The saved quantities of a body at its nodes, with von Mises stress if it follows from stresses, and a
    displacement of zero if that was not saved."""
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


def default_scalar(quantities: Quantities) -> str:
    """Von Mises stress if it is known, else the displacement."""
    return "von_mises" if "von_mises" in quantities else "displacement"


def fields_at(
    run: RunData, case: Case, body: str, points: FloatArray, levels: Sequence[Level]
) -> Iterator[tuple[Quantities, str]]:
    """Displacement, stress and von Mises stress of a body at ``points`` (e, 2), at finite strain of Cauchy's
    stress, and their origin, at levels with saved displacements: values and derivatives of the local
    polynomials of the run's degree, fitted to the nodal displacements. Raises RunError for points outside."""
    saved = [displacement_at(run, level, body) for level in levels]
    stencils = _stencils_at(run, case, body, points)
    if run.is_finite:
        from mlsanm_cli.app.finite.fields import fields_at
        from mlsanm_cli.app.scene.materials import laws_of

        law, nodes = laws_of(case)[body], run.bodies[body].points
        at_nodes = _stencils_at(run, case, body, nodes) if law.nested else None
        for level, (displacement, how) in zip(levels, saved, strict=True):
            degrees, mean = _degrees(case, body, level, points), None
            if at_nodes is not None:
                gradient = gradient_of(at_nodes.derivatives(displacement))
                nodal = law.mean(gradient, _degrees(case, body, level, nodes))[0]
                mean = stencils.derivatives(nodal[:, None])[:, 0, 0]
            yield fields_at(law, stencils.derivatives(displacement), degrees, mean), how
        return
    of_nodes = partial(_stencils_at, run, case, body, run.bodies[body].points)
    rows = point_rows(stencils, _material(case, body), of_nodes)
    free = _material(case, body).stress_of_expansion
    for level, (displacement, how) in zip(levels, saved, strict=True):
        values = (rows @ displacement.ravel()).reshape(-1, len(points)).T
        stress = values[:, 2:] - _degrees(case, body, level, points)[:, None] * free
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
            total += float(factor) * temperature_of(load).at(points)
    return total
