"""Slits, thin parts, nodes too close, notches: what a stencil must not do, and what is refused."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Arc, Curve, Outline, Segment, rectangle, sector
from mlsanm_cli.cloud.spacing import Spacing, Zone, build_cloud
from mlsanm_cli.errors import NumericalError
from tests.mechanics.bodies import STEEL, boundary_values, build, polygon, solved, with_body_force

OPEN = sector((0.0, 0.0), (0.5, 1.5), (0.0, math.radians(359.5)))


class Winding:
    """u = (t, t^2/2), t the angle from 0 to 2 pi: it jumps across the positive x axis."""

    def polar(self, at: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Angle (n,), its gradient (n, 2) and second derivatives xx, yy, xy (n, 3)."""
        x, y = at.T
        r2 = x**2 + y**2
        angle = np.mod(np.arctan2(y, x) + 1e-9, 2.0 * np.pi)
        second = np.stack([2.0 * x * y, -2.0 * x * y, y**2 - x**2], axis=1) / (r2**2)[:, None]
        return angle, np.stack([-y, x], axis=1) / r2[:, None], second

    def displacement(self, at: FloatArray) -> FloatArray:
        angle = self.polar(at)[0]
        return np.stack([angle, 0.5 * angle**2], axis=1)

    def stress(self, at: FloatArray) -> FloatArray:
        t, (tx, ty) = self.polar(at)[0], self.polar(at)[1].T
        return np.stack([tx, t * ty, ty + t * tx], axis=1) @ STEEL.stiffness

    def force(self, at: FloatArray) -> FloatArray:
        t, (tx, ty), (xx, yy, xy) = self.polar(at)[0], self.polar(at)[1].T, self.polar(at)[2].T
        c = STEEL.stiffness
        by_x = np.stack([xx, tx * ty + t * xy, xy + tx * tx + t * xx], axis=1) @ c
        by_y = np.stack([xy, ty * ty + t * yy, yy + ty * tx + t * xy], axis=1) @ c
        return -np.stack([by_x[:, 0] + by_y[:, 2], by_x[:, 2] + by_y[:, 1]], axis=1)


@pytest.mark.parametrize(("degree", "bar"), [(2, 0.03), (4, 3e-4), (6, 3e-4)])
def test_a_solution_may_jump_across_a_slit(degree: int, bar: float) -> None:
    exact, body = Winding(), build(build_cloud(OPEN, Spacing(0.06), 0), {"outer": (True, True)}, degree)
    source = boundary_values(body, exact.displacement, exact.stress)
    u = solved(body, with_body_force(body, source, exact.force))
    expected = exact.displacement(body.model.cloud.points)
    assert np.abs(u - expected).max() <= bar * np.abs(expected).max()
    # Values between the nodes of the two faces, half a degree apart: each has its own.
    for name in ("start", "end"):
        curve = body.model.cloud.surfaces[name].curve
        at = curve.points(np.linspace(0.1, 0.9, 29) * curve.length)
        axes = [np.tile(axis, (len(at), 1)) for axis in np.eye(2)]
        value = np.stack([body.model.values_along(at, axis) @ u.ravel() for axis in axes], axis=1)
        assert np.abs(value - exact.displacement(at)).max() <= 3.0 * bar * 20.0


def bar(across: float) -> Cloud:
    """A bar of length 12 with spacing 1."""
    return build_cloud(rectangle((0.0, 12.0), (0.0, across)), Spacing(1.0), 0)


def bent(at: FloatArray) -> FloatArray:
    """Displacements (n, 2) under a pure moment, of degree 2."""
    x, y = at.T
    c = STEEL.stiffness
    return np.stack([0.01 * x * y, -0.005 * (x**2 + c[0, 1] / c[1, 1] * y**2)], axis=1)


def bending_stress(at: FloatArray) -> FloatArray:
    """Its stresses (n, 3)."""
    c = STEEL.stiffness
    return np.outer(0.01 * at[:, 1], [c[0, 0] - c[0, 1] ** 2 / c[1, 1], 0.0, 0.0])


