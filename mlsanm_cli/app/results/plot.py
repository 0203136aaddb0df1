"""``mlsanm plot``: pictures of a run from its directory, and its path as GIF or MP4 files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mlsanm_cli.app.checks.references import ReferenceProfile, profile_on
from mlsanm_cli.app.results.drawn import marks_at
from mlsanm_cli.app.results.overlay import TANGENTIAL, draw_along_path, draw_line, draw_together, slips
from mlsanm_cli.app.results.path_lookup import (
    level_at,
    mean_normal,
    pressing_force,
    pressures_at,
    refuse_unknown,
    tangential_force,
)
from mlsanm_cli.app.results.probe import probe_contact
from mlsanm_cli.app.results.views import (
    KINDS,
    OF_CONTACT,
    Choice,
    along_surface,
    automatic_scale,
    chosen_state,
    contact_window,
    load_words,
    refuse_nonsense,
    shown_bodies,
)
from mlsanm_cli.case import Case, stored_case
from mlsanm_cli.contact.geometry.profile import regular_peak
from mlsanm_cli.errors import RunError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.plots.animation import animate_bodies, animate_pressure
from mlsanm_cli.io.plots.cloud import plot_cloud
from mlsanm_cli.io.plots.friction import plot_loop, plot_traction
from mlsanm_cli.io.plots.plots import ReferenceCurve, plot_pressure
from mlsanm_cli.io.run_reader import RunData, read_run

MAX_LEVELS = 6
"""More load levels in one picture cannot be distinguished."""
CURVE_POINTS = 801
MIN_TANGENTIAL_MOTION = 1e-3
"""Tangential displacement of a platen, relative to the slip, below which a loop is drawn over the slip."""
REFERENCE_NAMES = {"Hertz": "Hertz, closed formula", "uniform": "uniform pressure"}


Draw = Callable[[Path], None]


def plot(
    rundir: Path | Sequence[Path], *, formats: tuple[str, ...] = ("png",), choice: Choice | None = None
) -> list[Path]:
    """Draws the run in ``rundir`` and returns the files written.

    Pictures, selected by ``choice``: pressure along every contact; with friction its tractions and the loop
    of the tangential force over a platen's displacement; contact force and peak pressure along the path
    (without contact, forces of loads and supports); the deformed bodies at the last saved position. Several
    runs are drawn in one picture. Failed and stopped runs are drawn up to their last step. Raises RunError
    for a directory without a readable run or without any state, and for choices not available in the run.
    """
    places = [rundir] if isinstance(rundir, Path) else list(rundir)
    choice = choice or Choice()
    refuse_nonsense(choice, len(places))
    runs = [read_run(place) for place in places]
    for run in runs:
        if not run.path.rows:
            raise RunError(f"{run.directory} holds no finished step yet", "there is nothing to draw")
        if choice.contact is not None:
            refuse_unknown(choice.contact, run.contacts, "contact")
    cases = [stored_case(run.case_resolved) for run in runs]
    if len(runs) > 1:
        assert choice.out is not None
        draw_together(choice.out, runs, cases, choice)
        return [choice.out]
    run, case = runs[0], cases[0]
    if choice.animate:
        return animate(run, case, choice)
    pictures = [
        (kind, subject, draw)
        for kind, subject, draw in _pictures(run, case, choice)
        if choice.wants(kind, subject if kind in OF_CONTACT else "")
    ]
    if not pictures:
        kinds = ", ".join(choice.what) or "such pictures"
        raise RunError(f"the run has nothing for {kinds}", f"kinds are: {', '.join(KINDS)}")
    if choice.out is None:
        files = {
            run.directory / run_dir.picture_name(kind, suffix, subject): draw
            for kind, subject, draw in pictures
            for suffix in formats
        }
        for file, draw in files.items():
            draw(file)
        return list(files)
    if len(pictures) > 1:
        names = ", ".join(" ".join(filter(None, (kind, subject))) for kind, subject, _ in pictures)
        raise RunError(
            f"-o names one picture, but there are {len(pictures)}: {names}", "add --what or --contact"
        )
    ((_, _, draw),) = pictures
    draw(choice.out)
    return [choice.out]


def _pictures(run: RunData, case: Case, choice: Choice) -> Iterator[tuple[str, str, Draw]]:
    """Kind, subject and drawing function of every picture for which the run has data."""
    friction = {contact.name: contact.coefficient for contact in case.contact}
    for name in run.contacts:
        yield "pressure", name, partial(_draw_pressure, run=run, case=case, name=name, at=choice.at)
        if friction[name]:
            yield "traction", name, partial(_draw_traction, run=run, case=case, name=name, at=choice.at)
        if friction[name] and np.isfinite(friction[name]):
            yield "loop", name, partial(_draw_loop, run=run, case=case, name=name)
            yield "hysteresis", name, partial(_draw_loop, run=run, case=case, name=name, over_slip=True)
    for kind in ("force", "peak") if run.contacts else ("force",):
        yield kind, "", partial(draw_along_path, runs=[run], cases=[case], kind=kind, choice=choice)
    if run.states:
        yield "bodies", "", partial(_draw_bodies, run=run, case=case, choice=choice)
    if choice.along is not None:
        yield "line", choice.along, partial(draw_line, runs=[run], cases=[case], choice=choice)


def _levels(run: RunData) -> list[float]:
    """Positions at which pressures are drawn: the saved ones and the end of the path."""
    end = float(run.path.position[-1])
    saved = sorted({state.position for state in run.states if 0.0 < state.position < end})
    if len(saved) >= MAX_LEVELS:
        chosen = np.linspace(0, len(saved) - 1, MAX_LEVELS - 1).round().astype(int)
        saved = [saved[i] for i in chosen]
    return [*saved, end]


def _draw_pressure(path: Path, run: RunData, case: Case, name: str, at: tuple[float, ...]) -> None:
    contact = run.contacts[name]
    levels = list(at) or _levels(run)
    pressure = np.stack([pressures_at(run, level)[name] for level in levels])
    profile = _reference(run, case, name)
    if at and at[-1] != float(run.path.position[-1]):
        # The reference solution is that of the end of the path.
        profile = None
    labels = [f"position {level:.4g}" for level in levels]
    words = load_words(run, case, levels[-1]) if len(levels) == 1 or len(case.stage) == 1 else ""
    shared: dict[str, Any] = {
        "pressure_label": case.units.label("pressure", "stress"),
        "suffix": words if len(levels) == 1 else "",
        "highest": max(regular_peak(contact.arc_length, one) for one in pressure),
    }
    along = case.units.label("arc length", "length")
    if profile is None:
        order, arc = along_surface(contact, pressure.max(axis=0))
        plot_pressure(path, name, arc, pressure[:, order], labels, None, along, **shared)
        return
    x = np.linspace(profile.coordinate[0], profile.coordinate[-1], CURVE_POINTS)
    # The curve includes the ends of the loaded part, however far the candidates extend.
    edges = np.array([-profile.half_width, profile.half_width])
    x = np.union1d(x, edges[(edges > x[0]) & (edges < x[-1])])
    curve = ReferenceCurve(x, profile.curve(x), REFERENCE_NAMES.get(profile.label, profile.label))
    from_middle = case.units.label("distance from the middle", "length")
    plot_pressure(path, name, profile.coordinate, pressure, labels, curve, from_middle, **shared)


def _draw_traction(path: Path, run: RunData, case: Case, name: str, at: tuple[float, ...]) -> None:
    contact = run.contacts[name]
    friction = next(one.coefficient for one in case.contact if one.name == name)
    # Bonds have no friction limit.
    coefficient = friction if np.isfinite(friction) else 0.0
    position = at[-1] if at else float(run.path.position[-1])
    (found,) = probe_contact(run, [position], name, ("pressure", "traction"))
    # The contact status is stored by step: within a step it is that of its end.
    row = level_at(run, position).row
    limit = coefficient * np.maximum(found["pressure"], 0.0)
    most = np.maximum(limit, np.abs(found["traction"]))
    order, arc = along_surface(contact, np.maximum(found["pressure"], 0.0))
    plot_traction(
        path,
        name,
        ", ".join(filter(None, (f"position {position:.4g}", load_words(run, case, position)))),
        arc,
        found["traction"][order],
        limit[order],
        contact.status[row][order],
        arc_label=case.units.label("arc length", "length"),
        traction_label=case.units.label("traction on the slave", "stress"),
        highest=regular_peak(contact.arc_length, most),
    )


def _draw_loop(path: Path, run: RunData, case: Case, name: str, over_slip: bool = False) -> None:
    """Draws the tangential force on the master over the tangential displacement of the platen that moves
    most. Without a platen, or with ``over_slip``, over the mean slip."""
    contact = run.contacts[name]
    force, (n_x, n_y) = tangential_force(run, name), mean_normal(run, name)
    along = {load: moved @ np.array([n_y, -n_x]) for load, moved in run.path.displacements.items()}
    moved, label = slips(contact), "mean slip of the surfaces"
    load = max(along, key=lambda one: float(np.ptp(along[one])), default="")
    if load and not over_slip and float(np.ptp(along[load])) > MIN_TANGENTIAL_MOTION * float(np.ptp(moved)):
        moved, label = along[load], f"displacement along the contact, by {load}"
    plot_loop(
        path,
        moved,
        force,
        case.units.label(label, "length"),
        f"Tangential force, {name}",
        force_label=case.units.label(TANGENTIAL, "force"),
    )


def _reference(run: RunData, case: Case, name: str) -> ReferenceProfile | None:
    """The closed formula at the end of the path; None where the case names none or nothing is pressed."""
    force = float(np.hypot(*pressing_force(run, name)[-1]))
    if case.reference is None or force == 0.0:
        return None
    contact, described = run.contacts[name], next(c for c in case.contact if c.name == name)
    return profile_on(case, described, contact.points, contact.normal, contact.pressure[-1], force)


def _draw_bodies(path: Path, run: RunData, case: Case, choice: Choice) -> None:
    state = chosen_state(run, choice.at[-1] if choice.at else None)
    bodies, label = shown_bodies(run, case, state, choice.field)
    scale = automatic_scale(run, bodies)
    title = ", ".join(filter(None, (f"position {state.position:.4g}", load_words(run, case, state.position))))
    marks = marks_at(run, case, state, scale)
    window = contact_window(run, state.position, bodies, scale)
    plot_cloud(path, bodies, label, title, scale, window, marks=marks, unit=case.units.length)


FRAMES = 40
MIN_FRAMES = 2


def animate(run: RunData, case: Case, choice: Choice) -> list[Path]:
    """Writes pressures of contacts along the path, from its series, or the bodies at saved positions; returns
    the files. Raises RunError if there are fewer than two states.
    """
    if "bodies" in choice.what or choice.field is not None or not run.contacts:
        return [_bodies(run, case, choice)]
    names = [choice.contact] if choice.contact is not None else list(run.contacts)
    if choice.out is not None and len(names) > 1:
        raise RunError("-o names one picture, but there are several contacts", "add --contact")
    return [_pressure(run, case, name, choice) for name in names]


def _pressure(run: RunData, case: Case, name: str, choice: Choice) -> Path:
    stored = np.asarray(run.path.position)
    even = np.linspace(float(stored[0]), float(stored[-1]), FRAMES)
    # Without series only stored states are known.
    places = even if run.path.order.any() else np.unique(stored)
    if len(places) < MIN_FRAMES:
        raise RunError("the run has one state only", "an animation needs at least two")
    levels = [float(place) for place in places]
    pressure = np.stack([pressures_at(run, level)[name] for level in levels])
    order, arc = along_surface(run.contacts[name], pressure.max(axis=0))
    file = choice.out or run.directory / run_dir.picture_name("pressure", "gif", name)
    animate_pressure(
        file,
        name,
        arc,
        pressure[:, order],
        [load_words(run, case, level) or f"position {level:.3f}" for level in levels],
        case.units.label("arc length", "length"),
        case.units.label("pressure", "stress"),
    )
    return file


def _bodies(run: RunData, case: Case, choice: Choice) -> Path:
    if len(run.states) < MIN_FRAMES:
        raise RunError(
            "fields are saved at one position only; an animation needs at least two",
            "list several positions in output.at and run again",
        )
    shown = [shown_bodies(run, case, state, choice.field) for state in run.states]
    states, label = [bodies for bodies, _ in shown], shown[0][1]
    scale = min(automatic_scale(run, bodies) for bodies in states)
    file = choice.out or run.directory / run_dir.picture_name("bodies", "gif")
    titles = [
        f"position {state.position:.4g}, {load_words(run, case, state.position)}" for state in run.states
    ]
    marks = [marks_at(run, case, state, scale) for state in run.states]
    animate_bodies(file, states, label, titles, scale, marks, unit=case.units.length)
    return file
