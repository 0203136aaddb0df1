"""Bonded surfaces against closed formulas, and against bodies of one piece."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.results.choice import Choice
from mlsanm_cli.app.results.plot import plot
from mlsanm_cli.app.results.probe import probe_contact, probe_force
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.io.run_reader import read_run
from tests.app.runs import warned
from tests.app.scenes import done, refused, solve
from tests.case_text import Scene, body, contact, load, polygon, scene


def bond(name: str, slave: str, master: str | None = None, **keys: Any) -> Scene:
    return contact(name, slave, master, friction="bonded", **keys)


def stacked(*spacings: float) -> Scene:
    """Two blocks 2 x 1, one on the other; the lower one stands on its bottom."""
    one, other = spacings or (None, None)
    low = scene("strain", "a", E=1000.0).body("low", "a", one, box=([0.0, 2.0], [-1.0, 0.0]))
    return low.body("high", "a", other, box=([0.0, 2.0], [0.0, 1.0]))


PULL = load("pull", "high.top", "traction", traction=[0.0, 2.0])


@pytest.mark.parametrize(("degree", "swapped"), [(2, False), (4, True)])
def test_a_bimetal_strip_bends_as_timoshenko_says(degree: int, swapped: bool, tmp_path: Path) -> None:
    # Timoshenko, Journal of the Optical Society of America 11 (1925), 233; clouds of unlike spacing.
    length, thick, stiff, grows = 12.0, (0.5, 1.0), (200.0, 70.0), (1e-3, 2.4e-3)
    pair = ("low.top", "high.bottom")
    text = (
        scene("stress", "a", E=stiff[0], alpha=grows[0])
        .material("b", E=stiff[1], nu=0.3, alpha=grows[1])
        .body("low", "a", box=([0.0, length], [-thick[0], 0.0]))
        .body("high", "b", box=([0.0, length], [0.0, 1.0]))
        .pin("low", [6.0, -0.5], ux=0.0, uy=0.0)
        .pin("low", [6.0, 0.0], ux=0.0)
        .heat("low", "low", 10.0)
        .heat("high", "high", 10.0)
        .add(bond("glue", *(pair[::-1] if swapped else pair)))
    )
    summary = done(text, tmp_path / "run", f"mls.degree={degree}")
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
    found = data.contacts["glue"]
    middle = np.abs(found.points[:, 0] - 6.0) < 2.0
    assert np.abs(found.traction[-1][middle]).max() <= 1e-2 * np.abs(found.traction[-1]).max()
    np.testing.assert_allclose(summary["contacts"]["glue"]["force"], 0.0, atol=1e-9)
    assert summary["contacts"]["glue"]["peak_tension"] > 0.0


def test_uniform_tension_goes_across_whatever_the_clouds(tmp_path: Path) -> None:
    text = stacked(0.15, 0.25).support("low.bottom", uy=0.0).pin("low", [0.0, -1.0], ux=0.0).add(PULL)
    solved = done(text + bond("glue", "low.top", "high.bottom"), tmp_path / "run")
    found = read_run(tmp_path / "run").contacts["glue"]
    np.testing.assert_allclose(found.pressure[-1], -2.0, atol=1e-7)
    np.testing.assert_allclose(found.traction[-1], 0.0, atol=1e-7)
    assert solved["forces"]["low.bottom"][1] == pytest.approx(-4.0, rel=1e-9)
    assert (found.gap == 0.0).all()
    assert plot(tmp_path / "run", choice=Choice(("pressure",)))


@pytest.mark.parametrize("slave", ["disk.arc", "ring.inner"])
def test_a_disk_bonded_in_a_ring(slave: str, tmp_path: Path) -> None:
    # Lame's solution of two materials; the ring is pulled, so that the bond carries tension.
    text = (
        scene("strain", "a", E=1000.0)
        .material("b", E=100.0, nu=0.3)
        .body("disk", "a", disk=([0.0, 0.0], 1.0))
        .body("ring", "b", annulus=([0.0, 0.0], [1.0, 2.0]))
        .pin("disk", [0.0, 0.0], ux=0.0, uy=0.0)
        .pin("disk", [1.0, 0.0], uy=0.0)
        .load("pull", "ring.outer", "pressure", pressure=-1.0)
        .add(bond("glue", slave, "ring.inner" if slave == "disk.arc" else "disk.arc"))
    )
    summary = done(text, tmp_path / "run")
    # Displacements at radius 1 per pressure there, and per pull.
    inner = 1.3 * 0.4 / 1000.0
    ring, pull = 1.3 / 100.0 * (0.4 + 4.0) / 3.0, 1.3 / 100.0 * (0.4 * 4.0 + 4.0) / 3.0
    tension = pull / (inner + ring)
    data = read_run(tmp_path / "run")
    found = data.contacts["glue"]
    np.testing.assert_allclose(found.pressure[-1], -tension, rtol=1e-2)
    np.testing.assert_allclose(found.traction[-1], 0.0, atol=1.5e-2 * tension)
    away, size = 0.0, 0.0
    for name, one in data.bodies.items():
        r, beyond = np.hypot(*one.points.T)[:, None], 4.0 / 3.0 * (1.0 - tension)
        stretch = 1.3 / 100.0 * (0.4 * (tension + beyond) + beyond / np.maximum(r, 1.0) ** 2)
        true = one.points * (inner * tension if name == "disk" else stretch)
        away += ((data.states[-1].bodies[name]["displacement"] - true) ** 2).sum()
        size += (true**2).sum()
    error = float(np.sqrt(away / size))
    assert error / 3.0 <= summary["error_estimate"]["displacement"] <= 3.0 * error
    assert summary["error_estimate"]["pressure"] == {"glue": None}


def coated(split: bool) -> Scene:
    """A half-disk on a block, of one piece or of a layer on the rest of it, of one material."""
    text = (
        scene("strain", "a", E=1000.0)
        .body("punch", "a", half_disk=([0.0, 4.0], 4.0))
        .body("base", "a", box=([-4.0, 4.0], [-4.0, -1.0 if split else 0.0]))
        .support("base.bottom", uy=0.0)
        .pin("base", [0.0, -4.0], ux=0.0)
        .pin("punch", [0.0, 4.0], ux=0.0)
        .load("press", "punch.flat", "platen", fy=-20.0)
        .contact("c", "punch.arc", "coat.top" if split else "base.top")
    )
    coat = body("coat", "a", box=([-4.0, 4.0], [-1.0, 0.0])).add(bond("glue", "coat.bottom", "base.top"))
    return text.add(coat) if split else text


def test_a_layer_of_the_same_material_is_not_seen(tmp_path: Path) -> None:
    whole = solve(coated(split=False), tmp_path / "whole")
    split = done(coated(split=True), tmp_path / "split", "output.at=[0.37, 1.0]")
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


def fibre(stiff: float, spacings: tuple[float, float | None], half: float) -> Scene:
    """A disk of radius 1 bonded in a square matrix of modulus 1, with a probe in its middle."""
    corners = [[-half, -half], [half, -half], [half, half], [-half, half]]
    hole = {"center": [0.0, 0.0], "radius": 1.0, "name": "hole"}
    return (
        scene("strain", "glass", E=stiff)
        .material("resin", E=1.0, nu=0.3)
        .body("fibre", "glass", spacings[0], disk=([0.0, 0.0], 1.0))
        .body("matrix", "resin", spacings[1], polygon(corners, "b r t l", holes=[hole]))
        .contact("grip", "fibre.arc", "matrix.hole", friction="bonded")
        .probe("middle", "fibre", [0.0, 0.0])
    )


def test_a_stiff_fibre_in_a_stretched_matrix(tmp_path: Path) -> None:
    # Uniform inside, see Eshelby 1957; Muskhelishvili, Some Basic Problems, section 59: p (k + 1) / 2 and
    # s (k + 1) / k of the mean stress p and of half the difference s, with k = 3 - 4 nu of the matrix.
    text = fibre(3e4, (0.16, None), 20.0)
    text = text.pin("matrix", [-20.0, 0.0], uy=0.0).pin("matrix", [20.0, 0.0], uy=0.0)
    text = text.pin("matrix", [0.0, 20.0], ux=0.0)
    for name, sign in (("r", 1.0), ("l", -1.0)):
        text = text.load(name, f"matrix.{name}", "traction", traction=[sign, 0.0])
    across, along, _ = solve(text, tmp_path / "run")["probes"]["middle"]["stress"]
    k = 3.0 - 4.0 * 0.3
    assert across + along == pytest.approx(0.5 * (k + 1.0), rel=3e-3)
    assert across - along == pytest.approx((k + 1.0) / k, rel=1e-2)
    grip = read_run(tmp_path / "run").contacts["grip"]
    turn, uneven = 2.0 * np.arctan2(grip.points[:, 1], grip.points[:, 0]), 0.5 * (k + 1.0) / k
    off = grip.pressure[-1] + 0.25 * (k + 1.0) + uneven * np.cos(turn)
    assert np.linalg.norm(off) <= 0.02 * np.linalg.norm(grip.pressure[-1])
    off = np.abs(grip.traction[-1]) - uneven * np.abs(np.sin(turn))
    assert np.linalg.norm(off) <= 0.03 * np.linalg.norm(grip.traction[-1])


def test_few_nodes_around_a_fibre_bond_it_and_are_told(tmp_path: Path) -> None:
    text = fibre(3.0, (0.6, 0.6), 8.0).support("matrix.l", ux=0.0).pin("matrix", [-8.0, 0.0], uy=0.0)
    summary = solve(text.load("right", "matrix.r", "traction", traction=[0.01, 0.0]), tmp_path / "run")
    # Eshelby's formulas in an infinite plate.
    outer, inner, k = 1.0 / 2.6, 3.0 / 2.6, 3.0 - 4.0 * 0.3
    mean = inner * (k + 1.0) / (2.0 * inner + outer * (k - 1.0))
    shear = inner * (k + 1.0) / (outer + k * inner)
    assert summary["probes"]["middle"]["stress"][0] == pytest.approx(0.005 * (mean + shear), rel=0.05)
    assert "bonded_curve" in warned(summary)


def test_bodies_hang_on_bonds_alone(tmp_path: Path) -> None:
    # Two posts, one above the other, each held by nothing but its bond, pulled aside: a cantilever.
    def post(*cuts: float) -> Scene:
        text = scene("stress", "a", E=1000.0).support("b0.bottom", ux=0.0, uy=0.0)
        for number, pair in enumerate(pairwise(cuts)):
            text = text.body(f"b{number}", "a", 0.1, box=([0.0, 1.0], pair))
        last = f"b{len(cuts) - 2}"
        text = text.load("push", f"{last}.top", "traction", traction=[0.1, 0.0])
        return text.probe("tip", last, [0.5, 5.0])

    # Bonded bodies have degree 2.
    whole = solve(post(0.0, 5.0), tmp_path / "whole", "mls.degree=2")
    split = done(post(0.0, 2.0, 5.0) + bond("glue", "b1.bottom", "b0.top"), tmp_path / "split")
    tips: list[FloatArray] = [np.array(some["probes"]["tip"]["displacement"]) for some in (whole, split)]
    np.testing.assert_allclose(tips[1], tips[0], atol=3e-3 * np.abs(tips[0]).max())
    np.testing.assert_allclose(split["contacts"]["glue"]["force"], [-0.1, 0.0], atol=1e-9)


def test_a_bond_ends_where_a_surface_goes_on(tmp_path: Path) -> None:
    # A post on a block, against both of one piece; the block is cut where the post begins and ends.
    def pushed(of: str) -> Scene:
        push = load("push", f"{of}.right", "traction", traction=[-0.5, 0.0])
        return push.probe("tip", of, [2.0, 3.0])

    text = scene("strain", "a", E=1000.0).support("block.bottom", ux=0.0, uy=0.0)
    corners = [[0, -1], [4, -1], [4, 0], [2, 0], [2, 3], [1, 3], [1, 0], [0, 0]]
    fine = [{"at": [x, 0.0], "spacing": 0.01, "radius": 0.02} for x in (1.0, 2.0)]
    one = body("block", "a", 0.1, polygon(corners, "bottom r b right top left a l"), refine=fine)
    whole = solve(text.add(one, pushed("block")), tmp_path / "whole")
    text = text.body("block", "a", box=([0.0, 4.0], [-1.0, 0.0]))
    text = text.body("post", "a", box=([1.0, 2.0], [0.0, 3.0])).add(pushed("post"))
    tips = [whole["probes"]["tip"]["displacement"]]
    for pair in (("post.bottom", "block.top"), ("block.top", "post.bottom")):
        split = done(text + bond("glue", *pair), tmp_path / pair[0])
        sign = 1.0 if pair[0] == "post.bottom" else -1.0
        np.testing.assert_allclose(split["contacts"]["glue"]["force"], [1.5 * sign, 0.0], atol=1e-8)
        tips.append(split["probes"]["tip"]["displacement"])
    np.testing.assert_allclose(tips[1:], [tips[0]] * 2, rtol=0.025)


BONDED = stacked().support("low.bottom", ux=0.0, uy=0.0) + PULL
FACES = ("high.bottom", "low.top")
GLUED = BONDED + bond("glue", *FACES)


def test_bonds_touch_and_are_not_refined(tmp_path: Path) -> None:
    apart = GLUED.changed("[0.0, 1.0]", "[0.1, 1.0]")
    refused(apart, tmp_path / "run", "contact.glue.friction", "at least 0.1 apart")
    refused(GLUED.table("adapt", passes=1), tmp_path / "run", "adapt.passes", "bonded")
    law = coated(split=True).table("solver", method="anm")
    refused(law, tmp_path / "run", "contact.c.regularization.law", "need the exact law")
