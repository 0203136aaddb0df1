"""Error estimates against true errors: over-refined runs of the same geometry, and a closed formula."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from benchmarks.peers.scenes import REFERENCE, Profile, difference, read_profile
from mlsanm_cli.app.run import run
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.io.run_reader import RunData, read_run
from mlsanm_cli.operators.rows import scalar_rows
from mlsanm_cli.operators.settings import MlsSettings
from mlsanm_cli.operators.stencils import build_stencils
from mlsanm_cli.reference.lame import LameRing
from tests.app.scenes import Quiet

CASES = Path(__file__).parents[2] / "cases"
EXACT = 'contact.interface.regularization.law="exact"'
FACTOR = 3.0
DEGREE_4, TWO_CYLINDERS = 5.0, 4.0
"""Where estimates scatter more. Over eight seeds, on symmetric clouds and others, they were 0.27 to 4.9 times
the displacement's error at degree 4; for two cylinders 0.25 to 1.3 times it, and 0.6 to 3.2 times that of the
pressure."""


def solve(name: str, directory: Path, *overrides: str) -> tuple[Mapping[str, Any], RunData]:
    summary = run(CASES / f"{name}.toml", overrides=overrides, out=directory, console=Quiet())
    assert summary["status"] == "done", summary
    return summary, read_run(directory)


@dataclass(frozen=True)
class Truth:
    """An over-refined run: degree 4, 24 spacings over the half-width, ``at_edge`` at the contact's edges.

    Far from it the clouds of hertz are so fine that a symmetric one and another agree to 1e-4: with twice the
    spacing they are 6e-4 apart, as much as the errors at degree 4.

    Displacements of the block agreed to 1e-3 with quadratic finite elements under the same pressure.
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
            difference += float(((data.states[-1].bodies[name]["displacement"] - expected) ** 2).sum())
            size += float((expected**2).sum())
        fine, coarse = self.data.contacts["interface"], data.contacts["interface"]
        arc = np.linspace(coarse.arc_length[0], coarse.arc_length[-1], 20001)
        expected = np.interp(arc, fine.arc_length, fine.pressure[-1], left=0.0, right=0.0)
        found = np.interp(arc, coarse.arc_length, coarse.pressure[-1])
        return float(np.sqrt(difference / size)), norm(found - expected) / norm(expected)


def norm(values: FloatArray) -> float:
    return float(np.sqrt((values**2).sum()))


def zones(radii: Mapping[str, float], width: float, at_edge: float, growth: float = 0.12) -> list[str]:
    """Overrides that put zones under a contact of half-width ``width`` and at its edges.

    ``radii`` maps bodies to the signed radii of their surfaces, infinite for a straight one.
    """
    settings = []
    for body, radius in radii.items():
        fine = [f"{{at=[0.0, 0.0], spacing={width / 24.0!r}, radius={1.3 * width!r}, growth={growth!r}}}"]
        for x in (-width, width):
            at = [x, 0.5 * x**2 / radius]
            edge = width / at_edge
            fine.append(f"{{at={at!r}, spacing={edge!r}, radius={12.0 * edge!r}, growth={growth!r}}}")
        settings.append(f"body.{body}.refine=[{', '.join(fine)}]")
    return settings


@pytest.fixture(scope="module")
def hertz(tmp_path_factory: pytest.TempPathFactory) -> Truth:
    fine = zones({"cylinder": 1.0, "block": np.inf}, 0.04994, 1024.0, growth=0.08)
    fine += ["body.cylinder.spacing=0.03", "body.block.spacing=0.06"]
    return Truth(solve("hertz", tmp_path_factory.mktemp("t") / "hertz", EXACT, "mls.degree=4", *fine)[1])


@pytest.fixture(scope="module")
def cylinders(tmp_path_factory: pytest.TempPathFactory) -> Truth:
    fine = [*zones({"upper": 1.0, "lower": -2.0}, 0.029513, 1024.0), "body.lower.spacing=0.1"]
    return Truth(solve("two_cylinders", tmp_path_factory.mktemp("t") / "two", "mls.degree=4", *fine)[1])


def check(summary: Mapping[str, Any], data: RunData, truth: Truth, factor: float = FACTOR) -> None:
    displacement, pressure = truth.errors(data)
    estimate = summary["error_estimate"]
    assert displacement / factor <= estimate["displacement"] <= displacement * factor
    assert pressure / factor <= estimate["pressure"]["interface"] <= pressure * factor


def test_the_over_refined_pressure_is_that_of_finite_elements(hertz: Truth) -> None:
    contact = hertz.data.contacts["interface"]
    along = np.argsort(contact.points[:, 0])
    found = Profile(contact.points[along, 0], contact.pressure[-1][along])
    # 0.10 % where the master took its pressures from the slave's closest points.
    assert difference(found, read_profile(REFERENCE / "hertz.csv", "pressure")) <= 5e-4


