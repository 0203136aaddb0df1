"""``mlsanm probe``: results of a run at any level of its path."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mlsanm_cli.app.results.path_lookup import (
    SERIES,
    Level,
    checked_error,
    displacement_at,
    level_at,
    pressing_force,
    refuse_unknown,
)
from mlsanm_cli.app.results.views import boundary_edges
from mlsanm_cli.app.scene.assemble import mls_settings
from mlsanm_cli.app.scene.loads import temperature_of
from mlsanm_cli.app.scene.materials import materials
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, Temperature, stored_case
from mlsanm_cli.cloud.membership import inside_body
from mlsanm_cli.cloud.sight import visibility_criterion
from mlsanm_cli.cloud.tips import tips_of
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.run_reader import RunData, read_run
from mlsanm_cli.mechanics.body_model import enough_neighbors, enriched_tips
from mlsanm_cli.mechanics.elasticity import von_mises
from mlsanm_cli.mechanics.material import PlaneMaterial
from mlsanm_cli.mechanics.probes import point_rows, stress_of_expansion
from mlsanm_cli.operators.stencil_weights import Stencils
from mlsanm_cli.operators.stencils import build_stencils
from mlsanm_cli.startup import cKDTree

QUANTITIES = ("pressure", "traction", "gap", "slip")
FIELDS: Mapping[str, tuple[str, ...]] = {
    "displacement": ("ux", "uy"),
    "stress": ("xx", "yy", "xy"),
    "von_mises": ("von_mises",),
}
Row = dict[str, Any]


def contents(rundir: Path) -> Mapping[str, Any]:
    """The results available in a run."""
    run = read_run(rundir)
    rows = run.path.position
    return {
        "path": [float(rows[0]), float(rows[-1])] if run.path.rows else [],
        "contacts": list(run.contacts),
        "forces": [*run.path.resultants, *run.contacts],
        "bodies": list(run.bodies),
        "probes": list(run.probes),
        "fields_at": [state.position for state in run.states],
    }


def probe_contact(
    rundir: Path | RunData, at: Sequence[float], name: str, quantities: Sequence[str] = ()
) -> list[Row]:
    """Quantities (m,) of a contact's slave nodes at every position of ``at``; all of them by default."""
    run, case = _read(rundir)
    refuse_unknown(name, run.contacts, "contact")
    frictional = bool(_friction(case)[name])
    for wanted in quantities:
        if wanted in ("traction", "slip") and not frictional:
            raise RunError(f'contact "{name}" has no friction and so no {wanted}', "use pressure or gap")
    chosen = quantities or (QUANTITIES if frictional else ("pressure", "gap"))
    contact = run.contacts[name]
    place = {"arc_length": contact.arc_length, "x": contact.points[:, 0], "y": contact.points[:, 1]}
    levels = _levels(run, at)
    return [
        _position(level)
        | place
        | {key: _on_contact(run, case, level, name, key) for key in chosen}
        | _interpolated(run, level, "pressures", contact.pressure, contact.traction)
        for level in levels
    ]


def probe_force(rundir: Path | RunData, at: Sequence[float], name: str, contact: bool = False) -> list[Row]:
    """Force (x, y) that a load or support exerts on its body, or a contact on its slave. With ``contact`` the
    name is that of a contact, even if a load has it too."""
    run, case = _read(rundir)
    refuse_unknown(name, [*run.path.resultants, *run.contacts], "load, support or contact")
    if name in run.path.resultants and name in run.contacts and not contact:
        raise RunError(f'"{name}" is both a load and a contact', "give one of them another name")
    rows = []
    for level in _levels(run, at):
        if name in run.contacts and run.is_finite:
            force = level.between(run.path.resultants[f"contact {name}"])
        elif name in run.contacts:
            force = _contact_force(run, case, level, name)
        elif level.how == SERIES:
            force = _mapped(run, level, "forces", name)
        else:
            force = level.between(run.path.resultants[name])
        history = run.path.resultants[name] if name in run.path.resultants else pressing_force(run, name)
        error = _interpolated(run, level, "forces", history)
        rows.append(_position(level) | {"fx": float(force[0]), "fy": float(force[1])} | error)
    return rows


