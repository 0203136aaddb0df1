"""Bodies that only contacts hold, moving obstacles, fits: what starts, what is held, what is refused."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from mlsanm_cli.app.scene.assemble import assemble_bodies, prepare
from mlsanm_cli.app.scene.clouds import clouds
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import parse_case
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import disk
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.laws.active_set import solve_exact
from mlsanm_cli.contact.response.condensed import condense
from mlsanm_cli.errors import CaseError
from mlsanm_cli.io.run_reader import read_run
from mlsanm_cli.operators.linear.cholesky import CholeskySolver
from mlsanm_cli.solve.load_factors import stage_factors
from tests.app.scenes import Quiet, solve

DISK = """
format = 1
[model]
plane = "strain"
[material.steel]
E = 1.0
nu = 0.3
[[body]]
name = "disk"
material = "steel"
spacing = 0.25
shape = { kind = "disk", center = [0.0, 0.0], radius = 1.0 }
refine = [
    { at = [0.0, 1.0], spacing = 0.012, radius = 0.06, growth = 0.2 },
    { at = [0.0, -1.0], spacing = 0.012, radius = 0.06, growth = 0.2 },
]
[[load]]
name = "press"
kind = "obstacle"
obstacle = "top"
fy = -0.0022
[[contact]]
name = "bottom"
slave = "disk.arc"
obstacle = { kind = "plane", point = [0.0, -1.0], normal = [0.0, 3.0] }
regularization = { law = "exact" }
[[contact]]
name = "top"
slave = "disk.arc"
obstacle = { kind = "plane", point = [0.0, 1.0], normal = [0.0, -1.0] }
regularization = { law = "exact" }
"""
SIDEWAYS = DISK.replace("fy = -0.0022", "force = [1e-4, -0.0022]")
MONOLITHIC = ['solver.formulation="monolithic"']
LAW = ['contact.floor.regularization.law="hyperbolic"']
FIT = ["contact.floor.interference=0.01"]
FLOOR = "contact.floor.obstacle.point=[0.0, {}]"
SMOOTH = [f'contact.{name}.regularization.law="hyperbolic"' for name in ("bottom", "top")]
ROUGH = [f"contact.{name}.friction=0.3" for name in ("bottom", "top")]
APART = ["contact.top.obstacle.point=[0.0, 1.05]", "contact.bottom.obstacle.point=[0.0, -1.02]"]

BLOCK = """
format = 1
[model]
plane = "strain"
[material.steel]
E = 1.0
nu = 0.3
[[body]]
name = "block"
material = "steel"
spacing = 0.25
shape = { kind = "rectangle", x = [0.0, 1.0], y = [0.0, 1.0] }
[[load]]
name = "push"
boundary = "block.top"
kind = "traction"
traction = [0.0, -0.001]
[[contact]]
name = "floor"
slave = "block.bottom"
obstacle = { kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0] }
regularization = { law = "exact" }
"""


class Mirrored(Cloud):
    """A cloud whose areas are as symmetric as its nodes: of a trapezoid, either diagonal is Delaunay's."""

    @cached_property
    def areas(self) -> FloatArray:
        twin = cKDTree(self.points).query(self.points * np.array([1.0, -1.0]))[1]
        plain = Cloud(self.points, self.spacing, self.surfaces).areas
        return np.asarray(0.5 * (plain + plain[twin]))


