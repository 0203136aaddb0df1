"""Scenes as users write them, each of which once was refused, took minutes, or was off without a warning."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import done, solve
from tests.case_text import FLOOR, Scene, disk, polygon, scene


def test_a_lever_that_turns_presses_along_the_normal_of_a_rigid_plane(tmp_path: Path) -> None:
    friction, force = 0.4, 60.0
    slope = float(np.arctan(8.0 / 13.0))
    radius = 3.0 / (1.0 / float(np.sin(slope)) - 1.0)  # so that the nose ends at y = 0
    low, nose = [[0.0, 10.0], [42.0, 10.0]], [50.0, -3.0]
    corners = [*low, nose, [58.0, 10.0], [120.0, 10.0], [120.0, 22.0], [0.0, 22.0]]
    rounded = {
        "rounding": [0.0, 2.0, radius, 2.0, 0.0, 0.0, 0.0],
        "corners": ["", "", "nose", "", "", "", ""],
    }
    shape = polygon(corners, "low down up beyond right top left", **rounded)
    summary = solve(
        scene("stress")
        .body("lever", "steel", shape=shape)
        .load("hinge", "lever.left", "platen", ux=0.0, uy=0.0, hinge=[0.0, 16.0])
        .load("press", "lever.top", "pressure", pressure=6.0, from_=[100.0, 22.0], to=[110.0, 22.0])
        .pushed("turn", "drum", ux=-0.1, uy=0.0)
        .contact("drum", "lever.nose", plane=([50.0, 0.0], [0.0, 1.0]), friction=friction)
        .stages("press hinge", "turn"),
        tmp_path / "run",
    )
    along, across = summary["contacts"]["drum"]["force"]
    assert -along == pytest.approx(friction * across, rel=1e-9)
    # Moments about the hinge, of the load at x = 105 and of the contact at x = 50, y = 0.
    assert across == pytest.approx(105.0 * force / (50.0 - 16.0 * friction), rel=1e-3)


def test_a_body_in_a_bowl_stays_where_it_is_whatever_the_axes(tmp_path: Path) -> None:
    def moved(angle: float) -> np.ndarray:
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])

        def at(x: float, y: float) -> list[float]:
            return [float(v) for v in np.array([x, y]) @ turn]

        corners = [at(-4.0, 0.0), at(4.0, 0.0), at(4.0, 4.0), at(-4.0, 4.0)]
        shape = polygon(corners, "foot right head left", rounding=[0.7] * 4)
        bowl = {"kind": "disk", "center": at(0.0, 60.0), "radius": 60.0, "inside": True}
        case = (
            scene("stress", "soft", E=100.0, nu=0.15)
            .body("pad", "soft", shape=shape)
            .load("press", "pad.head", "traction", traction=at(0.0, -1.0))
            .contact("bowl", "pad.foot", obstacle=bowl, accuracy=0.02)
            .probe("aside", "pad", at(0.0, 4.0))
        )
        summary = solve(case, tmp_path / f"turned by {angle}")
        return np.asarray(turn @ summary["probes"]["aside"]["displacement"])

    upright = moved(0.0)
    assert moved(0.5) == pytest.approx(upright, abs=0.01 * float(np.abs(upright).max()))


def test_a_wedge_that_locks_keeps_its_forces(tmp_path: Path) -> None:
    slope, friction, force = float(np.tan(np.radians(7.0))), 0.2, 600.0

    def high(x: float) -> float:
        return 8.0 - slope * x

    key = [[-30.0, 0.0], [30.0, 0.0], [30.0, high(30.0)], [-30.0, high(-30.0)]]
    hub = [[-15.0, high(-15.0)], [15.0, high(15.0)], [15.0, 35.0], [-15.0, 35.0]]
    case = (
        scene("strain")
        .body("key", "steel", shape=polygon(key, "low tip high back"))
        .body("hub", "steel", shape=polygon(hub, "face right top left"), clamped="top")
        .body("base", "steel", box=([-50.0, 50.0], [-30.0, 0.0]), clamped="bottom")
        .load("drive", "key.back", "pressure", pressure=force / high(-30.0))
        .contact("above", "hub.face", "key.high", friction=friction, accuracy=0.01)
        .contact("below", "key.low", "base.top", friction=friction, accuracy=0.01)
        .stages("drive", "drive=0")
    )
    directory = tmp_path / "run"
    summary = solve(case, directory)
    above, below = (np.array(summary["contacts"][name]["force"]) for name in ("above", "below"))
    assert above == pytest.approx(below, abs=1e-6 * force)
    data = read_run(directory)
    assert sum(len(one.points) for one in data.contacts.values()) < 600
    # Driven in, both faces slip: across they carry N' = N (cos a - mu sin a).
    sine, cosine = np.sin(np.arctan(slope)), np.cos(np.arctan(slope))
    normal = force / (friction * (cosine - friction * sine) + sine + friction * cosine)
    driven = data.contacts["below"]
    at = int(np.argmin(np.abs(data.path.position - 1.0)))
    across = float(driven.weight @ driven.pressure[at])
    assert across == pytest.approx(normal * (cosine - friction * sine), rel=3e-3)
    assert below[1] > 0.8 * across


def test_a_corner_inside_an_obstacle_is_told_by_the_side_that_faces_it(tmp_path: Path) -> None:
    summary = solve(
        scene("strain", "pad", E=200.0, nu=0.25)
        .material("steel", E=210e3, nu=0.3)
        .body("pad", "pad", 2.0, box=([0.0, 40.0], [0.0, 10.0]))
        .body("plate", "steel", 1.2, box=([0.0, 40.0], [10.0, 15.0]))
        .contact("rotor", "pad.bottom", obstacle=FLOOR, friction=0.4, accuracy=0.1)
        .contact("abutment", "plate.right", plane=([40.0, 0.0], [-1.0, 0.0]), accuracy=0.1)
        .contact("glue", "pad.top", "plate.bottom", friction="bonded")
        .load("press", "plate.top", "pressure", pressure=5.0)
        .pushed("run", "rotor", ux=1.0, uy=0.0)
        .stages("press", "run"),
        tmp_path / "run",
    )
    assert summary["status"] == "failed"
    assert '"pad.right"' in summary["hint"]


def lug(friction: float) -> Scene:
    """A lug pulled by a pin in its hole."""
    corners = [[0.0, 0.0], [60.1, 0.0], [75.0, 14.9], [75.0, 15.1], [60.1, 30.0], [0.0, 30.0]]
    shape = polygon(corners, "bottom n1 nose n2 top left", holes=[{"center": [60.0, 15.0], "radius": 6.0}])
    return (
        scene("stress", "alu", E=70e3, nu=0.33)
        .material("steel", E=210e3, nu=0.3)
        .body("lug", "alu", shape=shape, clamped="left")
        .body("pin", "steel", shape=disk([60.0, 15.0], 5.98))
        .body_force("pull", "pin", [4.4504, 0.0])
        .contact("fit", "pin.arc", "lug.hole1", friction=friction)
    )


@pytest.mark.parametrize(("friction", "stress"), [(0.25, 149.1), (0.6, 86.2)])
def test_the_peak_beside_a_contact(friction: float, stress: float, tmp_path: Path) -> None:
    """That of a mesh of 19,000 nodes at 0.25; at 0.6 the stress grows up to the end of the contact."""
    peak = done(lug(friction), tmp_path / "run")["peak_stress"]["lug"]
    assert peak["stress"] == pytest.approx(stress, rel=5e-3)
    assert ("at_contact" in peak) == (friction > 0.5)
    assert peak.get("at_contact", 150.0) > 1.5 * stress or friction < 0.5


def test_a_pin_in_the_hole_of_a_lug_that_friction_alone_keeps_from_turning(tmp_path: Path) -> None:
    summary = done(lug(0.15), tmp_path / "run")
    fit = summary["contacts"]["fit"]
    assert fit["force"] == pytest.approx([-4.4504 * np.pi * 5.98**2, 0.0], abs=1e-3)
    # Between the pressures without friction, 59.9, and those with twice as much, 50.5.
    assert 50.5 < fit["peak_pressure"] < 59.9
    assert summary["contact_unknowns"] < 1000
    assert not summary["warnings"]