def probe_named(
    rundir: Path | RunData, at: Sequence[float], name: str, field: str | None = None
) -> list[Row]:
    """Displacement and stress at a ``[[probe]]`` of the case."""
    run, case = _read(rundir)
    refuse_unknown(name, run.probes, "[[probe]]")
    body, point = next((p.body, np.array([p.point])) for p in case.probe if p.name == name)
    rows = []
    for level in _levels(run, at):
        if level.how == SERIES:
            seen = _mapped(run, level, "probes", name)
        else:
            seen = np.concatenate(
                [level.between(run.probes[name].displacement), level.between(run.probes[name].stress)]
            )
        if run.is_finite:
            seen, error = np.append(seen, level.between(run.probes[name].von_mises)), {}
        else:
            seen = _with_mises(case, body, level, point, seen[None])[0]
            error = _interpolated(run, level, "displacements", run.probes[name].displacement)
        rows.append(_position(level) | _columns(seen, field) | error)
    return rows


def probe_point(
    rundir: Path | RunData,
    at: Sequence[float],
    body: str,
    point: tuple[float, float],
    field: str | None = None,
) -> list[Row]:
    """Displacement and stress of a body at any point, at levels with saved fields. Values and derivatives of
    the local polynomials of the run's degree, fitted to the nodal displacements."""
    run, case = _read(rundir)
    refuse_unknown(body, run.bodies, "body")
    levels = _levels(run, at)
    found = seen_at(run, case, body, np.array([point], dtype=np.float64), levels)
    return [
        {"position": level.position, "how": how} | _columns(seen[0], field)
        for level, (seen, how) in zip(levels, found, strict=True)
    ]


def seen_at(
    run: RunData, case: Case, body: str, points: FloatArray, levels: Sequence[Level]
) -> Iterator[tuple[FloatArray, str]]:
    """Displacement, stress and von Mises stress (e, 6) of a body at ``points`` (e, 2), at finite strain
    Cauchy's, and their origin, at levels with saved fields. Raises RunError as `probe_point` does."""
    saved = [displacement_at(run, level, body) for level in levels]
    stencils = _stencils_at(run, case, body, points)
    if run.is_finite:
        from mlsanm_cli.app.finite.fields import FiniteFields
        from mlsanm_cli.app.finite.scene import law_of, material_of

        law, alpha = law_of(case, body), material_of(case, body).alpha
        for level, (displacement, how) in zip(levels, saved, strict=True):
            warm = 1.0 + alpha * _degrees(case, body, level, points) if isinstance(alpha, float) else None
            seen = FiniteFields.of(law, stencils.derivatives(displacement), warm)
            yield np.column_stack([seen.displacement, seen.stress, seen.von_mises]), how
        return
    nodal = partial(_stencils_at, run, case, body, run.bodies[body].points)
    rows = point_rows(stencils, _material(case, body), nodal)
    free = stress_of_expansion(_material(case, body))
    for level, (displacement, how) in zip(levels, saved, strict=True):
        values = (rows @ displacement.ravel()).reshape(5, -1).T
        values[:, 2:] -= _degrees(case, body, level, points)[:, None] * free
        yield _with_mises(case, body, level, points, values), how


def _read(rundir: Path | RunData) -> tuple[RunData, Case]:
    run = rundir if isinstance(rundir, RunData) else read_run(rundir)
    return run, stored_case(run.case_resolved)


def _levels(run: RunData, at: Sequence[float]) -> list[Level]:
    if not at and run.path.rows:
        at = (float(run.path.position[-1]),)
    return [level_at(run, position) for position in at or (0.0,)]


def _position(level: Level) -> Row:
    return {"position": level.position, "how": level.how}


def _interpolated(run: RunData, level: Level, name: str, *histories: FloatArray) -> Row:
    """The estimated error of interpolated ``histories``; empty if the level is not interpolated."""
    error = checked_error(run, level, name, *histories)
    return {} if error is None else {"error": error}


def _friction(case: Case) -> dict[str, float]:
    return {contact.name: contact.coefficient for contact in case.contact}


def _mapped(run: RunData, level: Level, kind: str, name: str) -> FloatArray:
    """The value of a stored map at a level."""
    found = run.maps[kind].get(name)
    if found is None:
        raise RunError(
            f"{run.directory} was written by a version that kept {kind} at the ends of steps only",
            "run the case again, or ask for a stored position",
        )
    result: FloatArray = found @ level.unknowns
    return result


