"""Two deformed sides that meet: gaps, directions, slips and what is transferred, against differences."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.curves import Segment
from mlsanm_cli.contact.finite.node_curve import NodeCurve
from mlsanm_cli.contact.finite.pair import BodyContact, Meeting, RigidContact
from mlsanm_cli.contact.finite.sides import ContactSide, SideNodes
from mlsanm_cli.contact.geometry.obstacles import Round

NO_PLANE = (None, None)


def side(body: str, arc: FloatArray, places: FloatArray, outward: FloatArray) -> ContactSide:
    steps = np.diff(arc)
    weight = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
    free = np.zeros(len(arc), dtype=bool)
    straight = Segment(tuple(places[0].tolist()), tuple(places[-1].tolist()))
    points = (
        body,
        places,
        outward,
        weight,
        arc,
        None,
        free,
        (0, len(arc) - 1),
        NO_PLANE,
        NO_PLANE,
        straight,
        (None,),
    )
    numbers = np.arange(len(arc))
    return ContactSide(*points, SideNodes(*points, numbers, (("side", numbers),)))


def test_a_curve_with_corners_is_exact_for_parabolas_between_them() -> None:
    """A kink stays where it is, on open curves and on closed ones."""
    arc = np.array([0.0, 0.3, 0.5, 1.0, 1.2, 1.5, 1.7, 2.0])
    values = np.where(arc < 1.0, arc**2, 3.0 - 2.0 * arc)
    at = np.linspace(0.0, 1.999, 41)
    before = at < 1.0
    expected = (
        np.where(before, at**2, 3.0 - 2.0 * at),
        np.where(before, 2.0 * at, -2.0),
        np.where(before, 2.0, 0.0),
    )
    for around in (None, 2.5):
        curve = NodeCurve(arc, around, (3,) if around is None else (0, 3, 7))
        for rows, derivative in zip(curve.rows(at), expected, strict=True):
            np.testing.assert_allclose(rows @ values, derivative, atol=1e-11)
        behind, ahead = (rows @ values for rows in curve.slopes)
        np.testing.assert_allclose([behind[3], ahead[3]], [2.0, -2.0], atol=1e-12)


def bent_pair() -> tuple[BodyContact, FloatArray]:
    """A slave above a master of other spacings, with a displacement of both."""
    rng = np.random.default_rng(0)
    x = np.array([0.3, 0.45, 0.7, 0.9, 1.2, 1.4])
    above = side(
        "s", x[::-1].max() - x[::-1], np.stack([x[::-1], 0.02 + 0 * x], 1), np.tile([0.0, -1.0], (6, 1))
    )
    z = np.linspace(0.0, 2.0, 14) + 0.02 * rng.normal(size=14)
    below = side("m", z[-1] - z[::-1], np.stack([z[::-1], 0 * z], 1), np.tile([0.0, 1.0], (14, 1)))
    u = np.concatenate([0.01 * rng.normal(size=(6, 2)), np.zeros((14, 2))])
    u[6:, 1] = 0.15 * np.sin(2.0 * below.places[:, 0])
    u[6:, 0] = 0.1 * below.places[:, 0] ** 2
    u[:6] += np.stack([0.1 * x[::-1] ** 2, 0.15 * np.sin(2.0 * x[::-1])], 1)
    return BodyContact("c", above, below, 0.3), u


def test_places_on_a_closed_curve_go_around() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    ring = NodeCurve(angle, 2.0 * np.pi)
    nodes = np.stack([np.cos(angle), np.sin(angle)], 1)
    turn = np.array([0.01, 3.0, 6.27])
    place, inside = ring.closest(nodes, 1.1 * np.stack([np.cos(turn), np.sin(turn)], 1), np.zeros(len(turn)))
    assert inside.all()
    np.testing.assert_allclose(place, turn, atol=1e-5)


@pytest.mark.parametrize("rigid", [False, True])
def test_all_moves_as_differences_say(rigid: bool) -> None:
    pair, u = bent_pair()
    contact: BodyContact | RigidContact = pair
    if rigid:
        u = u[:6]
        shape = Round((0.8, -1.0), 1.05, False)
        turned = np.array([0.7]), np.array(shape.center)
        contact = RigidContact("c", pair.slave, shape, np.zeros((2, 1)), 0.3, *turned)
    factors, rng = np.ones(1), np.random.default_rng(1)
    before = contact.meet(0.5 * u, factors, None).place
    p, q = rng.uniform(0.5, 1.0, 6), rng.normal(size=6)
    direction = rng.normal(size=u.shape)

    def seen(step: float) -> tuple[Meeting, FloatArray]:
        met = contact.meet(u + step * direction, factors, before)
        return met, met.tractions(p, q)

    step = 1e-6
    (one, ahead), (other, behind), (here, _) = seen(step), seen(-step), seen(0.0)
    assert here.facing.all()
    flat = direction.ravel()
    for name, rows in (("gap", here.d_gap), ("slip", here.d_slip)):
        found = (getattr(one, name) - getattr(other, name)) / (2 * step)
        np.testing.assert_allclose(rows @ flat, found, atol=1e-7)
    found = ((one.normal - other.normal) * here.tangent).sum(axis=1) / (2 * step)
    np.testing.assert_allclose(here.d_turn @ flat, found, atol=1e-7)
    np.testing.assert_allclose(here.turning(p, q) @ flat, (ahead - behind) / (2 * step), atol=1e-6)


def test_no_force_is_lost_and_a_constant_traction_arrives() -> None:
    pair, u = bent_pair()
    met = pair.meet(u, np.zeros(1), None)
    on_slave, on_master = np.split(met.tractions(np.arange(1.0, 7.0), np.ones(6)).reshape(-1, 2), [6])
    np.testing.assert_allclose(pair.slave.weight @ on_slave, -pair.master.weight @ on_master, atol=1e-13)
    flat = pair.meet(0.0 * u, np.zeros(1), None).tractions(np.ones(6), np.zeros(6)).reshape(-1, 2)[6:]
    x = pair.master.places[:, 0]
    inner = (x > 0.5) & (x < 1.2)
    np.testing.assert_allclose(flat[inner], np.tile([0.0, -1.0], (inner.sum(), 1)), atol=1e-12)


def test_a_parabola_of_pressures_arrives_without_smoothing() -> None:
    """Exactly between equal nodes; integrals over the lengths of the nodes lower it by 0.007."""
    x = np.linspace(0.0, 2.0, 15)
    above = side("s", x, np.stack([2.0 - x, 0 * x], 1), np.tile([0.0, -1.0], (15, 1)))
    below = side("m", x, np.stack([x, 0 * x], 1), np.tile([0.0, 1.0], (15, 1)))
    met = BodyContact("c", above, below).meet(np.zeros((30, 2)), np.zeros(1), None)
    arrived = met.tractions(1.0 - (x - 1.0) ** 2, np.zeros(15)).reshape(-1, 2)[15:, 1]
    np.testing.assert_allclose(arrived[2:-2], ((x - 1.0) ** 2 - 1.0)[2:-2], atol=1e-12)


def test_knots_load_nodes_with_their_force_and_moment() -> None:
    """Ten knots within an interval of two nodes, and coarse ones elsewhere; what nodes move by, cubic,
    arrives at the knots."""
    x = np.array([0.0, 0.2, 0.5, 0.7, 1.0, 1.3, 1.5, 1.6, 1.9, 2.2, 2.4, 2.7, 3.0])
    nodes = side("s", x, np.stack([x, 0 * x], 1), np.tile([0.0, 1.0], (len(x), 1))).nodes
    knots = ContactSide.on(nodes, np.concatenate([[0.0, 0.8], np.linspace(1.05, 1.25, 10), [2.0, 3.0]]))
    traction = np.random.default_rng(2).normal(size=2 * knots.count)
    nodal = (knots.spread @ traction).reshape(-1, 2)

    def sums(arc: FloatArray, values: FloatArray) -> FloatArray:
        """Integrals of piecewise linear values, and of them times the place."""
        fine = np.union1d(arc, np.linspace(0.0, 3.0, 20001))
        seen = np.stack([np.interp(fine, arc, one) for one in values.T], 1)
        return np.stack([np.trapezoid(seen, fine, axis=0), np.trapezoid(seen * fine[:, None], fine, axis=0)])

    expected = sums(knots.arc, traction.reshape(-1, 2))
    np.testing.assert_allclose(sums(nodes.arc, nodal), expected, rtol=1e-5, atol=1e-6)
    moved = np.stack([x**3 - x, 1.0 - x**2], 1).ravel()
    s = knots.arc
    found = (knots.onto @ moved).reshape(-1, 2)
    np.testing.assert_allclose(found, np.stack([s**3 - s, 1.0 - s**2], 1), atol=1e-9)
