"""check, info, plot and warmup on small scenes, and what they say of runs that went wrong."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import h5py
import meshio
import numpy as np
import pytest

from mlsanm_cli.app.check import check
from mlsanm_cli.app.checks import quality
from mlsanm_cli.app.results.choice import Choice
from mlsanm_cli.app.results.curves import pressure_picture
from mlsanm_cli.app.results.fields import bodies_picture
from mlsanm_cli.app.results.info import info
from mlsanm_cli.app.results.plot import plot
from mlsanm_cli.app.scene import build as estimate
from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.case import parse_case, stored_case
from mlsanm_cli.cli import main
from mlsanm_cli.errors import CaseError, RunError
from mlsanm_cli.io.run_reader import Dataset, SavedState, read_run
from tests.app.runs import events_of, summary_of
from tests.app.scenes import BAR, FAST, PATCH, Quiet, done, hertz, solve


def checked(directory: Path, text: str, *overrides: str, **more: Any) -> dict[str, Any]:
    """What `mlsanm check` finds; more warnings are told on a console that is given."""
    case = directory / "case.toml"
    case.write_text(text)
    return dict(check(case, overrides=overrides, **{"console": Quiet(), **more}))


def test_check_agrees_with_the_run(tmp_path: Path) -> None:
    console = Quiet()
    found = checked(tmp_path, hertz(), console=console)
    # A grid is found by the run.
    assert found["contact_unknowns"] is None
    assert any("use a contact grid" in note for note in found["notes"])
    assert 0.0 <= found["contacts"]["interface"]["smallest_gap"] <= 2e-5
    assert found["bodies"]["block"]["finest"] == 0.25
    assert found["boundaries"]["cylinder.flat"] == {"x": "free", "y": "force -226 (press)"}
    assert found["boundaries"]["block.bottom"] == {"x": "free", "y": "held"}
    assert found["boundaries"]["cylinder.arc"]["x"] == "slave of interface"
    assert found["warnings"] == console.warnings == []
    assert [path.name for path in tmp_path.iterdir()] == ["case.toml"]
    summary = done(hertz(), tmp_path / "run")
    for key in ("nodes", "unknowns"):
        assert found[key] == summary[key]
    for name, body in summary["quality"]["bodies"].items():
        assert found["bodies"][name]["hole"] == body["hole"]


def test_estimates_grow_with_the_scene(tmp_path: Path) -> None:
    small = checked(tmp_path, BAR, "mls.degree=2")
    fine = checked(tmp_path, BAR, "body.bar.spacing=0.02", "mls.degree=2")
    high = checked(tmp_path, BAR, "body.bar.spacing=0.02", "mls.degree=4")
    for key in ("estimated_cpu_seconds", "estimated_memory_mb"):
        assert 0.0 < small[key] < fine[key] < high[key]
    assert small["contacts"] == {}
    assert small["boundaries"]["bar.right"]["x"] == "traction 30 (pull)"


def test_check_writes_the_model(tmp_path: Path) -> None:
    model = tmp_path / "model.vtu"
    found = checked(tmp_path, hertz(), write=model)
    mesh = meshio.read(model)
    data = mesh.point_data
    assert len(mesh.points) == found["nodes"]
    cylinder = data["body"] == 0
    assert cylinder.sum() == found["bodies"]["cylinder"]["nodes"]
    normal = np.hypot(*data["normal"][:, :2].T)
    assert normal[data["boundary_tag"] > 0] == pytest.approx(1.0)
    assert not normal[data["boundary_tag"] == 0].any()
    flat = cylinder & (data["boundary_tag"] > 0) & (mesh.points[:, 1] > 0.99)
    assert data["normal"][flat][:, 1] == pytest.approx(1.0)
    paired = np.hypot(*data["partner"][:, :2].T) > 0.0
    assert not (paired & ~cylinder).any()
    assert paired.sum() >= found["contacts"]["interface"]["candidates"] - 1
    assert (mesh.points + data["partner"])[paired][:, 1] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.usefixtures("alone")
@pytest.mark.parametrize(
    ("spacing", "nodal", "warned", "noted"),
    [(0.08, True, 1, 0), (0.125, True, 0, 1), (0.2, True, 0, 0), (0.08, False, 0, 0)],
)
def test_unequal_spacings_at_nodal_contacts_are_told(
    spacing: float, nodal: bool, warned: int, noted: int, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    if nodal:
        request.getfixturevalue("by_nodes")
    found = checked(tmp_path, PATCH, f"body.upper.spacing={spacing}")
    told = [len([text for text in found[kind] if "factor of" in text]) for kind in ("warnings", "notes")]
    assert told == [warned, noted]
    if nodal:
        assert found["contacts"]["interface"]["spacing_ratio"] == pytest.approx(0.2 / spacing, rel=0.02)


@pytest.mark.usefixtures("by_nodes")
def test_stiff_slaves_and_degree_one_are_warned_of(tmp_path: Path) -> None:
    text = PATCH.material("soft", E=1e3, nu=0.3)
    soft = 'body.lower.material="soft"'
    found = checked(tmp_path, text, soft, "mls.degree=1")
    assert [text for text in found["warnings"] if "times stiffer than the master" in text]
    assert [text for text in found["warnings"] if "for comparisons only" in text]
    swapped = ("contact.interface.slave=lower.top", "contact.interface.master=upper.bottom")
    found = checked(tmp_path, text, soft, *swapped)
    assert not [text for text in found["warnings"] if "stiffer" in text]


def test_poor_clouds_are_warned_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the run's events and summary too, with the key to change."""

    def measure(cloud: Any) -> dict[str, float]:
        counts = {"nodes": len(cloud.points), "boundary_nodes": 10}
        return {**counts, "closest": 0.49, "hole": 1.61, "growth": 0.31}

    monkeypatch.setattr(quality, "measure", measure)
    summary = solve(BAR, tmp_path / "bar")
    told = " ".join(summary["warnings"])
    assert len(summary["warnings"]) == 3
    for part in ("0.49 of the local spacing", "1.61 spacings", "0.31 per unit length", "body.bar.spacing"):
        assert part in told
    assert [one["message"] for one in events_of(tmp_path / "bar", "warning")] == summary["warnings"]
    assert summary["quality"]["bodies"]["bar"]["hole"] == 1.61


