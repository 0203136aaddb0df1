"""Residual of a body's displacements in equations of the next higher degree.

Defect correction (Stetter 1978, doi:10.1007/BF01432879): local fits of degree p + 1 to the nodal
displacements u reveal the truncation error of degree p. With M the rows of degree p and M+ those of degree p
+ 1, the factorised system with right-hand side (M - M+) u gives approximately minus the error of u.

Equation (18) of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.body_model import BodyModel, enough_neighbors
from mlsanm_cli.mechanics.elasticity import divergence_of_stress, stress_of, traction_of
from mlsanm_cli.mechanics.material import PlaneMaterial
from mlsanm_cli.mechanics.pieces import reaction_of
from mlsanm_cli.memo import NO_CACHE, Memo
from mlsanm_cli.operators.fits import fitted_derivatives
from mlsanm_cli.operators.refinement import FUNCTIONAL_TOLERANCE, MAX_UPDATES, STALL_RATIO
from mlsanm_cli.operators.settings import MlsSettings
from mlsanm_cli.operators.stencil_weights import Stencils
from mlsanm_cli.operators.stencils import build_stencils

MAX_KEPT_NODES = 2000
"""Number of nodes of a body up to which its fits may be kept: 10 MB of weights."""
DEGREES = (2, 3, 4)
"""Degrees whose error estimates were validated. At degree 1 the estimate was up to 300 times too large, from
5 on up to 10 times."""

CORRECTION_TOLERANCE = 1e-3
"""Accepted relative error of a correction: an estimate has a digit or two."""
ALGEBRAIC_FRACTION = 0.15
"""Accepted algebraic error of the displacements, as a fraction of the correction computed from them.

The algebraic error is smooth, and its own defect is small: with 0.3 the estimates of all published cases
agree with those of refined displacements to 2e-3. In nearly incompressible bodies it may be 500 times as
large; there the displacements are refined as far as possible.
"""
ALGEBRAIC_FLOOR = 1e-13
"""The same as a fraction of the displacements, for scenes that the fits represent exactly."""


def next_degree(settings: MlsSettings, material: PlaneMaterial) -> MlsSettings:
    """Settings of the fits that evaluate the defect."""
    return enough_neighbors(replace(settings, degree=settings.degree + 1, neighbors=None), material)


@dataclass(frozen=True)
class Defect:
    """``source`` (r,) in the units of the body's rows, ``stress`` (n, 3) of the better fits minus the
    body's, and ``lacking``: force and moment about the origin (3,) on every gripped surface, likewise."""

    source: FloatArray
    stress: FloatArray
    reactions: Mapping[str, FloatArray]


@dataclass(frozen=True)
class Corrected:
    """``displacement`` (N, 2) of a body, its elastic ``solution`` (2N, 1) without rigid motions, its
    ``defect`` and the resulting ``change`` (2N,). ``rough`` is the relative error of solutions by the factor
    alone."""

    displacement: FloatArray
    solution: FloatArray
    defect: Defect
    change: FloatArray
    rough: float

    def response(self, body: ElasticBody, sources: sparse.csc_array) -> FloatArray:
        """Displacements (2N, c) of the body for ``sources`` (r, c), to CORRECTION_TOLERANCE or better."""
        if self.rough > CORRECTION_TOLERANCE:
            return body.system.solve(sources, FUNCTIONAL_TOLERANCE)
        return body.system.solve_unrefined(sources)


def correct(
    body: ElasticBody, source: sparse.csc_array, moved: FloatArray, memo: Memo = NO_CACHE
) -> Corrected:
    """Displacements of a body for ``source`` (r, 1) plus the rigid part ``moved`` (2N,), with their
    correction. ``memo`` keeps the better fits of small bodies.

    Unrefined solutions suffice for corrections. The displacements themselves are refined, each step sharing
    one pass through the factor with a correction, until the steps are small against it. The first step
    estimates the error of unrefined solutions: it is largest for smooth ones like this. Raises NumericalError
    as :func:`defect_of`.
    """
    better = memo.value("next degree", body.model.content, partial(NextDegree.of, body.model, memo.keeps))
    solution = body.system.solve_unrefined(source)
    size = float(np.linalg.norm(solution))
    before, rough = np.inf, 0.0
    part = 0.0 if body.model.material.nearly_incompressible else ALGEBRAIC_FRACTION
    for _ in range(MAX_UPDATES):
        defect = defect_of(body, (solution[:, 0] + moved).reshape(-1, 2), better)
        beyond = sparse.csc_array(defect.source[:, None])
        step, change = body.system.step(source, solution, beyond).T
        solution = solution + step[:, None]
        length = float(np.linalg.norm(step))
        rough = max(rough, length / size if size > 0.0 else 0.0)
        if (
            length <= max(part * float(np.linalg.norm(change)), ALGEBRAIC_FLOOR * size)
            or length >= STALL_RATIO * before
        ):
            break
        before = length
    if rough > CORRECTION_TOLERANCE:
        change = body.system.solve(beyond, FUNCTIONAL_TOLERANCE)[:, 0]
    return Corrected((solution[:, 0] + moved).reshape(-1, 2), solution, defect, change, rough)


