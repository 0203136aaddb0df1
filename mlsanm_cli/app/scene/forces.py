"""Forces and moments on bodies and boundaries, as body forces and tractions of the same resultants. Areas and
their moments are integrals along outlines, by the divergence theorem."""

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
    revolved = case.model.revolved
    loads = tuple(
        _spread(load, outlines, revolved) if isinstance(load, Force) else load for load in case.load
    )
    return case.model_copy(update={"load": loads})


def _spread(load: Force, outlines: Mapping[str, Outline], revolved: bool) -> Traction | BodyForce:
    curves = _loaded(load, outlines)
    points, normals, weight = _points(curves)
    square = (points**2).sum(axis=1)
    if revolved:
        ring = np.pi * points[:, 0] * weight
        size = ring @ (points[:, 0] * normals[:, 0]) if load.body is not None else 2.0 * ring.sum()
        return load.spread(float(size), (0.0, 0.0), 1.0)
    if load.body is None:
        return load.spread(*_moments(weight.sum(), weight @ points, weight @ square))
    flux = weight * (points * normals).sum(axis=1)
    return load.spread(*_moments(flux.sum() / 2.0, flux @ points / 3.0, flux @ square / 4.0))


def _loaded(load: Force, outlines: Mapping[str, Outline]) -> Sequence[Curve]:
    """The loaded curves, or those around the loaded body."""
    outline = outlines[load.owner]
    if load.body is not None:
        return outline.curves
    (place,) = load.places
    if place.ends is not None:
        return [run_of(outlines, place, f"load.{load.name}").part]
    return [outline.curves[number] for number in outline.numbers(*place.edges)]


def _points(curves: Sequence[Curve]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Quadrature points (g, 2) of curves, outward normals (g, 2) and weights (g,)."""
    share = ((np.arange(PANELS)[:, None] + 0.5 + 0.5 * POINTS) / PANELS).ravel()
    weight = np.tile(0.5 * WEIGHTS / PANELS, PANELS)
    points = np.concatenate([curve.points(share * curve.length) for curve in curves])
    normals = np.concatenate([curve.normals(share * curve.length) for curve in curves])
    return points, normals, np.concatenate([weight * curve.length for curve in curves])


def _moments(size: float, first: FloatArray, second: float) -> tuple[float, tuple[float, float], float]:
    """Size, centroid and polar moment about it, from integrals of 1, x and the squared distance from 0."""
    x, y = (first / size).tolist()
    return float(size), (x, y), float(second - size * (x * x + y * y))
