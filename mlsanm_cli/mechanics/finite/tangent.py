"""Derivative of a body's rows by the nodal displacements, in a state of finite strain."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cells import Halves
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.body_series import SECOND, BodySeries
from mlsanm_cli.mechanics.finite.faces import FacePoints
from mlsanm_cli.operators.rows import nodal_rows, pair_rows
from mlsanm_cli.operators.stencil_weights import Stencils


def derivative_rows(body: FiniteBody, displacement: FloatArray, factors: FloatArray) -> sparse.csr_array:
    """Rows (r - 3k, 2N) of the nodes at ``displacement`` (2N,) and load ``factors`` (L,)."""
    elastic = body.elastic
    model, stencils = elastic.model, elastic.model.stencils
    stress, divergence = _coefficients(body, displacement, factors)
    blocks = [_rows(stencils, range(1, 6), divergence[component]) for component in (0, 1)]
    for name, index, normal, held in body.conditions:
        some = stencils.take(index)
        for component in (0, 1):
            if held[component]:
                blocks.append(nodal_rows(index, component, len(model.nodes)))
                continue
            row = stress[2 * component : 2 * component + 2][..., index]
            chosen = row[0] * normal[:, 0] + row[1] * normal[:, 1]
            if body.applied.follows:
                at = elastic.condition_rows(name, component)
                pressure = body.applied.pressed[at] @ factors
                chosen = chosen + pressure * _cofactor(normal)[component]
            blocks.append(_rows(some, range(1, 3), chosen))
    blocks.append(body.single)
    rows = sparse.csr_array(sparse.vstack(blocks, format="csr"))
    return sparse.csr_array(rows + body.pulls) if elastic.springs else rows


def _coefficients(
    body: FiniteBody, displacement: FloatArray, factors: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Derivatives at the nodes of P (4, 2, 2, n) by d/dX and d/dY of u_x and u_y, and of Div P (2, 5, 2, n)
    by all five derivatives."""
    derivatives = body.elastic.model.stencils.derivatives(displacement.reshape(-1, 2))
    count = len(derivatives)
    series = BodyJets.of(body, derivatives, factors)
    stress, divergence = np.zeros((4, 2, 2, count)), np.zeros((2, 5, 2, count))
    for kind in range(5):
        for component in (0, 1):
            found = series.moved(kind, component)
            divergence[0, kind, component] = found[0, 1] + found[1, 2]
            divergence[1, kind, component] = found[2, 1] + found[3, 2]
            if kind < 2:
                stress[:, kind, component] = found[:, 0]
    return stress, divergence


class BodyJets:
    """The law at the nodes of a state, and its response to unit derivatives."""

    def __init__(self, body: FiniteBody, gradient: FloatArray, factors: FloatArray) -> None:
        stretch = body.stretch_jets(factors, 0)
        self._series = body.law.series(1, 3, gradient.shape[-1], stretch is not None)
        self._series.put(0, gradient, stretch)

    @classmethod
    def of(cls, body: FiniteBody, derivatives: FloatArray, factors: FloatArray) -> BodyJets:
        """From ``derivatives`` (n, 6, 2) of the displacement and load ``factors`` (L,)."""
        gradient = np.zeros((4, 3, len(derivatives)))
        for component in (0, 1):
            for axis in (0, 1):
                where = 2 * component + axis
                gradient[where, 0] = derivatives[:, 1 + axis, component]
                gradient[where, 1:] = derivatives[:, list(SECOND[axis]), component].T
        return cls(body, gradient, factors)

    def moved(self, kind: int, component: int) -> FloatArray:
        """Change of P (4, 3, n), a jet, by the derivative number ``kind`` of one displacement
        ``component``."""
        unit = np.zeros_like(self._series.gradient[:, 1])
        if kind < 2:
            unit[2 * component + kind, 0] = 1.0
        for axis in (0, 1):
            for along in (0, 1):
                if SECOND[axis][along] == kind + 1:
                    unit[2 * component + axis, 1 + along] = 1.0
        self._series.put(1, unit)
        return self._series.stress[:, 1]


def _rows(stencils: Stencils, kinds: range, coefficients: FloatArray) -> sparse.csr_array:
    """Rows (e, 2N) of derivatives times ``coefficients`` (kinds, 2, e)."""
    entry = np.repeat(np.arange(len(stencils.indptr) - 1), np.diff(stencils.indptr))
    values = np.zeros((len(stencils.indices), 2))
    for number, kind in enumerate(kinds):
        values += stencils.weights[:, kind, None] * coefficients[number].T[entry]
    return pair_rows(stencils, values)


