"""``mlsanm probe``: results of a run at any level of its path."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
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
from mlsanm_cli.cloud.cloud import at_axis
from mlsanm_cli.contact.geometry.profile import half_width
from mlsanm_cli.errors import RunError
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


def probe_contact(
    rundir: Path | RunData, at: Sequence[float], name: str, quantities: Sequence[str] = ()
) -> list[Row]:
    """Quantities (m,) of a contact's slave nodes at every position of ``at``; all of them by default."""
    run, case = _read(rundir)
    refuse_unknown(name, run.contacts, "contact")
    contact = run.contacts[name]
    friction = any(described.name == name and described.coefficient for described in case.contact)
    for wanted in quantities:
        if wanted in TANGENTIAL and not friction:
            raise RunError(f'contact "{name}" has no friction and so no {wanted}', "use pressure or gap")
    chosen = quantities or [quantity for quantity in QUANTITIES if friction or quantity not in TANGENTIAL]
    place = {"arc_length": contact.arc_length, "x": contact.points[:, 0], "y": contact.points[:, 1]}
    return _rows(
        *(run, at, lambda level: place | {key: level[f"contacts/{name}/{key}"] for key in chosen}),
        *("pressures", contact.pressure, contact.traction),
    )


def probe_everything(rundir: Path | RunData, at: Sequence[float]) -> list[Row]:
    """Figures of all contacts, or without contacts the forces of loads and supports, at every position."""
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
    """Force (x, y) of a load or support on its body, or a contact, as ``contact`` decides, on its slave."""
    run, _ = _read(rundir)
    resultants = run.path.resultants
    refuse_unknown(name, [*resultants, *run.contacts], "load, support or contact")
    if name in resultants and name in run.contacts and not contact:
        raise RunError(f'"{name}" is both a load and a contact', "give one of them another name")

    def values(level: Level) -> Row:
        of_contact = name in run.contacts
        x, y = contact_force(run, name, level) if of_contact else level[f"path/resultants/{name}"]
        return {"fx": float(x), "fy": float(y)}

    history = resultants[name] if name in resultants else contact_force(run, name)
    return _rows(run, at, values, "forces", history)


def probe_named(
    rundir: Path | RunData, at: Sequence[float], name: str, field: str | None = None
) -> list[Row]:
    """Displacement and stress at a ``[[probe]]`` of the case."""
    run, case = _read(rundir)
    refuse_unknown(name, run.probes, "[[probe]]")
    body, point = next((p.body, np.array([p.point])) for p in case.probe if p.name == name)

    def values(level: Level) -> Row:
        keys = ("displacement", "stress", *(("von_mises",) if run.is_finite else ()))
        seen = {key: level[f"probes/{name}/{key}"][None] for key in keys}
        if case.model.revolved:
            hoop = level[f"probes/{name}/stress_zz"][None, None]
            seen["stress"] = np.concatenate([seen["stress"], hoop], axis=1)
        return _row(seen if run.is_finite else with_mises(case, body, level, point, **seen), field)

    return _rows(run, at, values, "displacements", run.probes[name].displacement)


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
    end = (float(run.path.position[-1]),) if run.rows else (0.0,)
    return [level_at(run, position) for position in at or end]


def _rows(
    run: RunData, at: Sequence[float], values: Callable[[Level], Row], name: str, *histories: FloatArray
) -> list[Row]:
    """The ``values`` at levels, after position, origin, and estimated error."""
    rows = []
    for level in _levels(run, at):
        error = checked_error(run, level, name, *histories)
        known = {} if error is None else {"error": error}
        rows.append({"position": level.position, "how": level.how, **known, **values(level)})
    return rows


def _row(seen: Quantities, field: str | None) -> Row:
    """The scalars of quantities at one point, of one ``field`` or all; vectors by component."""
    return {
        name: float(scalar(seen, name)[0])
        for name, component in SCALARS.items()
        if component.quantity in ([field] if field else seen.keys() & POINT_FIELDS) and name != "displacement"
    }
