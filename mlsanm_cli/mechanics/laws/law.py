"""The protocol of a constitutive law in the plane: first Piola-Kirchhoff stress P of the deformation gradient
F, as series, with derivatives of any order.

Components of F and P in the plane are ordered 11, 12, 21, 22; 33 is the stretch and the stress across it. In
plane strain the stretch across the plane is 1, in plane stress it makes the stress across vanish. A body of
temperature T deforms elastically by F G^-1 with its free stretch G = 1 + a T, also across the plane::

    P(F) = det(G) P_e(F G^-1) G^-T                F_e = F G^-1

The linearisation at F = 1 is the law of small strains. Laws of nearly incompressible materials give the
part p cof(F) of P apart, p being their mean stress due to volume changes: derivatives of p by first
derivatives of nodal values do not lock.

Equations (19) and (21) of docs/method.md.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.laws.series import Series, Tape, Term, dot, linear
from mlsanm_cli.mechanics.material import PlaneMaterial
from mlsanm_cli.records import dataclass

WAVE_DIRECTIONS = 24
"""Directions, over half a turn, in which ellipticity is tested."""


@dataclass(frozen=True)
class Stress:
    """First Piola-Kirchhoff stress ``plane`` 11, 12, 21, 22, functions that record the stress ``across`` and
    the ``stretch`` across, and the ``mean`` stress of volume changes if left out, else None."""

    plane: Sequence[Series]
    across: Callable[[], Term]
    stretch: Callable[[], Term]
    mean: Term | None = None


class Law(ABC):
    """A law with its ``linear`` part at small strain, in ``plane`` "strain" or "stress"."""

    name: str
    linear: PlaneMaterial
    plane: str

    @abstractmethod
    def stress_of(self, tape: Tape, f: Sequence[Series], across: Term | None, apart: bool) -> Stress:
        """Elastic stress of the gradient ``f`` in the plane and the stretch ``across``, None if there is no
        stress across. Leaves the mean stress ``apart`` if possible and asked for."""

    def series(
        self, orders: int, jets: int, points: int, warm: bool = False, apart: bool = False
    ) -> Response:
        """Empty series of ``orders`` beyond the state, ``jets`` 1 (values) or 3 (with spatial
        derivatives)."""
        # The stretch across a sheet is the solution of an equation.
        orders = max(orders, 1) if self.plane == "stress" else orders
        return Response(self, Tape(orders, jets, points), warm, apart)

    def state(
        self, gradient: FloatArray, degrees: FloatArray | None = None, orders: int = 0, apart: bool = False
    ) -> Response:
        """The response, values only, to a displacement ``gradient`` (4, n) and temperature change (n,)."""
        response = self.series(orders, 1, gradient.shape[1], degrees is not None, apart)
        response.put(0, gradient[:, None], None if degrees is None else degrees[None])
        return response

    def stress(self, gradient: FloatArray, degrees: FloatArray | None = None) -> FloatArray:
        """P (4, n) at a displacement ``gradient`` (4, n) and temperature change (n,)."""
        return np.asarray(self.state(gradient, degrees).stress[:, 0, 0])

    def mean(self, gradient: FloatArray, degrees: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """Mean stress p (n,) of volume changes, and dp/dF (4, n), at a displacement ``gradient`` (4, n)."""
        response = self.state(gradient, degrees, 1, apart=True)
        assert response.mean is not None
        mean = response.mean
        return mean[0, 0], np.stack([mean[1, 0].copy() for _ in response.units()])

    def moduli(
        self, gradient: FloatArray, degrees: FloatArray | None = None, apart: bool = False
    ) -> FloatArray:
        """dP/dF (4, 4, n) at a displacement ``gradient`` (4, n) and temperature change (n,)."""
        response = self.state(gradient, degrees, 1, apart)
        return np.stack([response.stress[:, 1, 0].copy() for _ in response.units()], axis=1)

    def squared_free_stretch(self, tensor: FloatArray, degrees: FloatArray) -> FloatArray:
        """A ``tensor`` (4, n) times the square of the free stretch G of a temperature change (n,)."""
        xx, yy, double, _ = self.linear.free_expansion
        shear = 0.5 * double * degrees
        free = np.array([[1.0 + xx * degrees, shear], [shear, 1.0 + yy * degrees]])
        product = np.einsum("ijn,jkn,kln->iln", tensor.reshape(2, 2, -1), free, free)
        return np.asarray(product.reshape(4, -1))

    @property
    def nested(self) -> bool:
        """Whether the mean stress of volume changes is differentiated as a nodal field."""
        return False

    def ellipticity(self, gradient: FloatArray, degrees: FloatArray | None = None) -> FloatArray:
        """Smallest eigenvalue (n,) of the acoustic tensors of all directions N, over the shear modulus."""
        moduli = self.moduli(gradient, degrees).reshape(2, 2, 2, 2, -1)
        least = np.full(gradient.shape[1], np.inf)
        for angle in np.linspace(0.0, np.pi, WAVE_DIRECTIONS, endpoint=False):
            n = np.array([np.cos(angle), np.sin(angle)])
            q = np.einsum("iJkLn,J,L->ikn", moduli, n, n)
            mean, half = 0.5 * (q[0, 0] + q[1, 1]), 0.5 * (q[0, 0] - q[1, 1])
            least = np.minimum(least, mean - np.hypot(half, 0.5 * (q[0, 1] + q[1, 0])))
        return least / self.linear.shear


@dataclass(frozen=True)
class SaintVenantKirchhoff(Law):
    """P = F S, S = C E, E = (F^T F - 1) / 2 with the stiffness of the ``linear`` material. C is that of the
    plane: S_33 = 0 in plane stress is linear in E."""

    name = "saint-venant-kirchhoff"
    linear: PlaneMaterial
    plane: str

    def stress_of(self, tape: Tape, f: Sequence[Series], across: Term | None, apart: bool) -> Stress:
        f11, f12, f21, f22 = f
        squares = [(f11**2, f21**2), (f12**2, f22**2)]
        direct = [linear([(x, 0.5), (y, 0.5)], -0.5) for x, y in squares]
        thickening = 0.0 if across is None else 0.5 * (across**2 - 1.0)
        strain = (*direct, f11 * f12 + f21 * f22, thickening)
        material = self.linear
        moduli = np.column_stack([material.stiffness, material.coupling]).tolist()
        s11, s22, s12 = stress = [linear(zip(strain, row, strict=True)) for row in moduli]
        plane = _times_symmetric(f, s11, s12, s22)

        def contraction() -> Term:
            return linear(zip(stress, 2.0 * material.contraction, strict=True), 1.0) ** 0.5

        def stress_across() -> Term:
            factors = np.append(material.across, material.across_modulus)
            return stretch() * linear(zip((*stress, thickening), factors, strict=True))

        stretch = contraction if across is None else lambda: across
        return Stress(plane, (lambda: 0.0) if across is None else stress_across, stretch)


def _times_symmetric(tensor: Sequence[Series], xx: Term, xy: Term, yy: Term) -> list[Series]:
    """A ``tensor`` 11, 12, 21, 22 times a symmetric one."""
    columns = ((xx, xy), (xy, yy))
    return [dot((x, t_x), (y, t_y)) for t_x, t_y in (tensor[:2], tensor[2:]) for x, y in columns]


def law_class(name: str) -> type[Any]:
    """The class of the hyperelastic law ``name``, loaded when it is needed."""
    from mlsanm_cli.mechanics.laws.rubber import LAWS

    return LAWS[name]


class Response:
    """Series of F, ``gradient`` (4, K + 1, j, n), and P, ``stress``, of a law at points, filled order by
    order. ``mean`` is the mean stress (K + 1, j, n) of volume changes if it is apart."""

    def __init__(self, law: Law, tape: Tape, warm: bool, apart: bool) -> None:
        self.law, self._tape = law, tape
        self._f = [tape.input() for _ in range(4)]
        self._degrees = tape.input() if warm else None
        self._found = found = self._stress(apart)
        self._mean = None if found.mean is None else tape.as_series(found.mean)
        self.gradient = np.zeros((4, *self._f[0].values.shape))
        self.stress = np.zeros_like(self.gradient)

    def _stress(self, apart: bool) -> Stress:
        """Stress of the deformation beyond the free stretch."""
        law, degrees, confined = self.law, self._degrees, self.law.plane == "strain"
        if degrees is None:
            return law.stress_of(self._tape, self._f, 1.0 if confined else None, apart)
        a11, a22, double, a33 = law.linear.free_expansion
        g11, g22, g12 = degrees * a11 + 1.0, degrees * a22 + 1.0, degrees * (0.5 * double)
        g33, g21 = degrees * a33 + 1.0, g12
        area = g11 * g22 - g12 * g21
        elastic = _times_symmetric(self._f, g22 / area, -g12 / area, g11 / area)
        cold = law.stress_of(self._tape, elastic, 1.0 / g33 if confined else None, apart)
        plane = _times_symmetric(cold.plane, g22 * g33, -g12 * g33, g11 * g33)
        return Stress(plane, lambda: cold.across() * area, lambda: cold.stretch() * g33, cold.mean)

    def put(self, order: int, gradient: FloatArray | None, degrees: FloatArray | None = None) -> None:
        """Set ``order`` of displacement gradient (4, j, n) and temperature (j, n), zero if None; compute
        P."""
        self.gradient[:, order] = 0.0 if gradient is None else gradient
        if not order:
            self.gradient[[0, 3], 0, 0] += 1.0
        for component, values in zip(self._f, self.gradient[:, order], strict=True):
            component.values[order] = values
        if self._degrees is not None:
            self._degrees.values[order] = 0.0 if degrees is None else degrees
        self._tape.advance(order)
        for place, component in enumerate(self._found.plane):
            self.stress[place, order] = component.values[order]

    def units(self) -> Iterator[int]:
        """Set the first order to a unit change of every component of the gradient, in turn."""
        for component in range(4):
            unit = np.zeros((4, *self.gradient.shape[2:]))
            unit[component, 0] = 1.0
            self.put(1, unit)
            yield component

    @property
    def mean(self) -> FloatArray | None:
        """Mean stress (K + 1, j, n) of volume changes that ``stress`` leaves out; None if there is none."""
        return None if self._mean is None else self._mean.values

    def _value(self, term: Term) -> FloatArray:
        """Value (n,) of a term recorded after the state."""
        series = self._tape.as_series(term)
        self._tape.advance(0)
        return np.asarray(series.values[0, 0])

    @cached_property
    def stretch_across(self) -> FloatArray:
        """Stretch (n,) across the plane."""
        return self._value(self._found.stretch())

    @property
    def volume(self) -> FloatArray:
        """Volume ratio det F (n,)."""
        xx, xy, yx, yy = self.gradient[:, 0, 0]
        return np.asarray((xx * yy - xy * yx) * self.stretch_across)

    @property
    def cauchy(self) -> FloatArray:
        """Cauchy stresses xx, yy, zz, xy (4, n)."""
        (f11, f12, f21, f22), (p11, p12, p21, p22) = self.gradient[:, 0, 0], self.stress[:, 0, 0]
        across = self._value(self._found.across()) * self.stretch_across
        whole = np.stack([p11 * f11 + p12 * f12, p21 * f21 + p22 * f22, across, p11 * f21 + p12 * f22])
        return np.asarray(whole / self.volume)


def gradient_of(derivatives: FloatArray) -> FloatArray:
    """Displacement gradient (4, n) from ``derivatives`` (n, 3 or more, 2): value, d/dX, d/dY, ..."""
    return np.asarray(derivatives[:, 1:3].transpose(2, 1, 0).reshape(4, -1))


def determinant(gradient: FloatArray) -> FloatArray:
    """det F - 1 (n,) in the plane for a displacement ``gradient`` (4, n), accurate for small ones."""
    xx, xy, yx, yy = gradient
    return np.asarray(xx + yy + xx * yy - xy * yx)


def stretches(gradient: FloatArray) -> FloatArray:
    """In-plane principal stretches (2, n), the larger first, of a displacement ``gradient`` (4, n)."""
    xx, xy, yx, yy = gradient
    green_xx, green_yy = xx + 0.5 * (xx**2 + yx**2), yy + 0.5 * (xy**2 + yy**2)
    mean = 1.0 + green_xx + green_yy
    half = np.hypot(green_xx - green_yy, xy + yx + xx * xy + yx * yy)
    return np.asarray(np.sqrt(np.stack([mean + half, np.maximum(mean - half, 0.0)])))
