"""Derivative of a body's rows by the nodal displacements, in a state of finite strain."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import replace
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.mechanics.assembly import rows_of_nodes
from mlsanm_cli.mechanics.elasticity import ALL, FIRST, operator_rows, traction_moduli
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.body_series import BodySeries, jets_of
from mlsanm_cli.mechanics.finite.faces import FacePoints
from mlsanm_cli.mechanics.finite.loads import cofactor_normal
from mlsanm_cli.mechanics.laws.law import gradient_of
from mlsanm_cli.mechanics.pieces import gathering
from mlsanm_cli.operators.rows import pair_rows, scalar_rows
from mlsanm_cli.operators.stencil_weights import Stencils
from mlsanm_cli.records import dataclass


def derivative_rows(
    body: FiniteBody, displacement: FloatArray, factors: FloatArray, mean: MeanStress | None = None
) -> sparse.csr_array:
    """Rows (r - 3k, 2N) of the nodes at ``displacement`` (2N,) and load ``factors`` (L,), with the ``mean``
    stress of volume changes there or another one in its place."""
    elastic, surfaces = body.elastic, body.elastic.model.cloud.surfaces
    moduli, divergence = _coefficients(body, displacement, factors)
    equilibrium = [operator_rows(elastic.model.stencils, ALL, one) for one in divergence]
    if body.law.nested:
        mean = mean or MeanStress.at(body, displacement, factors)
        equilibrium = [one + rows for one, rows in zip(equilibrium, mean.divergence(), strict=True)]
        moduli = moduli + mean.moduli

    def traction(name: str, component: int) -> FloatArray:
        surface = surfaces[name]
        found = traction_moduli(moduli[..., surface.index], surface.normal, component)
        if body.applied.follows:
            pressure = body.applied.pressed[elastic.condition_rows(name, component)] @ factors
            found = found + pressure * _cofactor(surface.normal)[component]
        return found

    rows = rows_of_nodes(elastic.model, elastic.held, equilibrium, traction, body.single)
    return sparse.csr_array(rows + body.pulls) if elastic.springs else rows


@dataclass(frozen=True)
class MeanStress:
    """Mean stress p of volume changes at a ``body``'s nodes, ``values`` (n,), in a state with displacement
    ``gradient`` (4, n), and its derivatives ``slopes`` (4, n) by the components of F."""

    body: FiniteBody
    gradient: FloatArray
    values: FloatArray
    slopes: FloatArray

    @classmethod
    def at(cls, body: FiniteBody, displacement: FloatArray, factors: FloatArray) -> MeanStress:
        """That at ``displacement`` (2N,) and load ``factors`` (L,)."""
        gradient = body.gradient(displacement)
        return cls(body, gradient, *body.law.mean(gradient, body.degrees(factors)))

    def after(self, earlier: MeanStress) -> MeanStress:
        """The same with the values that the ``earlier`` state predicts linearly, as Newton's method does with
        p as an unknown of its own: derivatives with them allow larger steps, as the bulk modulus does not
        multiply the error of the prediction (Magisano, Leonetti and Garcea 2017, doi:10.1002/nme.5369)."""
        change = (earlier.slopes * (self.gradient - earlier.gradient)).sum(axis=0)
        return replace(self, values=earlier.values + change)

    @property
    def stencils(self) -> Stencils:
        """The stencils of the nodes."""
        return self.body.elastic.model.stencils

    @cached_property
    def rows(self) -> sparse.csr_array:
        """Rows (n, 2N) of the derivatives of nodal values by displacements."""
        by_x, by_y = self.slopes[::2], self.slopes[1::2]
        return operator_rows(self.stencils, FIRST, np.stack([by_x, by_y]))

    @property
    def cofactor(self) -> FloatArray:
        """cof F (2, 2, n)."""
        xx, xy, yx, yy = self.gradient
        return np.array([[1.0 + yy, -yx], [-xy, 1.0 + xx]])

    @property
    def moduli(self) -> FloatArray:
        """Derivatives (4, 2, 2, n) of p cof(F), p being nodal values, by d/dX and d/dY of u_x and u_y."""
        slopes = self.slopes.reshape(2, 2, -1).transpose(1, 0, 2)
        found = np.einsum("iJn,Lkn->iJLkn", self.cofactor, slopes).reshape(4, 2, 2, -1)
        found[0, 1, 1] += self.values
        found[3, 0, 0] += self.values
        found[1, 0, 1] -= self.values
        found[2, 1, 0] -= self.values
        return np.asarray(found)

    def divergence(self) -> list[sparse.csr_array]:
        """Rows (n, 2N), x and y, of the derivatives of cof(F) grad p with fits of nodal values."""
        stencils, found = self.stencils, []
        by_x, by_y = (scalar_rows(stencils, stencils.weights[:, kind]) for kind in (1, 2))
        slope = stencils.derivatives(self.values[:, None])[:, 1:3, 0]
        changed = _cofactor(slope)
        for component in (0, 1):
            x, y = self.cofactor[component]
            nested = (sparse.diags_array(x) @ by_x + sparse.diags_array(y) @ by_y) @ self.rows
            found.append(sparse.csr_array(nested + operator_rows(stencils, FIRST, changed[component])))
        return found


def _coefficients(
    body: FiniteBody, displacement: FloatArray, factors: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Derivatives at the nodes of P (4, 2, 2, n) by d/dX and d/dY of u_x and u_y, and of Div P (2, 5, 2, n)
    by all five derivatives."""
    derivatives = body.elastic.model.stencils.derivatives(displacement.reshape(-1, 2))
    count, degrees = len(derivatives), body.degrees_jets(factors)
    series = body.law.series(1, 3, count, degrees is not None, body.law.nested)
    series.put(0, jets_of(derivatives), degrees)
    stress, divergence = np.zeros((4, 2, 2, count)), np.zeros((2, 5, 2, count))
    for kind in range(5):
        for component in (0, 1):
            unit = np.zeros((count, 6, 2))
            unit[:, 1 + kind, component] = 1.0
            series.put(1, jets_of(unit))
            found = series.stress[:, 1]
            divergence[0, kind, component] = found[0, 1] + found[1, 2]
            divergence[1, kind, component] = found[2, 1] + found[3, 2]
            if kind < 2:
                stress[:, kind, component] = found[:, 0]
    return stress, divergence