def _cofactor(normal: FloatArray) -> FloatArray:
    """d cof(F) N / dF (2, 2, 2, n): component of the result, derivative, displacement component."""
    found = np.zeros((2, 2, 2, len(normal)))
    x, y = normal.T
    found[0, 1, 1], found[0, 0, 1] = x, -y
    found[1, 1, 0], found[1, 0, 0] = -x, y
    return found


def derivative_pieces(body: FiniteBody, displacement: FloatArray, factors: FloatArray) -> sparse.csr_array:
    """Rows (3k, 2N) of the pieces at ``displacement`` (2N,) and load ``factors`` (L,)."""
    state = BodySeries(body, 0)
    state.put(0, displacement, factors)
    force, place, middle = state.state()
    inner, held = body.stressed
    loaded, u = body.applied.points, displacement.reshape(-1, 2)
    total: sparse.csr_array = sparse.csr_array((3 * body.count, body.unknowns))
    first, stretch = 0, body.face_stretch(factors)
    for points in (inner, held, loaded):
        here = slice(first, first + points.count)
        first = here.stop
        if not points.count:
            continue
        shape = points.places.shape[:2]
        pulling = np.zeros((2, *shape))
        if points is loaded:
            pulling = body.applied.pulling.reshape(2, *shape)
            pressure = (body.applied.pressure @ factors).reshape(shape)
            moduli = np.zeros((2, 2, 2, *shape))
            if body.applied.follows:
                turned = _cofactor(points.normals.reshape(-1, 2)).reshape(moduli.shape)
                moduli = -pressure * turned
        else:
            moduli = _moduli(body, points, u, None if stretch is None else stretch[here])
        moduli = moduli * points.kept.T[:, None, None, :, None]
        parts = (force[:, here].reshape(2, *shape), place[:, here].reshape(2, *shape))
        total = sparse.csr_array(total + _spread(body, points, moduli, pulling, *parts, middle))
    return sparse.csr_array(total - _turned(body, state, factors))


def _moduli(body: FiniteBody, points: FacePoints, u: FloatArray, stretch: FloatArray | None) -> FloatArray:
    """Derivatives (2, 2, 2, e, t) of P N at points with stress: component of the force, derivative, component
    of the displacement ``u`` (N, 2)."""
    _, by_x, by_y = points.seen(u)
    gradient = np.stack([by_x[:, 0], by_y[:, 0], by_x[:, 1], by_y[:, 1]])
    whole = body.law.moduli(gradient, stretch).reshape(2, 2, 2, 2, *points.places.shape[:2])
    return np.asarray(np.einsum("iJkL...,...J->iLk...", whole, points.normals))


def held_force(
    body: FiniteBody, displacement: FloatArray, factors: FloatArray, names: Collection[str], about: FloatArray
) -> tuple[FloatArray, sparse.csr_array]:
    """Force x, y and moment (3,) about a point (2,) of some held sides, and rows (3, 2N) of their
    derivatives."""
    inner, held = body.stressed
    series, u, stretch = BodySeries(body, 0), displacement.reshape(-1, 2), body.face_stretch(factors)
    series.put(0, displacement, factors)
    here = slice(inner.count, inner.count + held.count)
    force, place = (one[:, here] for one in series.state()[:2])
    some, first = np.zeros(held.count), 0
    for name in (one for one, components in body.elastic.gripped.items() if any(components)):
        last = first + len(Halves.of(body.elastic.model.cloud.surfaces[name], body.rule).arc)
        some[first:last] = name in names
        first = last
    force, arm = force * some, place - about[:, None]
    now = np.array([*force.sum(axis=1), (arm[0] * force[1] - arm[1] * force[0]).sum()])
    moduli = _moduli(body, held, u, None if stretch is None else stretch[here])[..., 0]
    moduli = moduli * held.kept.T[:, None, None] * some
    entry, weights = held.entries(), held.weights(0)
    x, y = ((weights[:, 1:, None] * one[:, :, entry].transpose(2, 0, 1)).sum(axis=1) for one in moduli)
    moment = arm[0, entry, None] * y - arm[1, entry, None] * x
    moment += weights[:, :1] * np.stack([force[1], -force[0]], axis=1)[entry]
    rows = np.stack([held.rows(one).sum(axis=0) for one in (x, y, moment)])
    return now, sparse.csr_array(rows)


