"""Forces on a body in a state: of loads by number, of held sides by name, and their balance."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.body_series import BodySeries
from mlsanm_cli.mechanics.finite.loads import cofactor_normal
from mlsanm_cli.mechanics.laws.law import gradient_of
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class Forces:
    """Forces on a body in one state: ``loads`` (L, 2) of tractions, pressures and body forces, ``reactions``
    (2,) of held sides by surface. ``size`` is the largest sum of their magnitudes."""

    loads: FloatArray
    reactions: dict[str, FloatArray]
    size: float

    @classmethod
    def of(cls, body: FiniteBody, displacement: FloatArray, factors: FloatArray) -> Forces:
        """Forces at ``displacement`` (2N,) and load ``factors`` (L,)."""
        series = BodySeries.at(body, displacement, factors)
        loads, reactions = _of_loads(body, displacement, factors), _reactions(body, series)
        sizes = [float(np.hypot(*force).sum()) for force in series.outline_forces()]
        return cls(loads, reactions, max([*sizes, *np.hypot(*loads.T).tolist()], default=0.0))

    @property
    def total(self) -> FloatArray:
        """Sum of all forces (2,), without those of single held nodes."""
        return np.asarray(np.array([*self.loads, *self.reactions.values()]).reshape(-1, 2).sum(axis=0))

    @property
    def rest(self) -> float:
        """Force imbalance, without forces of single held nodes."""
        return float(np.abs(self.total).max())


def _of_loads(body: FiniteBody, displacement: FloatArray, factors: FloatArray) -> FloatArray:
    applied = body.applied
    points = applied.points
    found = np.einsum("iql->li", applied.dead) * factors[:, None]
    if points.count:
        gradient = gradient_of(points.seen(displacement)) + np.array([1.0, 0.0, 0.0, 1.0])[:, None]
        turned = cofactor_normal(gradient, points.normals.reshape(-1, 2)) * points.kept.T
        found -= (turned @ applied.pressure).T * factors[:, None]
    count = body.count
    whole = body.of_force[: 2 * count].reshape(2, count, -1)[:, body.elastic.pieces.main].sum(axis=1)
    return np.asarray(found + whole.T * factors[:, None])


def _reactions(body: FiniteBody, series: BodySeries) -> dict[str, FloatArray]:
    """Reactions by surface, of soft springs and of held points."""
    found = {name: series.spring_forces(name) for name in body.elastic.soft_springs}
    force = series.outline_forces()[0]
    for name, here in body.points[1].along.items():
        found[name] = found.get(name, 0.0) + force[:, here].sum(axis=1)
    return found