def _cofactor(normal: FloatArray) -> FloatArray:
    """d cof(F) N / dF (2, 2, 2, n): component of the result, derivative, displacement component."""
    found = np.zeros((2, 2, 2, len(normal)))
    x, y = normal.T
    found[0, 1, 1], found[0, 0, 1] = x, -y
    found[1, 1, 0], found[1, 0, 0] = -x, y
    return found


def derivative_pieces(
    body: FiniteBody, displacement: FloatArray, factors: FloatArray, mean: MeanStress | None = None
) -> sparse.csr_array:
    """Rows (3k, 2N) of the pieces, likewise."""
    state = BodySeries.at(body, displacement, factors)
    force, place, middle = state.state()
    size = body.elastic.pieces.size
    if body.law.nested:
        mean = mean or MeanStress.at(body, displacement, factors)
    total, first = _moments_of_centers(body, state, factors), 0
    for points in body.points:
        here = slice(first, first + points.count)
        first = here.stop
        if points.count:
            moduli = _moduli(body, points, here, displacement, factors, mean)
            rows, center = _by_fit(body, points, moduli, force[:, here], place[:, here])
            onto = _onto(points.fit, points.owner, points.sign, center, middle, size)
            total = sparse.csr_array(total + onto @ rows)
    if mean is not None:
        for points, here in body.stressed:
            each = points.places.shape[1]
            owner, sign = np.repeat(points.owner, each), np.repeat(points.sign, each)
            number = (each * points.fit[:, None] + np.arange(each)).ravel()
            onto = _onto(number, owner, sign, place[:, here], middle, size)
            total = total + onto[:, : 2 * points.count] @ _mean_forces(mean, points, displacement)
    return total