def _spread(
    body: FiniteBody,
    points: FacePoints,
    moduli: FloatArray,
    pulling: FloatArray,
    force: FloatArray,
    place: FloatArray,
    middle: FloatArray,
) -> sparse.csr_array:
    """Contribution of points with ``moduli`` (2, 2, 2, e, t) of their forces, spring stiffness ``pulling``,
    ``force`` and ``place`` (2, e, t), to pieces with centres ``middle`` (2, k). Moments of a fit are taken
    about its own centre and then transferred to the pieces."""
    entry, center = points.entries(), place.mean(axis=2)
    x, y, moment = (np.zeros((len(entry), 2)) for _ in range(3))
    for point in range(place.shape[2]):
        weights = points.weights(point)
        own = moduli[..., point][..., entry]
        d_x = weights[:, 1, None] * own[0, 0].T + weights[:, 2, None] * own[0, 1].T
        d_y = weights[:, 1, None] * own[1, 0].T + weights[:, 2, None] * own[1, 1].T
        back = pulling[:, :, point][:, entry] * weights[:, 0]
        d_x[:, 0] -= back[0]
        d_y[:, 1] -= back[1]
        arm = (place[:, :, point] - center)[:, entry]
        x += d_x
        y += d_y
        moment += arm[0][:, None] * d_y - arm[1][:, None] * d_x
        pull = force[:, :, point][:, entry]
        moment += weights[:, :1] * np.stack([pull[1], -pull[0]], axis=1)
    rows = sparse.vstack([points.rows(one) for one in (x, y, moment)], format="csr")
    return sparse.csr_array(_onto(body, points.fit, points.owner, points.sign, center, middle) @ rows)


def _onto(
    body: FiniteBody, fit: IntArray, owner: IntArray, sign: FloatArray, center: FloatArray, middle: FloatArray
) -> sparse.csr_array:
    """Matrix (3k, 3e) that sums forces x, forces y and moments about the ``center`` (2, e) of fits on the
    pieces."""
    count, fits, size = body.count, center.shape[1], body.elastic.pieces.size
    arm = (center[:, fit] - middle[:, owner]) / size[owner]
    line = [owner, count + owner, *[2 * count + owner] * 3]
    column = [fit, fits + fit, fit, fits + fit, 2 * fits + fit]
    value = [sign, sign, -sign * arm[1], sign * arm[0], sign / size[owner]]
    entries = (np.concatenate(value), (np.concatenate(line), np.concatenate(column)))
    return sparse.csr_array(entries, shape=(3 * count, 3 * fits))


def load_columns(
    body: FiniteBody, displacement: FloatArray, factors: FloatArray, some: slice
) -> sparse.csr_array:
    """Derivatives (r, l) of all rows by the factors of ``some`` loads, dead tractions and motions, at
    ``displacement`` (2N,) and load ``factors`` (L,)."""
    points, dead = body.applied.points, body.applied.dead[:, :, some]
    u = displacement.reshape(-1, 2)
    place = points.places.reshape(-1, 2).T + points.seen(u)[0].T
    middle = body.elastic.pieces.whole.middle.T + (body.centers @ u).T
    onto = _onto(body, points.fit, points.owner, points.sign, place, middle)
    forces = sparse.csr_array(dead.reshape(2 * points.count, dead.shape[2]))
    sources = body.loads.sources[: body.elastic.rows - 3 * body.count, some].copy()
    for plate in body.loads.turning:
        angle = float(plate.rate @ factors)
        sources[plate.rows] += np.outer(plate.moved(-math.sin(angle), math.cos(angle)), plate.rate[some])
    nodes = sparse.csr_array(-sources)
    return sparse.csr_array(sparse.vstack([nodes, onto[:, : 2 * points.count] @ forces], format="csr"))


def _turned(body: FiniteBody, state: BodySeries, factors: FloatArray) -> sparse.csr_array:
    """Derivative (3k, 2N) of the moments by the pieces' centres, to be subtracted; with body forces also by
    their nodes."""
    count, nodes, size = body.count, len(body.elastic.model.nodes), body.elastic.pieces.size
    force = state.resultant()
    centers = body.centers.tocoo()
    own, node = centers.coords
    pull = force[:, own]
    rows = np.concatenate([2 * count + own] * 2)
    columns = np.concatenate([2 * node, 2 * node + 1])
    values = np.concatenate([pull[1] * centers.data, -pull[0] * centers.data]) / size[np.tile(own, 2)]
    entries = (values, (rows, columns))
    turned: sparse.csr_array = sparse.csr_array(entries, shape=(3 * count, 2 * nodes))
    for number, turning in body.turning.items():
        nothing = sparse.csr_array((2 * count, 2 * nodes))
        turned = turned + sparse.vstack([nothing, factors[number] * turning], format="csr")
    return sparse.csr_array(turned)
