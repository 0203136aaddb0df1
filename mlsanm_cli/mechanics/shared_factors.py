"""Translated copies of a body, which share one factorised system."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.roundoff import ROUND_OFF


def is_translated_copy(one: BodyModel, other: BodyModel) -> bool:
    """Whether two bodies differ by a translation only, so that one system serves both."""
    a, b = one.cloud, other.cloud
    if len(a.points) != len(b.points) or list(a.surfaces) != list(b.surfaces):
        return False
    same = one.settings == other.settings and np.array_equal(one.material.stiffness, other.material.stiffness)
    shift = b.points[0] - a.points[0]
    near = np.abs(b.points - a.points - shift).max(axis=1) <= ROUND_OFF * np.minimum(a.spacing, b.spacing)
    rows = all(np.array_equal(a.surfaces[name].index, b.surfaces[name].index) for name in a.surfaces)
    return bool(same and rows and near.all())


def with_shared_factors(twin: ElasticBody, model: BodyModel) -> ElasticBody:
    """The body of ``model`` with the system of ``twin``, for which :func:`is_translated_copy` holds."""
    shift = model.cloud.points[0] - twin.model.cloud.points[0]
    center = (twin.free.center[0] + float(shift[0]), twin.free.center[1] + float(shift[1]))
    pieces = replace(twin.pieces, cloud=model.cloud, middle=twin.pieces.middle + shift)
    return replace(twin, model=model, free=replace(twin.free, center=center), pieces=pieces)
