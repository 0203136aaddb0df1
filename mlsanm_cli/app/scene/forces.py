"""Forces and moments on bodies and boundaries, as body forces and tractions of the same resultants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mlsanm_cli.app.scene.outlines import run_of
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import BodyForce, Case, Force, Traction
from mlsanm_cli.cloud.curves import Curve, Outline

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(4)
PANELS = 64
"""Gauss panels per curve, as the knots of splines are not known here."""


def with_spread_forces(case: Case, outlines: Mapping[str, Outline]) -> Case:
    """The case with a body force or a traction for every load of kind `force`. Raises CaseError for parts of
    boundaries that do not join."""
    loads = tuple(_spread(load, outlines) if isinstance(load, Force) else load for load in case.load)
    return case.model_copy(update={"load": loads})


def _spread(load: Force, outlines: Mapping[str, Outline]) -> Traction | BodyForce:
    outline = outlines[load.owner]
    if load.body is not None:
        return load.spread(*_of_area(outline.curves))
    (place,) = load.places
    if place.ends is not None:
        return load.spread(*_of_length([run_of(outlines, place, f"load.{load.name}").part]))
    return load.spread(*_of_length([outline.curves[number] for number in outline.numbers(*place.edges)]))


def _points(curves: Sequence[Curve]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Quadrature points (g, 2) of curves, outward normals (g, 2) and weights (g,)."""
    share = ((np.arange(PANELS)[:, None] + 0.5 + 0.5 * POINTS) / PANELS).ravel()
    weight = np.tile(0.5 * WEIGHTS / PANELS, PANELS)
    points = np.concatenate([curve.points(share * curve.length) for curve in curves])
    normals = np.concatenate([curve.normals(share * curve.length) for curve in curves])
    return points, normals, np.concatenate([weight * curve.length for curve in curves])


def _of_length(curves: Sequence[Curve]) -> tuple[float, tuple[float, float], float]:
    """Length, centroid and polar moment about it of curves."""
    points, _, weight = _points(curves)
    return _moments(weight.sum(), weight @ points, weight @ (points**2).sum(axis=1))


def _of_area(curves: Sequence[Curve]) -> tuple[float, tuple[float, float], float]:
    """Area, centroid and polar moment about it of what closed curves enclose, by the divergence theorem."""
    points, normals, weight = _points(curves)
    flux = weight * (points * normals).sum(axis=1)
    return _moments(flux.sum() / 2.0, flux @ points / 3.0, flux @ (points**2).sum(axis=1) / 4.0)


def _moments(size: float, first: FloatArray, second: float) -> tuple[float, tuple[float, float], float]:
    x, y = (first / size).tolist()
    return float(size), (x, y), float(second - size * (x * x + y * y))
