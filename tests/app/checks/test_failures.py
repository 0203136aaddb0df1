"""A run whose numbers are wrong never ends as done, whichever it is; and it tells where it is worst."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

from mlsanm_cli.app.analysis import small_strain
from mlsanm_cli.app.checks import end
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.linear_map import LinearMap
from mlsanm_cli.io.summary import read_json
from mlsanm_cli.solve import coercivity as certificate
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.fields import fields_of
from mlsanm_cli.solve.paths import path_of
from mlsanm_cli.solve.state import Checkpoint, PathStep, State
from tests.app.runs import events_of
from tests.app.scenes import ANM, BAR, EXACT_LAW, FAST, NODAL, PATCH, SHEARED, hertz, solve

BAD = [1e3, float("nan")]
ONCE = ("stage=[{press=1.0}, {shear=1.0}]", "output.at=[2.0]")
"""Nothing turns back, which would only take longer."""
Change = Callable[[State], State]


def altered(change: Change, saved: bool) -> Callable[[CondensedScene, Checkpoint | None], Iterator[PathStep]]:
    """A path whose last state, or last saved state, is another."""

    def path(built: CondensedScene, start: Checkpoint | None) -> Iterator[PathStep]:
        end = float(len(built.case.stage))
        for step in path_of(built, start):
            if step.state.position < end:
                yield step
            elif saved:
                yield replace(step, saved=tuple(map(change, step.saved)))
            else:
                yield replace(step, state=change(step.state))

    return path


def assert_failed(summary: Mapping[str, Any], words: str) -> None:
    assert (summary["status"], words in summary["stop_reason"]) == ("failed", True), summary["stop_reason"]


@pytest.mark.usefixtures("by_nodes")
@pytest.mark.parametrize("saved", [False, True])
@pytest.mark.parametrize("bad", BAD)
def test_a_residual(bad: float, saved: bool, tmp_path: Path, afterwards: pytest.MonkeyPatch) -> None:
    path = altered(lambda state: replace(state, residual=bad), saved)
    afterwards.setattr(small_strain, "path_of", path)
    summary = solve(PATCH, tmp_path / "run")
    assert_failed(summary, "residual")
    assert summary["hint"]


@pytest.mark.parametrize("name", ["pressure", "gap", "motion", "traction"])
def test_a_number_that_is_none(name: str, tmp_path: Path, afterwards: pytest.MonkeyPatch) -> None:
    path = altered(lambda state: replace(state, **{name: getattr(state, name) * np.nan}), False)
    afterwards.setattr(small_strain, "path_of", path)
    summary = solve(SHEARED, tmp_path / "run", EXACT_LAW, *ONCE)
    assert_failed(summary, "not finite")
    assert len(summary["failure"]["worst_nodes"]) == 10


def test_a_traction_beyond_its_limit(tmp_path: Path, afterwards: pytest.MonkeyPatch) -> None:
    path = altered(lambda state: replace(state, traction=1.2 * state.traction), False)
    afterwards.setattr(small_strain, "path_of", path)
    summary = solve(SHEARED, tmp_path / "run", EXACT_LAW, *ONCE)
    assert_failed(summary, "friction limit")
    nodes = summary["failure"]["worst_nodes"]
    assert max(node["cone_ratio"] for node in nodes) == pytest.approx(1.2)
    assert [node["residual"] for node in nodes] == sorted((node["residual"] for node in nodes), reverse=True)


@pytest.mark.usefixtures("by_nodes")
@pytest.mark.parametrize("bad", [0.0, float("nan")])
@pytest.mark.parametrize(("text", "name"), [(PATCH, "contact_stability"), (BAR, "bulk_stability")])
def test_a_certificate(
    text: str, name: str, bad: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(certificate, name, lambda *arguments: bad)
    assert_failed(solve(text, tmp_path / "run"), "stability")
    # Nothing was solved: the model is shown.
    mesh = meshio.read(tmp_path / "run" / "failure.vtu")
    assert {"normal", "partner", "spacing"} <= mesh.point_data.keys()


@pytest.mark.usefixtures("by_nodes")
def test_a_search_for_contact_without_end_tells_of_the_certificate(tmp_path: Path) -> None:
    # It had pointed at a figure of `mlsanm check`, which has none.
    zones = [(0.0, 0.032, 0.07), (-0.05, 0.004, 0.004), (0.05, 0.004, 0.004)]
    refine = ", ".join(f"{{at=[{x}, 0.0], spacing={h}, radius={r}}}" for x, h, r in zones)
    coarse = [f"body.{body}.refine=[{refine}]" for body in ("cylinder", "block")]
    summary = solve(hertz(), tmp_path / "run", "mls.degree=6", "body.*.spacing=0.8", *coarse)
    assert_failed(summary, "stability")
    assert summary["hint"].startswith("use mls.degree = 2")
    assert summary["stability"] < -1.0


@pytest.mark.usefixtures("by_nodes")
@pytest.mark.parametrize("bad", BAD)
def test_a_force_balance(bad: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = LinearMap.__call__

    def call(self: LinearMap, *state: Any) -> Any:
        values = kept(self, *state)
        # The imbalance alone has two rows for each of the two bodies.
        return values + np.array([0.0, 0.0, 0.0, bad]) if len(values) == 4 else values

    monkeypatch.setattr(LinearMap, "__call__", call)
    assert_failed(solve(PATCH, tmp_path / "run"), "force imbalance on body lower")


@pytest.mark.usefixtures("by_nodes")
@pytest.mark.parametrize("bad", [[1e3], [float("nan")], [float("nan"), 1e-12]])
@pytest.mark.parametrize("fields", ["[]", '["displacement"]'])
def test_a_linear_residual_of_any_state(
    bad: list[float], fields: str, tmp_path: Path, afterwards: pytest.MonkeyPatch
) -> None:
    kept, values = fields_of, iter(bad)

    def found(*arguments: Any, **options: Any) -> Any:
        return [(fields, next(values, bad[-1])) for fields, _ in kept(*arguments, **options)]

    afterwards.setattr(small_strain, "fields_of", found)
    summary = solve(PATCH, tmp_path / "run", f"output.fields={fields}", "output.at=[0.5, 1.0]")
    assert_failed(summary, "linear-solver error")


@pytest.mark.usefixtures("by_nodes")
def test_a_linear_residual_of_one_body(tmp_path: Path, afterwards: pytest.MonkeyPatch) -> None:
    kept = Condensed.checked_displacements

    def displacement(self: Condensed, scene: Any, name: str, *state: Any) -> Any:
        found, residual = kept(self, scene, name, *state)
        return found, np.full_like(residual, np.nan) if name == "upper" else residual

    afterwards.setattr(Condensed, "checked_displacements", displacement)
    assert_failed(solve(PATCH, tmp_path / "body"), "linear-solver error")


@pytest.mark.usefixtures("by_nodes")
@pytest.mark.parametrize("bad", [9.0, float("nan")])
def test_a_ratio_of_spacings(bad: float, tmp_path: Path, afterwards: pytest.MonkeyPatch) -> None:
    afterwards.setattr(end, "spacing_ratio", lambda *arguments: bad)
    assert_failed(solve(PATCH, tmp_path / "run"), "spacings")


@pytest.mark.parametrize("text", [hertz(), NODAL])
def test_slave_and_master_feel_the_same(tmp_path: Path, text: str) -> None:
    summary = solve(text, tmp_path / "run", EXACT_LAW)
    assert 0.0 <= summary["contacts"]["interface"]["force_mismatch"] <= 1e-6
    assert summary["limits"]["force_mismatch"] == 0.1


@pytest.mark.parametrize(
    ("lost", "status", "warned"), [(0.02, "done", 0), (0.04, "done", 1), (0.2, "failed", 0)]
)
def test_a_contact_that_loses_force_is_told(
    tmp_path: Path, afterwards: pytest.MonkeyPatch, lost: float, status: str, warned: int
) -> None:
    afterwards.setattr(end, "force_mismatch", lambda built, state: {"interface": lost})
    summary = solve(hertz(), tmp_path / "run", EXACT_LAW, FAST)
    message = f"the forces on slave and master differ by {100.0 * lost:.2g} %"
    assert summary["status"] == status
    assert sum(message in text for text in summary["warnings"]) == warned
    assert (message in summary["stop_reason"]) == (status == "failed")


def test_what_a_failed_path_leaves(tmp_path: Path) -> None:
    summary = solve(NODAL, tmp_path / "run", ANM, "solver.max_steps=9")
    assert summary["status"] == "failed"
    failure = read_json(tmp_path / "run" / "summary.json")["failure"]
    assert failure["position"] == summary["position"] > 0.0
    mesh = meshio.read(tmp_path / "run" / "failure.vtu")
    data = mesh.point_data
    assert {"displacement", "stress", "residual", "gap", "pressure", "cone_ratio", "worst"} <= data.keys()
    table = np.genfromtxt(tmp_path / "run" / "interface.csv", delimiter=",", names=True)
    told = np.flatnonzero(np.isfinite(data["gap"]))
    assert sorted(data["gap"][told]) == pytest.approx(sorted(table["gap"]))
    assert np.isnan(data["cone_ratio"]).all()
    ranked = np.argsort(-data["worst"])[:10][::-1]
    assert data["worst"][ranked].tolist() == list(range(1, 11))
    for node, row in zip(ranked, failure["worst_nodes"], strict=True):
        assert mesh.points[node, :2] == pytest.approx([row["x"], row["y"]])
        assert data["residual"][node] == pytest.approx(row["residual"])
        assert row["contact"] == "interface"
    # The smooth law is furthest from the exact one where nodes are about to touch.
    assert np.abs(mesh.points[ranked[0], 0]) > 0.5 * np.abs(table["x"][table["pressure"] > 1.0]).max()
    event, end = events_of(tmp_path / "run")[-2:]
    assert event == {"event": "failure", "reason": summary["stop_reason"], "hint": summary["hint"], **failure}
    assert end["event"] == "end"