def test_a_coarse_hertz_case_refined(tmp_path: Path, hertz: Truth) -> None:
    # Five nodes over the half-width, and no hint where the contact ends.
    even = "[{at=[0.0, 0.0], spacing=0.01, radius=0.1}]"
    coarse = [f"body.{body}.refine={even}" for body in ("cylinder", "block")]
    summary, data = solve("hertz", tmp_path / "run", EXACT, *coarse, "mls.degree=4", "adapt.passes=2")
    assert summary["nodes"] <= 7000
    # Over eight seeds 1.1e-3 to 1.8e-3, and estimates that fall by 2.8 to 10 and by 2.2 to 17; on clouds that
    # are not symmetric 1.2e-3 to 1.7e-3, by 4.4 to 8.3 and by 3.5 to 7.3.
    assert hertz.errors(data)[1] <= 2e-3
    estimates = [one["error_estimate"]["pressure"]["interface"] for one in summary["adapt"]]
    assert estimates[0] > 2.5 * estimates[1] > 5.0 * estimates[2]


def scaled(scale: float) -> list[str]:
    settings = []
    for body in ("cylinder", "block"):
        for number, spacing in enumerate((0.004, 0.0005, 0.0005)):
            settings.append(f"body.{body}.refine.{number}.spacing={scale * spacing!r}")
            settings.append(f"body.{body}.refine.{number}.growth={min(0.25, 0.12 * scale**0.5)!r}")
    return settings


@pytest.mark.parametrize(
    "overrides",
    [
        [EXACT],
        [],
        [EXACT, *scaled(2.0)],
        [EXACT, *scaled(0.7)],
        [EXACT, "mls.degree=4"],
        [EXACT, "mls.degree=4", *scaled(1.4)],
    ],
    ids=["published", "hyperbolic", "coarser", "finer", "degree 4", "coarser, degree 4"],
)
def test_hertz(tmp_path: Path, hertz: Truth, overrides: list[str]) -> None:
    factor = DEGREE_4 if "mls.degree=4" in overrides else FACTOR
    check(*solve("hertz", tmp_path / "run", *overrides), hertz, factor)


@pytest.mark.parametrize("spacing", [0.0024, 0.0008])
def test_two_cylinders(tmp_path: Path, cylinders: Truth, spacing: float) -> None:
    sizes = [f"body.{body}.refine.0.spacing={spacing!r}" for body in ("upper", "lower")]
    check(*solve("two_cylinders", tmp_path / "run", *sizes), cylinders, TWO_CYLINDERS)


@pytest.mark.parametrize(("degree", "spacing"), [(2, 0.1), (2, 0.025), (4, 0.14), (4, 0.05)])
def test_lame(tmp_path: Path, degree: int, spacing: float) -> None:
    sizes = (f"body.ring.spacing={spacing!r}", f"body.ring.refine.0.spacing={0.5 * spacing!r}")
    summary, data = solve("lame", tmp_path / "run", f"mls.degree={degree}", *sizes)
    points, found = data.bodies["ring"].points, data.states[-1].bodies["ring"]["displacement"]
    r = np.hypot(points[:, 0], points[:, 1])
    ring = LameRing(1.0, 2.0, 100.0, 210e3 / (1.0 - 0.3**2), 0.3 / 0.7)
    expected = points * (ring.displacement(r) / r)[:, None]
    error = norm(found - expected) / norm(expected)
    assert error / FACTOR <= summary["error_estimate"]["displacement"] <= error * FACTOR
    assert summary["error_estimate"]["pressure"] == {}


def test_an_exact_result_is_known_to_be_exact(tmp_path: Path) -> None:
    estimate = solve("patch", tmp_path / "run")[0]["error_estimate"]
    assert estimate["displacement"] <= 1e-11
    assert estimate["pressure"]["interface"] <= 1e-11


@pytest.mark.parametrize("degree", [1, 5, 6])
def test_no_figure_is_made_up_for_other_degrees(tmp_path: Path, degree: int) -> None:
    summary, _ = solve("lame", tmp_path / "run", f"mls.degree={degree}")
    assert summary["error_estimate"] == {"displacement": None, "pressure": {}}


def test_nearly_incompressible_bodies_have_no_estimate(tmp_path: Path) -> None:
    # It had been 22 times the displacement, where the error was 0.6 %.
    summary, _ = solve("lame", tmp_path / "run", "mls.degree=2", "material.steel.nu=0.4999")
    assert summary["status"] == "done"
    assert summary["error_estimate"] == {"displacement": None, "pressure": {}}
