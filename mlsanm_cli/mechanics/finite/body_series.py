"""Residuals of a body's equations along a path, order by order, and the forces of a state."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.loads import cofactor_normal
from mlsanm_cli.mechanics.laws.law import gradient_of

JETS = np.array([[1, 3, 4], [2, 4, 5]])
"""Among the derivatives of a stencil: d/dX and d/dY, each with its own derivatives by X and Y."""


class BodySeries:
    """Residuals of a body's equations along u(a), factors(a), filled order by order. Order k of the residual
    needs the orders up to k of displacement and factors; an unknown one is first put as None, then with its
    value. ``force`` and ``place`` (K + 1, 2, q) are those of the points of the pieces, ``middle`` (K + 1, 2,
    k) the centres of these."""

    def __init__(self, body: FiniteBody, orders: int) -> None:
        self.body, self.orders = body, orders
        inner, held, loaded = (one.count for one in body.points)
        stressed, total, warm = inner + held, inner + held + loaded, bool(body.loads.warming)
        self._held, self._loaded = slice(inner, stressed), slice(stressed, total)
        nodes, apart = len(body.elastic.model.cloud.points), body.law.nested
        self._nodes = body.law.series(orders, 3, nodes, warm, apart)
        self._faces = body.law.series(orders, 1, stressed, warm, apart)
        self._volumes = self._nodes
        if body.coarser is not None:
            self._volumes = body.law.series(orders, 1, nodes, warm, apart)
        # Mean stress of volume changes: fits of nodal values with derivatives at nodes, values at faces.
        self._mean = np.zeros((orders + 1, 3, nodes)) if apart else None
        self._face_mean = np.zeros((orders + 1, stressed)) if apart else None
        self.force, self.place = np.zeros((2, orders + 1, 2, total))
        self._moved = np.zeros((orders + 1, 2, loaded))
        self.middle = np.zeros((orders + 1, 2, body.count))
        self.displacement = np.zeros((orders + 1, body.unknowns))
        self.factors = np.zeros((orders + 1, body.loads.count))
        self._loaded_gradient = np.zeros((orders + 1, 4, loaded))
        self._normals = np.concatenate([one.normals.reshape(-1, 2) for one in body.points])
        kept = [np.repeat(one.kept, one.places.shape[1], axis=0) for one in body.points]
        self._kept = np.concatenate(kept).T
        self._turns = [np.zeros((2, orders + 1)) for _ in body.loads.turning]

    @classmethod
    def at(cls, body: FiniteBody, displacement: FloatArray, factors: FloatArray) -> BodySeries:
        """One state, order 0 alone."""
        series = cls(body, 0)
        series.put(0, displacement, factors)
        return series

    def put(self, order: int, displacement: FloatArray | None, factors: FloatArray) -> None:
        """Set ``order`` of displacement (2N,) and load factors (L,)."""
        body, applied, end = self.body, self.body.applied, self._held.stop
        self.factors[order] = factors
        for plate, turn in zip(body.loads.turning, self._turns, strict=True):
            # Cosine and sine of the plate's rotation.
            angle = self.factors[: order + 1] @ plate.rate
            if not order:
                turn[:, 0] = np.cos(angle[0]), np.sin(angle[0])
                continue
            weighted = np.arange(1, order + 1) * angle[1:] / order
            cos, sin = turn[:, :order][:, ::-1]
            turn[:, order] = -weighted @ sin, weighted @ cos
        degrees, on_faces = body.degrees_jets(factors), body.face_degrees(factors)
        gradient: FloatArray | None = None
        jets: FloatArray | None = None
        if displacement is not None:
            self.displacement[order] = displacement
            seen = np.concatenate([one.seen(displacement) for one in body.points])
            self.place[order] = seen[:, 0].T
            self._moved[order] = seen[self._loaded, 0].T
            self.middle[order] = (body.centers @ displacement.reshape(-1, 2)).T
            whole = gradient_of(seen)
            gradient, self._loaded_gradient[order] = whole[:, None, :end], whole[:, end:]
            jets = jets_of(body.elastic.model.stencils.derivatives(displacement.reshape(-1, 2)))
        self._nodes.put(order, jets, degrees)
        if body.coarser is not None:
            # Volume changes at the nodes by the coarser fits.
            coarse = None
            if displacement is not None:
                fitted = body.coarser.stencils.derivatives(displacement.reshape(-1, 2))
                coarse = gradient_of(fitted)[:, None]
            self._volumes.put(order, coarse, None if degrees is None else degrees[:1])
        self._faces.put(order, gradient, None if on_faces is None else on_faces[None])
        if self._mean is not None and self._face_mean is not None:
            # The mean stress of volume changes is fitted to its nodal values.
            assert self._volumes.mean is not None
            nodal = self._volumes.mean[order, 0][:, None]
            faces = [points.stencils.derivatives(nodal)[:, ::3].ravel() for points in body.points[:2]]
            self._mean[order] = body.elastic.model.stencils.derivatives(nodal)[:, :3, 0].T
            self._face_mean[order] = np.concatenate(faces)
        if not order:
            self.place[0] += np.concatenate([one.places.reshape(-1, 2) for one in body.points]).T
            self.middle[0] += body.elastic.pieces.middle.T
            self._loaded_gradient[0, [0, 3]] += 1.0
        # Forces at all points, in the components that count.
        stress, normal = self._faces.stress[:, order, 0], self._normals[:end].T
        self.force[order, 0, :end] = stress[0] * normal[0] + stress[1] * normal[1]
        self.force[order, 1, :end] = stress[2] * normal[0] + stress[3] * normal[1]
        if self._face_mean is not None:
            for low in range(order + 1):
                turned = cofactor_normal(self._faces.gradient[:, order - low, 0], self._normals[:end])
                self.force[order, :, :end] += self._face_mean[low] * turned
        self.force[order, :, end:] = applied.dead @ self.factors[order] - applied.pulling * self._moved[order]
        if applied.follows:
            for low in range(order + 1):
                pressure = applied.pressure @ self.factors[low]
                turned = cofactor_normal(self._loaded_gradient[order - low], self._normals[end:])
                self.force[order, :, end:] -= pressure * turned
        self.force[order] *= self._kept

    def rows(self, order: int) -> FloatArray:
        """Coefficient (r,) of ``order`` of the residual of all rows: of the nodes, then of the pieces."""
        body, elastic, applied = self.body, self.body.elastic, self.body.applied
        left = -(body.loads.sources @ self.factors[order])
        for plate, turn in zip(body.loads.turning, self._turns, strict=True):
            cos, sin = turn[:, order]
            left[plate.rows] -= plate.moved(cos - (not order), sin)
        count = len(elastic.model.cloud.points)
        stress = self._nodes.stress[:, order]
        left[:count] += stress[0, 1] + stress[1, 2]
        left[count : 2 * count] += stress[2, 1] + stress[3, 2]
        if self._mean is not None:
            for low in range(order + 1):
                slope = self._mean[low, 1:].T
                turned = cofactor_normal(self._nodes.gradient[:, order - low, 0], slope)
                left[: 2 * count] += turned.ravel()
        u = self.displacement[order].reshape(-1, 2)
        gradient = self._nodes.gradient
        for name, index, normal, held in body.conditions:
            mean, nodal = None, self._volumes.mean
            if self._mean is not None and nodal is not None:
                # Coefficient (2, b) of p cof(F) N, p being nodal values.
                mean = sum(
                    nodal[low, 0, index] * cofactor_normal(gradient[:, order - low, 0, index], normal)
                    for low in range(order + 1)
                )
            for component in (0, 1):
                at = elastic.condition_rows(name, component)
                if held[component]:
                    left[at] += u[index, component]
                    continue
                if mean is not None:
                    left[at] += mean[component]
                row = stress[2 * component : 2 * component + 2, 0, index]
                left[at] += row[0] * normal[:, 0] + row[1] * normal[:, 1]
                if applied.follows:
                    for low in range(order + 1):
                        pressure = applied.pressed[at] @ self.factors[low]
                        turned = cofactor_normal(gradient[:, order - low, 0, index], normal)
                        left[at] += pressure * turned[component]
        last = body.node_rows
        if elastic.springs:
            left[:last] += body.pulls @ self.displacement[order]
        left[last - len(elastic.held_nodes) : last] += body.single @ self.displacement[order]
        # Force x, y and moment imbalance of the pieces.
        count, (point, owner, sign) = body.count, body.on_pieces
        force = sign * self.force[: order + 1][:, :, point]
        arm = self.place[: order + 1][:, :, point] - self.middle[: order + 1][:, :, owner]
        back = force[::-1]
        moment = np.einsum("km,km->m", arm[:, 0], back[:, 1]) - np.einsum("km,km->m", arm[:, 1], back[:, 0])
        x, y, moments = (np.bincount(owner, one, count) for one in (*force[order], moment))
        left[last:] = np.concatenate([x, y, moments / elastic.pieces.size])
        left[last:] -= body.of_force @ self.factors[order]
        for number, turning in body.turning.items():
            for low in range(order + 1):
                moved = turning @ self.displacement[order - low]
                left[last + 2 * count :] -= self.factors[low, number] * moved
        return np.asarray(left)

    def outline_forces(self) -> tuple[FloatArray, FloatArray]:
        """Forces (2, g), at order 0, at the points of held sides and of those with prescribed tractions."""
        return self.force[0, :, self._held], self.force[0, :, self._loaded]

    def resultant(self) -> FloatArray:
        """Sum (2, k), at order 0, of the forces on the faces of each piece, as in its rows."""
        point, owner, sign = self.body.on_pieces
        return np.stack([np.bincount(owner, one, self.body.count) for one in sign * self.force[0][:, point]])


def jets_of(derivatives: FloatArray) -> FloatArray:
    """Jets (4, 3, n) of the displacement gradient from ``derivatives`` (n, 6, 2) of the displacement."""
    return np.asarray(derivatives[:, JETS].transpose(3, 1, 2, 0).reshape(4, 3, -1))


class Forces:
    """Forces on a body in one state: ``loads`` (L, 2) of tractions, pressures and body forces, ``reactions``
    (2,) of held sides and soft springs by surface. ``size`` is the largest sum of their magnitudes."""

    def __init__(self, body: FiniteBody, displacement: FloatArray, factors: FloatArray) -> None:
        """Forces at ``displacement`` (2N,) and load ``factors`` (L,)."""
        applied, count = body.applied, body.count
        series, points = BodySeries.at(body, displacement, factors), applied.points
        held, loaded = series.outline_forces()
        loads = np.einsum("iql->li", applied.dead) * factors[:, None]
        if points.count:
            gradient = gradient_of(points.seen(displacement)) + np.array([1.0, 0.0, 0.0, 1.0])[:, None]
            turned = cofactor_normal(gradient, points.normals.reshape(-1, 2)) * points.kept.T
            loads -= (turned @ applied.pressure).T * factors[:, None]
        whole = body.of_force[: 2 * count].reshape(2, count, -1)[:, body.elastic.pieces.main].sum(axis=1)
        self.loads: FloatArray = loads + whole.T * factors[:, None]
        self.reactions: dict[str, FloatArray] = {}
        for name in body.elastic.soft_springs:
            here = points.along[name]
            moved = points.seen(displacement)[here, 0].T
            self.reactions[name] = -(applied.pulling[:, here] * moved).sum(axis=1)
        for name, here in body.points[1].along.items():
            self.reactions[name] = self.reactions.get(name, 0.0) + held[:, here].sum(axis=1)
        sizes = [float(np.hypot(*force).sum()) for force in (held, loaded)]
        self.size = max([*sizes, *np.hypot(*self.loads.T).tolist()], default=0.0)

    @property
    def total(self) -> FloatArray:
        """Sum of all forces (2,), without those of single held nodes."""
        return np.asarray(np.array([*self.loads, *self.reactions.values()]).reshape(-1, 2).sum(axis=0))

    @property
    def rest(self) -> float:
        """Force imbalance, without forces of single held nodes."""
        return float(np.abs(self.total).max())
