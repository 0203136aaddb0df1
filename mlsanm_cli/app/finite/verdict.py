"""Admissibility of a state at finite strain, and the error of a path that cannot be continued."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation import Outcome
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.finite.law import determinant

ELLIPTICITY_WARNING = 0.1
"""Least eigenvalue of the acoustic tensor over the shear modulus below which a run warns."""
_LAWS = 'use law = "neo-hookean", which admits any compression, or smaller loads'


def check_deformation(
    scene: FiniteScene, position: float, factors: FloatArray, displacement: FloatArray
) -> None:
    """NumericalError, with body and node, if det F <= 0 or the law has lost ellipticity in a state of load
    ``factors`` (L,) and ``displacement`` (2N,) of all bodies."""
    for name, own in scene.parts(displacement).items():
        _check_body(scene, name, position, factors, own)


def _check_body(
    scene: FiniteScene, name: str, position: float, factors: FloatArray, displacement: FloatArray
) -> None:
    body = scene.bodies[name]
    gradient = body.gradient(displacement)
    volume = 1.0 + determinant(gradient)
    node = int(np.argmin(volume))
    if not volume[node] > 0.0:
        raise NumericalError(
            f"{_place(scene, name, node)}: the deformation is not invertible at position {position:.6g} "
            f"(det F = {volume[node]:.3g})",
            "use smaller loads, or finer nodes there",
        )
    waves = body.ellipticity(displacement, factors)
    node = int(np.argmin(waves))
    if waves[node] <= 0.0:
        raise NumericalError(
            f"{_place(scene, name, node)}: {body.law.kind} has lost ellipticity at position {position:.6g} "
            f"(acoustic tensor {waves[node]:.3g} of the shear modulus): the state is not unique",
            _LAWS,
        )


def path_failure(
    scene: FiniteScene, position: float, factors: FloatArray, displacement: FloatArray, outcome: Outcome
) -> NumericalError:
    """Error of a path of one body that cannot be continued from its last state."""
    name, body = scene.alone
    gradient = body.gradient(displacement)
    volume = 1.0 + determinant(gradient)
    waves = body.ellipticity(displacement, factors)
    node, soft = int(np.argmin(volume)), int(np.argmin(waves))
    where = f"the path stopped at position {position:.6g}: {outcome.reason.value} ({outcome.message})"
    if waves[soft] < ELLIPTICITY_WARNING:
        place = _place(scene, name, soft)
        close = f"{place} is close to losing ellipticity (acoustic tensor {waves[soft]:.2g})"
        return NumericalError(f"{where}; {close}", _LAWS)
    least = f"the smallest det F is {volume[node]:.3g}, at {_place(scene, name, node)}"
    return NumericalError(f"{where}; {least}", "use smaller loads, finer nodes, or raise solver.tolerance")


def _place(scene: FiniteScene, name: str, node: int) -> str:
    x, y = scene.bodies[name].elastic.model.cloud.points[node]
    return f"body {name}, node {node} at ({x:.6g}, {y:.6g})"
