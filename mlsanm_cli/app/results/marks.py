"""Symbols of supports, loads and obstacles in pictures; the picture of a scene before it is solved."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from mlsanm_cli.app.output.parts import obstacle_shift, obstacles
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.loads import amounts_of, table_of
from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.case import (
    AnyLoad,
    BodyForce,
    Case,
    Centrifugal,
    ExpressionError,
    Force,
    ObstacleMotion,
    Place,
    Platen,
    Pressure,
    Temperature,
    value_at,
)
from mlsanm_cli.io.plots.cloud import BodyPicture, CloudBody, plot_bodies
from mlsanm_cli.io.plots.figures import ConditionMarks
from mlsanm_cli.io.run_reader import Dataset, RunData, SavedState


def marks_of(
    case: Case,
    bodies: Mapping[str, Dataset],
    touching: Mapping[str, FloatArray],
    moved: Mapping[str, FloatArray],
    scale: float,
    factors: Mapping[str, float],
    displaced: Mapping[str, FloatArray],
) -> ConditionMarks:
    """The symbols of a case. Loads of obstacles are drawn at points (m, 2) of contacts, ``touching``;
    displacements of platens and obstacles by load, ``moved``, and of nodes, ``displaced``, ``scale`` times as
    large; arrows of loads with negative factors are reversed."""
    points = np.concatenate([body.points for body in bodies.values()])
    lines = obstacles(case, points)
    shown = {name: body.points + scale * displaced.get(name, 0.0) for name, body in bodies.items()}
    held, nodes = [], []
    for support in case.support:
        if support.place is not None:
            index, normals = _along(bodies[support.place.body], support.place, 40)
            held.append((shown[support.place.body][index], normals))
        elif support.body is not None and support.near is not None:
            near = bodies[support.body].points
            nodes.append(shown[support.body][np.hypot(*(near - np.array(support.near)).T).argmin()])
    arrows = []
    for load in case.load:
        factor = factors.get(load.name, 1.0)
        shift = scale * moved.get(load.name, np.zeros(2))
        for point, vector, normal in _acting(load, bodies, shown, touching, shift):
            if factor and vector.any():
                arrows.append((point, np.sign(factor) * vector / np.hypot(*vector), normal, load.name))
    drawn, given = [], {one.name: one.obstacle for one in case.contact if one.obstacle is not None}
    for name, (line, _) in lines.items():
        angle, pivot = 0.0, (0.0, 0.0)
        for load in case.load:
            if isinstance(load, ObstacleMotion) and load.obstacle == name and load.rotation:
                angle += load.rotation * factors.get(load.name, 0.0)
                pivot = load.pivot_on(given[name]) or pivot
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        drawn.append(pivot + (line - pivot) @ turn + scale * obstacle_shift(case, name, moved))
    return ConditionMarks(tuple(held), tuple(nodes), tuple(arrows), tuple(drawn))


def marks_at(run: RunData, case: Case, state: SavedState, scale: float) -> ConditionMarks:
    """The symbols in a saved state of a run, with displacements multiplied by ``scale``."""
    row = int(np.abs(run.path.position - state.position).argmin())
    moved = {load: history[row] for load, history in run.path.displacements.items()}
    touching = {}
    for name, contact in run.contacts.items():
        pressed = contact.pressure[row] > 0.0
        touching[name] = contact.points[pressed if pressed.any() else [int(contact.gap[0].argmin())]]
    factors = {load: float(history[row]) for load, history in run.path.factors.items()}
    displaced = {
        name: fields["displacement"] for name, fields in state.bodies.items() if "displacement" in fields
    }
    return marks_of(case, run.bodies, touching, moved, scale, factors, displaced)


def boundary_nodes(body: Dataset, place: Place) -> tuple[IntArray, FloatArray]:
    """Node numbers (k,) and outward normals (k, 2) along the boundaries of a place, in their order."""
    # Pieces of a boundary are called "name/number".
    owner = np.array([name.partition("/")[0] for name in body.boundary.name])
    chosen = np.concatenate([np.flatnonzero(owner == edge) for edge in place.edges])
    return body.boundary.index[chosen], body.boundary.normal[chosen]


def _along(body: Dataset, place: Place, most: int) -> tuple[IntArray, FloatArray]:
    """Indices (k,) and normals (k, 2) of evenly distributed nodes of a place, at most ``most``."""
    index, normal = boundary_nodes(body, place)
    points = body.points[index]
    if place.ends is not None:
        first, last = sorted(int(np.hypot(*(points - np.array(end)).T).argmin()) for end in place.ends)
        part = slice(first, last + 1)
        index, points, normal = index[part], points[part], normal[part]
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    chosen = np.unique(np.searchsorted(length, np.linspace(0.0, length[-1], most)).clip(0, len(points) - 1))
    return index[chosen], normal[chosen]


def _acting(
    load: AnyLoad,
    bodies: Mapping[str, Dataset],
    shown: Mapping[str, FloatArray],
    touching: Mapping[str, FloatArray],
    shift: FloatArray,
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """Points, vectors and outward normals where a load is drawn; ``shift`` is that of its obstacle."""
    if isinstance(load, Force | BodyForce | Centrifugal):
        place = next(iter(load.places), None)
        middle = shown[load.owner].mean(axis=0)
        if place is not None:
            index, _ = _along(bodies[load.owner], place, 3)
            middle = shown[load.owner][index[len(index) // 2]]
        force = load.total if isinstance(load, Force) else amounts_of(load)
        yield middle, _numbers(force, middle), np.zeros(2)
    elif isinstance(load, ObstacleMotion):
        if load.obstacle in touching:
            # An obstacle pushes: its arrow ends at the contact.
            yield touching[load.obstacle].mean(axis=0) + shift, _control(load), -_control(load)
    elif isinstance(load, Platen):
        index, normals = _along(bodies[load.place.body], load.place, 3)
        half = len(index) // 2
        yield shown[load.place.body][index[half]], _control(load), normals[half]
    elif not isinstance(load, Temperature):
        body, places = bodies[load.place.body], shown[load.place.body]
        (index, normals), table = _along(body, load.place, 7), table_of(load)
        for point, normal, place in zip(places[index], normals, body.points[index], strict=True):
            values = np.array(table)[:, 1:].mean(axis=0) if table else _numbers(amounts_of(load), place)
            # The table of a pressure is drawn as a positive one.
            pressure = -(1.0 if table else np.sign(values[0])) * normal
            vector = pressure if isinstance(load, Pressure) else values
            yield point, vector, normal


def _control(load: Platen | ObstacleMotion) -> FloatArray:
    return np.array([load.control[axis][1] if axis in load.control else 0.0 for axis in ("x", "y")])


def _numbers(given: Sequence[float | str | None], place: FloatArray) -> FloatArray:
    """The values of numbers and expressions at a ``place`` (2,)."""
    values = []
    for part in given:
        try:
            values.append(value_at(part, *place.tolist()) if isinstance(part, str) else part or 0.0)
        except ExpressionError:
            # Expressions need values at nodes only; a drawn point may lie elsewhere.
            values.append(1.0)
    return np.array(values)


def draw_model(path: Path, case: Case, prepared: SceneModel) -> None:
    """Draws the bodies coloured by their spacing, with supports, loads and contacts. Raises RunError."""
    clouds = prepared.clouds
    still = {name: np.zeros_like(cloud.points) for name, cloud in clouds.items()}
    bodies = [CloudBody(c.points, still[name], c.spacing, c.triangles) for name, c in clouds.items()]
    touching = {pairing.name: pairing.points[[int(pairing.gap.argmin())]] for pairing in prepared.pairings}
    stored = {}
    for name, cloud in clouds.items():
        boundary = dict(zip(("index", "normal", "name"), cloud.boundary, strict=True))
        stored[name] = Dataset({"points": cloud.points, "boundary": boundary})
    nodes = sum(len(cloud.points) for cloud in clouds.values())
    title = ", ".join(filter(None, (case.title, f"{nodes} nodes")))
    marks = marks_of(case, stored, touching, {}, 1.0, {}, {})
    label = case.units.label("spacing", "length")
    plot_bodies(path, BodyPicture(bodies, label, title, marks=marks, unit=case.units.length))
