"""``mlsanm plot``: pictures of a run, made from what its directory holds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np

from mlsanm_cli.app.history import pressures_at
from mlsanm_cli.app.references import ReferenceProfile, profile_on
from mlsanm_cli.app.views import automatic_scale, boundary_edges, contact_window, scalar_of
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, stored_case
from mlsanm_cli.cloud.sight import look
from mlsanm_cli.cloud.triangles import triangulate
from mlsanm_cli.errors import RunError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.plot_cloud import CloudBody, plot_cloud
from mlsanm_cli.io.plot_friction import plot_loop, plot_traction
from mlsanm_cli.io.plots import ReferenceCurve, plot_path, plot_pressure
from mlsanm_cli.io.run_reader import ContactData, RunData, read_run

MOST_LEVELS = 6
"""More load levels in one picture cannot be told apart."""
CURVE_POINTS = 801
REFERENCE_NAMES = {"Hertz": "Hertz, closed formula", "uniform": "uniform pressure"}


class _Draw(Protocol):
    def __call__(self, path: Path) -> None: ...


def plot(rundir: Path, *, formats: tuple[str, ...] = ("png",)) -> list[Path]:
    """Draw the run in ``rundir`` and return the files written into it.

    Pressure along every contact, with friction its tractions and the loop of their sum over a platen's
    displacement, contact force and peak pressure along the path (forces of loads and supports in a scene
    without contact), and the deformed bodies at the last saved position. A run that failed or was stopped is
    drawn as far as it came. Raises RunError for a directory without a readable run, or without any state.
    """
    run = read_run(rundir)
    if not run.path.rows:
        raise RunError(f"{rundir} holds no finished step yet", "there is nothing to draw")
    case = stored_case(run.case_resolved)
    files = []
    for kind, subject, draw in _pictures(run, case):
        for suffix in formats:
            file = run.directory / run_dir.picture_name(kind, suffix, subject)
            draw(file)
            files.append(file)
    return files


def _pictures(run: RunData, case: Case) -> Iterator[tuple[str, str, _Draw]]:
    """Kind, subject and drawing function of every picture that the run has data for."""
    friction = {contact.name: contact.coefficient for contact in case.contact}
    for name in run.contacts:
        yield "pressure", name, partial(_draw_pressure, run=run, case=case, name=name)
        if np.isinf(friction[name]):
            yield "traction", name, partial(_draw_traction, run=run, friction=0.0, name=name)
        elif friction[name]:
            yield "traction", name, partial(_draw_traction, run=run, friction=friction[name], name=name)
            yield "loop", name, partial(_draw_loop, run=run, name=name)
    if run.contacts:
        yield "force", "", partial(_draw_forces, run=run)
        yield "peak", "", partial(_draw_peaks, run=run)
    else:
        yield "force", "", partial(_draw_resultants, run=run)
    if run.states:
        yield "bodies", "", partial(_draw_bodies, run=run, case=case)


def _levels(run: RunData) -> list[float]:
    """Positions whose pressure is drawn: the saved ones that the path reached, and its end."""
    end = float(run.path.position[-1])
    saved = sorted({state.position for state in run.states if 0.0 < state.position < end})
    if len(saved) >= MOST_LEVELS:
        chosen = np.linspace(0, len(saved) - 1, MOST_LEVELS - 1).round().astype(int)
        saved = [saved[i] for i in chosen]
    return [*saved, end]


def _draw_pressure(path: Path, run: RunData, case: Case, name: str) -> None:
    contact = run.contacts[name]
    levels = _levels(run)
    pressure = np.stack([pressures_at(run, level)[name] for level in levels])
    profile = _reference(case, name, contact)
    labels = [f"position {level:.4g}" for level in levels]
    if profile is None:
        plot_pressure(path, name, contact.arc_length, pressure, labels)
        return
    x = np.linspace(profile.coordinate[0], profile.coordinate[-1], CURVE_POINTS)
    # The ends of the loaded part belong to the curve, however wide the candidates reach.
    edges = np.array([-profile.half_width, profile.half_width])
    x = np.union1d(x, edges[(edges > x[0]) & (edges < x[-1])])
    curve = ReferenceCurve(x, profile.curve(x), REFERENCE_NAMES.get(profile.label, profile.label))
    plot_pressure(path, name, profile.coordinate, pressure, labels, curve, "distance from the middle")


def _draw_traction(path: Path, run: RunData, friction: float, name: str) -> None:
    contact = run.contacts[name]
    limit = friction * np.maximum(contact.pressure[-1], 0.0)
    label = f"position {run.path.position[-1]:.4g}"
    plot_traction(path, name, label, contact.arc_length, contact.traction[-1], limit, contact.status[-1])


def _draw_loop(path: Path, run: RunData, name: str) -> None:
    """Tangential force on the master against the displacement along it of the platen that moves most.

    Where there is no platen, against the mean slip.
    """
    contact = run.contacts[name]
    force: FloatArray = -(contact.traction @ contact.weight)
    n_x, n_y = contact.weight @ contact.normal / contact.weight.sum()
    along = {load: moved @ np.array([n_y, -n_x]) for load, moved in run.path.displacements.items()}
    moved: FloatArray = contact.slip @ contact.weight / contact.weight.sum()
    label = "mean slip of the surfaces"
    if along:
        load = max(along, key=lambda one: float(np.ptp(along[one])))
        moved, label = along[load], f"displacement of the platen of {load} along the contact"
    plot_loop(path, moved, force, label, f"Tangential force, {name}")


def _reference(case: Case, name: str, contact: ContactData) -> ReferenceProfile | None:
    """The closed formula at the end of the path; None where the case names none or nothing is pressed."""
    force = float(np.hypot(*_contact_force(contact)[-1]))
    if case.reference is None or force == 0.0:
        return None
    described = next(c for c in case.contact if c.name == name)
    return profile_on(case, described, contact.points, contact.normal, contact.pressure[-1], force)


def _contact_force(contact: ContactData) -> FloatArray:
    """Force (S+1, 2) that the contact exerts on its slave."""
    force: FloatArray = contact.pressure @ (contact.weight[:, None] * contact.normal)
    return force


def _draw_forces(path: Path, run: RunData) -> None:
    curves = {name: np.hypot(*_contact_force(contact).T) for name, contact in run.contacts.items()}
    _draw_curves(path, run, curves, "contact force per unit thickness", "Contact force along the path")


def _draw_peaks(path: Path, run: RunData) -> None:
    curves = {name: contact.pressure.max(axis=1, initial=0.0) for name, contact in run.contacts.items()}
    _draw_curves(path, run, curves, "peak pressure", "Peak contact pressure along the path")


def _draw_resultants(path: Path, run: RunData) -> None:
    curves = {name: np.hypot(*force.T) for name, force in run.path.resultants.items()}
    _draw_curves(path, run, curves, "force per unit thickness", "Forces of loads and supports")


def _draw_curves(path: Path, run: RunData, curves: Mapping[str, FloatArray], y: str, title: str) -> None:
    # Exact contact is solved at a few positions: what lies between them is not on a straight line.
    joined = not run.contacts or bool(run.path.order.any())
    alone = f"{title}, {next(iter(curves))}" if len(curves) == 1 else title
    plot_path(path, run.path.position, curves, "position on the load path (stages)", y, alone, joined)


def _draw_bodies(path: Path, run: RunData, case: Case) -> None:
    state = run.states[-1]
    bodies, label = [], ""
    for name, body in run.bodies.items():
        fields = state.bodies[name]
        displacement = fields.get("displacement", np.zeros_like(body.points))
        scalar, label = scalar_of(case, name, fields, displacement)
        edges = boundary_edges(body)
        triangles = triangulate(body.points, edges, look(body.points, edges))
        bodies.append(CloudBody(body.points, displacement, scalar, triangles))
    scale = automatic_scale(run, bodies)
    title = f"position {state.position:.4g}"
    plot_cloud(path, bodies, label, title, scale, contact_window(run, state.position, bodies))