def _moduli(
    body: FiniteBody,
    points: FacePoints,
    here: slice,
    displacement: FloatArray,
    factors: FloatArray,
    mean: MeanStress | None,
) -> FloatArray:
    """Derivatives (2, 2, 2, e, t) of the forces at ``points``, which are ``here`` among all, in the kept
    components: component of the force, derivative, component of the displacement."""
    shape, degrees = points.places.shape[:2], body.face_degrees(factors)
    if points is not body.applied.points:
        warmth = None if degrees is None else degrees[here]
        whole = body.law.moduli(gradient_of(points.seen(displacement)), warmth, body.law.nested)
        found = np.einsum("iJkL...,...J->iLk...", whole.reshape(2, 2, 2, 2, *shape), points.normals)
        if mean is not None:
            fitted = points.stencils.derivatives(mean.values[:, None])[:, ::3, 0].reshape(shape)
            found += fitted * _cofactor(points.normals.reshape(-1, 2)).reshape(2, 2, 2, *shape)
    elif body.applied.follows:
        pressure = (body.applied.pressure @ factors).reshape(shape)
        found = -pressure * _cofactor(points.normals.reshape(-1, 2)).reshape(2, 2, 2, *shape)
    else:
        found = np.zeros((2, 2, 2, *shape))
    return np.asarray(found * points.kept.T[:, None, None, :, None])


def held_force(
    body: FiniteBody, displacement: FloatArray, factors: FloatArray, names: Collection[str], about: FloatArray
) -> tuple[FloatArray, sparse.csr_array]:
    """Force x, y and moment (3,) about a point (2,) of some held sides, and rows (3, 2N) of their
    derivatives."""
    inner, held, _ = body.points
    here, some = slice(inner.count, inner.count + held.count), np.zeros(held.count)
    for name in names:
        some[held.along[name]] = 1.0
    force, place = (one[:, here] for one in BodySeries.at(body, displacement, factors).state()[:2])
    mean = MeanStress.at(body, displacement, factors) if body.law.nested else None
    moduli = _moduli(body, held, here, displacement, factors, mean)
    rows, center = _by_fit(body, held, moduli, force, place)
    onto = _onto(held.fit, np.zeros_like(held.fit), some, center, about[:, None], np.ones(1))
    on_forces, total = onto[:, : force.size], onto @ rows
    if mean is not None:
        total = total + on_forces @ _mean_forces(mean, held, displacement)
    return on_forces @ force.ravel(), sparse.csr_array(total)


def _mean_forces(mean: MeanStress, points: FacePoints, displacement: FloatArray) -> sparse.csr_array:
    """Rows (2q, 2N) of the derivatives of the forces p cof(F) N at ``points``, in the kept components, by the
    nodal values of p."""
    stencils, each = points.stencils, points.places.shape[1]
    columns = stencils.weights[:, ::3]
    rows = [scalar_rows(stencils, np.ascontiguousarray(column)) for column in columns.T]
    values = sparse.csr_array(sparse.vstack(rows, format="csr"))
    # From one row per fit for each of its points to the points of each fit.
    order = np.arange(points.count).reshape(each, -1).T.ravel()
    gradient = gradient_of(points.seen(displacement)) + np.array([1.0, 0.0, 0.0, 1.0])[:, None]
    turned = cofactor_normal(gradient, points.normals.reshape(-1, 2))
    turned *= np.repeat(points.kept, each, axis=0).T
    changed = values[order] @ mean.rows
    return sparse.csr_array(
        sparse.vstack([sparse.diags_array(one) @ changed for one in turned], format="csr")
    )


