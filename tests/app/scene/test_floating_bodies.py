"""Bodies that only contacts hold, moving obstacles, fits: what starts, what is held, what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import Delaunay

from mlsanm_cli.case import parse_case
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import Quiet, done, refused, solve
from tests.case_text import EXACT, FLOOR, Scene, body, contact, disk, head, plane, polygon, scene

PRECISION: dict[str, Any] = {"regularization": EXACT, "accuracy": 0.03}
DISK = (
    scene("strain", E=1.0)
    .body("disk", "steel", 0.25, disk=([0.0, 0.0], 1.0))
    .pushed("press", "top", fy=-0.0022)
    .contact("bottom", "disk.arc", plane=([0.0, -1.0], [0.0, 3.0]), **PRECISION)
    .contact("top", "disk.arc", plane=([0.0, 1.0], [0.0, -1.0]), **PRECISION)
)
SIDEWAYS = DISK.changed("fy = -0.0022", "force = [1e-4, -0.0022]")
LAW = ['contact.floor.regularization.law="hyperbolic"']
FIT = ["contact.floor.interference=0.01"]
LEVEL = "contact.floor.obstacle.point=[0.0, {}]"
ROUGH = [f"contact.{name}.friction=0.3" for name in ("bottom", "top")]
APART = ["contact.top.obstacle.point=[0.0, 1.05]", "contact.bottom.obstacle.point=[0.0, -1.02]"]

BLOCK = (
    scene("strain", E=1.0)
    .body("block", "steel", 0.25, box=([0.0, 1.0], [0.0, 1.0]))
    .load("push", "block.top", "traction", traction=[0.0, -0.001])
    .contact("floor", "block.bottom", obstacle=FLOOR, regularization=EXACT)
)


@pytest.mark.parametrize("settings", [[], ROUGH])
def test_a_gap_closes_before_the_force_grows(tmp_path: Path, settings: list[str]) -> None:
    """The disk between plates may neither turn nor drift, but for friction."""
    console = Quiet()
    done(DISK, tmp_path / "touching", *settings, console=console)
    held = [note.partition(" (")[0] for note in console.notes if "fixed at 0" in note]
    assert held == (
        [] if settings == ROUGH else [f"body disk: {way} is fixed at 0" for way in ("rotation", "ux")]
    )
    done(DISK, tmp_path / "apart", *settings, *APART)
    touching, apart = (read_run(tmp_path / name) for name in ("touching", "apart"))
    pressed = touching.contacts["top"].pressure[-1]
    assert apart.contacts["top"].pressure[-1] == pytest.approx(pressed, abs=2e-5 * pressed.max())


@pytest.mark.parametrize("settings", [[], ROUGH])
def test_a_disk_floats_where_it_is_drawn_until_a_plate_finds_it(tmp_path: Path, settings: list[str]) -> None:
    near, apart = (DISK.changed("fy = -0.0022", f"uy = {way}") for way in (-0.005, -0.075))
    done(near, tmp_path / "near", *settings)
    done(apart, tmp_path / "apart", *settings, *APART, "output.at=[0.3, 1.0]")
    close, far = read_run(tmp_path / "near"), read_run(tmp_path / "apart")
    assert np.abs(far.states[0].bodies["disk"]["displacement"]).max() == 0.0
    for name in ("top", "bottom"):
        peaks = [run.contacts[name].pressure[-1].max() for run in (close, far)]
        assert peaks[1] == pytest.approx(peaks[0], rel=1e-3)


def test_an_idle_roller_beside_a_pressed_one_stays(tmp_path: Path) -> None:
    idle = body("idle", "steel", 0.25, disk([3.0, 0.0], 0.9))
    beside = (
        contact(f"idle-{n}", "idle.arc", obstacle=plane([0.0, y], [0.0, -y]))
        for n, y in (("low", -1.0), ("high", 1.0))
    )
    console = Quiet()
    rough = [*ROUGH, "contact.idle-low.friction=0.2", "contact.idle-high.friction=0.2"]
    summary = done(DISK + idle + "".join(beside), tmp_path / "run", *rough, console=console)
    assert any("no contact loads body idle" in note for note in console.notes)
    assert summary["error_estimate"]["displacement"] is not None
    assert np.abs(read_run(tmp_path / "run").states[-1].bodies["idle"]["displacement"]).max() == 0.0


def test_a_rolling_disk_turns_with_the_plate(tmp_path: Path) -> None:
    rolling = DISK.pushed("roll", "top", ux=1e-3).stages("press", "roll")
    done(rolling, tmp_path / "roll", *ROUGH, "output.at=[1.0, 2.0]")
    data = read_run(tmp_path / "roll")
    inner = np.hypot(*data.bodies["disk"].points.T) < 0.5
    before, after = (state.bodies["disk"]["displacement"][inner] for state in data.states)
    assert (after - before).mean(axis=0)[0] == pytest.approx(0.5e-3, rel=0.02)
    assert data.path.displacements["roll"][-1, 0] == 1e-3
    assert np.abs(data.path.resultants["roll"][-1, 0]) <= 0.01 * 0.0022


@pytest.mark.parametrize(
    ("text", "settings", "key", "words"),
    [
        (SIDEWAYS, [], "load.press", "on the obstacle of contact top in ux"),
        (BLOCK, ["load.push.traction=[1e-4, -1e-3]"], "load.push", "on body block in ux"),
        (BLOCK, LAW, "contact.floor.regularization.law", "need the exact law"),
        (BLOCK, [*FIT, LEVEL.format(-0.1)], "contact.floor.interference", "press fit"),
        (BLOCK, [*FIT, LEVEL.format(0.1)], "contact.floor.interference", "more than the interference"),
        (BLOCK, [LEVEL.format(0.3)], "contact.floor", "declare it with interference"),
        (BLOCK, ["contact.floor.obstacle.normal=[0.0, -1.0]"], "contact.floor", "faces the obstacle"),
    ],
)
def test_what_nothing_resists_is_refused(
    tmp_path: Path, text: str, settings: list[str], key: str, words: str
) -> None:
    found = refused(text, tmp_path / "run", key, words, *settings)
    assert found.line or found.source == "--set" or key.startswith(("mls", "solver"))


def test_friction_resists_what_normals_do_not(tmp_path: Path) -> None:
    settings = ["load.push.traction=[1e-4, -1e-3]", "contact.floor.friction=0.5"]
    summary = done(BLOCK, tmp_path / "run", *settings)
    assert summary["contacts"]["floor"]["force"] == pytest.approx([-1e-4, 1e-3], abs=1e-12)


ACCURATE = {**PRECISION, "accuracy": 6e-3}
BETWEEN = (
    scene("stress", "soft", E=1083.0, nu=0.34)
    .material("hard", E=95464.0, nu=0.4)
    .body("base", "hard", box=([-3.6, 3.6], [-4.4, 0.0]), clamped="bottom")
    .body("disk", "soft", disk=([0.0, 2.2], 2.2))
    .contact("floor", "disk.arc", "base.top", friction=0.3, **ACCURATE)
    .contact("lid", "disk.arc", plane=([0.0, 4.4], [0.0, -1.0]), **ACCURATE)
    .pushed("press", "lid", fy=-15.5)
    .item("stop", what="force", of="lid", above=0.02)
)


def test_the_first_nodes_to_touch_hold_a_disk(tmp_path: Path) -> None:
    """One node on either side, exactly above each other, does not tell which way the disk would roll."""
    summary = done(BETWEEN, tmp_path / "run")
    assert summary["contacts"]["floor"]["force"][1] == pytest.approx(0.02, rel=1e-6)


SHOE = polygon([[-1.5, 0.0], [1.5, 0.0], [1.5, 2.4], [-1.5, 2.4]], "sole right head left")
SHOE |= {"corners": ["sole", "sole", "", ""], "rounding": [0.3, 0.3, 0.3, 0.3]}


def foot(spacing: float | None, material: dict[str, Any], obstacle: dict[str, Any]) -> Scene:
    """A foot with rounded edges that is pressed on an obstacle."""
    return (
        head("strain")
        .material("soft", **material)
        .body("foot", "soft", spacing, SHOE)
        .load("press", "foot.head", "traction", traction=[0.0, -11.0])
        .contact("hollow", "foot.sole", accuracy=0.02, obstacle=obstacle)
    )


def test_a_foot_drawn_into_a_hollow_floats_out_of_it(tmp_path: Path) -> None:
    """Its rounded edges overlap the hollow as drawn, and nothing but the contact holds it up."""
    hollow = {**disk([0.0, 28.0], 28.0), "inside": True}
    summary = done(foot(None, {"E": 1221.0, "nu": 0.4}, hollow), tmp_path / "run")
    assert summary["contacts"]["hollow"]["force"] == pytest.approx([0.0, 26.4], abs=1e-6)


def test_an_eccentric_push_moves_the_pressure_below_it(tmp_path: Path) -> None:
    wide = BLOCK.load("edge", "block.left", "traction", traction=[0.0, -2e-4])
    summary = done(wide, tmp_path / "wide")
    contact = read_run(tmp_path / "wide").contacts["floor"]
    x, pressure = (
        values[np.argsort(contact.points[:, 0])] for values in (contact.points[:, 0], contact.pressure[-1])
    )
    # Simpson's rule, exact for pressures that are linear between the nodes.
    ends, middle = x * pressure, 0.25 * (x[1:] + x[:-1]) * (pressure[1:] + pressure[:-1])
    moment = np.diff(x) @ (ends[1:] + 4.0 * middle + ends[:-1]) / 6.0
    assert moment == pytest.approx(1e-3 * 0.5, rel=1e-6)
    assert summary["contacts"]["floor"]["force"] == pytest.approx([0.0, 1.2e-3], abs=1e-12)


def test_an_interference_moves_with_the_stages_that_name_it(tmp_path: Path) -> None:
    fitted = (
        scene("strain", E=1.0)
        .body("block", "steel", 0.25, box=([0.0, 1.0], [0.0, 1.0]))
        .contact("floor", "block.bottom", obstacle=FLOOR, regularization=EXACT, interference=0.01)
        .support("block.top", uy=0.0)
    )
    staged = fitted.stages("floor=0.5", "floor")
    stress = 0.01 / (1.0 - 0.3**2)
    for text, stages in ((fitted, [0.0, 1.0]), (staged, [0.0, 0.5, 1.0])):
        directory = tmp_path / str(len(stages))
        done(text, directory)
        data = read_run(directory)
        expected = np.asarray(data.path.factors["floor"])
        assert expected == pytest.approx(np.interp(data.path.position, range(len(stages)), stages))
        found = data.contacts["floor"].pressure
        assert np.abs(found - np.outer(expected, np.full(found.shape[1], stress))).max() <= 1e-7 * stress
    assert parse_case(fitted, Path("case.toml")).case.stage == ({"floor": 1.0},)


def test_a_disk_as_far_from_its_hole_all_around_is_pushed_to_its_wall(tmp_path: Path) -> None:
    # No place of the gap is nearer than others, and closing all of it takes tension.
    text = (
        scene("strain", E=1.0)
        .body("disk", "steel", 0.25, disk=([0.0, 0.0], 1.0))
        .body_force("push", "disk", [-2e-3, -1e-3])
        .contact("hole", "disk.arc", obstacle={**disk([0.0, 0.0], 1.01), "inside": True}, **PRECISION)
    )
    summary = done(text, tmp_path / "run")
    assert summary["contacts"]["hole"]["force"] == pytest.approx([2e-3 * np.pi, 1e-3 * np.pi], rel=1e-4)


def test_surfaces_that_overlap_as_drawn_are_told(tmp_path: Path) -> None:
    """Nothing is said where an overlap is given as one."""
    held = BLOCK.changed('kind = "traction"\ntraction = [0.0, -0.001]', 'kind = "platen"\nuy = -0.001')
    drawn = solve(held, tmp_path / "drawn", LEVEL.format(0.01))
    (warning,) = [text for text in drawn["warnings"] if "overlap as drawn" in text]
    assert "by 0.01 near" in warning
    assert "contact.floor.interference" in warning
    fitted = solve(held, tmp_path / "fitted", LEVEL.format(0.01), *FIT)
    assert not [text for text in fitted["warnings"] if "overlap" in text]
    assert fitted["contacts"]["floor"]["force"] == pytest.approx(drawn["contacts"]["floor"]["force"])


def test_a_body_that_may_slide_does_not_in_the_mean(tmp_path: Path) -> None:
    # Its grain, aslant, lets fields in closed form slide by 1.2e-3.
    grain = {"E1": 1221.0, "E2": 120.0, "E3": 120.0, "G12": 150.0, "angle": 30.0}
    grain |= dict.fromkeys(("nu12", "nu13", "nu23"), 0.3)
    done(foot(0.15, grain, FLOOR), tmp_path / "run")
    run = read_run(tmp_path / "run")
    points, moved = run.bodies["foot"].points, run.states[-1].bodies["foot"]["displacement"]
    triangles = Delaunay(points).simplices
    (ax, ay), (bx, by) = (np.subtract(points[triangles[:, k]], points[triangles[:, 0]]).T for k in (1, 2))
    areas = np.bincount(triangles.ravel(), np.repeat(np.abs(ax * by - ay * bx), 3))
    assert abs(areas @ moved[:, 0] / areas.sum()) <= 1e-4


def test_a_free_body_on_a_flat_that_shrinks_and_grows_carries_nothing(tmp_path: Path) -> None:
    """Heated again to its first size, all of its face just touches."""
    text = scene("strain", alpha=1e-5).body("free", "steel", 0.5, box=([-1.0, 1.0], [0.0, 1.0]))
    text = text.body("fixed", "steel", 0.5, box=([-2.0, 2.0], [-2.0, 0.0]), clamped="bottom")
    text = text.contact("c", "free.bottom", "fixed.top")
    text = text.heat("cool", "free", -100.0).stages("cool", "cool=0.0", "cool=-1.0", "cool=0.0")
    assert solve(text, tmp_path / "run")["contacts"]["c"]["peak_pressure"] == pytest.approx(0.0, abs=1e-6)
