"""``mlsanm plot``: pictures of a run from its directory, and its path as GIF or MP4 files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from mlsanm_cli.app.results import curves
from mlsanm_cli.app.results.choice import KINDS, Choice
from mlsanm_cli.app.results.fields import bodies_picture, line_picture, saved_state
from mlsanm_cli.app.results.marks import marks_at
from mlsanm_cli.app.results.path_lookup import along_surface, pressures_at, refuse_unknown, tangential_force
from mlsanm_cli.case import Case, stored_case
from mlsanm_cli.errors import RunError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.plots.cloud import BodyPicture, plot_bodies
from mlsanm_cli.io.plots.cloud import animate as write_frames
from mlsanm_cli.io.plots.curves import Curve, Panel, Picture, draw, visible_range
from mlsanm_cli.io.plots.figures import COLOURS
from mlsanm_cli.io.run_reader import RunData, read_run

FRAMES = 40
"""Frames of a path with power series."""
Make = Callable[[], Picture | BodyPicture]


def plot(
    rundir: Path | Sequence[Path], *, formats: tuple[str, ...] = ("png",), choice: Choice | None = None
) -> list[Path]:
    """Draws the pictures of a run selected by ``choice``, or several runs in one picture, and returns the
    files. Failed and stopped runs are drawn up to their last step. Raises RunError."""
    places = [rundir] if isinstance(rundir, Path) else list(rundir)
    choice = choice or Choice()
    choice.check(len(places))
    runs = [read_run(place) for place in places]
    for run in runs:
        if not run.rows:
            raise RunError(f"{run.directory} holds no finished step yet", "there is nothing to draw")
        if choice.contact is not None:
            refuse_unknown(choice.contact, run.contacts, "contact")
    cases = [stored_case(run.case_resolved) for run in runs]
    if len(runs) > 1:
        assert choice.out is not None
        if choice.along is not None:
            return [write(choice.out, line_picture(runs, cases, choice))]
        if len(choice.what) != 1 or choice.what[0] in ("traction", "bodies"):
            hint = "add --what pressure, force, peak, loop or hysteresis, or --along"
            raise RunError("several runs need one kind of picture", hint)
        return [write(choice.out, curves.path_picture(runs, cases, choice.what[0], choice))]
    run, case = runs[0], cases[0]
    if choice.animate:
        return animate(run, case, choice)
    wanted = [picture for picture in pictures(run, case, choice) if choice.wants(*picture[:2])]
    if not wanted:
        kinds = ", ".join(choice.what) or "such pictures"
        raise RunError(f"the run has nothing for {kinds}", f"kinds are: {', '.join(KINDS)}")
    if choice.out is not None and len(wanted) > 1:
        names = ", ".join(f"{kind} {subject}".rstrip() for kind, subject, _ in wanted)
        message = f"-o names one picture, but there are {len(wanted)}: {names}"
        raise RunError(message, "add --what or --contact")
    files = []
    for kind, subject, make in wanted:
        places = [run.directory / run_dir.picture_name(kind, suffix, subject) for suffix in formats]
        made = make()
        files += [(file, made) for file in (places if choice.out is None else [choice.out])]
    return [write(file, made) for file, made in files]


def write(file: Path, made: Picture | BodyPicture) -> Path:
    """Draws a picture; returns its file. Raises RunError if it cannot be written."""
    if isinstance(made, BodyPicture):
        plot_bodies(file, made)
    else:
        draw(file, made)
    return file


def pictures(run: RunData, case: Case, choice: Choice) -> Iterator[tuple[str, str, Make]]:
    """Kind, subject and maker of every picture for which the run has data."""
    friction = {contact.name: contact.coefficient for contact in case.contact}
    for name in run.contacts:
        of_contact = {"run": run, "case": case, "name": name, "choice": choice}
        yield "pressure", name, partial(curves.pressure_picture, **of_contact)
        if friction[name]:
            yield "traction", name, partial(curves.traction_picture, **of_contact)
        asked = not {"loop", "hysteresis"}.isdisjoint(choice.what)
        if friction[name] and np.isfinite(friction[name]) and (asked or tangential_force(run, name).any()):
            yield "loop", name, partial(curves.loop_picture, **of_contact)
            yield "hysteresis", name, partial(curves.loop_picture, **of_contact, over_slip=True)
    for kind in ("force", "peak") if run.contacts else ("force",):
        yield kind, "", partial(curves.path_picture, [run], [case], kind, choice)
    if run.states:
        state = partial(saved_state, run, choice.at[-1] if choice.at else None)
        yield "bodies", "", lambda: bodies_picture(run, case, state(), choice.field)
    if choice.along is not None:
        yield "line", choice.along, partial(line_picture, [run], [case], choice)


def animate(run: RunData, case: Case, choice: Choice) -> list[Path]:
    """Draws pressures along the path, or bodies at saved positions. Raises RunError for one state only."""
    if "bodies" in choice.what or choice.field is not None or not run.contacts:
        if len(run.states) < 2:
            message = "fields are saved at one position only; an animation needs at least two"
            raise RunError(message, "list several positions in output.at and run again")
        shown = [bodies_picture(run, case, state, choice.field) for state in run.states]
        scale = min(picture.scale for picture in shown)
        frames = [
            picture._replace(scale=scale, marks=marks_at(run, case, state, scale))
            for picture, state in zip(shown, run.states, strict=True)
        ]
        file = choice.out or run.directory / run_dir.picture_name("bodies", "gif")
        write_frames(file, frames)
        return [file]
    names = [choice.contact] if choice.contact is not None else list(run.contacts)
    if choice.out is not None and len(names) > 1:
        raise RunError("-o names one picture, but there are several contacts", "add --contact")
    stored = run.path.position
    # Without series only stored states are known.
    places = np.linspace(stored[0], stored[-1], FRAMES) if run.path.order.any() else np.unique(stored)
    if len(places) < 2:
        raise RunError("the run has one state only", "an animation needs at least two")
    known, files = [pressures_at(run, level) for level in places.tolist()], []
    words = [curves.load_words(run, case, level) or f"position {level:.3f}" for level in places.tolist()]
    labels = case.units.label("arc length", "length"), case.units.label("pressure", "stress")
    look = {"color": COLOURS[0], "marker": "o", "markersize": 2.0, "linewidth": 1.0}
    for name in names:
        pressure = np.stack([pressures[name] for pressures in known])
        order, arc = along_surface(run.contacts[name], pressure.max(axis=0))
        pressure = pressure[:, order]
        limits = visible_range(arc, pressure), (0.0, 1.05 * (float(pressure.max(initial=0.0)) or 1.0))
        panels = [Panel([Curve(arc, values, look=look)], *labels, *limits) for values in pressure]
        files.append(choice.out or run.directory / run_dir.picture_name("pressure", "gif", name))
        titles = [f"Contact pressure, {name}, {text}" for text in words]
        pairs = zip(panels, titles, strict=True)
        write_frames(files[-1], [Picture([panel], title, size=(6.4, 3.8)) for panel, title in pairs])
    return files
