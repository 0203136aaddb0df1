"""Pairs: gaps on known curves, and their order."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Outline, annulus, disk, half_disk, rectangle
from mlsanm_cli.cloud.spacing import Spacing, Zone, build_cloud
from mlsanm_cli.contact.geometry.pairing import MAX_FACING_COSINE, Pairing, pair_surfaces, spacing_ratio
from tests.cloud.shapes import polygon

BLOCK = rectangle((-2.0, 2.0), (-1.0, 0.0))


def pair(
    upper: Outline, slave: str, lower: Outline, master: str, spacings: tuple[Spacing, Spacing]
) -> tuple[Pairing, Cloud, Cloud]:
    """Two clouds and the pairing of a surface on each."""
    one, other = build_cloud(upper, spacings[0], 0), build_cloud(lower, spacings[1], 0)
    pairing = pair_surfaces("contact", "upper", one, one.surfaces[slave], ("lower", other.surfaces[master]))
    return pairing, one, other


def even(upper: float, lower: float) -> tuple[Spacing, Spacing]:
    """The same spacing everywhere in each body."""
    return Spacing(upper), Spacing(lower)


@given(lift=st.floats(-0.01, 0.3), x=st.floats(-0.5, 0.5))
@settings(max_examples=15)
def test_gaps_between_an_arc_and_a_flat_are_exact(lift: float, x: float) -> None:
    arc = half_disk((x, 1.0 + lift), 1.0, "lower")
    pairing, upper, _ = pair(arc, "arc", BLOCK, "top", even(0.1, 0.2))
    points = upper.points[pairing.node]
    assert np.abs(pairing.gap - points[:, 1]).max() <= 1e-15
    assert np.abs(pairing.partner - points * np.array([1.0, 0.0])).max() <= 1e-15
    assert np.array_equal(pairing.normal, np.tile([0.0, 1.0], (len(points), 1)))
    # Those nodes and no others face the block: their normal points down enough.
    facing = upper.surfaces["arc"].normal[:, 1] < MAX_FACING_COSINE
    assert np.array_equal(pairing.position, np.flatnonzero(facing))


@given(angle=st.floats(0.3, 2.8), lift=st.floats(0.0, 0.2))
@settings(max_examples=15)
def test_gaps_between_two_arcs_are_exact(angle: float, lift: float) -> None:
    away = (1.5 + lift) * np.array([math.cos(angle), math.sin(angle)])
    upper = disk((float(away[0]), float(away[1])), 1.0)
    pairing, one, _ = pair(upper, "arc", disk((0.0, 0.0), 0.5), "arc", even(0.1, 0.05))
    points = one.points[pairing.node]
    distance = np.hypot(*points.T)
    assert np.abs(pairing.gap - (distance - 0.5)).max() <= 1e-14
    assert np.abs(pairing.normal - points / distance[:, None]).max() <= 1e-14
    assert np.abs(pairing.partner - 0.5 * pairing.normal).max() <= 1e-14
    assert pairing.gap.min() == pytest.approx(lift, abs=0.01)
    assert len(points) > 10


def test_nodes_beyond_the_masters_ends_have_no_partner() -> None:
    wide = rectangle((-3.0, 1.0), (0.0, 1.0))
    pairing, upper, _ = pair(wide, "bottom", BLOCK, "top", even(0.3, 0.2))
    x = upper.points[pairing.node, 0]
    below = upper.points[upper.surfaces["bottom"].index, 0] >= -2.0 - 1e-9
    assert len(x) == below.sum()
    assert x.min() >= -2.0 - 1e-9


def test_reach_chooses_the_candidates() -> None:
    fine = Spacing(0.1, (Zone.around((0.0, 0.0), 0.01, 0.05, 0.3),))
    pairing, _, _ = pair(half_disk((0.0, 1.0), 1.0, "lower"), "arc", BLOCK, "top", (fine, fine))
    assert pairing.candidate.all()
    assert 3 < (pairing.gap <= 0.003).sum() < len(pairing.gap)
    # To begin with, the zone of fine nodes: out to 0.05 plus where the spacing has grown by half.
    first = pairing.first_reach()
    assert first == pytest.approx(1.0 - math.sqrt(1.0 - 0.067**2), rel=0.3)


@pytest.mark.parametrize(("upper", "lower"), [(0.1, 0.25), (0.25, 0.1)])
def test_spacing_ratio_of_facing_surfaces(upper: float, lower: float) -> None:
    block = rectangle((-1.0, 1.0), (0.0, 1.0))
    pairing, _, other = pair(block, "bottom", BLOCK, "top", even(upper, lower))
    assert spacing_ratio(pairing, {"lower": other}) == pytest.approx(2.5)
    nobody = replace(pairing, candidate=np.zeros(len(pairing.gap), dtype=bool))
    assert spacing_ratio(nobody, {"lower": other}) == 1.0


@pytest.mark.parametrize("angle", [0.0, 0.5, 1.0, 1.5])
def test_where_a_circle_begins_makes_no_difference(angle: float) -> None:
    # The disk's arc begins at its top; the block lies below, next to or, turned by pi, on that very place.
    away = np.array([math.sin(angle * math.pi), -math.cos(angle * math.pi)])
    along = np.array([-away[1], away[0]])
    low, high = (away + side * along for side in (-0.5, 0.5))
    corners = (high, low, low + away, high + away)
    block = polygon(*((float(x), float(y)) for x, y in corners))
    zone = (Zone.around((float(away[0]), float(away[1])), 0.02, 0.1, 0.2),)
    spacings = Spacing(0.1, zone), Spacing(0.025)
    whole, _, flat = pair(disk((0.0, 0.0), 1.0), "arc", block, "side0", spacings)
    pairing = replace(whole, candidate=whole.gap <= 0.01)
    assert (np.diff(pairing.arc) > 0.0).all()
    assert (np.diff(pairing.arc) < 0.2).all()
    # Candidates reach 0.12 to both sides.
    place = pairing.points[pairing.candidate] @ along
    assert place.min() <= -0.0999
    assert place.max() >= 0.0999
    assert spacing_ratio(pairing, {"lower": flat}) <= 1.3


def pin_in_hole(shift: float) -> tuple[Pairing, Cloud, Cloud]:
    """A pin of radius 1 in a hole of radius 1.1, nearest to it ``shift`` radians from the top."""
    place = 0.05 * np.array([-math.sin(shift), math.cos(shift)])
    pin = disk((float(place[0]), float(place[1])), 1.0)
    return pair(pin, "arc", annulus((0.0, 0.0), (1.1, 2.0)), "inner", even(0.1, 0.1))


@given(shift=st.floats(-3.0, 3.0))
@settings(max_examples=10)
def test_a_pin_in_a_hole_is_cut_open_where_its_gap_is_widest(shift: float) -> None:
    pairing, one, _ = pin_in_hole(shift)
    assert len(pairing.position) == len(pairing.slave.index)
    assert pairing.all_around
    assert not replace(pairing, candidate=pairing.gap <= 0.1).all_around
    assert pairing.gap[0] == pairing.gap.max()
    assert (np.diff(pairing.arc) > 0.0).all()
    points = one.points[pairing.node]
    assert np.abs(pairing.gap - (1.1 - np.hypot(*points.T))).max() <= 1e-14
