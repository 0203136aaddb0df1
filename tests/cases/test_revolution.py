"""Bodies of revolution against closed formulas."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import refused, solve
from tests.case_text import Scene

NU, PRESSURE = 0.3, 1e-3


def ring(nu: float = NU, **model: Any) -> Scene:
    start = Scene("format = 1\n").table("model", plane="axisymmetric", **model)
    return start.material("m", E=1.0, nu=nu, alpha=1e-3)


def probed(scene: Scene, path: Path, *points: tuple[float, float]) -> list[dict[str, Any]]:
    """Displacement and stress of the body ``b`` at points."""
    for number, point in enumerate(points):
        scene = scene.item("probe", name=f"p{number}", body="b", point=list(point))
    summary = solve(scene, path / f"run{len(list(path.iterdir()))}")
    assert summary["status"] == "done"
    assert abs(summary["energy_error"]) < 0.02
    assert summary["force_balance"] < 1e-9
    return [summary["probes"][f"p{number}"] for number in range(len(points))]


def pipe(nu: float = NU, spacing: float = 0.1) -> Scene:
    body = ring(nu).body("b", "m", spacing, box=([1.0, 2.0], [0.0, 1.0]))
    held = body.support("b.bottom", uy=0.0).support("b.top", uy=0.0)
    return held.load("p", "b.left", "pressure", pressure=PRESSURE)


def wall(spacing: float) -> Scene:
    """A quarter of a hollow sphere under inner pressure; its pole is on the axis."""
    shape = {"kind": "sector", "center": [0.0, 0.0], "radii": [1.0, 2.0], "angles": [0.0, 90.0]}
    body = ring().body("b", "m", spacing, shape).support("b.start", uy=0.0)
    return body.load("p", "b.inner", "pressure", pressure=PRESSURE)


@pytest.mark.parametrize(("nu", "degree", "error"), [(0.3, 4, 2e-5), (0.3, 2, 5e-3), (0.499, 4, 1e-4)])
def test_pipe_of_lame(nu: float, degree: int, error: float, tmp_path: Path) -> None:
    (inside,) = probed(pipe(nu).table("mls", degree=degree), tmp_path, (1.0, 0.5))
    q = PRESSURE / 3.0
    assert inside["displacement"][0] == pytest.approx((1.0 + nu) * q * (5.0 - 2.0 * nu), rel=error)
    assert inside["stress_zz"] == pytest.approx(5.0 * q, rel=10.0 * error)


def test_hollow_sphere(tmp_path: Path) -> None:
    """Displacements of the pole, on the axis, and of the equator."""
    exact = PRESSURE / 7.0 * ((1.0 - 2.0 * NU) + 4.0 * (1.0 + NU))
    pole, equator = probed(wall(0.06).table("mls", degree=4), tmp_path, (0.0, 1.0), (1.0, 0.0))
    assert pole["displacement"] == pytest.approx([0.0, exact], rel=2e-4, abs=1e-6 * exact)
    assert equator["displacement"] == pytest.approx([exact, 0.0], rel=2e-4, abs=1e-6 * exact)
    assert pole["stress"][0] == pytest.approx(pole["stress_zz"], rel=1e-9)


def test_turning_disk(tmp_path: Path) -> None:
    """A thin disk with the stresses of Timoshenko and Goodier on its rim is a cubic displacement."""
    half, square = 0.2, 1e-4
    across = NU * (1.0 + NU) / (6.0 * (1.0 - NU))
    body = ring().body("b", "m", 0.05, box=([0.0, 1.0], [0.0, half])).support("b.bottom", uy=0.0)
    turning = body.item("load", name="turning", kind="centrifugal", body="b", omega=square**0.5, density=1.0)
    rim = f"{square * across!r}*({half**2!r}-3*y**2)"
    turning = turning.load("rim", "b.right", "traction", traction=[rim, 0.0])
    center, edge = probed(turning.table("mls", degree=4), tmp_path, (0.0, 0.0), (1.0, 0.0))
    middle = square * ((3.0 + NU) / 8.0 + across * half**2)
    hoop = square * ((1.0 - NU) / 4.0 + across * half**2)
    assert center["stress"][0] == pytest.approx(middle, rel=1e-6)
    assert center["stress_zz"] == pytest.approx(middle, rel=1e-6)
    assert edge["stress_zz"] == pytest.approx(hoop, rel=1e-6)
    assert edge["displacement"][0] == pytest.approx(hoop - NU * square * across * half**2, rel=1e-6)


def test_uniform_states(tmp_path: Path) -> None:
    """A plate's force is that of the full turn; a cylinder heated in a rigid bore."""
    body = ring().body("b", "m", 0.2, box=([0.0, 1.0], [0.0, 1.0])).support("b.bottom", uy=0.0)
    (corner,) = probed(body.load("f", "b.top", "platen", fy=-1e-3 * np.pi), tmp_path, (1.0, 1.0))
    assert corner["displacement"] == pytest.approx([NU * 1e-3, -1e-3], rel=1e-9)
    heated = body.support("b.right", ux=0.0)
    heated = heated.item("load", name="T", kind="temperature", body="b", temperature=1.0)
    (middle,) = probed(heated, tmp_path, (0.5, 0.5))
    assert middle["stress"] == pytest.approx([-1e-3 / (1.0 - NU), 0.0, 0.0], abs=1e-12)
    assert middle["stress_zz"] == pytest.approx(-1e-3 / (1.0 - NU), rel=1e-9)