@pytest.mark.parametrize(
    ("degree", "refused", "enough"),
    [(2, (0.1, 1.0, 1.5), (2.0, 3.0)), (4, (1.0, 2.5, 3.0), (4.0,)), (6, (3.0, 4.0), (6.0,))],
)
def test_thin_parts_are_carried_or_refused(
    degree: int, refused: tuple[float, ...], enough: tuple[float, ...]
) -> None:
    for across in refused:
        with pytest.raises(NumericalError, match=r"nodes around \(.*\) do not determine polynomials"):
            build(bar(across), {}, degree, held_nodes=((0, 0), (0, 1), (1, 1)))
    for across in enough:
        # The stencils carry their whole polynomial space there: bending by moments is solved exactly.
        body = build(bar(across), {"left": (True, True)}, degree)
        u = solved(body, boundary_values(body, bent, bending_stress))
        assert np.abs(u - bent(body.model.cloud.points)).max() <= 1e-8


def wedge(angle: float) -> Outline:
    """A triangle with a sharp tip at the origin."""
    y = 2.0 * math.tan(angle)
    return polygon([(0.0, 0.0), (2.0, -y), (2.0, y)], ("low", "back", "up"))


def test_nodes_too_close_are_refused_with_their_place() -> None:
    points = [(0.0, 0.0), (2.0, 0.0), (2.0, 0.999), (1.999, 1.0), (0.0, 1.0)]
    cloud = build_cloud(polygon(points, tuple("abcde")), Spacing(0.1), 0)
    with pytest.raises(NumericalError, match=r"body body: two nodes near \(.*, .*\) are only 0\.0"):
        build(cloud, {"a": (True, True)})
    sound = build_cloud(wedge(0.4), Spacing(0.1), 0)
    assert build(sound, {"back": (True, True)}).model.stencils.worst_ratio > 0.0


def test_tips_are_told_from_nodes_too_close() -> None:
    # Nodes of both faces are 0.35 spacings apart next to a tip of 20 degrees, with every seed; no spacing
    # helps the narrower one.
    sound = build_cloud(wedge(math.radians(10.0)), Spacing(0.1), 0)
    assert build(sound, {"back": (True, True)}).model.cloud.separation[0].min() > 0.6
    needle = build_cloud(wedge(math.radians(4.0)), Spacing(0.02), 0)
    with pytest.raises(NumericalError, match=r"corner of 8 degrees at \(0, 0\) is too acute") as error:
        build(needle, {"back": (True, True)})
    assert "round it" in (error.value.hint or "")


def notched() -> Outline:
    """A plate 10 wide with a notch 3 deep and 2 wide, its corners rounded to a tenth."""
    p = [(0.0, -8.0), (10.0, -8.0), (10.0, 8.0), (0.0, 8.0), (0.0, 1.0)]
    upper = Arc((2.9, 0.9), 0.1, 0.5 * math.pi, -0.5 * math.pi)
    lower = Arc((2.9, -0.9), 0.1, 0.0, -0.5 * math.pi)
    curves: list[Curve] = [Segment(a, b) for a, b in pairwise(p)]
    curves += [Segment((0.0, 1.0), (2.9, 1.0)), upper, Segment((3.0, 0.9), (3.0, -0.9)), lower]
    curves += [Segment((2.9, -1.0), (0.0, -1.0)), Segment((0.0, -1.0), p[0])]
    names = ("bottom", "right", "top", "left", "upper", "round", "end", "round2", "lower", "left2")
    return Outline(names, tuple(curves))


def test_a_notched_plate_opens() -> None:
    outline = notched()
    openings = []
    for fine, degree in ((0.02, 4), (0.01, 4), (0.01, 2)):
        zones = tuple(Zone(outline.curves[k], fine, 0.0, 0.12) for k in (5, 7))
        cloud = build_cloud(outline, Spacing(0.5, zones), 0)
        first = int(cloud.surfaces["bottom"].index[0])
        body = build(cloud, {"bottom": (False, True)}, degree, held_nodes=((first, 0),))
        pull = np.tile([0.0, 1.0], (len(cloud.surfaces["top"].index), 1))
        u = solved(body, body.source("top", pull, held=False))
        upper, lower = cloud.surfaces["upper"].index[0], cloud.surfaces["lower"].index[-1]
        openings.append(float(u[upper, 1] - u[lower, 1]))
    # 33.72 is what degree 4 comes to on finer clouds.
    assert 210.0 * openings[1] == pytest.approx(33.72, rel=0.003)
    assert 210.0 * openings[0] == pytest.approx(33.72, rel=0.01)
    assert 210.0 * openings[2] == pytest.approx(33.72, rel=0.01)
