"""Error estimates against true errors: over-refined runs of the same geometry, and a closed formula."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from benchmarks.formulas import LameRing
from benchmarks.peers.scenes import REFERENCE, Profile, difference, read_profile
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.io.run_reader import RunData
from mlsanm_cli.operators.neighbors import MlsSettings
from mlsanm_cli.operators.stencil_weights import scalar_rows
from mlsanm_cli.operators.stencils import build_stencils
from tests.app.scenes import EXACT_LAW
from tests.cases.test_published import solve

FINE = "contact.interface.accuracy=5e-5"
FACTOR = 3.0
NEARBY = 0.25
"""Displacements nearer to the contact are not interpolated from nodes: their fields are in closed form."""


@dataclass(frozen=True)
class Truth:
    """An over-refined run: degree 4, fine clouds and a contact grid twenty times as accurate as usual.

    Its pressures are those of finite elements within 1e-4.
    """

    data: RunData

    def errors(self, data: RunData) -> tuple[float, float]:
        """Relative errors of displacement and pressure of the last state."""
        difference = size = 0.0
        for name, body in self.data.bodies.items():
            points = data.bodies[name].points
            stencils = build_stencils(body.points, cKDTree(body.points), points, 0, MlsSettings(4))
            true = self.data.states[-1].bodies[name]["displacement"]
            expected = scalar_rows(stencils, stencils.weights[:, 0]) @ true
            far = np.hypot(*points.T) > NEARBY
            found = data.states[-1].bodies[name]["displacement"]
            difference += float(((found - expected)[far] ** 2).sum())
            size += float((expected[far] ** 2).sum())
        fine, coarse = self.data.contacts["interface"], data.contacts["interface"]
        arc = np.linspace(fine.arc_length[0], fine.arc_length[-1], 20001)
        expected, pressure = (
            np.interp(arc, one.arc_length, one.pressure[-1], left=0.0, right=0.0) for one in (fine, coarse)
        )
        return float(np.sqrt(difference / size)), norm(pressure - expected) / norm(expected)


def norm(values: FloatArray) -> float:
    return float(np.sqrt((values**2).sum()))


def over_refined(name: str, directory: Path, spacings: Mapping[str, float]) -> Truth:
    sizes = [f"body.{body}.spacing={spacing!r}" for body, spacing in spacings.items()]
    return Truth(solve(name, directory, EXACT_LAW, "mls.degree=4", FINE, *sizes)[1])


@pytest.fixture(scope="module")
def hertz(tmp_path_factory: pytest.TempPathFactory) -> Truth:
    return over_refined("hertz", tmp_path_factory.mktemp("t") / "hertz", {"cylinder": 0.05, "block": 0.08})


def check(summary: Mapping[str, Any], data: RunData, truth: Truth, factor: float = FACTOR) -> None:
    displacement, pressure = truth.errors(data)
    estimate = summary["error_estimate"]
    assert displacement / factor <= estimate["displacement"] <= displacement * factor
    assert pressure / factor <= estimate["pressure"]["interface"] <= pressure * factor


def test_the_over_refined_pressure_is_that_of_finite_elements(hertz: Truth) -> None:
    contact = hertz.data.contacts["interface"]
    along = np.argsort(contact.points[:, 0])
    found = Profile(contact.points[along, 0], contact.pressure[-1][along])
    assert difference(found, read_profile(REFERENCE / "hertz.csv", "pressure")) <= 1e-4


@pytest.mark.parametrize(
    "overrides",
    [
        [],
        ["mls.degree=2", "body.cylinder.spacing=0.3", "body.block.spacing=0.4"],
        ["contact.interface.accuracy=1e-2"],
    ],
    ids=["published", "coarser", "coarser grid"],
)
def test_hertz(tmp_path: Path, hertz: Truth, overrides: list[str]) -> None:
    summary, data = solve("hertz", tmp_path / "run", EXACT_LAW, *overrides)
    check(summary, data, hertz)
    accuracy = {(): 1e-3, ("contact.interface.accuracy=1e-2",): 1e-2}.get(tuple(overrides))
    if accuracy is not None:
        assert summary["nodes"] <= 400
        assert hertz.errors(data)[1] <= 0.5 * accuracy
        # No finer than they have to be either: about 50 places for 1 %, and h^(3/2).
        assert summary["contact_unknowns"] <= 90 * (0.01 / accuracy) ** 0.5


@pytest.mark.parametrize(
    ("degree", "spacing", "nu"), [(2, 0.1, 0.3), (4, 0.05, 0.3), (2, 0.1, 0.46), (2, 0.1, 0.4999)]
)
def test_lame(tmp_path: Path, degree: int, spacing: float, nu: float) -> None:
    # With the defect of the area change times the bulk modulus the last estimate was 22.
    sizes = (f"body.ring.spacing={spacing!r}", f"body.ring.refine.0.spacing={0.5 * spacing!r}")
    steel = f"material.steel.nu={nu!r}"
    summary, data = solve("lame", tmp_path / "run", f"mls.degree={degree}", steel, *sizes)
    points, found = data.bodies["ring"].points, data.states[-1].bodies["ring"]["displacement"]
    r = np.hypot(points[:, 0], points[:, 1])
    ring = LameRing(1.0, 2.0, 100.0, 210e3 / (1.0 - nu**2), nu / (1.0 - nu))
    expected = points * (ring.displacement(r) / r)[:, None]
    error = norm(found - expected) / norm(expected)
    assert error / FACTOR <= summary["error_estimate"]["displacement"] <= error * FACTOR
    assert summary["error_estimate"]["pressure"] == {}


@pytest.mark.parametrize("degree", [1, 6])
def test_no_figure_is_made_up_for_other_degrees(tmp_path: Path, degree: int) -> None:
    summary, _ = solve("lame", tmp_path / "run", f"mls.degree={degree}")
    assert summary["error_estimate"] == {"displacement": None, "pressure": {}}


TURNED = ("stage=[{press=1.0},{shear=1.0},{shear=0.0}]", "output.at=[3.0]")


@pytest.fixture(scope="module")
def turned_back(tmp_path_factory: pytest.TempPathFactory) -> Truth:
    sizes = ("body.cylinder.spacing=0.06", "body.block.spacing=0.1", *TURNED)
    return Truth(solve("cattaneo_mindlin", tmp_path_factory.mktemp("t") / "turned", EXACT_LAW, *sizes)[1])


def test_friction_whose_loads_have_turned_back(tmp_path: Path, turned_back: Truth) -> None:
    sizes = ("body.cylinder.spacing=0.12", "body.block.spacing=0.2", *TURNED)
    summary, data = solve("cattaneo_mindlin", tmp_path / "run", EXACT_LAW, *sizes)
    true, told = turned_back.errors(data)[0], summary["error_estimate"]["displacement"]
    # Between the two runs lie 0.2 %, of which a part is what histories on unlike grids differ by.
    assert true / 5.0 <= told <= true * FACTOR
    # Tractions make pressures of their own; what the grid leaves counts here too.
    assert 1e-4 <= summary["error_estimate"]["pressure"]["interface"] <= 0.02