def test_thin_ring_is_plane_strain(tmp_path: Path) -> None:
    found = []
    for plane in ("axisymmetric", "strain"):
        scene = ring().changed("axisymmetric", plane).body("b", "m", 0.05, box=([1e4, 1e4 + 1.0], [0.0, 1.0]))
        scene = scene.support("b.bottom", ux=0.0, uy=0.0)
        scene = scene.load("t", "b.top", "traction", traction=[0.0, PRESSURE])
        found.append(probed(scene.table("mls", degree=4), tmp_path, (1e4 + 1.0, 1.0))[0])
    one, other = found
    assert one["displacement"][1] == pytest.approx(other["displacement"][1], rel=1e-3)
    assert one["von_mises"] == pytest.approx(other["von_mises"], rel=5e-3)


def test_nearly_a_solid_shaft(tmp_path: Path) -> None:
    """A pin-hole on the axis doubles the hoop stress beside it."""
    body = ring().body("b", "m", 0.1, box=([0.1, 1.0], [0.0, 0.5])).support("b.bottom", uy=0.0)
    body = body.support("b.top", uy=0.0).load("p", "b.right", "pressure", pressure=PRESSURE)
    (edge,) = probed(
        body.item("body.refine", along="b.left", spacing=0.01, radius=0.05), tmp_path, (0.1, 0.25)
    )
    assert edge["stress_zz"] == pytest.approx(-2.0 * PRESSURE / 0.99, rel=2e-3)


def solid() -> Scene:
    """A shaft under a load that is missing."""
    return ring().body("b", "m", 0.2, box=([0.0, 1.0], [0.0, 1.0])).support("b.bottom", uy=0.0)


WALL = {"kind": "plane", "point": [0.0, 0.0], "normal": [1.0, 0.0]}
ORTHOTROPIC = "E1 = 1.0\nE2 = 2.0\nE3 = 1.5\nG12 = 0.4\nnu12 = 0.2\nnu13 = 0.2\nnu23 = 0.2"


@pytest.mark.parametrize(
    ("scene", "key", "words"),
    [
        (pipe().changed("[1.0, 2.0]", "[-1.0, 2.0]"), "body.b.shape", "beyond the axis"),
        (pipe().changed("[model]", '[model]\nstrain = "finite"'), "model.strain", "finite strain"),
        (pipe().pin("b", [1.0, 0.0], uy=0.0), "support.2.near", "a point"),
        (pipe().changed("nu = 0.3", "nu = 0.3\nyield_stress = 0.1"), "material.m.yield_stress", "plasticity"),
        (solid().load("p", "b.left", "pressure", pressure=1.0), "load.p", "axis"),
        (solid().load("p", "b.right", "platen", ux=1.0), "load.p", "along the axis"),
        (
            solid().item("contact", name="c", slave="b.left", obstacle=WALL, interference=1e-3),
            "contact.c.slave",
            "axis",
        ),
        (
            solid().changed("E = 1.0\nnu = 0.3", ORTHOTROPIC).load("p", "b.top", "pressure", pressure=1.0),
            "body.b.material",
            "E1 = E3",
        ),
    ],
)
def test_refused(scene: Scene, key: str, words: str, tmp_path: Path) -> None:
    refused(scene, tmp_path / "run", key, words)


