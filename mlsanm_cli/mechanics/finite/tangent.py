"""Derivative of a body's rows by the nodal displacements, in a state of finite strain."""

from __future__ import annotations

import math
from collections.abc import Collection
from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.kernels.assembly import add_force_rows, add_nested, add_rows
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.body_series import BodySeries, jets_of
from mlsanm_cli.mechanics.finite.loads import FacePoints, cofactor_normal
from mlsanm_cli.mechanics.laws.law import gradient_of
from mlsanm_cli.mechanics.pieces import gathering
from mlsanm_cli.operators.stencil_weights import pair_rows


def tangent_rows(
    body: FiniteBody, displacement: FloatArray, factors: FloatArray, mean: MeanStress | None = None
) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Rows (r - 3k, 2N) of the nodes and (3k, 2N) of the pieces at ``displacement`` (2N,) and load
    ``factors`` (L,), with the ``mean`` stress of volume changes there or another one in its place."""
    if body.law.nested and mean is None:
        mean = MeanStress(body, displacement, factors)
    pattern, stencils = body.pattern, body.elastic.model.stencils
    values = np.zeros((len(pattern.direct.nodes), 2 if mean is None else 3))
    coefficients = _coefficients(body, displacement, factors, mean)
    add_rows(stencils.indptr, stencils.weights, pattern.stencil, coefficients, pattern.at, values)
    state, first, size = BodySeries.at(body, displacement, factors), 0, body.elastic.pieces.size
    for points, at in zip(body.points, pattern.on_pieces, strict=True):
        _add_forces(points, first, state, mean, (state.middle[0], size), at, values)
        first += points.count
    if mean is not None:
        values = mean.nested(values)
    flat = values.reshape(-1)
    flat[pattern.at_constant] += pattern.constant.data
    single = body.single
    flat[pattern.whole.coefficients(single, pattern.pieces - single.shape[0])] += single.data
    # Moments are about the mean of a piece's nodes, which moves with them.
    labels = body.elastic.pieces.labels
    share = state.resultant() / (size * np.bincount(labels, minlength=body.count))
    values[pattern.centers] += np.stack([-share[1], share[0]], axis=1)[labels]
    for number, turning in body.turning.items():
        flat[pattern.whole.coefficients(turning, pattern.moments)] -= factors[number] * turning.data
    return pattern.rows(values)


class MeanStress:
    """Mean stress p of volume changes at a ``body``'s nodes, ``values`` (n,), in a state with displacement
    ``gradient`` (4, n), and its derivatives ``slopes`` (4, n) by the components of F."""

    def __init__(self, body: FiniteBody, displacement: FloatArray, factors: FloatArray) -> None:
        self.body, self.gradient = body, body.gradient(displacement)
        self.values, self.slopes = body.law.mean(self.gradient, body.degrees(factors))

    def after(self, earlier: MeanStress) -> MeanStress:
        """The same with the values that the ``earlier`` state predicts linearly, as Newton's method does with
        p as an unknown of its own: derivatives with them allow larger steps, as the bulk modulus does not
        multiply the error of the prediction (Magisano, Leonetti and Garcea 2017, doi:10.1002/nme.5369)."""
        predicted = copy(self)
        predicted.values = earlier.values + (earlier.slopes * (self.gradient - earlier.gradient)).sum(axis=0)
        return predicted

    @property
    def cofactor(self) -> FloatArray:
        """cof F (2, 2, n)."""
        xx, xy, yx, yy = self.gradient
        return np.array([[1.0 + yy, -yx], [-xy, 1.0 + xx]])

    @property
    def moduli(self) -> FloatArray:
        """Derivatives (2, 2, 2, 2, n) of p cof(F), p being nodal values, by the components of F."""
        found = np.einsum("iJn,kLn->iJkLn", self.cofactor, self.slopes.reshape(2, 2, -1))
        found[0, 0, 1, 1] += self.values
        found[1, 1, 0, 0] += self.values
        found[0, 1, 1, 0] -= self.values
        found[1, 0, 0, 1] -= self.values
        return np.asarray(found)

    @cached_property
    def _by_displacements(self) -> FloatArray:
        """Derivatives (nnz, 2) of nodal values, in the entries of the stencils."""
        stencils = self.body.elastic.model.stencils
        count, entries = stencils.nodes, len(stencils.indices)
        found, coefficients = np.zeros((entries, 2)), np.zeros((count, 5, 2))
        coefficients[:, :2] = self.slopes.reshape(2, 2, -1).T
        add_rows(stencils.indptr, stencils.weights, np.arange(count), coefficients, np.arange(entries), found)
        return found

    @property
    def rows(self) -> sparse.csr_array:
        """Rows (n, 2N) of the derivatives of nodal values by displacements."""
        return pair_rows(self.body.elastic.model.stencils, self._by_displacements)

    def nested(self, values: FloatArray) -> FloatArray:
        """Coefficients (n, 2) of the displacements, for all entries of the body's pattern, of rows with
        ``values`` (m, 3) for its direct ones, the last of them for p at the nodes."""
        stencils, pattern = self.body.elastic.model.stencils, self.body.pattern
        direct, whole = pattern.direct, pattern.whole
        total, slot = np.zeros((len(whole.nodes), 2)), np.zeros(whole.count, dtype=np.int64)
        fitted = (stencils.indptr, stencils.indices, self._by_displacements)
        add_nested(direct.begin, direct.nodes, values, *fitted, whole.begin, whole.nodes, slot, total)
        return total


def _coefficients(
    body: FiniteBody, displacement: FloatArray, factors: FloatArray, mean: MeanStress | None
) -> FloatArray:
    """Coefficients (s, 5, c) of the derivatives in the rows with stresses at nodes, of both displacements and
    the mean stress if that is a field of its own."""
    stencils = body.elastic.model.stencils
    derivatives = stencils.derivatives(displacement.reshape(-1, 2))
    count, degrees = len(derivatives), body.degrees_jets(factors)
    series = body.law.series(1, 3, count, degrees is not None, mean is not None)
    series.put(0, jets_of(derivatives), degrees)
    # Derivatives of P by F, and their own derivatives by X and Y: (iJ, jet, kL, n).
    jets = np.stack([series.stress[:, 1].copy() for _ in series.units()], axis=2)
    moduli = jets[:, 0].reshape(2, 2, 2, 2, count)
    by_x, by_y = (jets[:, jet].reshape(2, 2, 2, 2, count) for jet in (1, 2))
    found = np.zeros((len(body.pattern.row), 5, 2 if mean is None else 3))
    inside = found[: 2 * count].reshape(2, count, 5, -1)
    inside[:, :, :2, :2] = (by_x[:, 0] + by_y[:, 1]).transpose(0, 3, 2, 1)
    inside[:, :, 2, :2] = moduli[:, 0, :, 0].transpose(0, 2, 1)
    inside[:, :, 3, :2] = (moduli[:, 0, :, 1] + moduli[:, 1, :, 0]).transpose(0, 2, 1)
    inside[:, :, 4, :2] = moduli[:, 1, :, 1].transpose(0, 2, 1)
    if mean is not None:
        slope = stencils.derivatives(mean.values[:, None])[:, 1:3, 0]
        inside[:, :, :2, :2] += _cofactor(slope).transpose(0, 3, 1, 2)
        inside[:, :, :2, 2] = mean.cofactor.transpose(0, 2, 1)
        moduli = moduli + mean.moduli
    last = 2 * count
    for name, index, normal, held in body.conditions:
        for component in (axis for axis in (0, 1) if not held[axis]):
            here = slice(last, last + len(index))
            last = here.stop
            found[here, :2, :2] = np.einsum("JkLb,bJ->bLk", moduli[component][..., index], normal)
            if body.applied.follows:
                pressure = body.applied.pressed[body.elastic.condition_rows(name, component)] @ factors
                found[here, :2, :2] += (pressure * _cofactor(normal)[component]).transpose(2, 0, 1)
    return found


def _cofactor(normal: FloatArray) -> FloatArray:
    """d cof(F) N / dF (2, 2, 2, n): component of the result, derivative, displacement component."""
    found = np.zeros((2, 2, 2, len(normal)))
    x, y = normal.T
    found[0, 1, 1], found[0, 0, 1] = x, -y
    found[1, 1, 0], found[1, 0, 0] = -x, y
    return found


UNDEFORMED = np.array([1.0, 0.0, 0.0, 1.0])[:, None]
"""F at rest."""


def _add_forces(
    points: FacePoints,
    first: int,
    state: BodySeries,
    mean: MeanStress | None,
    pieces: tuple[FloatArray, FloatArray],
    at: IntArray,
    values: FloatArray,
) -> None:
    """Add the derivatives of the forces at ``points``, the ``first`` of which has that number among all, and
    of their moments to ``values``, at places ``at`` (3, e). ``pieces``: centres (2, k) and sizes (k,)."""
    body, here = state.body, slice(first, first + points.count)
    normals, applied, factors = points.normals.reshape(-1, 2), body.applied, state.factors[0]
    # By value, d/dX and d/dY of both displacements and of the mean stress if that is a field of its own.
    moduli = np.zeros((points.count, 2, 3, 2 if mean is None else 3))
    if points is not applied.points:
        degrees = body.face_degrees(factors)
        gradient = gradient_of(points.seen(state.displacement[0]))
        warmth = None if degrees is None else degrees[here]
        whole = body.law.moduli(gradient, warmth, mean is not None).reshape(2, 2, 2, 2, -1)
        moduli[:, :, 1:, :2] = np.einsum("iJkLq,qJ->qiLk", whole, normals)
        if mean is not None:
            fitted = points.stencils.derivatives(mean.values[:, None])[:, ::3].ravel()
            moduli[:, :, 1:, :2] += (fitted * _cofactor(normals)).transpose(3, 0, 1, 2)
            moduli[:, :, 0, 2] = cofactor_normal(gradient + UNDEFORMED, normals).T
    else:
        moduli[:, 0, 0, 0], moduli[:, 1, 0, 1] = -applied.pulling
        if applied.follows:
            pressure = applied.pressure @ factors
            moduli[:, :, 1:, :2] = (-pressure * _cofactor(normals)).transpose(3, 0, 1, 2)
    moduli *= np.repeat(points.kept, points.places.shape[1], axis=0)[:, :, None, None]
    by_force = moduli.reshape(points.count, 6, moduli.shape[-1])
    force, place = (np.ascontiguousarray(one[0][:, here]) for one in (state.force, state.place))
    fitted_to = (points.stencils.indptr, np.ascontiguousarray(points.stencils.weights))
    fit, owner, sign = points.fit, points.owner, points.sign
    add_force_rows(*fitted_to, by_force, force, place, fit, owner, sign, *pieces, at, values)


def held_force(
    body: FiniteBody, displacement: FloatArray, factors: FloatArray, names: Collection[str], about: FloatArray
) -> tuple[FloatArray, sparse.csr_array]:
    """Force x, y and moment (3,) about a point (2,) of held sides, and their derivatives (3, 2N)."""
    inner, held, _ = body.points
    some, nodes = np.zeros(held.count), body.unknowns // 2
    for name in names:
        some[held.along[name]] = 1.0
    state = BodySeries.at(body, displacement, factors)
    mean = MeanStress(body, displacement, factors) if body.law.nested else None
    values = np.zeros((3 * nodes, 2 if mean is None else 3))
    points = replace(held, owner=np.zeros_like(held.fit), sign=some)
    at = points.reached[1] + nodes * np.arange(3)[:, None]
    _add_forces(points, inner.count, state, mean, (about[:, None], np.ones(1)), at, values)
    rows = sparse.csr_array(values[:, :2].reshape(3, -1))
    if mean is not None:
        rows = rows + sparse.csr_array(values[:, 2].reshape(3, -1)) @ mean.rows
    force, place = (one[0][:, inner.count : inner.count + held.count] for one in (state.force, state.place))
    arm = place - about[:, None]
    moment = arm[0] * force[1] - arm[1] * force[0]
    return np.array([*force, moment]) @ some, sparse.csr_array(rows)


def load_columns(
    body: FiniteBody, displacement: FloatArray, factors: FloatArray, some: slice
) -> sparse.csr_array:
    """Derivatives (r, l) of all rows by the factors of ``some`` loads, dead tractions and motions, at
    ``displacement`` (2N,) and load ``factors`` (L,)."""
    points, dead = body.applied.points, body.applied.dead[:, :, some]
    u = displacement.reshape(-1, 2)
    place = points.places.reshape(-1, 2).T + points.seen(u)[:, 0].T
    middle = body.elastic.pieces.middle.T + (body.centers @ u).T
    size = body.elastic.pieces.size
    arm = ((place[:, points.fit] - middle[:, points.owner]) / size[points.owner]).T
    onto = gathering(points.fit, points.owner, points.sign, arm, size, points.count)
    forces = sparse.csr_array(dead.reshape(2 * points.count, dead.shape[2]))
    sources = body.loads.sources[: body.node_rows, some].copy()
    for plate in body.loads.turning:
        angle = float(plate.rate @ factors)
        sources[plate.rows] += np.outer(plate.moved(-math.sin(angle), math.cos(angle)), plate.rate[some])
    nodes = sparse.csr_array(-sources)
    return sparse.csr_array(sparse.vstack([nodes, onto[:, : 2 * points.count] @ forces], format="csr"))