def mirrored(cloud: Cloud) -> Cloud:
    """The upper half of a cloud of the unit disk and its mirror image, with no node on the line between."""
    arc, clear = cloud.surfaces["arc"], 0.3 * cloud.spacing
    upper = arc.index[cloud.points[arc.index, 1] > clear[arc.index]]
    angle = np.mod(np.arctan2(cloud.points[upper, 1], cloud.points[upper, 0]) - 0.5 * np.pi, 2.0 * np.pi)
    s = np.sort(np.mod(np.concatenate([angle, np.pi - angle]), 2.0 * np.pi))
    curve = disk((0.0, 0.0), 1.0).curves[0]
    inner = np.setdiff1d(np.flatnonzero(cloud.points[:, 1] > clear), arc.index)
    kept = cloud.points[inner]
    points = np.concatenate([curve.points(s), kept, kept * np.array([1.0, -1.0])])
    at = np.arccos(np.clip(np.abs(points[: len(s), 1]), 0.0, 1.0))
    depth = np.arccos(np.clip(cloud.points[upper, 1], 0.0, 1.0))
    ranked = np.argsort(depth)
    around = np.interp(at, depth[ranked], cloud.spacing[upper][ranked])
    spacing = np.concatenate([around, cloud.spacing[inner], cloud.spacing[inner]])
    return Mirrored(points, spacing, {"arc": Surface("arc", curve, np.arange(len(s)), s, curve.normals(s))})


@pytest.mark.parametrize(("scale", "largest"), [(1.0, 0.02), (0.5, 0.01), (0.25, 5e-4)])
def test_both_contacts_of_a_mirrored_disk_are_alike(scale: float, largest: float) -> None:
    """But for discretisation errors: the cloud knows of no mirror, so that its pieces are not images. With
    spacings times 1, 0.7, 0.5, 0.35 and 0.25 the figure is 9e-3, 1e-4, 6e-3, 3e-4 and 2e-4."""
    text = DISK.replace("= 0.25", f"= {0.25 * scale!r}").replace("= 0.012", f"= {0.012 * scale!r}")
    case = parse_case(text, Path("case.toml")).case
    placed = clouds(case)
    prepared = prepare(case, {"disk": mirrored(placed["disk"])}, grids=False)
    condensed = condense(assemble_bodies(case, prepared, CholeskySolver()), prepared.pairings)
    pressure = solve_exact(condensed, stage_factors(case)[-1]).pressure
    bottom, top = (pressure[condensed.spans[name]] for name in ("bottom", "top"))
    # Both run counter-clockwise: one from left to right, the other from right to left.
    assert np.abs(bottom - top[::-1]).max() <= largest * bottom.max()


def test_a_disk_between_plates_may_neither_turn_nor_drift(tmp_path: Path) -> None:
    console = Quiet()
    assert solve(DISK, tmp_path / "run", console=console)["status"] == "done"
    assert [note.split(",")[0] for note in console.notes[:2]] == [
        "body disk: rotation is held at 0",
        "body disk: ux is held at 0",
    ]
    console = Quiet()
    assert solve(DISK, tmp_path / "rough", *ROUGH, console=console)["status"] == "done"
    assert not [note for note in console.notes if "held at 0" in note]


@pytest.mark.parametrize("settings", [[], SMOOTH, ROUGH])
def test_a_gap_closes_before_the_force_grows(tmp_path: Path, settings: list[str]) -> None:
    solve(DISK, tmp_path / "touching", *settings)
    summary = solve(DISK, tmp_path / "apart", *settings, *APART)
    assert summary["status"] == "done"
    touching, apart = (
        read_run(tmp_path / name).contacts["top"].pressure[-1] for name in ("touching", "apart")
    )
    assert apart == pytest.approx(touching, abs=2e-5 * touching.max())
    moved = read_run(tmp_path / "apart").path.displacements["press"][:, 1]
    if settings == SMOOTH:
        # The law lets the plates float onto the disk before any load.
        assert moved[0] == pytest.approx(-0.07, abs=0.002)


def test_a_plate_that_moves_finds_the_disk_where_it_floats(tmp_path: Path) -> None:
    moving = DISK.replace("fy = -0.0022", "uy = -0.075")
    assert solve(moving, tmp_path / "smooth", *SMOOTH, *APART, "output.at=[0.3, 1.0]")["status"] == "done"
    summary = solve(moving, tmp_path / "exact", *APART, "output.at=[0.3, 1.0]")
    assert summary["status"] == "failed"
    assert "may be loose there" in summary["hint"]