def two_rings(**contact: Any) -> Scene:
    """A ring in a stiffer one, between planes of symmetry."""
    scene = ring().material("soft", E=0.5, nu=NU)
    scene = scene.body("b", "m", 0.05, box=([1.0, 2.0], [0.0, 0.5]))
    scene = scene.body("inner", "soft", 0.05, box=([0.5, 1.0], [0.0, 0.5]))
    for side in ("b.bottom", "b.top", "inner.bottom", "inner.top"):
        scene = scene.support(side, uy=0.0)
    return scene.item("contact", name="joint", slave="inner.right", master="b.left", **contact)


@pytest.mark.parametrize("friction", ["bonded", 0.0])
def test_ring_in_a_ring(friction: Any, tmp_path: Path) -> None:
    """Under inner pressure bonded rings and rings in contact are the same: Lame's two layers."""
    scene = two_rings(friction=friction).load("p", "inner.left", "pressure", pressure=PRESSURE)
    (edge,) = probed(scene, tmp_path, (2.0, 0.25))
    rows, shear = [], {0.5: 0.5 / (2.0 * (1.0 + NU)), 1.0: 1.0 / (2.0 * (1.0 + NU))}
    for modulus in (0.5, 1.0):
        bulk = shear[modulus] / (1.0 - 2.0 * NU)
        rows.append(lambda r, bulk=bulk, mu=shear[modulus]: [2.0 * bulk, -2.0 * mu / r**2])
    matrix = np.zeros((4, 4))
    matrix[0, :2], matrix[1, 2:], matrix[2, :2] = rows[0](0.5), rows[1](2.0), rows[0](1.0)
    matrix[2, 2:], matrix[3] = -np.array(rows[1](1.0)), [1.0, 1.0, -1.0, -1.0]
    _, _, a, b = np.linalg.solve(matrix, [-PRESSURE, 0.0, 0.0, 0.0])
    assert edge["displacement"][0] == pytest.approx(2.0 * a + b / 2.0, rel=1.5e-3)


def test_hub_pulled_off(tmp_path: Path) -> None:
    """A press fit slides when the pull is the friction of all of its pressures."""
    scene = ring().body("b", "m", 0.25, box=([1.0, 2.0], [0.0, 1.0]))
    scene = scene.body("shaft", "m", 0.25, box=([0.0, 1.0], [-1.0, 2.0])).support("shaft.bottom", uy=0.0)
    scene = scene.item(
        "contact", name="fit", slave="b.left", master="shaft.right", interference=1e-3, friction=0.1
    )
    scene = scene.load("pull", "b.right", "traction", traction=[0.0, 4e-5])
    scene = scene.add("[[stage]]\nfit = 1.0\n[[stage]]\npull = 1.0\n").table("mls", degree=2)
    summary = solve(scene, tmp_path / "run")
    assert summary["status"] == "failed"
    assert "slides" in summary["stop_reason"]
    force = summary["contacts"]["fit"]["force"]
    assert abs(force[1]) == pytest.approx(0.1 * force[0], rel=1e-3)


def test_cone(tmp_path: Path) -> None:
    """Depth of a cone on a block, from collocation with the kernel of rings of pressure."""
    stiff, slope, radius = 1.0 / (1.0 - NU**2), 0.1, 0.2
    scene = ring().body("b", "m", box=([0.0, 1.0], [-1.0, 0.0])).support("b.bottom", ux=0.0, uy=0.0)
    plane = {"kind": "plane", "point": [0.0, 0.0], "normal": [0.0, -1.0]}
    scene = scene.item("contact", name="c", slave="b.top", obstacle=plane, gap=f"{slope}*x")
    force = 0.5 * np.pi * radius**2 * stiff * slope
    scene = scene.item("load", name="press", kind="obstacle", obstacle="c", fy=-force)
    summary = solve(scene, tmp_path / "run")
    assert -read_run(tmp_path / "run").path.displacements["press"][-1, 1] == pytest.approx(
        0.0289856, rel=1e-3
    )
    assert summary["contacts"]["c"]["half_width"] == pytest.approx(0.1995, rel=1e-2)
