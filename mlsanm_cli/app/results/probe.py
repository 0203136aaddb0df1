"""``mlsanm probe``: results of a run at any level of its path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mlsanm_cli.app.results.choice import POINT_FIELDS, QUANTITIES
from mlsanm_cli.app.results.fields import SCALARS, Quantities, fields_at, scalar, with_mises
from mlsanm_cli.app.results.path_lookup import (
    Level,
    along_surface,
    checked_error,
    contact_force,
    level_at,
    refuse_unknown,
)
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, stored_case
from mlsanm_cli.cloud.revolution import at_axis
from mlsanm_cli.contact.geometry.profile import half_width
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.columns import force_on_slave
from mlsanm_cli.io.run_reader import RunData, read_run

TANGENTIAL = ("traction", "slip")
Row = dict[str, Any]


def contents(rundir: Path) -> Mapping[str, Any]:
    run = read_run(rundir)
    return {
        "path": [float(run.path.position[0]), float(run.path.position[-1])] if run.rows else [],
        "contacts": list(run.contacts),
        "forces": [*run.path.resultants, *run.contacts],
        "bodies": list(run.bodies),
        "probes": list(run.probes),
        "fields_at": [state.position for state in run.states],
    }


def probe(
    rundir: Path,
    at: Sequence[float],
    kind: str = "contacts",
    name: str = "",
    quantities: Sequence[str] = (),
    point: tuple[float, float] | None = None,
    field: str | None = None,
) -> list[Row]:
    """Results of a contact, force, probe or body by name, or the figures of all "contacts", at positions."""
    if kind == "contact":
        return probe_contact(rundir, at, name, quantities)
    if kind == "force":
        return probe_force(rundir, at, name)
    if kind == "probe":
        return probe_named(rundir, at, name, field)
    return probe_everything(rundir, at) if point is None else probe_point(rundir, at, name, point, field)


def probe_contact(
    rundir: Path | RunData, at: Sequence[float], name: str, quantities: Sequence[str] = ()
) -> list[Row]:
    """Quantities (m,) of a contact's slave nodes at every position of ``at``; all of them by default."""
    run, case = _read(rundir)
    refuse_unknown(name, run.contacts, "contact")
    friction, contact = _has_friction(case, name), run.contacts[name]
    for wanted in quantities:
        if wanted in TANGENTIAL and not friction:
            raise RunError(f'contact "{name}" has no friction and so no {wanted}', "use pressure or gap")
    chosen = quantities or [quantity for quantity in QUANTITIES if friction or quantity not in TANGENTIAL]
    place = {"arc_length": contact.arc_length, "x": contact.points[:, 0], "y": contact.points[:, 1]}
    return [
        _origin(run, level, "pressures", contact.pressure, contact.traction)
        | place
        | {key: level[f"contacts/{name}/{key}"] for key in chosen}
        for level in _levels(run, at)
    ]


def probe_everything(rundir: Path | RunData, at: Sequence[float]) -> list[Row]:
    """Largest pressure, half-width and force on the slave of all contacts at every position of ``at``; of a
    run without contacts the forces of loads and supports."""
    run, case = _read(rundir)
    rows = []
    for level in _levels(run, at):
        for name in run.contacts or run.path.resultants:
            (force,) = probe_force(run, [level.position], name, contact=name in run.contacts)
            row = {"position": force.pop("position"), "name": name}
            if name in run.contacts:
                pressure = level[f"contacts/{name}/pressure"]
                order, arc = along_surface(run.contacts[name], pressure)
                axis = at_axis(run.contacts[name].points[order], case.model.revolved)
                width = half_width(arc, pressure[order], axis)
                row |= {"peak_pressure": float(pressure.max(initial=0.0)), "half_width": width}
            rows.append(row | force)
    return rows


def probe_force(rundir: Path | RunData, at: Sequence[float], name: str, contact: bool = False) -> list[Row]:
    """Force (x, y) that a load or support exerts on its body, or a contact on its slave. With ``contact`` the
    name is that of a contact, even if a load has it too."""
    run, case = _read(rundir)
    resultants = run.path.resultants
    refuse_unknown(name, [*resultants, *run.contacts], "load, support or contact")
    if name in resultants and name in run.contacts and not contact:
        raise RunError(f'"{name}" is both a load and a contact', "give one of them another name")
    history = resultants[name] if name in resultants else contact_force(run, name)
    rows = []
    for level in _levels(run, at):
        if name in run.contacts and not run.is_finite:
            one, pressure = run.contacts[name], level[f"contacts/{name}/pressure"]
            traction = level[f"contacts/{name}/traction"] if _has_friction(case, name) else None
            force = force_on_slave(one.weight, one.normal, pressure, traction)
        else:
            force = level[f"path/resultants/{'contact ' if name in run.contacts else ''}{name}"]
        row = _origin(run, level, "forces", history)
        rows.append(row | {"fx": float(force[0]), "fy": float(force[1])})
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
        seen = {key: level[f"probes/{name}/{key}"][None] for key in ("displacement", "stress")}
        if run.is_finite:
            seen["von_mises"] = level[f"probes/{name}/von_mises"][None]
        else:
            if case.model.revolved:
                hoop = level[f"probes/{name}/stress_zz"][None, None]
                seen["stress"] = np.concatenate([seen["stress"], hoop], axis=1)
            seen = dict(with_mises(case, body, level, point, **seen))
        rows.append(_origin(run, level, "displacements", run.probes[name].displacement) | _row(seen, field))
    return rows


def probe_point(
    rundir: Path | RunData,
    at: Sequence[float],
    body: str,
    point: tuple[float, float],
    field: str | None = None,
) -> list[Row]:
    """Displacement and stress of a body at any point, at levels with saved fields; see `fields_at`."""
    run, case = _read(rundir)
    refuse_unknown(body, run.bodies, "body")
    levels = _levels(run, at)
    fields = fields_at(run, case, body, np.array([point], dtype=np.float64), levels)
    return [
        {"position": level.position, "how": how} | _row(seen, field)
        for level, (seen, how) in zip(levels, fields, strict=True)
    ]


def _read(rundir: Path | RunData) -> tuple[RunData, Case]:
    run = rundir if isinstance(rundir, RunData) else read_run(rundir)
    return run, stored_case(run.case_resolved)


def _levels(run: RunData, at: Sequence[float]) -> list[Level]:
    if not at and run.rows:
        at = (float(run.path.position[-1]),)
    return [level_at(run, position) for position in at or (0.0,)]


def _origin(run: RunData, level: Level, name: str, *histories: FloatArray) -> Row:
    """The position of a level, the origin of its values, and the estimated error of interpolated ones."""
    error = checked_error(run, level, name, *histories)
    known = {} if error is None else {"error": error}
    return {"position": level.position, "how": level.how, **known}


def _has_friction(case: Case, contact: str) -> bool:
    return any(described.name == contact and described.coefficient for described in case.contact)


def _row(seen: Quantities, field: str | None) -> Row:
    """The scalars of quantities at one point, of one ``field`` or all; vectors by component."""
    return {
        name: float(scalar(seen, name)[0])
        for name, component in SCALARS.items()
        if component.quantity in ([field] if field else seen.keys() & POINT_FIELDS) and name != "displacement"
    }
