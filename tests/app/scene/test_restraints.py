"""Motions that nothing resists, of one body and of several, however they lie and in whatever units; supports
of single nodes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mlsanm_cli.errors import CaseError
from tests.app.runs import warned
from tests.app.scenes import done, prepared, solve
from tests.case_text import EXACT, FLOOR, Scene, body_force, contact, load, pin, polygon, probe, scene

SQUEEZED = (
    scene("strain", "rubber", E=50.0, nu=0.45)
    .body("base", "rubber", box=([-9.549841954259321, 9.549841954259321], [0.0, 2.657353613610373]))
    .body("disk", "rubber", disk=([0.0, 4.9096456071428705], 2.2522919935324976))
    .body("lid", "rubber", box=([-4.9, 4.9], [7.161937600675368, 11.299480446932417]))
    .support("base.bottom", ux=0.0, uy=0.0)
    .load("press", "lid.top", "platen", fy=-2.0, ux=0.0)
    .contact("lower", "base.top", "disk.arc")
    .contact("upper", "disk.arc", "lid.bottom")
)
FIT = (
    scene("strain")
    .body("ring", "steel", 0.4, annulus=([0.0, 0.0], [1.0, 2.0]))
    .body("shaft", "steel", 0.4, disk=([0.0, 0.0], 1.0))
    .contact("fit", "shaft.arc", "ring.inner", interference=0.001)
)
PINS = (
    scene("strain", "cast", E=110e3, nu=0.25)
    .body("plate", "cast", box=([-20.0, 20.0], [0.0, 8.0]))
    .load("push", "plate.top", "pressure", pressure=50.0)
    .contact("left", "plate.bottom", disk=([-14.0, -5.0], 5.0), regularization=EXACT, accuracy=0.01)
    .contact("right", "plate.bottom", disk=([16.0, -5.0], 5.0), regularization=EXACT, accuracy=0.01)
)


def weight(of: str, value: float) -> Scene:
    return body_force("weight", of, [0.0, value])


def seal(unit: float = 1.0, modulus: float = 8.0, turned: bool = False) -> Scene:
    """A seal squeezed into a groove that it fills only then; ``turned`` by 90 degrees."""

    def place(x: float, y: float) -> list[float]:
        return [-y * unit, x * unit] if turned else [x * unit, y * unit]

    walls = [(8.0, 4.5), (3.1, 4.5), (3.1, 0.0), (-3.1, 0.0), (-3.1, 4.5), (-8.0, 4.5)]
    law = {"regularization": EXACT, "accuracy": 0.03}
    groove = {"kind": "polyline", "points": [place(*one) for one in walls]}
    return (
        scene("strain", "rubber", E=modulus, nu=0.45)
        .body("seal", "rubber", disk=(place(0.0, 3.0), 3.0 * unit))
        .pushed("close", "lid", displacement=place(0.0, -0.6))
        .contact("groove", "seal.arc", obstacle=groove, **law)
        .contact("lid", "seal.arc", plane=(place(0.0, 6.0), place(0.0, -1.0)), **law)
    )


def test_round_off_drives_no_motion() -> None:
    notes = prepared(SQUEEZED).notes
    assert any(note.startswith("body disk: ux is fixed at 0 (no load") for note in notes)


def test_a_motion_of_two_bodies_names_both() -> None:
    notes = [note for note in prepared(FIT).notes if "fixed at 0" in note]
    assert [note.split(":")[0] for note in notes] == ["body ring", "body shaft", "body ring", "body ring"]
    assert all("moves together with body shaft" in note for note in notes[2:])
    with pytest.raises(CaseError) as caught:
        prepared(FIT + weight("shaft", -1.0))
    message = caught.value.problems[0].message
    assert "body ring in uy, which moves body shaft with it" in message
    assert "a force of -3.06" in message


BORE = (
    scene("stress")
    .body("inner", "steel", annulus=([3.0, 1.0], [10.0, 20.0]))
    .body("outer", "steel", annulus=([3.0, 1.0], [20.0, 30.0]))
    .load("oil", "inner.inner", "pressure", pressure=30.0)
    .contact("fit", "inner.outer", "outer.inner", interference=0.01)
)


def test_forces_that_all_point_at_the_centre_drive_no_rotation() -> None:
    """Their moment is round-off, and so are its parts; that of a slight shear is not."""
    assert any(note.startswith("body inner: rotation is fixed at 0") for note in prepared(BORE).notes)
    spin = body_force("spin", "outer", ["0.03*(x-3)", "0.03*(y-1)"])
    assert prepared(BORE + spin).notes
    drag = ["1e-3*(1-y)/30", "1e-3*(x-3)/30"]
    with pytest.raises(CaseError, match="nothing resists its force"):
        prepared(BORE.load("drag", "outer.outer", "traction", traction=drag))


def pendulum(way: tuple[float, float]) -> Scene:
    """A disk held at its top, towards which a plane pushes it."""
    up = np.array(way)
    top, below, moved = ((size * up).tolist() for size in (10.0, -10.0, 0.01))
    return (
        scene("strain")
        .body("disk", "steel", disk=([0.0, 0.0], 10.0))
        .pin("disk", top, ux=0.0, uy=0.0)
        .contact("floor", "disk.arc", plane=(below, list(way)))
        .pushed("press", "floor", displacement=moved)
    )


@pytest.mark.parametrize("way", [(0.0, 1.0), (-1.0, 0.0), (0.6, 0.8)])
def test_a_disk_held_at_its_top_may_turn_about_it(way: tuple[float, float]) -> None:
    # The node that is nearest to the top of a tilted scene is not quite there.
    found = prepared(pendulum(way))
    (warning,) = found.restrained.weak
    assert warning.startswith("body disk: rotation is hardly resisted")


@pytest.mark.parametrize("away", [(0.6, 0.8), (-0.8, 0.6)])
def test_a_plate_pressed_on_an_oblique_plane_does_not_slip(away: tuple[float, float], tmp_path: Path) -> None:
    turn = np.array([[away[1], -away[0]], away])
    corners = (np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]]) @ turn).tolist()
    text = (
        scene("stress", "cork", E=100.0, nu=0.0)
        .body("block", "cork", 0.4, polygon(corners, "foot right top left"))
        .contact("floor", "block.foot", plane=([0.0, 0.0], list(away)))
        .load("press", "block.top", "platen", force=[-4.0 * part for part in away])
        .probe("middle", "block", (np.array([2.0, 1.0]) @ turn).tolist())
    )
    summary = solve(text, tmp_path / "run")
    middle = 1.0 * (4.0 / 4.0) / 100.0
    assert summary["probes"]["middle"]["displacement"] == pytest.approx(-middle * np.array(away), rel=1e-6)
    assert summary["contacts"]["floor"]["force"] == pytest.approx(4.0 * np.array(away), rel=1e-6)
    assert summary["forces"]["press"] == pytest.approx(-4.0 * np.array(away), rel=1e-6)


def test_a_motion_hardly_resisted_is_told_and_carries_nothing(tmp_path: Path) -> None:
    summary = done(pendulum((0.6, 0.8)), tmp_path / "run")
    assert "weak_motion" in warned(summary)
    across, along = np.array([[0.6, 0.8], [0.8, -0.6]]) @ summary["contacts"]["floor"]["force"]
    assert abs(along) < 1e-9 * across


def test_what_is_held_carries_nothing(tmp_path: Path) -> None:
    # A bent plate is pressed on by both pins along normals of their own.
    summary = solve(PINS, tmp_path / "run")
    forces = np.array([one["force"] for one in summary["contacts"].values()])
    assert summary["status"] == "done"
    assert abs(forces[0, 0]) > 1e-3 * forces[0, 1]
    assert np.abs(forces.sum(axis=0) - [0.0, 2000.0]).max() <= 1e-6 * 2000.0


def test_a_hold_that_would_carry_much_is_told(tmp_path: Path) -> None:
    summary = solve(PINS, tmp_path / "run", "contact.right.obstacle.center=[16.0, -5.5]")
    forces = [one["force"][0] for one in summary["contacts"].values()]
    assert abs(sum(forces)) <= 1e-6 * 2000.0
    assert "held_motion" in warned(summary)


def test_a_seal_fills_its_groove_in_all_directions_and_units(tmp_path: Path) -> None:
    one = solve(seal(), tmp_path / "one")
    other = done(seal(turned=True, unit=1e3, modulus=8e-6), tmp_path / "other")
    for name, found in one["contacts"].items():
        peak = 1e-6 * found["peak_pressure"]
        assert other["contacts"][name]["peak_pressure"] == pytest.approx(peak, rel=1e-6)
    assert other["stability"] == pytest.approx(one["stability"], rel=1e-6)


ROLLING = SQUEEZED.changed('boundary = "base.bottom"\nux = 0.0\n', 'boundary = "base.bottom"\n')


@pytest.mark.parametrize("point", [[0.0, 0.0], [3.0, 1.0], [9.549841954259321, 2.0]])
def test_a_support_holds_the_point_that_it_names(point: list[float]) -> None:
    found = prepared(ROLLING.pin("base", point, ux=0.0))
    ((node, component),) = found.held_nodes["base"]
    assert component == 0
    assert np.hypot(*(found.models["base"].cloud.points[node] - point)) <= 1e-12
    assert not [note for note in found.notes if "fixes the node" in note]


def test_a_support_beside_all_nodes_tells_where_it_is() -> None:
    notes = prepared(ROLLING.pin("base", [0.0, 2.64], ux=0.0)).notes
    (told,) = (note for note in notes if "fixes the node" in note)
    assert told.startswith("the support of base near (0, 2.64) fixes the node at (")
    assert told.endswith("0.0174 away")


def test_a_support_far_from_its_body_is_refused() -> None:
    with pytest.raises(CaseError) as error:
        prepared(SQUEEZED.pin("base", [0.0, 40.0], ux=0.0))
    (problem,) = error.value.problems
    assert "lies outside body" in problem.message
    assert problem.key == f"support.{SQUEEZED.count('[[support]]')}.near"


BLOCK = scene("strain", "soft", E=1000.0).body("b", "soft", box=([-2.0, 2.0], [0.0, 1.0]))
ON_FLOOR = load("p", "b.top", "pressure", pressure="10 if 0 < x < 1 else 0") + contact(
    "c", "b.bottom", obstacle=FLOOR
)


@pytest.mark.parametrize(
    "place", [[1.0, 0.0], [0.3, 0.0], [-2.0, 1.0]], ids=["load", "contact", "free corner"]
)
def test_the_point_stays(place: list[float], tmp_path: Path) -> None:
    """Wherever the point is that is held sideways, others move alike relative to it."""
    probes = Scene().add(probe("pin", "b", place), probe("a", "b", [2.0, 0.5]), probe("b", "b", [-2.0, 0.5]))
    found = solve(BLOCK + pin("b", place, ux=0.0) + ON_FLOOR + probes, tmp_path / "run")
    moved = {name: one["displacement"][0] for name, one in found["probes"].items()}
    assert abs(moved["pin"]) <= 5e-6
    assert moved["a"] - moved["b"] == pytest.approx(3.996e-3, rel=5e-3)
    if place == [1.0, 0.0]:
        assert moved["b"] == pytest.approx(-4.106e-3, rel=2e-3)
        assert moved["a"] == pytest.approx(-1.10e-4, abs=5e-6)


def test_forces_of_single_nodes_follow_from_statics(tmp_path: Path) -> None:
    """A beam on two points: the one at a quarter of the span carries three quarters of the load."""
    supports = pin("b", [-2.0, 0.0], ux=0.0, uy=0.0) + pin("b", [2.0, 0.0], uy=0.0)
    loads = load("down", "b.top", "traction", traction=["1.0", "-4 if -2 < x < 0 else 0"])
    forces = solve(BLOCK + supports + loads, tmp_path / "run")["forces"]
    # Moments about the left point: 8 at 1 from it, and the shear of 4 at height 1.
    assert forces["b near (2, 0)"] == pytest.approx([0.0, (8.0 * 1.0 + 4.0 * 1.0) / 4.0], abs=1e-8)
    assert forces["b near (-2, 0)"] == pytest.approx([-4.0, 5.0], abs=1e-8)
