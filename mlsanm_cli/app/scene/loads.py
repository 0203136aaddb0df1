"""Loads and springs of a case on given clouds, as values at nodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mlsanm_cli.app.scene.boundaries import Boundaries, SurfacePart
from mlsanm_cli.app.scene.load_profiles import AmountField, amounts_at, profiles
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import (
    BodyForce,
    Case,
    Displacement,
    ExpressionError,
    ObstacleMotion,
    Platen,
    Pressure,
    Temperature,
    Traction,
)
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.mechanics import scene as mechanics
from mlsanm_cli.mechanics.heat import Heating
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, ROUND_OFF

SAMPLES_PER_POINT = 32
"""Samples for each quadrature point if tractions are discontinuous between nodes."""


@dataclass(frozen=True)
class Acting:
    """Loads at factor 1, without those on platens, and ``springs[body][surface]``, traction per
    displacement."""

    surface_loads: tuple[mechanics.SurfaceLoad, ...]
    body_forces: tuple[mechanics.BodyForce, ...]
    heatings: tuple[Heating, ...]
    springs: Mapping[str, Mapping[str, tuple[float, float]]]


def temperature_of(load: Temperature) -> AmountField:
    """The temperature change of a load."""
    return AmountField(f"load.{load.name}.temperature", load.temperature)


def acting(case: Case, boundaries: Boundaries, clouds: Mapping[str, Cloud]) -> Acting:
    """Evaluates all loads. Raises CaseError for expressions without a value at a node, and for tables that do
    not cover their boundary.
    """
    surface_loads: list[mechanics.SurfaceLoad] = []
    body_forces: list[mechanics.BodyForce] = []
    heatings: list[Heating] = []
    problems: list[CaseProblem] = []
    for number, load in enumerate(case.load):
        if isinstance(load, Platen | ObstacleMotion):
            continue
        cloud = clouds[load.owner]
        key = f"load.{load.name}.{load.kind}"
        try:
            if isinstance(load, BodyForce):
                values = amounts_at(load.body_force, cloud.points)
                body_forces.append(mechanics.BodyForce(number, load.body, values))
            elif isinstance(load, Temperature):
                field = temperature_of(load)
                heatings.append(Heating(number, load.body, field, field.at(cloud.points)))
            else:
                held = isinstance(load, Displacement)
                for part in boundaries.parts(cloud, load.place):
                    surface = part.surface
                    values = _on_surface(load, part, surface.arc_length, cloud.points[surface.index])
                    if not held and not surface.curve.closed:
                        # Tractions may be discontinuous at the end of a surface.
                        just = np.array([ROUND_OFF, 1.0 - ROUND_OFF]) * surface.curve.length
                        values[[0, -1]] = _on_surface(load, part, just, surface.curve.points(just))
                    between = None if isinstance(load, Displacement) else _between(case, load, part)
                    own = mechanics.SurfaceLoad(number, load.owner, surface.name, values, held, between)
                    surface_loads.append(own)
        except ExpressionError as error:
            problems.append(CaseProblem(key, str(error)))
        except CaseError as error:
            problems += error.problems
    if problems:
        raise CaseError(tuple(problems))
    return Acting(tuple(surface_loads), tuple(body_forces), tuple(heatings), _springs(case, boundaries))


def _between(case: Case, load: Traction | Pressure, part: SurfacePart) -> FloatArray:
    """Values (g, 2) at the FINE quadrature points of a surface; if tractions are discontinuous between nodes
    of a file, means over the length of each point."""
    surface, halves = part.surface, Halves.of(part.surface, FINE)
    body = next(one for one in case.body if one.name == load.owner)
    if not body.has_nodes or not any(one.jumps for one in profiles(body.shape, load)):
        return _on_surface(load, part, halves.arc, surface.curve.points(halves.arc))
    order = np.argsort(halves.arc)
    length = halves.length[order]
    share = (np.arange(SAMPLES_PER_POINT) + 0.5) / SAMPLES_PER_POINT
    arc = ((np.cumsum(length) - length)[:, None] + share * length[:, None]).ravel()
    values = np.zeros((len(order), 2))
    values[order] = (
        _on_surface(load, part, arc, surface.curve.points(arc)).reshape(-1, SAMPLES_PER_POINT, 2).mean(axis=1)
    )
    return values


def _on_surface(
    load: Traction | Pressure | Displacement, part: SurfacePart, arc: FloatArray, points: FloatArray
) -> FloatArray:
    """Values (e, 2) of a load at ``points`` (e, 2) and arc lengths ``arc`` (e,) of a loaded part; 0 in free
    directions."""
    surface = part.surface
    if isinstance(load, Displacement):
        return amounts_at([0.0 if part is None else part for part in load.components], points)
    if isinstance(load, Traction):
        if load.table is not None:
            return _from_table(load, load.table, part, arc)
        assert load.traction is not None
        return amounts_at(load.traction, points)
    if load.table is not None:
        return -_from_table(load, load.table, part, arc) * surface.curve.normals(arc)
    assert load.pressure is not None
    return -amounts_at([load.pressure], points) * surface.curve.normals(arc)


def _from_table(
    load: Traction | Pressure, rows: Sequence[tuple[float, ...]], part: SurfacePart, arc: FloatArray
) -> FloatArray:
    """Values (e, c) at ``arc`` (e,), interpolated linearly between rows of arc length and c values. Raises
    CaseError for tables that do not cover their boundary."""
    table = np.array(rows)
    length = part.total
    first, last = float(table[0, 0]), float(table[-1, 0])
    if first > COARSE_ROUND_OFF * length or last < (1.0 - COARSE_ROUND_OFF) * length:
        message = f"goes from {first:.6g} to {last:.6g}, the boundary from 0 to {length:.9g}"
        raise CaseError((CaseProblem(f"load.{load.name}.table", message),))
    columns = [np.interp(arc + part.first, table[:, 0], column) for column in table[:, 1:].T]
    return np.stack(columns, axis=1)


def _springs(case: Case, boundaries: Boundaries) -> dict[str, dict[str, tuple[float, float]]]:
    found: dict[str, dict[str, tuple[float, float]]] = {body.name: {} for body in case.body}
    for support in case.support:
        if support.place is not None and support.spring is not None:
            own = found[support.place.body]
            for surface in boundaries.names(support.place):
                x, y = own.get(surface, (0.0, 0.0))
                own[surface] = (x + support.spring[0], y + support.spring[1])
    return found