def test_friction_does_not_find_a_floating_disk(tmp_path: Path) -> None:
    # A plate that approaches had thrown the disk somewhere, and the run failed for what it met there.
    moving = DISK.replace("fy = -0.0022", "uy = -0.075")
    summary = solve(moving, tmp_path / "exact", *ROUGH, APART[0])
    assert (summary["status"], "nothing presses on it yet" in summary["stop_reason"]) == ("failed", True)
    assert "draw the surfaces touching" in summary["hint"]
    summary = solve(DISK, tmp_path / "smooth", *ROUGH, *SMOOTH, *APART)
    assert (summary["status"], "drawn apart" in summary["stop_reason"]) == ("failed", True)
    assert 'law = "exact"' in summary["hint"]


def test_a_rolling_disk_turns_with_the_plate(tmp_path: Path) -> None:
    rolling = DISK + '[[load]]\nname = "roll"\nkind = "obstacle"\nobstacle = "top"\nux = 1e-3\n'
    rolling += "[[stage]]\npress = 1.0\n[[stage]]\nroll = 1.0\n"
    assert solve(rolling, tmp_path / "roll", *ROUGH, "output.at=[1.0, 2.0]")["status"] == "done"
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
        (BLOCK, ['mls.scheme="ghost"'], "mls.scheme", "held by contact alone"),
        (BLOCK, [*MONOLITHIC, *LAW], "solver.formulation", "condensed formulation"),
        (BLOCK, [*FIT, FLOOR.format(-0.1)], "contact.floor.interference", "drawn apart"),
        (BLOCK, [*FIT, FLOOR.format(0.1)], "contact.floor.interference", "more than the interference"),
        (BLOCK, [FLOOR.format(0.3)], "contact.floor", "declare it with interference"),
        (BLOCK, ["contact.floor.obstacle.normal=[0.0, -1.0]"], "contact.floor", "faces the obstacle"),
    ],
)
def test_what_nothing_resists_is_refused(
    tmp_path: Path, text: str, settings: list[str], key: str, words: str
) -> None:
    with pytest.raises(CaseError) as caught:
        solve(text, tmp_path / "run", *settings)
    found = [problem for problem in caught.value.problems if problem.key == key]
    assert found, caught.value.problems
    assert words in found[0].message + found[0].hint
    assert found[0].line or found[0].source == "--set" or key.startswith(("mls", "solver"))


def test_friction_resists_what_normals_do_not(tmp_path: Path) -> None:
    settings = ["load.push.traction=[1e-4, -1e-3]", "contact.floor.friction=0.5"]
    summary = solve(BLOCK, tmp_path / "run", *settings)
    assert summary["status"] == "done"
    assert summary["contacts"]["floor"]["force"] == pytest.approx([-1e-4, 1e-3], abs=1e-12)


BETWEEN = """
format = 1
[model]
plane = "stress"
[material.soft]
E = 1083.0
nu = 0.34
[material.hard]
E = 95464.0
nu = 0.4
[[body]]
name = "base"
material = "hard"
shape = { kind = "rectangle", x = [-3.6, 3.6], y = [-4.4, 0.0] }
[[body]]
name = "disk"
material = "soft"
shape = { kind = "disk", center = [0.0, 2.2], radius = 2.2 }
[[support]]
boundary = "base.bottom"
ux = 0.0
uy = 0.0
[[contact]]
name = "floor"
slave = "disk.arc"
master = "base.top"
friction = 0.3
accuracy = 6e-3
regularization = { law = "exact" }
[[contact]]
name = "lid"
slave = "disk.arc"
accuracy = 6e-3
obstacle = { kind = "plane", point = [0.0, 4.4], normal = [0.0, -1.0] }
regularization = { law = "exact" }
[[load]]
name = "press"
kind = "obstacle"
obstacle = "lid"
fy = -15.5
[[stop]]
what = "force"
of = "lid"
above = 0.02
"""


def test_the_first_nodes_to_touch_hold_a_disk(tmp_path: Path) -> None:
    """One node on either side, exactly above each other, does not tell which way the disk would roll."""
    summary = solve(BETWEEN, tmp_path / "run")
    assert summary["status"] == "done"
    assert summary["contacts"]["floor"]["force"][1] == pytest.approx(0.02, rel=1e-6)


