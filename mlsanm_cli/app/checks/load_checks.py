"""Checks of loads as the nodes represent them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from mlsanm_cli.app.checks.check import Check
from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.load_profiles import amounts_at, runs_of
from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.case import BodyForce, Case, Centrifugal, ExpressionError, Pressure, Temperature, Traction
from mlsanm_cli.cloud.cloud import Cloud


def load_resolution(case: Case, boundaries: Boundaries, clouds: Mapping[str, Cloud]) -> Iterator[Check]:
    """Errors of linear interpolation of varying loads between the nodes."""
    for load in case.load:
        if isinstance(load, Temperature | BodyForce | Centrifugal):
            amounts = [load.temperature] if isinstance(load, Temperature) else list(load.body_force)
            body, cloud = load.body, clouds[load.body]
            spans = [cloud.triangles]
        elif isinstance(load, Pressure | Traction):
            given = [load.pressure] if isinstance(load, Pressure) else list(load.traction or ())
            amounts = [0.0 if one is None else one for one in given]
            body, cloud = load.owner, clouds[load.owner]
            indices = [cloud.surfaces[name].index for name in boundaries.names(load.place)]
            # Only inside of surfaces: tractions may be discontinuous at their ends.
            spans = [np.stack([index[1:-2], index[2:-1]], axis=1) for index in indices if len(index) > 3]
        else:
            continue
        varying = [one for one in amounts if isinstance(one, str)]
        error, (x, y) = _interpolation(varying, cloud, np.concatenate(spans)) if varying and spans else NONE
        yield Check(
            "load_resolution",
            error,
            f"load.{load.name} varies faster than the nodes of body {body} resolve near ({x:.4g}, {y:.4g}): "
            f"interpolation between them is off by {100 * error:.2g} % of its largest value",
            f"refine there with body.{body}.refine, or use a smoother expression",
            f"load {load.name}",
        )


NONE = 0.0, (0.0, 0.0)


def _interpolation(varying: list[str], cloud: Cloud, spans: IntArray) -> tuple[float, tuple[float, float]]:
    """Largest difference of the mean over a span (s, 2 or 3) of nodes from the value at its centre, over the
    largest value, and its place."""
    middles: FloatArray = cloud.points[spans].mean(axis=1)
    nodes, place = np.unique(spans, return_inverse=True)
    try:
        at_nodes, between = amounts_at(varying, cloud.points[nodes]), amounts_at(varying, middles)
    except ExpressionError:  # reported when loads are evaluated at the nodes
        return NONE
    # A peak at a single node is seen at the nodes only.
    scale = float(max(np.abs(between).max(initial=0.0), np.abs(at_nodes).max(initial=0.0)))
    missed = np.abs(at_nodes[place.reshape(spans.shape)].mean(axis=1) - between).max(axis=1)
    worst = int(missed.argmax())
    x, y = middles[worst].tolist()
    return (float(missed[worst] / scale), (x, y)) if scale > 0.0 else NONE


def loaded_length(case: Case, boundaries: Boundaries, clouds: Mapping[str, Cloud]) -> Iterator[Check]:
    """Loaded parts with another length than given, as the nodes are from a file."""
    for load in case.load:
        if not isinstance(load, Pressure | Traction) or load.ends is None:
            continue
        surfaces = clouds[load.owner].surfaces
        found = sum(surfaces[name].curve.length for name in boundaries.names(load.place))
        body = next(one for one in case.body if one.name == load.owner)
        wanted = sum(run.part.length for run in runs_of(body.shape, load.place))
        yield Check(
            "loaded_length",
            abs(found - wanted) / wanted,
            f"load.{load.name} acts on a length of {found:.4g} instead of {wanted:.4g}, as parts of body "
            f"{load.owner} end at nodes",
            "put nodes of the file at from and to, or use an expression",
            f"load {load.name}",
        )