def defect_of(body: ElasticBody, displacement: FloatArray, better: NextDegree | None = None) -> Defect:
    """Defect of the nodal ``displacement`` (N, 2) by fits of the next degree, ``better`` if known. Raises
    NumericalError for a degree outside DEGREES, or if the cloud is too small for the next degree."""
    model, stiffness = body.model, body.model.material.stiffness
    if model.settings.degree not in DEGREES:
        raise NumericalError(f"no error estimate is known for degree {model.settings.degree}")
    better = better or NextDegree(model)
    derivatives = better.of_displacement(displacement)
    less = model.stencils.derivatives(displacement) - derivatives
    lost, divergence, mean = stress_of(less, stiffness), model.divergence_of(less), None
    if model.material.nearly_incompressible:
        # The defect of the area change times the bulk modulus is large and not smooth. It enters by the
        # body's own fits, as in its rows; the next degree is compared on the mean stress, which is smooth.
        smooth = model.mean_stress(displacement)
        divergence += model.stress_divergence(smooth) - divergence_of_stress(better.of_stress(smooth))
        mean = stress_of(less, model.material.bulk_part) + smooth, smooth
    source = np.zeros(body.rows)
    source[: 2 * len(less)] = divergence.T.ravel()
    for name, surface in model.cloud.surfaces.items():
        source += body.source(name, traction_of(lost[surface.index], surface.normal), held=False)
    # Right-hand sides of pieces: the flux through their faces minus what the nodes' rows represent.
    lacking = partial(better.stress_around, displacement, mean)
    fluxes = body.pieces.flux_of(lacking, body.gripped)
    source[body.rows - len(fluxes) :] = fluxes - body.loads @ source
    reactions = {
        name: -reaction_of(
            model,
            model.cloud.surfaces[name],
            axes,
            (0.0, 0.0),
            lambda points: lacking(points, points[:, None])[:, 0],
        )
        for name, axes in body.gripped.items()
        if any(axes)
    }
    return Defect(source, stress_of(derivatives, stiffness) - model.stress(displacement), reactions)


@dataclass(frozen=True)
class NextDegree:
    """Fits one degree higher than a body's, with that degree's default stencil size; with ``kept`` weights a
    second evaluation is cheap."""

    model: BodyModel
    kept: dict[tuple[MlsSettings, int, bytes], Stencils] | None = field(default=None, compare=False)

    @classmethod
    def of(cls, model: BodyModel, keep: bool) -> NextDegree:
        """Fits that are to be kept, unless that takes much memory."""
        return cls(model, {} if keep and len(model.nodes) <= MAX_KEPT_NODES else None)

    def of_displacement(self, displacement: FloatArray) -> FloatArray:
        """Derivatives (n, 6, 2) of the ``displacement`` (N, 2) at the cloud's points."""
        return self._derivatives(
            displacement, self.model.cloud.points, next_degree(self.model.settings, self.model.material)
        )

    def of_stress(self, stress: FloatArray) -> FloatArray:
        """Derivatives (n, 6, 3) of the ``stress`` (n, 3) at the cloud's points, without ghosts."""
        return self._derivatives(
            stress, self.model.cloud.points, next_degree(self.model.settings, self.model.material)
        )

    def stress_around(
        self,
        displacement: FloatArray,
        mean: tuple[FloatArray, FloatArray] | None,
        places: FloatArray,
        points: FloatArray,
    ) -> FloatArray:
        """Stress (e, t, 3) of ``displacement`` (N, 2) by the model's fits minus that by these, at ``points``
        (e, t, 2) around ``places`` (e, 2), extrapolated with first and second derivatives; in nearly
        incompressible bodies mean stresses are fits of both degrees to nodal ones, a pair ``mean`` (n, 3).
        """
        model, c = self.model, self.model.material.stiffness
        # Fluxes are not of the narrower fits at nodes.
        settings = replace(model.settings, narrow=False)
        fits = settings, next_degree(settings, model.material)
        own, better = (self._derivatives(displacement, places, some) for some in fits)
        less, (x, y) = (own - better)[:, None], np.moveaxis(points - places[:, None], 2, 0)[..., None]
        near = [less[:, :, 0], less[:, :, 1] + x * less[:, :, 3] + y * less[:, :, 4]]
        near.append(less[:, :, 2] + x * less[:, :, 4] + y * less[:, :, 5])
        whole = np.stack(np.broadcast_arrays(*near), axis=2).reshape(-1, 3, 2)
        if mean is None:
            return stress_of(whole, c).reshape(*points.shape[:2], 3)
        flat, pairs = points.reshape(-1, 2), zip(mean, fits, strict=True)
        first, second = (self._derivatives(values, flat, some)[:, 0] for values, some in pairs)
        stress = stress_of(whole, c - model.material.bulk_part) + first - second
        return stress.reshape(*points.shape[:2], 3)

    def _derivatives(self, values: FloatArray, places: FloatArray, settings: MlsSettings) -> FloatArray:
        """Value and derivatives (e, 6, c) at ``places`` (e, 2) of nodal displacements (N, 2), or of stresses
        (n, 3) without ghosts."""
        model, cloud = self.model, self.model.cloud
        moved = values.shape[1] == 2
        nodes, tree, tips = (
            (model.nodes, model.tree, model.tips) if moved else (cloud.points, cloud.tree, None)
        )
        at_nodes = places is cloud.points and len(nodes) == len(model.nodes)
        near = model.near if at_nodes else None
        if self.kept is None:
            return fitted_derivatives(nodes, tree, places, settings, values, cloud.sight, near, tips)
        key = (settings, values.shape[1], places.tobytes())
        if key not in self.kept:
            self.kept[key] = build_stencils(nodes, tree, places, 2, settings, cloud.sight, near, tips)
        return self.kept[key].derivatives(values)