HOLLOW = """
format = 1
[model]
plane = "strain"
[material.soft]
E = 1221.0
nu = 0.4
[[body]]
name = "foot"
material = "soft"
[body.shape]
kind = "polygon"
points = [[-1.5, 0.0], [1.5, 0.0], [1.5, 2.4], [-1.5, 2.4]]
names = ["sole", "right", "head", "left"]
corners = ["sole", "sole", "", ""]
rounding = [0.3, 0.3, 0.3, 0.3]
[[load]]
name = "press"
boundary = "foot.head"
kind = "traction"
traction = [0.0, -11.0]
[[contact]]
name = "hollow"
slave = "foot.sole"
accuracy = 0.02
obstacle = { kind = "disk", center = [0.0, 28.0], radius = 28.0, inside = true }
"""


def test_a_foot_drawn_into_a_hollow_floats_out_of_it(tmp_path: Path) -> None:
    """Its rounded edges overlap the hollow as drawn, and nothing but the contact holds it up."""
    summary = solve(HOLLOW, tmp_path / "run")
    assert summary["status"] == "done"
    assert summary["contacts"]["hollow"]["force"] == pytest.approx([0.0, 26.4], abs=1e-6)


def test_an_eccentric_push_moves_the_pressure_below_it(tmp_path: Path) -> None:
    wide = (
        BLOCK
        + '[[load]]\nname = "edge"\nboundary = "block.left"\nkind = "traction"\ntraction = [0.0, -2e-4]\n'
    )
    summary = solve(wide, tmp_path / "wide")
    assert summary["status"] == "done"
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
        BLOCK.replace('law = "exact" }', 'law = "exact" }\ninterference = 0.01')
        + """
[[support]]
boundary = "block.top"
uy = 0.0
"""
    )
    fitted = fitted[: fitted.index("[[load]]")] + fitted[fitted.index("[[contact]]") :]
    staged = fitted + "[[stage]]\nfloor = 0.5\n[[stage]]\nfloor = 1.0\n"
    stress = 0.01 / (1.0 - 0.3**2)
    for text, expected in ((fitted, [0.0, 1.0]), (staged, [0.0, 0.5, 1.0])):
        directory = tmp_path / str(len(expected))
        assert solve(text, directory)["status"] == "done"
        data = read_run(directory)
        assert data.path.factors["floor"].tolist() == expected
        found = data.contacts["floor"].pressure
        assert np.abs(found - np.outer(expected, np.full(found.shape[1], stress))).max() <= 1e-7 * stress
    assert parse_case(fitted, Path("case.toml")).case.stage == ({"floor": 1.0},)


def test_a_flat_pad_with_rounded_corners_stays_where_nothing_drives_it(tmp_path: Path) -> None:
    # Its roundings resist a motion along the block, but it is the flat face that touches at first.
    text = """
format = 1
model = { plane = "strain" }
material.steel = { E = 210e3, nu = 0.3 }
support = [{ boundary = "block.bottom", ux = 0.0, uy = 0.0 }]
load = [{ name = "press", boundary = "pad.top", kind = "platen", fy = -600.0 }]
contact = [{ name = "face", slave = "pad.face", master = "block.top" }]
[[body]]
name = "pad"
material = "steel"
[body.shape]
kind = "polygon"
points = [[-4, 0], [4, 0], [4, 6], [-4, 6]]
names = ["face", "right", "top", "left"]
rounding = [2.0, 2.0, 0.0, 0.0]
[[body]]
name = "block"
material = "steel"
[body.shape]
kind = "rectangle"
x = [-20.0, 20.0]
y = [-20.0, 0.0]
"""
    console = Quiet()
    summary = solve(text, tmp_path / "run", console=console)
    assert summary["status"] == "done"
    assert any("pad: ux is held at 0" in note for note in console.notes)
    assert summary["force_balance"] < 1e-6
    assert summary["contacts"]["face"]["force"] == pytest.approx([0.0, 600.0], abs=0.01)
