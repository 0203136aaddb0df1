"""Residual of a body's displacements in equations of the next higher degree.

Defect correction (Stetter 1978, doi:10.1007/BF01432879): with M the rows of degree p and M+ those of degree p
+ 1, the factorised system with right-hand side (M - M+) u gives approximately minus the error of u. Equation
(29) of docs/method.md."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
import scipy.sparse as sparse
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cloud import BATCH_SIZE, nearest
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.body_model import BodyModel, enough_neighbors
from mlsanm_cli.mechanics.elasticity import divergence_of_stress, stress_of
from mlsanm_cli.mechanics.material import PlaneMaterial
from mlsanm_cli.mechanics.supports import singular_changes
from mlsanm_cli.memo import NO_CACHE, Memo
from mlsanm_cli.operators.neighbors import MlsSettings
from mlsanm_cli.operators.stencil_weights import Stencils
from mlsanm_cli.operators.stencils import build_stencils
from mlsanm_cli.operators.system import FUNCTIONAL_TOLERANCE, MAX_UPDATES, STALL_RATIO
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import FINE_ROUND_OFF

MAX_KEPT_NODES = 2000
"""Number of nodes of a body up to which its fits are kept: 10 MB of weights."""
DEGREES = (2, 3, 4)
"""Degrees whose error estimates are validated."""

SINGULAR_REACH = 4.0
"""Distance in spacings from ends of clamped sides within which a defect is uncertain."""
SINGULAR_SHARE = 0.5
"""Part of the change by these rows alone, without those of pieces, that is uncertain: where stresses are
singular, fits of the next degree are as wrong as others."""

CORRECTION_TOLERANCE = 1e-3
"""Accepted relative error of a correction: an estimate has a digit or two."""
ALGEBRAIC_FRACTION = 0.15
"""Accepted algebraic error of the displacements over the correction computed from them; nearly incompressible
bodies are refined as far as possible."""


def next_degree(settings: MlsSettings, material: PlaneMaterial) -> MlsSettings:
    """Settings of the fits that evaluate the defect."""
    return enough_neighbors(replace(settings, degree=settings.degree + 1, neighbors=None), material)


@dataclass(frozen=True)
class Defect:
    """``source`` (r,) in the units of the body's rows, its part ``singular`` (r,) near ends of clamped sides,
    ``stress`` (n, 3) of the better fits minus the body's, and likewise ``reactions``: force and moment about
    the origin (3,) on every restrained surface."""

    source: FloatArray
    singular: FloatArray
    stress: FloatArray
    reactions: Mapping[str, FloatArray]


@dataclass(frozen=True)
class Corrected:
    """``displacement`` (N, 2) of a body, its ``defect`` and the resulting ``change`` (2N,). ``rough`` is the
    relative error of solutions by the factor alone, ``uncertain`` (2N,) what the change may miss."""

    displacement: FloatArray
    defect: Defect
    change: FloatArray
    rough: float
    uncertain: FloatArray

    @property
    def missed(self) -> Corrected:
        """What the change may miss, in its place."""
        nothing = {name: np.zeros_like(one) for name, one in self.defect.reactions.items()}
        return replace(self, change=self.uncertain, defect=replace(self.defect, reactions=nothing))

    def response(self, body: ElasticBody, sources: sparse.csc_array) -> FloatArray:
        """Displacements (2N, c) of the body for ``sources`` (r, c), to CORRECTION_TOLERANCE or better."""
        if self.rough > CORRECTION_TOLERANCE:
            return body.system.solve(sources, FUNCTIONAL_TOLERANCE)
        return body.system.correction(sources)


def correct(
    body: ElasticBody,
    source: sparse.csc_array,
    moved: FloatArray,
    plates: Collection[str] = (),
    memo: Memo = NO_CACHE,
) -> Corrected:
    """Displacements of a body for ``source`` (r, 1) plus the rigid part ``moved`` (2N,), with their
    correction. Surfaces on ``plates`` are moved by forces; ``memo`` keeps the better fits of small bodies.
    The displacements are refined until steps are small against the correction; the first one estimates the
    error of unrefined solutions. Raises NumericalError as :func:`defect_of`."""
    better = memo.value("next degree", body.model.content, partial(NextDegree, body.model))
    solution = body.system.correction(source)
    size = float(np.linalg.norm(solution))
    before, rough = np.inf, 0.0
    part = 0.0 if body.model.material.nearly_incompressible else ALGEBRAIC_FRACTION
    for _ in range(MAX_UPDATES):
        defect = defect_of(body, (solution[:, 0] + moved).reshape(-1, 2), better, plates)
        beyond = sparse.csc_array(defect.source[:, None])
        both, from_both = sparse.hstack([source, beyond], format="csc"), np.hstack([solution, 0.0 * solution])
        step, change = body.system.correction(sparse.csc_array(both), from_both).T
        solution = solution + step[:, None]
        length = float(np.linalg.norm(step))
        rough = max(rough, length / size if size > 0.0 else 0.0)
        if (
            length <= max(part * float(np.linalg.norm(change)), FINE_ROUND_OFF * size)
            or length >= STALL_RATIO * before
        ):
            break
        before = length
    if rough > CORRECTION_TOLERANCE:
        change = body.system.solve(beyond, FUNCTIONAL_TOLERANCE)[:, 0]
    displacement, uncertain = (solution[:, 0] + moved).reshape(-1, 2), np.zeros_like(change)
    found = Corrected(displacement, defect, change, rough, uncertain)
    if not defect.singular.any():
        return found
    alone = found.response(body, sparse.csc_array(defect.singular[:, None]))[:, 0]
    return replace(found, uncertain=SINGULAR_SHARE * alone)


def defect_of(
    body: ElasticBody,
    displacement: FloatArray,
    better: NextDegree | None = None,
    plates: Collection[str] = (),
) -> Defect:
    """Defect of the nodal ``displacement`` (N, 2) by fits of the next degree, ``better`` if known; surfaces
    on ``plates`` are moved by forces. Raises NumericalError for a degree outside DEGREES or too small a
    cloud."""
    model, stiffness = body.model, body.model.material.stiffness
    if model.settings.degree not in DEGREES:
        raise NumericalError(
            f"no estimate is known for degree {model.settings.degree}",
            f"use mls.degree {DEGREES[0]} to {DEGREES[-1]}",
        )
    better = better or NextDegree(model)
    derivatives = better.at_nodes(displacement)
    less = model.stencils.derivatives(displacement) - derivatives
    radius = model.stencils.radius
    lost, divergence, mean = stress_of(less, stiffness, radius), model.divergence_of(less), None
    if model.material.nearly_incompressible:
        # The defect of the area change is large and not smooth: it enters by the body's own fits, as in its
        # rows; the next degree is compared on the mean stress.
        smooth = model.mean_stress(displacement)
        divergence += model.stress_divergence(smooth) - divergence_of_stress(better.at_nodes(smooth), radius)
        mean = stress_of(less, model.material.bulk_part, radius) + smooth, smooth
    # Right-hand sides of pieces: the flux through their faces minus what the nodes' rows represent.
    lacking = partial(better.stress_around, displacement, mean)
    source = body.stress_source(lost, divergence, lacking)
    held = [name for name, axes in body.restrained.items() if any(axes)]
    reactions = {name: -body.reaction(name, (0.0, 0.0), lacking) for name in held}
    stress = stress_of(derivatives, stiffness, radius) - model.stress(displacement)
    return Defect(source, np.where(_near_singular(body, plates), source, 0.0), stress, reactions)


def _near_singular(body: ElasticBody, plates: Collection[str]) -> BoolArray:
    """Mask (r,) of the rows of nodes near ends of clamped sides, but those on ``plates``, which are known."""
    cloud, found = body.model.cloud, np.zeros(body.rows, dtype=bool)
    fixed = {name: axes for name, axes in body.restrained.items() if name not in plates}
    ends = singular_changes(cloud, fixed, body.springs)
    if len(ends):
        near = nearest(cKDTree(cloud.points[ends]), cloud.points)[0] < SINGULAR_REACH * cloud.spacing
        found[: 2 * len(near)] = np.tile(near, 2)
        for name, surface in cloud.surfaces.items():
            for axis in (0, 1):
                found[body.condition_rows(name, axis)] = near[surface.index]
    return found


class NextDegree:
    """Fits one degree higher than a body's; the weights of small bodies are ``kept``."""

    def __init__(self, model: BodyModel) -> None:
        self.model = model
        self.kept: dict[tuple[MlsSettings, int, bytes], Stencils] = {}

    def at_nodes(self, values: FloatArray) -> FloatArray:
        """Derivatives (n, 6, c) at the cloud's points of displacements (N, 2) or stresses (n, 3)."""
        settings = next_degree(self.model.settings, self.model.material)
        return self._derivatives(values, self.model.cloud.points, settings)

    def stress_around(
        self,
        displacement: FloatArray,
        mean: tuple[FloatArray, FloatArray] | None,
        places: FloatArray,
        points: FloatArray,
    ) -> FloatArray:
        """Stresses (3 e t | 4 e t,) of ``displacement`` (N, 2) by the model's fits minus those by these, at
        ``points`` (e, t, 2) around ``places`` (e, 2), extrapolated with two derivatives; in nearly
        incompressible bodies mean stresses are fits of both degrees to nodal ones ``mean`` (n, 3)."""
        model, c = self.model, self.model.material.stiffness
        # Fluxes are not of the narrower fits at nodes.
        settings = replace(model.settings, narrow=False)
        fits = settings, next_degree(settings, model.material)
        own, better = (self._derivatives(displacement, places, some) for some in fits)
        value, d_x, d_y, d_xx, d_xy, d_yy = np.moveaxis((own - better)[:, None], 2, 0)
        x, y = np.moveaxis(points - places[:, None], 2, 0)[..., None]
        near = value + x * d_x + y * d_y, d_x + x * d_xx + y * d_xy, d_y + x * d_xy + y * d_yy
        whole = np.stack(np.broadcast_arrays(*near), axis=2).reshape(-1, 3, 2)
        flat, radius = points.reshape(-1, 2), model.cloud.radius(points.reshape(-1, 2))
        if mean is None:
            return stress_of(whole, c, radius).T.ravel()
        pairs = zip(mean, fits, strict=True)
        first, second = (self._derivatives(values, flat, some)[:, 0] for values, some in pairs)
        stress = stress_of(whole, c - model.material.bulk_part, radius) + first - second
        return stress.T.ravel()

    def _derivatives(self, values: FloatArray, places: FloatArray, settings: MlsSettings) -> FloatArray:
        """Value and derivatives (e, 6, c) at ``places`` of displacements (N, 2) or stresses (n, 3)."""
        model, cloud = self.model, self.model.cloud
        tips = model.tips if values.shape[1] == 2 else None

        def fits(some: IntArray) -> Stencils:
            nodes, tree, sight = cloud.fitted
            return build_stencils(nodes, tree, places[some], 2, settings, sight, tips, cloud.images)

        numbers = np.arange(len(places))
        if len(cloud.points) > MAX_KEPT_NODES:
            batches = np.split(numbers, range(BATCH_SIZE, len(numbers), BATCH_SIZE))
            return np.concatenate([fits(batch).derivatives(values) for batch in batches])
        key = (settings, values.shape[1], places.tobytes())
        if key not in self.kept:
            self.kept[key] = fits(numbers)
        return self.kept[key].derivatives(values)