def test_info_of_a_run_with_and_without_summary(hertz_run: Path, tmp_path: Path) -> None:
    """A kill leaves a run without one, and with status running."""
    found, summary = info(hertz_run), summary_of(hertz_run)
    assert {key: found[key] for key in summary} == summary
    assert {"threads", "versions", "case_hash", "host"} <= found["provenance"].keys()
    killed = tmp_path / "killed"
    shutil.copytree(hertz_run, killed)
    (killed / "summary.json").unlink()
    with h5py.File(killed / "run.h5", "r+") as file:
        file.attrs["status"] = "running"
    found = info(killed)
    assert found["status"] == "running"
    assert "killed" in found["stop_reason"]
    for key in ("steps", "position", "nodes", "solves", "factorizations"):
        assert found[key] == summary[key]
    contact = found["contacts"]["interface"]
    for key in ("peak_pressure", "half_width", "min_gap"):
        assert contact[key] == summary["contacts"]["interface"][key]
    assert len(plot(killed, choice=Choice(("pressure",)))) == 1


def test_plot_draws_what_there_is(bar_run: Path, punches_run: Path, tmp_path: Path) -> None:
    common = {"plot_force.png", "plot_peak.png", "plot_bodies.png"}
    under = {"plot_pressure_under-left.png", "plot_pressure_under-right.png"}
    assert {f.name for f in plot(punches_run)} == common | under
    files = plot(bar_run, formats=("svg",))
    assert {f.name for f in files} == {"plot_force.svg", "plot_bodies.svg"}
    assert all(file.stat().st_size > 2000 for file in files)
    for fields, drawn in (('["stress"]', {"plot_bodies.png"}), ("[]", set())):
        solve(BAR, tmp_path / "bar", f"output.fields={fields}", "output.vtu=false")
        assert {file.name for file in plot(tmp_path / "bar")} == {"plot_force.png"} | drawn
        shutil.rmtree(tmp_path / "bar")


def test_pressure_picture(hertz_run: Path) -> None:
    """Saved levels from the series, coordinates from the middle, Hertz' formula for the last level."""
    run = read_run(hertz_run)
    upper, lower = pressure_picture(run, stored_case(run.case_resolved), "interface", Choice()).panels
    *levels, formula = upper.curves
    assert [curve.label for curve in levels] == ["position 0.3", "position 0.7", "position 1"]
    assert levels[0].x == pytest.approx(-levels[0].x[::-1], abs=1e-6)
    weight = run.contacts["interface"].weight
    # Nodes without pressure far from the contact are not shown.
    hidden = (len(weight) - len(levels[0].x)) // 2
    weight = weight[hidden : len(weight) - hidden]
    # The force of each level is the load's, although 0.3 and 0.7 lie inside steps.
    forces = [curve.y @ weight for curve in levels]
    assert forces == pytest.approx([0.3 * 226.0, 0.7 * 226.0, 226.0], rel=2e-3)
    summary = summary_of(hertz_run)["contacts"]["interface"]["reference"]
    # By the sum of the pressures times their weights; the summary's is by their integral.
    assert formula.y.max() == pytest.approx(summary["peak_pressure"], rel=2e-5)
    loaded = formula.x[formula.y > 0.0]
    assert 0.5 * np.ptp(loaded) == pytest.approx(summary["half_width"], rel=0.02)
    difference = 100.0 * (levels[-1].y - np.interp(levels[-1].x, formula.x, formula.y)) / formula.y.max()
    assert lower.curves[-1].y == pytest.approx(difference)


