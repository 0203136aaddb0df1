"""Paths by Newton-Raphson: the same states as by power series, stored for what they are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from mlsanm_cli.app.results.path_lookup import INTERPOLATED, level_at, pressures_at
from mlsanm_cli.io.run_reader import read_run
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.paths import path_of
from mlsanm_cli.solve.state import State
from tests.app.scenes import ANM, NODAL, built_of, hertz, solve
from tests.app.test_friction import HOLONOMIC, SHEARED

NEWTON = 'solver.method="newton"'
SMOOTH = 'contact.interface.regularization.law="hyperbolic"'
CASES = Path(__file__).parents[2] / "cases"


def saved(built: CondensedScene, **solver: Any) -> list[State]:
    """The wanted states by another method or tolerance; no step exceeds the tolerance."""
    settings = built.case.solver.model_copy(update=solver)
    steps = list(path_of(replace(built, case=built.case.model_copy(update={"solver": settings}))))
    assert max(step.state.residual for step in steps) <= settings.tolerance
    return [state for step in steps for state in step.saved]


COARSE = "contact.interface.accuracy=0.03"


@pytest.mark.parametrize(
    ("case", "at", "settings"),
    [
        ("hertz", [0.3, 0.7, 1.0], [COARSE]),
        ("block_slide", [0.5, 1.0, 1.5, 2.0, 2.5, 3.0], ["contact.*.accuracy=0.1"]),
        ("cattaneo_mindlin", [0.5, 1.0, 1.5, 2.0, 3.0, 4.0], [COARSE]),
    ],
)
def test_published_cases_as_by_series(case: str, at: list[float], settings: list[str]) -> None:
    built = built_of(CASES / f"{case}.toml", SMOOTH, f"output.at={at}", *settings)
    # Inside a step a series is as good as its residual, times what the contact makes of that.
    series = saved(built, method="anm", tolerance=1e-10)
    newton = saved(built, method="newton")
    assert [state.position for state in newton] == [state.position for state in series] == at
    for one, other in zip(series, newton, strict=True):
        peak = one.pressure.max()
        assert np.abs(one.pressure - other.pressure).max() <= 1e-7 * peak
        assert np.abs(one.traction - other.traction).max(initial=0.0) <= 1e-7 * peak
        assert (one.status == other.status).all()
        # Dissipation is summed by trapezoids over the steps, which differ.
        assert np.abs(one.work - other.work).max(initial=0.0) <= 1e-3 * one.work.max(initial=1.0)


def test_friction_without_memory(tmp_path: Path) -> None:
    case = tmp_path / "case.toml"
    case.write_text(SHEARED)
    once = [HOLONOMIC, "stage=[{press=1.0},{shear=1.0}]", "output.at=[1.0, 1.4, 2.0]"]
    built = built_of(case, *once)
    series, newton = (saved(built, method=method, tolerance=1e-9) for method in ("anm", "newton"))
    for one, other in zip(series, newton, strict=True):
        assert np.abs(one.pressure - other.pressure).max() <= 1e-7 * one.pressure.max()
        assert np.abs(one.traction - other.traction).max() <= 1e-7 * one.pressure.max()


def test_what_is_stored(tmp_path: Path) -> None:
    solve(NODAL, tmp_path / "series", "output.at=[0.3, 0.7, 1.0]", ANM)
    summary = solve(NODAL, tmp_path / "run", "output.at=[0.3, 0.7, 1.0]", NEWTON)
    assert summary["status"] == "done"
    assert 0 < summary["steps"] < summary["iterations"] <= summary["factorizations"]
    assert summary["residual"] <= 1e-8
    run, other = read_run(tmp_path / "run"), read_run(tmp_path / "series")
    assert not run.path.order.any()
    assert (run.path.factorizations[1:] > 0).all()
    # A cubic between two states is a guess: it must not be taken for the path.
    with h5py.File(tmp_path / "run" / "run.h5", "r") as file:
        assert "series" not in file
    between = 0.5 * (run.path.position[1] + run.path.position[2])
    assert level_at(run, between).how == INTERPOLATED
    for position in (0.3, 0.7, 1.0):
        (found,), (expected,) = pressures_at(run, position).values(), pressures_at(other, position).values()
        assert np.abs(found - expected).max() <= 1e-6 * expected.max()
    assert [state.position for state in run.states] == [0.3, 0.7, 1.0]


def test_a_path_cut_short_says_so(tmp_path: Path) -> None:
    summary = solve(hertz(), tmp_path / "run", NEWTON, "solver.max_steps=3")
    assert (summary["status"], summary["steps"]) == ("failed", 3)
    assert "max steps" in summary["stop_reason"]
