"""Warnings of loads that the nodes of a case do not resolve."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from mlsanm_cli.app.scene.fields import amounts_at
from mlsanm_cli.app.scene.load_profiles import runs_of
from mlsanm_cli.app.scene.surfaces import surfaces_at
from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.case import BodyForce, Case, ExpressionError, Pressure, Temperature, Traction
from mlsanm_cli.cloud.cloud import Cloud

MAX_INTERPOLATION_ERROR = 0.08
"""Largest error of linear interpolation of a load between nodes, relative to its largest value. Stresses of a
hot spot were 20 % off with an error of 12 %, and 1 % with 5 %, as automatic spacings may leave."""

LENGTH_TOLERANCE = 0.01
"""Largest relative error of the length of a loaded part."""


def load_warnings(case: Case, clouds: Mapping[str, Cloud]) -> Iterator[str]:
    """Warnings of loads that the nodes do not resolve, and of loaded parts with another length."""
    yield from _part_warnings(case, clouds)
    for load in case.load:
        if isinstance(load, Temperature | BodyForce):
            amounts = [load.temperature] if isinstance(load, Temperature) else list(load.body_force)
            cloud = clouds[load.body]
            spans = [cloud.triangles]
        elif isinstance(load, Pressure | Traction):
            given = [load.pressure] if isinstance(load, Pressure) else list(load.traction or ())
            amounts = [0.0 if one is None else one for one in given]
            cloud = clouds[load.owner]
            indices = [cloud.surfaces[name].index for name in surfaces_at(case, load.place)]
            # Only inside of surfaces: tractions may be discontinuous at their ends.
            spans = [np.stack([index[1:-2], index[2:-1]], axis=1) for index in indices if len(index) > 3]
        else:
            continue
        varying = [one for one in amounts if isinstance(one, str)]
        if varying and spans:
            yield from _warning(load.name, load.owner, varying, cloud, np.concatenate(spans))


def _part_warnings(case: Case, clouds: Mapping[str, Cloud]) -> Iterator[str]:
    """Warnings of loaded parts with another length than given, as the nodes are from a file."""
    for load in case.load:
        if not isinstance(load, Pressure | Traction) or load.ends is None:
            continue
        surfaces = clouds[load.owner].surfaces
        found = sum(surfaces[name].curve.length for name in surfaces_at(case, load.place))
        body = next(one for one in case.body if one.name == load.owner)
        wanted = sum(curve.length for _, _, curve in runs_of(body.shape, load.place))
        if abs(found - wanted) > LENGTH_TOLERANCE * wanted:
            yield (
                f"load.{load.name} acts on a length of {found:.4g} instead of {wanted:.4g}, as parts of body "
                f"{load.owner} end at nodes; put nodes of the file at from and to, or use an expression"
            )


def _warning(name: str, body: str, varying: list[str], cloud: Cloud, spans: IntArray) -> Iterator[str]:
    """A warning if means over the ``spans`` (s, 2 or 3) of nodes differ from the values at their centres."""
    middles: FloatArray = cloud.points[spans].mean(axis=1)
    nodes, place = np.unique(spans, return_inverse=True)
    try:
        at_nodes, between = amounts_at(varying, cloud.points[nodes]), amounts_at(varying, middles)
    except ExpressionError:
        # Reported when loads are evaluated at the nodes.
        return
    # A peak at a single node is seen at the nodes only.
    scale = float(max(np.abs(between).max(initial=0.0), np.abs(at_nodes).max(initial=0.0)))
    missed = np.abs(at_nodes[place.reshape(spans.shape)].mean(axis=1) - between).max(axis=1)
    worst = int(missed.argmax())
    if missed[worst] > MAX_INTERPOLATION_ERROR * scale:
        x, y = middles[worst]
        yield (
            f"load.{name} varies faster than the nodes of body {body} resolve near ({x:.4g}, {y:.4g}): "
            f"interpolation between them is off by {100 * missed[worst] / scale:.2g} % of its largest value; "
            f"refine there with body.{body}.refine, or use a smoother expression"
        )