def test_colour_of_the_bodies(bar_run: Path) -> None:
    """Von Mises is made from stored stresses where it was not stored itself."""
    run = read_run(bar_run)
    case, state = stored_case(run.case_resolved), run.states[-1]
    (body,) = bodies_picture(run, case, state, None).bodies
    stress = Dataset({"bar": {"stress": state.bodies["bar"].stress}})
    picture = bodies_picture(run, case, SavedState(state.position, stress), None)
    assert picture.label == "von Mises stress"
    assert picture.bodies[0].scalar == pytest.approx(body.scalar)
    assert body.scalar == pytest.approx(np.sqrt(30.0**2 + 40.0**2 + 1200.0))
    moved = Dataset({"bar": {"displacement": state.bodies["bar"].displacement}})
    picture = bodies_picture(run, case, SavedState(state.position, moved), None)
    assert picture.label == "displacement"
    assert picture.bodies[0].scalar.max() == np.hypot(*state.bodies["bar"].displacement.T).max()


def test_a_failed_run_keeps_what_it_has(
    tmp_path: Path, afterwards: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    afterwards.chdir(tmp_path)
    Path("case.toml").write_text(hertz())
    wanted = ("--set", "solver.max_steps=4", "--set", "solver.method=anm")
    assert main(["run", "case.toml", *wanted, "--json"]) == 3
    out, err = capsys.readouterr()
    summary = json.loads(out)
    assert summary["status"] == "failed"
    assert "max steps" in summary["stop_reason"]
    assert "solver.max_steps" in err
    assert summary["hint"] == "raise solver.max_steps"
    directory = tmp_path / "results" / "case"
    assert summary["directory"] == "results/case"
    run = read_run(directory)
    assert run.status == "failed"
    assert run.rows == 5
    assert info(directory)["position"] == run.path.position[-1]
    assert {f.name for f in plot(directory)} >= {"plot_pressure_interface.png", "plot_force.png"}


def test_a_run_that_fails_before_its_first_state(tmp_path: Path) -> None:
    """A platen pulled away from the other body: nothing balances it."""
    summary = solve(hertz(), tmp_path / "pulled", "load.press.fy=226.0")
    assert summary["status"] == "failed"
    assert summary["steps"] == 0
    assert info(tmp_path / "pulled")["status"] == "failed"
    with pytest.raises(RunError, match="no finished step"):
        plot(tmp_path / "pulled")


def test_json_on_stdout(tmp_path: Path, capsys: pytest.CaptureFixture[str], bar_run: Path) -> None:
    case, model = tmp_path / "case.toml", tmp_path / "model.vtu"
    case.write_text(BAR)

    def told(*arguments: str) -> dict[str, Any]:
        assert main([*arguments, "--json"]) == 0
        return dict(json.loads(capsys.readouterr().out))

    assert told("check", str(case), "--write", str(model))["nodes"] > 0
    assert model.is_file()
    files = told("plot", str(bar_run), "--format", "svg", "--format", "svg")["files"]
    assert [Path(file).name for file in files] == ["plot_force.svg", "plot_bodies.svg"]
    assert told("info", str(bar_run))["status"] == "done"
    told("warmup")
    found = told("warmup")
    assert 0.0 <= found["seconds"] < 1.0
    assert found["compiled"] is False
    assert found["kept"] == (found["cache_directory"] is not None)


def test_memory_is_that_of_the_solver(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fine = "body.bar.spacing=0.001"
    cases = [
        parse_case(BAR, Path("case.toml"), (f"solver.linear={kind}", fine)).case
        for kind in ("auto", "superlu")
    ]
    boundaries = list(map(Boundaries.of, cases))
    ours, other = (estimate.memory_mb(one.case, estimate.node_counts(one)) for one in boundaries)
    assert ours < other
    monkeypatch.setattr(estimate, "physical_memory_mb", lambda: 0.5 * (ours + other))
    estimate.refuse_too_large(boundaries[0])
    with pytest.raises(CaseError, match="GB of memory") as caught:
        estimate.refuse_too_large(boundaries[1])
    assert caught.value.problems[0].key == "body.bar.spacing"


@pytest.mark.usefixtures("monkeypatch")  # grids must not begin with those of other tests
def test_results_do_not_depend_on_who_factorises(tmp_path: Path) -> None:
    one = done(hertz(), tmp_path / "other", FAST, "solver.linear=superlu")
    other = done(hertz(), tmp_path / "usual", FAST)
    assert one["linear_residual"] <= 1e-7
    assert one["warnings"] == other["warnings"]
    for key in ("peak_pressure", "half_width"):
        assert one["contacts"]["interface"][key] == pytest.approx(
            other["contacts"]["interface"][key], rel=1e-6
        )
