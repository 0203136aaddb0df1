"""Temperature changes of a body and their right-hand sides.

With the strains e(u) of the displacements and the thermal strains a T, stresses are C e(u) - C a T. The
stresses C e(u), which the rows represent, therefore balance div(C a T) inside and the traction t + C a T n on
free surfaces; the faces of a piece transmit C a T n in addition to the external load of the piece.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.elasticity import traction_of
from mlsanm_cli.mechanics.pieces import reaction_of
from mlsanm_cli.mechanics.probes import stress_of_expansion
from mlsanm_cli.records import dataclass


class Field(Protocol):
    """A scalar field over a body."""

    def at(self, points: FloatArray) -> FloatArray:
        """Values (e,) at ``points`` (e, 2) of the body."""


@dataclass(frozen=True)
class Heating:
    """Temperature change of a body at factor 1: a ``field``, and its ``values`` (n,) at the cloud's
    points."""

    number: int
    body: str
    field: Field
    values: FloatArray

    def source(self, body: ElasticBody) -> FloatArray:
        """Right-hand side (r,) of its ``body``."""
        even = stress_of_expansion(body.model.material)
        source = np.zeros(body.rows)
        inside = body.model.stress_divergence(self.values[:, None] * even)
        source[: inside.size] = inside.T.ravel()
        for name, surface in body.model.cloud.surfaces.items():
            traction = traction_of(self.values[surface.index, None] * even, surface.normal)
            source += body.source(name, traction, held=False)
        fluxes = body.pieces.flux_of(lambda _, points: self._blocked(even, points), body.restrained)
        source[body.rows - len(fluxes) :] = fluxes - body.loads @ source
        return source

    def reaction(self, body: ElasticBody, surface: str, center: tuple[float, float]) -> FloatArray:
        """Force x, y and moment about ``center`` (3,) due to thermal expansion, to be subtracted from those
        computed for a held surface from displacements."""
        even, held = stress_of_expansion(body.model.material), body.restrained[surface]
        where = body.model.cloud.surfaces[surface]
        return reaction_of(body.model, where, held, center, lambda points: self._blocked(even, points))

    def _blocked(self, even: FloatArray, points: FloatArray) -> FloatArray:
        """Minus the stress (..., 3) at points (..., 2) of a body prevented from expanding."""
        degrees = self.field.at(points.reshape(-1, 2)).reshape(points.shape[:-1])
        return np.asarray(degrees[..., None] * even)
