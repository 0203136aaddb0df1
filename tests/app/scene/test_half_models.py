"""Half and quarter models, cut at planes of symmetry, are the whole models."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.check import check
from mlsanm_cli.contact.geometry.grid import Hats
from mlsanm_cli.contact.geometry.unfolding import Unfolding
from mlsanm_cli.io.run_reader import read_run
from mlsanm_cli.mechanics.symmetry import SymmetryPlane, copies_around, images_of
from tests.app.scenes import Quiet, solve
from tests.case_text import FLOOR, Scene, contact, load, pushed, scene

SOFT = scene("strain", "soft", E=10.0)
ROUND = Scene().add(
    pushed("press", "c", uy=-0.02), contact("c", "block.top", disk=([0.0, 0.5], 0.5), friction=0.3)
)


def indented(left: float) -> Scene:
    """A rigid disk on a block from x = ``left`` to 1, with friction."""
    block = SOFT.body("block", "soft", box=([left, 1.0], [-1.0, 0.0]))
    return block.support("block.bottom", ux=0.0, uy=0.0) + ROUND


def squeezed(right: float) -> Scene:
    """A plate pressed onto a rigid plane and squeezed from its sides, which slips and opens there."""
    plate = scene("strain", "one", E=130e3, nu=0.2).body("block", "one", box=([0.0, right], [0.0, 40.0]))
    side = load("left", "block.left", "pressure", pressure=150.0)
    if right > 40.0:
        side += load("right", "block.right", "pressure", pressure=150.0)
    top = load("top", "block.top", "pressure", pressure=50.0)
    return (plate + side + top).contact("c", "block.bottom", obstacle=FLOOR, friction=1.0)


def rolled(half: bool, through_points: bool = False) -> Scene:
    """A steel cylinder on a softer block, with friction: a curved slave meets the plane at a right angle, or
    as nearly as a spline does."""
    text = scene("strain").material("soft", E=70e3, nu=0.2)
    shape: dict[str, Any] = {"half_disk": ([0.0, 1.0], 1.0)}
    if half:
        corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
        shape = {"kind": "polygon", "points": corners, "names": ["below", "side", "flat", "middle"]}
        shape = {"shape": shape | {"rounding": [0.0, 1.0, 0.0, 0.0], "corners": ["", "arc", "", ""]}}
    if half and through_points:
        angle = np.linspace(-0.5 * np.pi, 0.0, 9)
        arc = np.stack([np.cos(angle), 1.0 + np.sin(angle)], axis=1).tolist()
        sides = {"arc": arc, "flat": [[1.0, 1.0], [0.0, 1.0]], "middle": [[0.0, 1.0], [0.0, 0.0]]}
        named = [{"name": name, "points": points} for name, points in sides.items()]
        shape = {"shape": {"kind": "outline", "sides": named}}
    text = text.body("disk", "steel", **shape)
    text = text.body("block", "soft", box=([0.0 if half else -2.0, 2.0], [-2.0, 0.0]))
    text = text.support("block.bottom", ux=0.0, uy=0.0)
    press = load("press", "disk.flat", "displacement", displacement=[0.0, -0.002])
    return text + press + contact("c", "disk.arc", "block.top", friction=0.15)


def between(left: float) -> Scene:
    """A rigid disk that touches all of a block between two walls."""
    block = SOFT.body("block", "soft", box=([left, 1.0], [-1.0, 0.0])).support("block.bottom", uy=0.0)
    walls = block.support("block.left", ux=0.0).support("block.right", ux=0.0)
    return walls + pushed("press", "c", uy=-0.016) + contact("c", "block.top", disk=([0.0, 40.0], 40.0))


@pytest.mark.parametrize(
    ("half", "whole"),
    [
        (indented(0.0).support("block.left", ux=0.0), indented(-1.0)),
        (squeezed(40.0).support("block.right", ux=0.0), squeezed(80.0)),
        (rolled(True).support("block.left", ux=0.0).support("disk.middle", ux=0.0), rolled(False)),
        (rolled(True, True).support("block.left", ux=0.0).support("disk.middle", ux=0.0), rolled(False)),
        (between(0.0), between(-1.0)),
    ],
    ids=["round obstacle", "opening and sliding", "two bodies", "curve through points", "two planes"],
)
def test_a_half_is_half_of_the_whole(half: Scene, whole: Scene, tmp_path: Path) -> None:
    one, other = (solve(text, tmp_path / str(n)) for n, text in enumerate((half, whole)))
    runs = [read_run(tmp_path / str(number)).contacts["c"] for number in (0, 1)]
    force, whole_force = (found["contacts"]["c"]["force"][1] for found in (one, other))
    assert 2.0 * force == pytest.approx(whole_force, rel=1e-3)
    assert one["force_balance"] <= 1e-9
    assert runs[0].pressure[-1].max() == pytest.approx(runs[1].pressure[-1].max(), rel=2e-3)
    assert 2.0 * one["contacts"]["c"]["half_width"] == pytest.approx(
        other["contacts"]["c"]["half_width"], rel=5e-3
    )
    if runs[0].traction is not None:
        plane = 40.0 if "40.0" in half.split("[[contact]]")[0] else 0.0
        at = int(np.argmin(np.abs(runs[0].points[:, 0] - plane)))
        assert runs[0].traction[-1][at] == 0.0
        assert np.abs(runs[0].traction[-1]).max() == pytest.approx(
            np.abs(runs[1].traction[-1]).max(), rel=1e-2
        )
        assert 2.0 * one["contacts"]["c"]["dissipated_work"] == pytest.approx(
            other["contacts"]["c"]["dissipated_work"], rel=2e-2
        )


def plug(quarter: bool) -> Scene:
    """A quarter, or the upper half, of a disk under a rigid plate, with friction."""
    if quarter:
        corners, names = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], ["below", "side", "top", "middle"]
        shape = {"kind": "polygon", "points": corners, "names": names, "rounding": [0.0, 0.0, 1.0, 0.0]}
        text = SOFT.body("plug", "soft", shape=shape | {"corners": ["", "", "arc", ""]})
        text = text.support("plug.below", uy=0.0).support("plug.middle", ux=0.0)
    else:
        text = SOFT.body("plug", "soft", half_disk=([0.0, 0.0], 1.0, "upper"))
        text = text.support("plug.flat", uy=0.0).pin("plug", [0.0, 0.0], ux=0.0)
    plate = Scene().contact("c", "plug.arc", plane=([0.0, 1.0], [0.0, -1.0]), friction=0.3)
    return text + pushed("press", "c", uy=-0.02) + plate


@pytest.mark.parametrize(
    ("body", "half", "whole"),
    [
        ("block", indented(0.0).support("block.left", ux=0.0), indented(-1.0)),
        ("plug", plug(True), plug(False)),
    ],
    ids=["round obstacle", "quarter"],
)
def test_a_half_is_half_of_the_whole_at_finite_strain(
    body: str, half: Scene, whole: Scene, tmp_path: Path
) -> None:
    finite = ("model.strain=finite", "material.soft.law=neo-hookean", f"body.{body}.spacing=0.1")
    one, other = (
        solve(text.replace("uy = -0.02", "uy = -0.005"), tmp_path / str(n), *finite)
        for n, text in enumerate((half, whole))
    )
    found, expected = (summary["contacts"]["c"] for summary in (one, other))
    assert 2.0 * found["force"][1] == pytest.approx(expected["force"][1], rel=2e-3)
    assert found["peak_pressure"] == pytest.approx(expected["peak_pressure"], rel=4e-3)
    assert 2.0 * found["half_width"] == pytest.approx(expected["half_width"], rel=0.01)
    assert one["error_estimate"]["contacts"]["c"] <= 5e-3


def test_a_contact_beside_the_plane(tmp_path: Path) -> None:
    """A disk pressed next to a wall, without touching it, is one of two on a whole block."""

    def disks(left: float, *centers: float) -> Scene:
        text = SOFT.body("block", "soft", box=([left, 1.0], [-1.0, 0.0])).support(
            "block.bottom", ux=0.0, uy=0.0
        )
        for name, x in zip("ab", centers, strict=False):
            text += pushed(f"press-{name}", name, uy=-0.01)
            text += contact(name, "block.top", disk=([x, 0.5], 0.5), friction=0.3)
        return text

    one = solve(disks(0.0, 0.1).support("block.left", ux=0.0), tmp_path / "half")["contacts"]["a"]
    other = solve(disks(-1.0, 0.1, -0.1), tmp_path / "whole")["contacts"]["a"]
    assert one["force"] == pytest.approx(other["force"], rel=2e-3, abs=5e-5)
    assert one["peak_pressure"] == pytest.approx(other["peak_pressure"], rel=2e-3)


def test_an_obstacle_that_moves_across_the_wall_slips_there(tmp_path: Path) -> None:
    """No plane of symmetry for friction: the block cannot follow, and slides up to the wall."""
    text = indented(0.0).support("block.left", ux=0.0) + pushed("drag", "c", ux=0.02)
    solve(text, tmp_path / "run")
    found = read_run(tmp_path / "run").contacts["c"]
    assert found.traction is not None
    at = int(np.argmin(found.points[:, 0]))
    assert abs(found.traction[-1][at]) == pytest.approx(0.3 * found.pressure[-1][at], rel=1e-6)


@pytest.mark.parametrize(("left", "told"), [(0.0, False), (-2.0, True)])
def test_a_half_on_a_whole_is_told(left: float, told: bool, tmp_path: Path) -> None:
    """A body that is cut, on one that is not, is a guided body whose edge presses."""
    cut, case = rolled(True).support("disk.middle", ux=0.0), tmp_path / "case.toml"
    case.write_text(
        cut.support("block.left", ux=0.0) if left == 0.0 else cut.replace("[0.0, 2.0]", "[-2.0, 2.0]")
    )
    warnings = check(case, console=Quiet())["warnings"]
    assert any("cut both bodies at the plane" in warning for warning in warnings) == told


UPRIGHT, LEVEL = SymmetryPlane(0j, 1j), SymmetryPlane(0j, 1.0 + 0j)


@pytest.mark.parametrize(
    ("planes", "copies", "images"),
    [
        ((UPRIGHT, None), None, 1),
        ((None, UPRIGHT), None, 1),
        ((UPRIGHT, SymmetryPlane(2.0 + 0j, 1j)), 2, 2),
        ((UPRIGHT, SymmetryPlane(0j, -1j)), 2, 1),
        ((LEVEL, UPRIGHT), 4, 3),
        ((LEVEL, SymmetryPlane(0j, complex(np.exp(1j * np.pi / 3)))), 6, 5),
        ((LEVEL, SymmetryPlane(0j, complex(np.exp(2j * np.pi / 3)))), None, None),
    ],
)
def test_unfolded_ranges(planes: Any, copies: int | None, images: int | None) -> None:
    """Even and odd functions are interpolated exactly; copies have the length of the ring."""
    both = None not in planes
    assert not both or copies_around(*planes) == copies
    if images is None:
        return
    assert len(images_of([plane for plane in planes if plane])) == images
    unfolding = Unfolding(0.0, 2.0, 12, planes)
    s, tip = np.linspace(0.0, 2.0, 31), 0.0 if planes[0] else 2.0
    for of, cardinal in zip((np.cos, np.sin), unfolding.cardinals(s), strict=True):
        values = of(np.pi * (unfolding.samples - tip))
        assert cardinal @ values == pytest.approx(of(np.pi * (s - tip)), abs=1e-8)
    hats = Hats.on(np.linspace(0.0, 2.0, 5), (planes[0] is not None, planes[1] is not None))
    whole, fold = unfolding.hats(hats), unfolding.fold(len(hats.place))
    assert whole.weight.sum() == pytest.approx(len(unfolding.copies) * hats.weight.sum())
    assert fold.T @ whole.weight == pytest.approx(len(unfolding.copies) * hats.weight)
    at, _ = unfolding.located(whole.place)
    assert at == pytest.approx(fold @ hats.place)
