"""Bodies that flow against closed solutions and finite elements: loaded, unloaded, in contact."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.run import run
from mlsanm_cli.io.run_reader import RunData, read_run
from tests.app.runs import undeclared, warned
from tests.app.scenes import Quiet
from tests.case_text import Scene, scene

Y = 1e-3
LIMIT = 2.0 / np.sqrt(3.0) * Y * np.log(2.0)
"""Inner pressure that a perfectly plastic ring of radii 1 and 2 carries in plane strain (Hill 1950)."""


def solved(text: str, directory: Path, *overrides: str) -> tuple[dict[str, Any], RunData]:
    directory.mkdir()
    (directory / "case.toml").write_text(text)
    summary = run(directory / "case.toml", overrides=overrides, out=directory / "run", console=Quiet())
    return dict(summary), read_run(directory / "run")


def ring(spacing: float, **material: Any) -> Scene:
    """A quarter of a ring under inner pressure, its limit load at factor 1."""
    return (
        scene("strain", E=1.0, nu=0.3, yield_stress=Y, **material)
        .body(
            "ring",
            "steel",
            spacing,
            {"kind": "sector", "center": [0.0, 0.0], "radii": [1.0, 2.0], "angles": [0.0, 90.0]},
        )
        .support("ring.start", uy=0.0)
        .support("ring.end", ux=0.0)
        .load("inside", "ring.inner", "pressure", pressure=LIMIT)
    )


def radial(data: RunData, radius: float) -> list[float]:
    """Mean radial displacements at a radius in all saved states."""
    points = data.bodies["ring"].points
    on = np.abs(np.hypot(*points.T) - radius) < 1e-9
    moved = [(state.bodies["ring"]["displacement"] * points).sum(axis=1) / radius for state in data.states]
    return [float(one[on].mean()) for one in moved]


def test_a_thick_ring_to_its_limit_and_back(tmp_path: Path) -> None:
    text = ring(0.05).stages("inside=0.7", "inside=0.9", "inside=0.0").table("output", at=[1.0, 2.0, 3.0])
    summary, data = solved(text, tmp_path / "ring")
    assert summary["status"] == "done"
    assert not warned(summary)
    assert not undeclared(tmp_path / "ring" / "run")
    # One-dimensional elements; the residual displacements are differences of large ones.
    assert radial(data, 2.0) == pytest.approx([7.18022e-4, 1.18338e-3, 3.0936e-4], rel=1e-3)
    assert radial(data, 1.0) == pytest.approx([1.14433e-3, 1.98979e-3, 6.160e-4], rel=2e-3)
    fields, flow = data.states[-1].bodies["ring"], summary["flow"]
    assert fields["plastic_strain"].max() == pytest.approx(flow["bodies"]["ring"]["plastic_strain"])
    assert np.abs(fields["yield_ratio"]).max() <= 1.0 + 1e-6
    assert 0.0 < flow["increment_error"] < 4e-3
    work = flow["bodies"]["ring"]
    assert 0.0 < work["stored_energy"] < work["plastic_work"]


def test_a_plate_collapses_at_its_limit_load(tmp_path: Path) -> None:
    """A clamped plate in tension: the section away from the clamp carries the yield stress."""
    text = (
        scene("stress", E=1.0, nu=0.3, yield_stress=Y)
        .body("plate", "steel", 0.25, box=([0.0, 1.0], [0.0, 1.5]), clamped="bottom")
        .load("pull", "plate.top", "traction", traction=[0.0, Y])
        .stages("pull=1.1")
    )
    # Close to collapse accurate increments are short.
    summary, data = solved(text.table("solver", increment_error=0.3), tmp_path / "plate")
    assert summary["status"] == "failed"
    assert summary["stop_reason"].startswith("collapse: body plate")
    assert data.path.factors["pull"][-1] == pytest.approx(1.0, abs=0.015)


def test_a_cycle_dissipates_the_work_of_the_loads(tmp_path: Path) -> None:
    """Pulled, pushed and pulled with combined hardening: a uniform bar follows its law at every node."""
    text = (
        scene("stress", E=1.0, nu=0.3, yield_stress=Y, hardening=0.05, kinematic_hardening=0.1)
        .body("bar", "steel", 0.25, box=([0.0, 2.0], [0.0, 1.0]))
        .support("bar.left", ux=0.0)
        .support("bar.bottom", uy=0.0)
        .load("pull", "bar.right", "displacement", ux=0.008)
        .stages("pull", "pull=-1.0", "pull=1.0")
    )
    summary, data = solved(text, tmp_path / "bar")
    force = data.path.resultants["pull"][:, 0]
    strain = 0.004 * data.path.factors["pull"]
    plastic = strain - force
    # Elastic until q reaches the flow stress, then on both hardening lines.
    first = data.path.position.tolist().index(1.0)
    slope = 0.15
    assert force[first] == pytest.approx((Y + slope * 0.004) / (1.0 + slope), rel=1e-6)
    bar = summary["flow"]["bodies"]["bar"]
    assert bar["plastic_work"] == pytest.approx(2.0 * float(np.trapezoid(force, plastic)), rel=1e-3)
    # Elastic energy, and that of the back stress, which is reversible.
    assert bar["stored_energy"] == pytest.approx(force[-1] ** 2 + 0.1 * plastic[-1] ** 2, rel=1e-3)


@pytest.mark.parametrize("slope", [0.0, 0.01])
def test_a_plate_bends_a_beam_and_lets_go(slope: float, tmp_path: Path) -> None:
    """Pure bending to about 1.4 times the elastic moment, by a plate without force, and back: beam theory."""
    across = np.linspace(-0.5, 0.5, 20001)
    curvature = 2.0 * np.sqrt(5.0) * Y
    elastic = curvature * across
    stress = np.sign(across) * np.minimum(np.abs(elastic), (Y + slope * np.abs(elastic)) / (1.0 + slope))
    moment = float(np.trapezoid(stress * across, across))
    assert slope or moment == pytest.approx(1.4 * Y / 6.0, rel=1e-6)
    text = (
        scene("stress", E=1.0, nu=0.3, yield_stress=Y, hardening=slope)
        .body("beam", "steel", 1 / 16, box=([0.0, 2.0], [-0.5, 0.5]))
        .support("beam.left", ux=0.0)
        .pin("beam", [0.0, 0.0], uy=0.0)
        .load("bend", "beam.right", "platen", fx=0.0, moment=-moment)
        .stages("bend", "bend=0.0")
        .table("output", at=[1.0, 2.0])
    )
    summary, data = solved(text, tmp_path / "beam")
    assert summary["status"] == "done"
    points = data.bodies["beam"].points
    bent, left = (state.bodies["beam"] for state in data.states[-2:])
    end = np.isclose(points[:, 0], 2.0)
    for fields, expected in ((bent, curvature), (left, curvature - 12.0 * moment)):
        turned = np.polyfit(points[end, 1], fields["displacement"][end, 0], 1)[0]
        assert turned == pytest.approx(2.0 * expected, abs=0.02 * curvature)
    middle = np.abs(points[:, 0] - 1.0) < 0.5
    remains = np.interp(points[:, 1], across, stress) - 12.0 * moment * points[:, 1]
    assert np.abs(left["stress"][middle, 0] - remains[middle]).max() < 0.03 * Y


def test_contacts_of_bodies_that_flow_are_wider(tmp_path: Path) -> None:
    """A cylinder on a block: its pressures vanish at the ends, and what unloading leaves is no error."""
    text = (
        scene("strain", E=1000.0, nu=0.3, yield_stress=1.0, hardening=50.0)
        .body("block", "steel", box=([-2.0, 2.0], [-2.0, 0.0]))
        .support("block.bottom", uy=0.0)
        .pin("block", [0.0, -2.0], ux=0.0)
        .contact("c", "block.top", friction=0.0, disk=([0.0, 4.0], 4.0))
        .pushed("push", "c", fy=-1.3)
        .stages("push", "push=0.0")
        .table("output", at=[1.0, 2.0])
        .table("solver", increment_error=0.05)
    )
    summary, data = solved(text, tmp_path / "block")
    assert summary["status"] == "done"
    contact = data.contacts["c"]
    pressure = contact.pressure[data.path.position.tolist().index(1.0)]
    assert pressure[[0, -1]].max() < 1e-3 * pressure.max()
    elastic = 4.0 * np.sqrt(1.3 * (1.0 - 0.3**2) / (np.pi * 1000.0))
    assert np.ptp(contact.points[pressure > 0.0, 0]) > 1.5 * 2.0 * elastic
