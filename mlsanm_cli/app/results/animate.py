"""``mlsanm plot --animate``: the path of a run as GIF or MP4 files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mlsanm_cli.app.results.drawn import marks_at
from mlsanm_cli.app.results.history import pressures_at
from mlsanm_cli.app.results.plot_choice import Choice, load_words
from mlsanm_cli.app.results.views import along_surface, automatic_scale, shown_bodies
from mlsanm_cli.case import Case
from mlsanm_cli.errors import RunError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.plots.animation import animate_bodies, animate_pressure
from mlsanm_cli.io.run_reader import RunData

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
