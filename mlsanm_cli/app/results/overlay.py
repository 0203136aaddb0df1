"""Curves of one or several runs in one picture, and fields along lines and boundaries."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from mlsanm_cli.app.results.drawn import boundary_nodes
from mlsanm_cli.app.results.path_lookup import level_at, pressing_force, pressures_at, tangential_force
from mlsanm_cli.app.results.probe import seen_at
from mlsanm_cli.app.results.views import FIELDS, Choice, along_surface, chosen_state, field_of
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, Place
from mlsanm_cli.cloud.membership import inside_body
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.plots.plots import PlotCurve, plot_curves
from mlsanm_cli.io.run_reader import ContactData, RunData

LINE_POINTS, MIN_INSIDE = 301, 2
"""Points of a line, and least number of them in a body that it crosses."""
POSITION = "position on the load path (stages)"
TANGENTIAL = "tangential force on the master, per unit thickness"
COLUMNS = ("ux", "uy", "xx", "yy", "xy", "von_mises")


def draw_together(path: Path, runs: Sequence[RunData], cases: Sequence[Case], choice: Choice) -> None:
    """Draws several runs in one picture. Raises RunError for kinds that do not support it."""
    kind = "line" if choice.along is not None else choice.what[0] if len(choice.what) == 1 else ""
    if kind == "line":
        draw_line(path, runs, cases, choice)
    elif kind in ("pressure", "force", "peak", "loop", "hysteresis"):
        draw_along_path(path, runs, cases, kind, choice)
    else:
        raise RunError(
            "several runs need one kind of picture",
            "add --what pressure, force, peak, loop or hysteresis, or --along",
        )


def draw_along_path(
    path: Path, runs: Sequence[RunData], cases: Sequence[Case], kind: str, choice: Choice
) -> None:
    """Draws pressures, forces, peak pressures, or else tangential forces over slip, of one run or several."""
    units, names = cases[0].units, _names(runs) if len(runs) > 1 else [""]
    curves = [
        curve for run, name in zip(runs, names, strict=True) for curve in _of_run(run, name, kind, choice)
    ]
    if not curves:
        raise RunError(
            f"the runs have no data for {kind}", "pressures and peaks need a contact, loops need friction"
        )
    force = "contact force" if any(run.contacts for run in runs) else "force of loads and supports"
    x, y = {
        "pressure": (units.label("arc length", "length"), units.label("contact pressure", "stress")),
        "force": (POSITION, units.label(f"{force} per unit thickness", "force")),
        "peak": (POSITION, units.label("peak contact pressure", "stress")),
    }.get(kind, (units.label("mean slip of the surfaces", "length"), units.label(TANGENTIAL, "force")))
    title = {"pressure": "Contact pressure", "force": force.capitalize(), "peak": "Peak contact pressure"}
    alone = f", {curves[0].label}" if len(curves) == 1 else ""
    plot_curves(path, curves, x, y, title.get(kind, "Tangential force") + alone)


def draw_line(path: Path, runs: Sequence[RunData], cases: Sequence[Case], choice: Choice) -> None:
    """Draws a field along a boundary such as ``block.top``, or along the straight line ``X,Y:X,Y``, at saved
    positions. Raises RunError for an invalid line, and for one that crosses no body.
    """
    assert choice.along is not None
    field = choice.field or "von_mises"
    label, kind = FIELDS[field]
    curves = []
    for run, case, name in zip(runs, cases, _names(runs), strict=True):
        for position in choice.at or (chosen_state(run, None).position,):
            words = [name] if len(runs) > 1 else []
            words += [f"position {position:.4g}"] if len(choice.at) > 1 or len(runs) == 1 else []
            for where, x, y in _along(run, case, choice.along, field, position):
                curves.append(PlotCurve(x, y, ", ".join([*words, where] if where else words)))
    units = cases[0].units
    along = "distance along the line" if ":" in choice.along else "arc length"
    plot_curves(
        path,
        curves,
        units.label(along, "length"),
        units.label(label, kind),
        f"{label[0].upper()}{label[1:]} along {choice.along}",
    )


def slips(contact: ContactData) -> FloatArray:
    """The mean slip (S+1,) of a contact along the path."""
    return np.asarray(contact.slip @ contact.weight / contact.weight.sum(), dtype=np.float64)


def _of_run(run: RunData, name: str, kind: str, choice: Choice) -> Iterator[PlotCurve]:
    position = np.asarray(run.path.position)
    # Exact contact is solved at a few positions: what lies between them is not on a straight line.
    joined = not run.contacts or bool(run.path.order.any())
    if not run.contacts and kind == "force":
        for load, force in run.path.resultants.items():
            label = f"{name}, {load}" if name else load
            yield PlotCurve(position, np.hypot(*force.T), label, joined)
    for contact_name, contact in run.contacts.items():
        if choice.contact not in (None, contact_name):
            continue
        single = name and (len(run.contacts) == 1 or choice.contact)
        label = name if single else ", ".join(filter(None, (name, contact_name)))
        if kind == "pressure":
            for level in choice.at or (float(position[-1]),):
                legend = f"{label}, position {level:.4g}" if choice.at else label
                pressure = pressures_at(run, level)[contact_name]
                order, arc = along_surface(contact, pressure)
                yield PlotCurve(arc, pressure[order], legend)
        elif kind == "force":
            yield PlotCurve(position, np.hypot(*pressing_force(run, contact_name).T), label, joined)
        elif kind == "peak":
            yield PlotCurve(position, contact.pressure.max(axis=1, initial=0.0), label, joined)
        elif not np.isnan(contact.slip).any():
            yield PlotCurve(slips(contact), tangential_force(run, contact_name), label)


def _along(
    run: RunData, case: Case, along: str, field: str, position: float
) -> list[tuple[str, FloatArray, FloatArray]]:
    """For every body crossed: name, distances (k,) and values (k,), nan outside the body."""
    ends = along.split(":")
    if len(ends) == 1:
        return [("", *_on_boundary(run, case, along, field, position))]
    try:
        first, last = (np.array([float(part) for part in end.split(",")]) for end in ends)
        if first.shape != (2,) or last.shape != (2,) or not np.isfinite([first, last]).all():
            raise ValueError
    except ValueError:
        message = f'"{along}" is neither a boundary nor a line'
        raise RunError(message, "as in --along block.top or --along 0,0:0,-1") from None
    share = np.linspace(0.0, 1.0, LINE_POINTS)
    points = first + share[:, None] * (last - first)
    level = level_at(run, position)
    found = []
    for name, body in run.bodies.items():
        inside = inside_body(
            body.points, body.boundary_index, body.boundary_normal, body.boundary_name, points
        )
        if inside.sum() < MIN_INSIDE:
            continue
        ((seen, _),) = seen_at(run, case, name, points[inside], [level])
        values = np.full(LINE_POINTS, np.nan)
        magnitude = np.hypot(seen[:, 0], seen[:, 1])
        values[inside] = magnitude if field == "displacement" else seen[:, COLUMNS.index(field)]
        found.append((name, share * float(np.hypot(*(last - first))), values))
    if not found:
        raise RunError(f"the line {along} crosses no body", "give coordinates of the undeformed bodies")
    return [("" if len(found) == 1 else name, x, y) for name, x, y in found]


def _on_boundary(
    run: RunData, case: Case, boundary: str, field: str, position: float
) -> tuple[FloatArray, FloatArray]:
    name, _, edge = boundary.partition(".")
    body = run.bodies.get(name)
    edges = [] if body is None else list(dict.fromkeys(one.partition("/")[0] for one in body.boundary_name))
    if body is None or edge not in edges:
        known = ", ".join(f"{name}.{one}" for one in edges) or ", ".join(run.bodies)
        raise RunError(f'there is no boundary "{boundary}"', f"there are: {known}")
    index, _ = boundary_nodes(body, Place((boundary,)))
    fields = chosen_state(run, position).bodies[name]
    displacement = fields.get("displacement", np.zeros_like(body.points))
    values, _ = field_of(case, name, fields, displacement, field)
    steps = np.hypot(*np.diff(body.points[index], axis=0).T)
    return np.concatenate([[0.0], np.cumsum(steps)]), values[index]


def _names(runs: Sequence[RunData]) -> list[str]:
    """Names of runs: the last parts of their directories, as many as needed to distinguish them."""
    parts = [run.directory.resolve().parts for run in runs]
    for count in range(1, max(map(len, parts)) + 1):
        names = ["/".join(part[-count:]) for part in parts]
        if len(set(names)) == len(names):
            return names
    return [f"{run.directory} ({number})" for number, run in enumerate(runs, start=1)]
