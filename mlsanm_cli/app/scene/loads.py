"""Loads and springs of a case on given clouds, as values at nodes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.load_profiles import AmountField, amounts_at, profiles
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import (
    BodyForce,
    Case,
    Centrifugal,
    Displacement,
    ExpressionError,
    Force,
    ObstacleMotion,
    Platen,
    Pressure,
    Temperature,
    Traction,
)
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.mechanics import scene as mechanics
from mlsanm_cli.mechanics.heat import Heating
from mlsanm_cli.records import dataclass
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
        assert not isinstance(load, Force)  # spread by Boundaries
        cloud = clouds[load.owner]
        key = f"load.{load.name}.{load.kind}"
        try:
            if isinstance(load, BodyForce | Centrifugal):
                values = amounts_at(load.body_force, cloud.points)
                body_forces.append(mechanics.BodyForce(number, load.body, values))
            elif isinstance(load, Temperature):
                field = temperature_of(load)
                heatings.append(Heating(number, load.body, field, field.at(cloud.points)))
            else:
                held = isinstance(load, Displacement)
                parts = boundaries.parts(cloud, load.place)
                if not isinstance(load, Displacement):
                    _check_table(load, sum(surface.curve.length for surface, _ in parts))
                for surface, first in parts:
                    curve = surface.curve
                    points = cloud.points[surface.index]
                    values = _on_surface(load, curve, first, surface.arc_length, points)
                    if not held and not curve.closed:
                        # Tractions may be discontinuous at the end of a surface.
                        just = np.array([ROUND_OFF, 1.0 - ROUND_OFF]) * curve.length
                        values[[0, -1]] = _on_surface(load, curve, first, just, curve.points(just))
                    between = None if isinstance(load, Displacement) else _between(case, load, surface, first)
                    surface_loads.append(
                        mechanics.SurfaceLoad(number, load.owner, surface.name, values, held, between)
                    )
        except ExpressionError as error:
            problems.append(CaseProblem(key, str(error)))
        except CaseError as error:
            problems += error.problems
    if problems:
        raise CaseError(tuple(problems))
    return Acting(tuple(surface_loads), tuple(body_forces), tuple(heatings), _springs(case, boundaries))


def _between(case: Case, load: Traction | Pressure, surface: Surface, first: float) -> FloatArray:
    """Values (g, 2) at the FINE quadrature points of a surface; if tractions are discontinuous between nodes
    of a file, means over the length of each point."""
    halves, curve = Halves.of(surface, FINE), surface.curve
    body = next(body for body in case.body if body.name == load.owner)
    if not body.has_nodes or not any(profile.jumps for profile in profiles(body.shape, load)):
        return _on_surface(load, curve, first, halves.arc, curve.points(halves.arc))
    order = np.argsort(halves.arc)
    length = halves.length[order]
    share = (np.arange(SAMPLES_PER_POINT) + 0.5) / SAMPLES_PER_POINT
    arc = ((np.cumsum(length) - length)[:, None] + share * length[:, None]).ravel()
    values = np.zeros((len(order), 2))
    sampled = _on_surface(load, curve, first, arc, curve.points(arc))
    values[order] = sampled.reshape(-1, SAMPLES_PER_POINT, 2).mean(axis=1)
    return values


def _on_surface(
    load: Traction | Pressure | Displacement,
    curve: Curve,
    first: float,
    arc: FloatArray,
    points: FloatArray,
) -> FloatArray:
    """Values (e, 2) of a load at ``points`` (e, 2), arc lengths ``arc`` (e,) of a curve that starts at
    ``first`` of the loaded region; 0 in free directions."""
    if isinstance(load, Displacement):
        return amounts_at([0.0 if part is None else part for part in load.components], points)
    if load.table is not None:
        table = np.array(load.table)
        columns = [np.interp(arc + first, table[:, 0], column) for column in table[:, 1:].T]
        values = np.stack(columns, axis=1)
    elif isinstance(load, Traction):
        values = amounts_at(load.traction or (), points)
    else:
        values = amounts_at([load.pressure or 0.0], points)
    return -values * curve.normals(arc) if isinstance(load, Pressure) else values


def _check_table(load: Traction | Pressure, length: float) -> None:
    """CaseError for a table that does not cover the ``length`` of its region."""
    if load.table is not None:
        first, last = load.table[0][0], load.table[-1][0]
        if first > COARSE_ROUND_OFF * length or last < (1.0 - COARSE_ROUND_OFF) * length:
            message = f"goes from {first:.6g} to {last:.6g}, the boundary from 0 to {length:.9g}"
            raise CaseError((CaseProblem(f"load.{load.name}.table", message),))


def _springs(case: Case, boundaries: Boundaries) -> dict[str, dict[str, tuple[float, float]]]:
    found: dict[str, dict[str, tuple[float, float]]] = {body.name: {} for body in case.body}
    for support in case.support:
        if support.place is not None and support.spring is not None:
            own = found[support.place.body]
            for surface in boundaries.names(support.place):
                x, y = own.get(surface, (0.0, 0.0))
                own[surface] = (x + support.spring[0], y + support.spring[1])
    return found
