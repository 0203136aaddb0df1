"""Polished levels are those of the exact laws, and the run tells what that changed."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from mlsanm_cli.app.checks.verdicts import POLISH_WARNING, check_polish
from mlsanm_cli.app.results.path_lookup import pressures_at
from mlsanm_cli.errors import CaseError
from mlsanm_cli.io.run_reader import read_run
from mlsanm_cli.io.summary import read_json
from mlsanm_cli.solve.state import Polish
from tests.app.scenes import BAR, EXACT_LAW, FAST, HOLONOMIC, NODAL, PATCH, SHEARED, Quiet, hertz, solve

POLISH, SMOOTH = "solver.polish=true", "solver.polish=false"
COARSE = "contact.interface.regularization.eta=1e-3"
FIELDS = ("displacement", "stress", "von_mises")


@pytest.mark.usefixtures("alone")
@pytest.mark.parametrize(
    ("text", "levels"), [(hertz(), "output.at=[0.3, 0.7]"), (SHEARED, "output.at=[1.0, 1.5, 2.25]")]
)
def test_polished_levels_are_exact(text: str, levels: str, tmp_path: Path) -> None:
    rough = ["contact.interface.accuracy=0.02"] if "friction" in text else [FAST]
    solve(text, tmp_path / "smooth", levels, COARSE, SMOOTH, *rough)
    polished = solve(text, tmp_path / "polished", levels, COARSE, POLISH, *rough)
    # The exact law of friction is given grids five times as fine.
    exact_law = solve(text, tmp_path / "exact", levels, EXACT_LAW, FAST)
    if "friction" in text:
        assert polished["polish"]["factorizations"] == exact_law["factorizations"]
    runs = {name: read_run(tmp_path / name) for name in ("smooth", "polished", "exact")}
    contacts = {name: run.contacts["interface"] for name, run in runs.items()}
    places = [*(saved.position for saved in runs["exact"].states), runs["exact"].path.position[-1]]
    peak = contacts["exact"].pressure.max()
    for position in places:
        row = {name: np.flatnonzero(run.path.position == position) for name, run in runs.items()}
        for quantity in ("pressure", "traction"):
            exact = getattr(contacts["exact"], quantity)[row["exact"][0]]
            found = getattr(contacts["polished"], quantity)[row["polished"][0]]
            assert np.abs(found - exact).max() <= 1e-9 * peak, (quantity, position)
        smooth = pressures_at(runs["smooth"], position)["interface"]
        change = np.abs(contacts["exact"].pressure[row["exact"][0]] - smooth).max()
        assert change > 1e-3 * peak
    with h5py.File(tmp_path / "polished/run.h5") as a, h5py.File(tmp_path / "exact/run.h5") as b:
        for number in range(len(places) - 1):
            for name in FIELDS:
                found, exact = (
                    a[f"fields/{number}/block/{name}"][...],
                    b[f"fields/{number}/block/{name}"][...],
                )
                assert np.abs(found - exact).max() <= 1e-9 * np.abs(exact).max()


def test_what_polishing_changed_is_told(tmp_path: Path) -> None:
    solve(NODAL, tmp_path / "smooth", "output.at=[0.3, 1.0]", COARSE, SMOOTH)
    summary = solve(NODAL, tmp_path / "polished", "output.at=[0.3, 1.0]", COARSE, POLISH)
    smooth, polished = read_run(tmp_path / "smooth"), read_run(tmp_path / "polished")
    peak = summary["contacts"]["interface"]["peak_pressure"]
    changes = [
        np.abs(pressures_at(smooth, p)["interface"] - pressures_at(polished, p)["interface"]).max() / peak
        for p in (0.3, 1.0)
    ]
    told = summary["polish"]
    assert (told["levels"], told["traction"]) == (2, 0.0)
    assert told["pressure"] == pytest.approx(max(changes), rel=1e-6)
    assert told["factorizations"] <= 6
    assert summary["factorizations"] >= read_json(tmp_path / "smooth/summary.json")["factorizations"] + 2
    # Between the levels the smooth path is what it was, its series still at hand.
    for position in (0.29, 0.31, 0.9):
        before, after = (pressures_at(run, position)["interface"] for run in (smooth, polished))
        assert after == pytest.approx(before, abs=1e-12 * peak)


def test_a_large_change_is_warned_of(tmp_path: Path) -> None:
    console = Quiet()
    eta = "contact.interface.regularization.eta=0.03"
    summary = solve(hertz(), tmp_path / "soft", eta, POLISH, console=console)
    assert summary["polish"]["pressure"] > POLISH_WARNING
    assert any("lower contact.regularization.eta" in warning for warning in console.warnings)
    assert check_polish([Polish(0.0, 0.0, 1, 0.9 * POLISH_WARNING)]) == check_polish([]) == ""
    assert check_polish([Polish(0.0, 0.0, 1, 1.1 * POLISH_WARNING)])


def test_friction_without_memory_is_polished_without_memory(tmp_path: Path) -> None:
    once = ("stage=[{press=1.0},{shear=1.0}]", "output.at=[1.0, 1.5, 2.0]", HOLONOMIC, POLISH)
    changes = []
    for size in (1e-3, 1e-4):
        regular = [f"contact.interface.regularization.{key}={size}" for key in ("eta", "stick")]
        told = solve(SHEARED, tmp_path / f"s{size}", *once, *regular)["polish"]
        changes.append(max(told["pressure"], told["traction"]))
    assert changes[1] < 0.25 * changes[0]
    contact = read_run(tmp_path / "s0.0001").contacts["interface"]
    p, t, s, status = contact.pressure[-1], contact.traction[-1], contact.slip[-1], contact.status[-1]
    peak = p.max()
    assert (p >= 0.0).all()
    assert (np.abs(t) <= 0.4 * p + 1e-9 * peak).all()
    assert np.abs(s[status == 1]).max() == 0.0
    slides = status == 2
    assert slides.any()
    assert (t[slides] * s[slides] <= 1e-9 * peak * np.abs(s).max()).all()
    assert np.abs(np.abs(t[slides]) - 0.4 * p[slides]).max() <= 1e-9 * peak


def test_a_level_the_exact_laws_cannot_carry_ends_the_run(tmp_path: Path) -> None:
    summary = solve(SHEARED, tmp_path / "slides", POLISH, "load.shear.fx=180.0")
    assert summary["status"] == "failed"
    assert "slides as a whole" in summary["stop_reason"]


@pytest.mark.parametrize("text", [PATCH, BAR])
def test_nothing_to_polish(text: str, tmp_path: Path) -> None:
    with pytest.raises(CaseError, match=r"solver\.polish: nothing to polish"):
        solve(text, tmp_path / "refused", POLISH)