def _span(run: RunData, case: Case, name: str, frictional_only: bool) -> slice:
    """Indices of a contact among the nodes of all contacts, or of those with friction."""
    first = 0
    for contact, friction in _friction(case).items():
        if contact not in run.maps["bonds"] and (friction or not frictional_only):
            count = len(run.contacts[contact].arc_length)
            if contact == name:
                return slice(first, first + count)
            first += count
    return slice(0, 0)


def _on_contact(run: RunData, case: Case, level: Level, name: str, quantity: str) -> FloatArray:
    """One quantity (m,) of a contact."""
    if level.how != SERIES:
        return level.between(getattr(run.contacts[name], quantity))
    if name in run.maps["bonds"]:
        pressure, traction = np.split(_mapped(run, level, "bonds", name), 2)
        nothing = np.zeros(len(pressure))
        return {"pressure": pressure, "traction": traction}.get(quantity, nothing)
    if quantity == "slip":
        return _mapped(run, level, "slip", name)
    if quantity == "traction":
        return level.traction[_span(run, case, name, frictional_only=True)]
    values: FloatArray = level.pressure if quantity == "pressure" else level.gap
    return values[_span(run, case, name, frictional_only=False)]


def _contact_force(run: RunData, case: Case, level: Level, name: str) -> FloatArray:
    """Force (2,) on the slave."""
    contact = run.contacts[name]
    force = (contact.weight * _on_contact(run, case, level, name, "pressure")) @ contact.normal
    if _friction(case)[name]:
        tangent = np.stack([contact.normal[:, 1], -contact.normal[:, 0]], axis=1)
        force = force + (contact.weight * _on_contact(run, case, level, name, "traction")) @ tangent
    return np.asarray(force, dtype=np.float64)


def _stencils_at(run: RunData, case: Case, body: str, points: FloatArray) -> Stencils:
    """Stencils of value and first derivatives at ``points`` (e, 2) over the stored nodes."""
    data = run.bodies[body]
    inside = inside_body(data.points, data.boundary_index, data.boundary_normal, data.boundary_name, points)
    if not inside.all():
        x, y = points[~inside][0]
        message = f'({x:g}, {y:g}) lies outside body "{body}"'
        raise RunError(message, "give coordinates of the undeformed body")
    material = _material(case, body)
    settings = mls_settings(case)
    if data.degree is not None:
        settings = replace(settings, degree=data.degree)
    settings = enough_neighbors(settings, material)
    edges = boundary_edges(data)
    corners = tips_of(data.points, edges, data.boundary_index, data.boundary_normal)
    tips, sight = enriched_tips(corners, material, settings), visibility_criterion(data.points, edges)
    return build_stencils(data.points, cKDTree(data.points), points, 1, settings, sight, tips=tips)


def _material(case: Case, body: str) -> PlaneMaterial:
    return materials(case)[next(one.material for one in case.body if one.name == body)]


def _degrees(case: Case, body: str, level: Level, points: FloatArray) -> FloatArray:
    """Temperature change (e,) of the body at ``points`` (e, 2)."""
    total = np.zeros(len(points))
    for load, factor in zip(case.load, level.factors, strict=True):
        if isinstance(load, Temperature) and load.owner == body:
            total += float(factor) * temperature_of(load).at(points)
    return total


def _with_mises(case: Case, body: str, level: Level, points: FloatArray, seen: FloatArray) -> FloatArray:
    """Displacement and stress (e, 5) at ``points`` (e, 2), followed by von Mises stress (e, 6)."""
    across = _material(case, body).out_of_plane_stress(seen[:, 2:], _degrees(case, body, level, points))
    return np.column_stack([seen, von_mises(seen[:, 2:], across)])


def _columns(values: FloatArray, field: str | None) -> Row:
    """Displacement, stress and von Mises stress (6,) by name, for one field or all."""
    columns = [name for names in FIELDS.values() for name in names]
    wanted = FIELDS[field] if field else columns
    return {name: float(value) for name, value in zip(columns, values, strict=True) if name in wanted}
