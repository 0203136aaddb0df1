"""Bonded surfaces against closed formulas, and against bodies of one piece."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from mlsanm_cli.app.check import check
from mlsanm_cli.app.results.plot import plot
from mlsanm_cli.app.results.probe import probe_contact, probe_force
from mlsanm_cli.app.run import run
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import CaseError
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import ANM, Quiet, solve

HEAD = 'format = 1\n[model]\nplane = "{}"\n'
PINNED = '[[support]]\nbody = "{}"\nnear = [{}, {}]\n{}\n'


def material(name: str, modulus: float, alpha: float = 0.0) -> str:
    return f"[material.{name}]\nE = {modulus}\nnu = 0.3\nalpha = {alpha}\n"


def body(name: str, of: str, x: object, y: object, spacing: object = '"auto"') -> str:
    shape = f'{{ kind = "rectangle", x = {x}, y = {y} }}'
    return f'[[body]]\nname = "{name}"\nmaterial = "{of}"\nspacing = {spacing}\nshape = {shape}\n'


def bond(name: str, slave: str, master: str) -> str:
    return f'[[contact]]\nname = "{name}"\nslave = "{slave}"\nmaster = "{master}"\nfriction = "bonded"\n'


def heat(name: str, degrees: float) -> str:
    return f'[[load]]\nname = "heat-{name}"\nbody = "{name}"\nkind = "temperature"\ntemperature = {degrees}\n'


def load(name: str, boundary: str, kind: str, what: str) -> str:
    return f'[[load]]\nname = "{name}"\nboundary = "{boundary}"\nkind = "{kind}"\n{what}\n'


@pytest.mark.parametrize("degree", [2, 4])
@pytest.mark.parametrize("pair", [("low.top", "high.bottom"), ("high.bottom", "low.top")])
def test_a_bimetal_strip_bends_as_timoshenko_says(degree: int, pair: tuple[str, str], tmp_path: Path) -> None:
    # Timoshenko, Journal of the Optical Society of America 11 (1925), 233; clouds of unlike spacing.
    length, thick, stiff, grows = 12.0, (0.5, 1.0), (200.0, 70.0), (1e-3, 2.4e-3)
    text = HEAD.format("stress") + material("a", stiff[0], grows[0]) + material("b", stiff[1], grows[1])
    text += body("low", "a", [0.0, length], [-thick[0], 0.0]) + body("high", "b", [0.0, length], [0.0, 1.0])
    text += PINNED.format("low", 6.0, -0.5, "ux = 0.0\nuy = 0.0") + PINNED.format("low", 6.0, 0.0, "ux = 0.0")
    text += heat("low", 10.0) + heat("high", 10.0) + bond("glue", *pair)
    summary = solve(text, tmp_path / "run", f"mls.degree={degree}")
    assert summary["status"] == "done", summary
    assert summary["force_balance"] <= 1e-9
    data = read_run(tmp_path / "run")
    points, moved = data.bodies["low"].points, data.states[-1].bodies["low"]["displacement"]
    below = (np.abs(points[:, 0] - 6.0) < 3.0) & (points[:, 1] == -0.5)
    curvature = 2.0 * np.polyfit(points[below, 0], moved[below, 1], 2)[0]
    m, n = thick[0] / thick[1], stiff[0] / stiff[1]
    part = 3.0 * (1.0 + m) ** 2 + (1.0 + m * n) * (m**2 + 1.0 / (m * n))
    expected = -6.0 * (grows[1] - grows[0]) * 10.0 * (1.0 + m) ** 2 / (1.5 * part)
    assert curvature == pytest.approx(expected, rel=2e-5)
    # Far from the ends nothing crosses the bond; all of it is free of resultants.
    contact = data.contacts["glue"]
    middle = np.abs(contact.points[:, 0] - 6.0) < 2.0
    assert np.abs(contact.traction[-1][middle]).max() <= 1e-2 * np.abs(contact.traction[-1]).max()
    np.testing.assert_allclose(summary["contacts"]["glue"]["force"], 0.0, atol=1e-9)
    assert summary["contacts"]["glue"]["peak_tension"] > 0.0


def test_uniform_tension_goes_across_whatever_the_clouds(tmp_path: Path) -> None:
    text = HEAD.format("strain") + material("a", 1000.0)
    text += body("low", "a", [0.0, 2.0], [-1.0, 0.0], 0.15) + body("high", "a", [0.0, 2.0], [0.0, 1.0], 0.25)
    text += '[[support]]\nboundary = "low.bottom"\nuy = 0.0\n' + PINNED.format("low", 0.0, -1.0, "ux = 0.0")
    text += load("pull", "high.top", "traction", "traction = [0.0, 2.0]")
    solved = solve(text + bond("glue", "low.top", "high.bottom"), tmp_path / "run")
    assert solved["status"] == "done", solved
    contact = read_run(tmp_path / "run").contacts["glue"]
    np.testing.assert_allclose(contact.pressure[-1], -2.0, atol=1e-7)
    np.testing.assert_allclose(contact.traction[-1], 0.0, atol=1e-7)
    assert solved["forces"]["low.bottom"][1] == pytest.approx(-4.0, rel=1e-9)
    assert (contact.gap == 0.0).all()
    assert plot(tmp_path / "run")


@pytest.mark.parametrize("slave", ["disk.arc", "ring.inner"])
def test_a_disk_bonded_in_a_ring(slave: str, tmp_path: Path) -> None:
    # Lame's solution of two materials; the ring is pulled, so that the bond carries tension.
    text = HEAD.format("strain") + material("a", 1000.0) + material("b", 100.0)
    text += '[[body]]\nname = "disk"\nmaterial = "a"\n'
    text += 'shape = { kind = "disk", center = [0.0, 0.0], radius = 1.0 }\n'
    text += '[[body]]\nname = "ring"\nmaterial = "b"\n'
    text += 'shape = { kind = "annulus", center = [0.0, 0.0], radii = [1.0, 2.0] }\n'
    text += PINNED.format("disk", 0.0, 0.0, "ux = 0.0\nuy = 0.0") + PINNED.format(
        "disk", 1.0, 0.0, "uy = 0.0"
    )
    text += load("pull", "ring.outer", "pressure", "pressure = -1.0")
    other = "ring.inner" if slave == "disk.arc" else "disk.arc"
    summary = solve(text + bond("glue", slave, other), tmp_path / "run")
    assert summary["status"] == "done", summary
    # Displacements at radius 1 per pressure there, and per pull.
    disk = 1.3 * 0.4 / 1000.0
    ring, pull = 1.3 / 100.0 * (0.4 + 4.0) / 3.0, 1.3 / 100.0 * (0.4 * 4.0 + 4.0) / 3.0
    tension = pull / (disk + ring)
    contact = read_run(tmp_path / "run").contacts["glue"]
    np.testing.assert_allclose(contact.pressure[-1], -tension, rtol=1e-2)
    np.testing.assert_allclose(contact.traction[-1], 0.0, atol=1.5e-2 * tension)


def coated(split: bool) -> str:
    """A half-disk on a block, of one piece or of a layer on the rest of it, of one material."""
    text = HEAD.format("strain") + material("a", 1000.0)
    text += '[[body]]\nname = "punch"\nmaterial = "a"\n'
    text += 'shape = { kind = "half-disk", center = [0.0, 4.0], radius = 4.0, side = "lower" }\n'
    if split:
        text += body("coat", "a", [-4.0, 4.0], [-1.0, 0.0]) + body("base", "a", [-4.0, 4.0], [-4.0, -1.0])
        text += bond("glue", "coat.bottom", "base.top")
    else:
        text += body("base", "a", [-4.0, 4.0], [-4.0, 0.0])
    text += '[[support]]\nboundary = "base.bottom"\nuy = 0.0\n' + PINNED.format("base", 0.0, -4.0, "ux = 0.0")
    text += PINNED.format("punch", 0.0, 4.0, "ux = 0.0")
    text += load("press", "punch.flat", "platen", "fy = -20.0")
    top = "coat" if split else "base"
    return text + f'[[contact]]\nname = "c"\nslave = "punch.arc"\nmaster = "{top}.top"\n'


def test_a_layer_of_the_same_material_is_not_seen(tmp_path: Path) -> None:
    whole = solve(coated(split=False), tmp_path / "whole")
    split = solve(coated(split=True), tmp_path / "split", ANM)
    assert split["status"] == "done", split
    one, other = (some["contacts"]["c"] for some in (whole, split))
    assert other["peak_pressure"] == pytest.approx(one["peak_pressure"], rel=4e-3)
    assert other["half_width"] == pytest.approx(one["half_width"], rel=4e-3)
    assert split["contacts"]["glue"]["force"][1] == pytest.approx(20.0, rel=1e-9)
    # Between the steps of the path bonds follow from its series.
    directory = tmp_path / "split"
    for at in (0.37, 1.0):
        [force], [seen] = probe_force(directory, (at,), "glue"), probe_contact(directory, (at,), "glue")
        assert force["fy"] == pytest.approx(20.0 * at, rel=1e-9)
        assert np.abs(np.asarray(seen["pressure"])).max() > 0.0
        np.testing.assert_array_equal(seen["gap"], 0.0)


def test_a_stiff_fibre_in_a_stretched_matrix(tmp_path: Path) -> None:
    # Uniform inside, see Eshelby 1957; Muskhelishvili, Some Basic Problems, section 59: p (k + 1) / 2 and
    # s (k + 1) / k of the mean stress p and of half the difference s, with k = 3 - 4 nu of the matrix.
    text = HEAD.format("strain") + material("glass", 3e4) + material("resin", 1.0)
    text += '[[body]]\nname = "fibre"\nmaterial = "glass"\nspacing = 0.16\n'
    text += '[body.shape]\nkind = "disk"\ncenter = [0.0, 0.0]\nradius = 1.0\n'
    text += '[[body]]\nname = "matrix"\nmaterial = "resin"\n[body.shape]\nkind = "polygon"\n'
    text += "points = [[-20.0, -20.0], [20.0, -20.0], [20.0, 20.0], [-20.0, 20.0]]\n"
    text += 'names = ["b", "r", "t", "l"]\nholes = [{ center = [0.0, 0.0], radius = 1.0, name = "hole" }]\n'
    text += PINNED.format("matrix", -20.0, 0.0, "uy = 0.0") + PINNED.format("matrix", 20.0, 0.0, "uy = 0.0")
    text += PINNED.format("matrix", 0.0, 20.0, "ux = 0.0") + bond("grip", "fibre.arc", "matrix.hole")
    text += load("right", "matrix.r", "traction", "traction = [1.0, 0.0]")
    text += load("left", "matrix.l", "traction", "traction = [-1.0, 0.0]")
    text += '[[probe]]\nname = "middle"\nbody = "fibre"\npoint = [0.0, 0.0]\n'
    across, along, _ = solve(text, tmp_path / "run")["probes"]["middle"]["stress"]
    k = 3.0 - 4.0 * 0.3
    assert across + along == pytest.approx(0.5 * (k + 1.0), rel=3e-3)
    assert across - along == pytest.approx((k + 1.0) / k, rel=1e-2)
    # Three spacings apart, 0.48 radian, knots left 3.2 % of the pressures.
    grip = read_run(tmp_path / "run").contacts["grip"]
    turn, uneven = 2.0 * np.arctan2(grip.points[:, 1], grip.points[:, 0]), 0.5 * (k + 1.0) / k
    off = grip.pressure[-1] + 0.25 * (k + 1.0) + uneven * np.cos(turn)
    assert np.linalg.norm(off) <= 0.02 * np.linalg.norm(grip.pressure[-1])
    off = np.abs(grip.traction[-1]) - uneven * np.abs(np.sin(turn))
    assert np.linalg.norm(off) <= 0.03 * np.linalg.norm(grip.traction[-1])


def test_few_nodes_around_a_fibre_bond_it_and_are_told(tmp_path: Path) -> None:
    # Three knots around, three spacings apart, had left it half of its load, without a word.
    text = HEAD.format("strain") + material("glass", 3.0) + material("resin", 1.0)
    text += '[[body]]\nname = "fibre"\nmaterial = "glass"\nspacing = 0.6\n'
    text += '[body.shape]\nkind = "disk"\ncenter = [0.0, 0.0]\nradius = 1.0\n'
    text += '[[body]]\nname = "matrix"\nmaterial = "resin"\nspacing = 0.6\n[body.shape]\nkind = "polygon"\n'
    text += "points = [[-8.0, -8.0], [8.0, -8.0], [8.0, 8.0], [-8.0, 8.0]]\n"
    text += 'names = ["b", "r", "t", "l"]\nholes = [{ center = [0.0, 0.0], radius = 1.0, name = "hole" }]\n'
    text += '[[support]]\nboundary = "matrix.l"\nux = 0.0\n' + PINNED.format("matrix", -8.0, 0.0, "uy = 0.0")
    text += bond("grip", "fibre.arc", "matrix.hole")
    text += load("right", "matrix.r", "traction", "traction = [0.01, 0.0]")
    text += '[[probe]]\nname = "middle"\nbody = "fibre"\npoint = [0.0, 0.0]\n'
    summary = solve(text, tmp_path / "run")
    # Eshelby's formulas in an infinite plate.
    outer, inner, k = 1.0 / 2.6, 3.0 / 2.6, 3.0 - 4.0 * 0.3
    mean = inner * (k + 1.0) / (2.0 * inner + outer * (k - 1.0))
    shear = inner * (k + 1.0) / (outer + k * inner)
    assert summary["probes"]["middle"]["stress"][0] == pytest.approx(0.005 * (mean + shear), rel=0.05)
    assert any("from node to node" in text for text in summary["warnings"])


def test_bodies_hang_on_bonds_alone(tmp_path: Path) -> None:
    # Two posts, one above the other, each held by nothing but its bond, pulled aside: a cantilever.
    def post(split: bool) -> str:
        text = HEAD.format("stress") + material("a", 1000.0)
        cuts = [0.0, 2.0, 5.0] if split else [0.0, 5.0]
        for number, (low, high) in enumerate(pairwise(cuts)):
            text += body(f"b{number}", "a", [0.0, 1.0], [low, high], 0.1)
        text += '[[support]]\nboundary = "b0.bottom"\nux = 0.0\nuy = 0.0\n'
        last = "b1" if split else "b0"
        text += load("push", f"{last}.top", "traction", "traction = [0.1, 0.0]")
        text += f'[[probe]]\nname = "tip"\nbody = "{last}"\npoint = [0.5, 5.0]\n'
        return text + (bond("glue", "b1.bottom", "b0.top") if split else "")

    # Bonded bodies have degree 2.
    whole = solve(post(split=False), tmp_path / "whole", "mls.degree=2")
    split = solve(post(split=True), tmp_path / "split")
    assert split["status"] == "done", split
    tips: list[FloatArray] = [np.array(some["probes"]["tip"]["displacement"]) for some in (whole, split)]
    np.testing.assert_allclose(tips[1], tips[0], atol=3e-3 * np.abs(tips[0]).max())
    np.testing.assert_allclose(split["contacts"]["glue"]["force"], [-0.1, 0.0], atol=1e-9)


def test_a_crack_closes_beside_its_bond(tmp_path: Path) -> None:
    # Two blocks glued along a part of their faces, pressed: stresses are those of one. The corner of the
    # other block, far off, was taken for the end of the contact, with a pressure of 1000 there; and the
    # contact had been asked to take in the glued part.
    text = HEAD.format("strain") + material("a", 1000.0)
    text += body("low", "a", [0.0, 10.0], [0.0, 5.0], 0.5) + body("high", "a", [0.0, 10.0], [5.0, 10.0], 0.5)
    text += '[[support]]\nboundary = "low.bottom"\nuy = 0.0\n'
    text += '[[support]]\nbody = "low"\nnear = [0.0, 0.0]\nux = 0.0\n'
    text += load("press", "high.top", "pressure", "pressure = 10.0")
    glue = bond("glue", "high.bottom", "low.top")
    slit = glue.replace("glue", "slit").replace('friction = "bonded"\n', "")
    text += glue + "from = [4.0, 5.0]\nto = [10.0, 5.0]\n" + slit + "from = [0.0, 5.0]\nto = [4.0, 5.0]\n"
    summary = solve(text, tmp_path / "run")
    assert summary["contacts"]["slit"]["force"][1] == pytest.approx(40.0, rel=0.01)
    assert summary["contacts"]["slit"]["peak_pressure"] == pytest.approx(10.0, rel=0.05)
    assert [text for text in summary["warnings"] if "ends where a bond begins, near (4, 5)" in text]
    assert not [text for text in summary["warnings"] if "continues without a corner" in text]


def test_a_bond_ends_where_a_surface_goes_on(tmp_path: Path) -> None:
    # A post on a block, against both of one piece; the block is cut where the post begins and ends.
    push = load("push", "post.right", "traction", "traction = [-0.5, 0.0]")
    probe = '[[probe]]\nname = "tip"\nbody = "{}"\npoint = [2.0, 3.0]\n'
    clamp = '[[support]]\nboundary = "block.bottom"\nux = 0.0\nuy = 0.0\n'
    text = HEAD.format("strain") + material("a", 1000.0) + clamp
    one = text + '[[body]]\nname = "block"\nmaterial = "a"\nspacing = 0.1\n[body.shape]\nkind = "polygon"\n'
    one += "points = [[0, -1], [4, -1], [4, 0], [2, 0], [2, 3], [1, 3], [1, 0], [0, 0]]\n"
    one += 'names = ["bottom", "r", "b", "right", "top", "left", "a", "l"]\n'
    for x in (1.0, 2.0):
        one += f"[[body.refine]]\nat = [{x}, 0.0]\nspacing = 0.01\nradius = 0.02\n"
    whole = solve(one + push.replace("post", "block") + probe.format("block"), tmp_path / "whole")
    text += body("block", "a", [0.0, 4.0], [-1.0, 0.0]) + body("post", "a", [1.0, 2.0], [0.0, 3.0]) + push
    tips = [whole["probes"]["tip"]["displacement"]]
    for pair in (("post.bottom", "block.top"), ("block.top", "post.bottom")):
        split = solve(text + bond("glue", *pair) + probe.format("post"), tmp_path / pair[0])
        assert split["status"] == "done", split
        sign = 1.0 if pair[0] == "post.bottom" else -1.0
        np.testing.assert_allclose(split["contacts"]["glue"]["force"], [1.5 * sign, 0.0], atol=1e-8)
        tips.append(split["probes"]["tip"]["displacement"])
    np.testing.assert_allclose(tips[1:], [tips[0]] * 2, rtol=0.025)


def test_check_and_faults(tmp_path: Path) -> None:
    case = tmp_path / "case.toml"
    text = HEAD.format("strain") + material("a", 1000.0)
    text += body("low", "a", [0.0, 2.0], [-1.0, 0.0]) + body("high", "a", [0.0, 2.0], [0.0, 1.0])
    text += '[[support]]\nboundary = "low.bottom"\nux = 0.0\nuy = 0.0\n'
    text += load("pull", "high.top", "traction", "traction = [0.0, 2.0]") + bond(
        "glue", "high.bottom", "low.top"
    )
    case.write_text(text)
    assert check(case, console=Quiet())["contacts"]["glue"]
    for more, words in (
        ("gap = 0.1\n", r"contact.glue.gap.*bonded"),
        ("interference = 0.1\n", r"contact.glue.interference.*bonded"),
        ("regularization = { eta = 1e-3 }\n", r"contact.glue.regularization.*bonded"),
    ):
        case.write_text(text + more)
        with pytest.raises(CaseError, match=words):
            check(case, console=Quiet())
    case.write_text(text.replace("y = [0.0, 1.0]", "y = [0.1, 1.0]"))
    with pytest.raises(CaseError, match=r"contact.glue.friction.*at least 0.1 apart"):
        run(case, out=tmp_path / "run", console=Quiet())
    case.write_text(text + "[adapt]\npasses = 1\n")
    with pytest.raises(CaseError, match=r"adapt.passes.*bonded"):
        check(case, console=Quiet())
    case.write_text(text.replace('"bonded"', '"glued"'))
    with pytest.raises(CaseError, match=r'contact.glue.friction.*"bonded"'):
        check(case, console=Quiet())
    obstacle = 'obstacle = { kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0] }'
    case.write_text(text.replace('master = "low.top"', obstacle))
    with pytest.raises(CaseError, match=r"contact.glue.friction.*rigid obstacle"):
        check(case, console=Quiet())