def _by_fit(
    body: FiniteBody, points: FacePoints, moduli: FloatArray, force: FloatArray, place: FloatArray
) -> tuple[sparse.csr_array, FloatArray]:
    """Rows (3e, 2N) of the derivatives of forces x, forces y and moments of fits about their own centres, and
    these (2, e); ``moduli`` (2, 2, 2, e, t), ``force`` and ``place`` (2, q) are those of the points."""
    force, place = (one.reshape(2, *points.places.shape[:2]) for one in (force, place))
    stencils, center = points.stencils, place.mean(axis=2)
    entry = np.repeat(np.arange(len(points.places)), np.diff(stencils.indptr))
    x, y, moment = (np.zeros((len(entry), 2)) for _ in range(3))
    for point in range(place.shape[2]):
        weights = stencils.weights[:, 3 * point : 3 * point + 3]
        own = moduli[..., point][..., entry]
        d_x = weights[:, 1, None] * own[0, 0].T + weights[:, 2, None] * own[0, 1].T
        d_y = weights[:, 1, None] * own[1, 0].T + weights[:, 2, None] * own[1, 1].T
        if points is body.applied.points:
            # Springs: one point per fit.
            d_x[:, 0] -= body.applied.pulling[0, entry] * weights[:, 0]
            d_y[:, 1] -= body.applied.pulling[1, entry] * weights[:, 0]
        arm = (place[:, :, point] - center)[:, entry]
        x += d_x
        y += d_y
        moment += arm[0][:, None] * d_y - arm[1][:, None] * d_x
        pull = force[:, :, point][:, entry]
        moment += weights[:, :1] * np.stack([pull[1], -pull[0]], axis=1)
    return sparse.csr_array(
        sparse.vstack([pair_rows(stencils, one) for one in (x, y, moment)], format="csr")
    ), center


def _onto(
    fit: IntArray, owner: IntArray, sign: FloatArray, center: FloatArray, middle: FloatArray, size: FloatArray
) -> sparse.csr_array:
    """Matrix (3k, 3e) that sums forces x, forces y and moments about the ``center`` (2, e) of fits on bodies
    with ``middle`` (2, k), moments over their ``size`` (k,)."""
    arm = ((center[:, fit] - middle[:, owner]) / size[owner]).T
    return gathering(fit, owner, sign, arm, size, center.shape[1])


def load_columns(
    body: FiniteBody, displacement: FloatArray, factors: FloatArray, some: slice
) -> sparse.csr_array:
    """Derivatives (r, l) of all rows by the factors of ``some`` loads, dead tractions and motions, at
    ``displacement`` (2N,) and load ``factors`` (L,)."""
    points, dead = body.applied.points, body.applied.dead[:, :, some]
    u = displacement.reshape(-1, 2)
    place = points.places.reshape(-1, 2).T + points.seen(u)[:, 0].T
    middle = body.elastic.pieces.middle.T + (body.centers @ u).T
    onto = _onto(points.fit, points.owner, points.sign, place, middle, body.elastic.pieces.size)
    forces = sparse.csr_array(dead.reshape(2 * points.count, dead.shape[2]))
    sources = body.loads.sources[: body.node_rows, some].copy()
    for plate in body.loads.turning:
        angle = float(plate.rate @ factors)
        sources[plate.rows] += np.outer(plate.moved(-math.sin(angle), math.cos(angle)), plate.rate[some])
    nodes = sparse.csr_array(-sources)
    return sparse.csr_array(sparse.vstack([nodes, onto[:, : 2 * points.count] @ forces], format="csr"))


def _moments_of_centers(body: FiniteBody, state: BodySeries, factors: FloatArray) -> sparse.csr_array:
    """Derivative (3k, 2N) of the moments by the pieces' centres; with body forces also by their nodes."""
    force, size = state.resultant(), body.elastic.pieces.size
    rows = sparse.diags_array(1.0 / size) @ body.centers
    by_x, by_y = (sparse.diags_array(one) @ rows for one in (-force[1], force[0]))
    moments = sparse.kron(by_x, [[1.0, 0.0]]) + sparse.kron(by_y, [[0.0, 1.0]])
    for number, turning in body.turning.items():
        moments = moments - factors[number] * turning
    nothing = sparse.csr_array((2 * body.count, body.unknowns))
    return sparse.csr_array(sparse.vstack([nothing, moments], format="csr"))
