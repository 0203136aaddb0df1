"""The Python interface: what docs/python.md promises."""

from __future__ import annotations

import csv
import inspect
import re
import shutil
import tomllib
import warnings
from pathlib import Path

import click
import numpy as np
import pytest

import mlsanm_cli as mlsanm
from mlsanm_cli import api
from mlsanm_cli.cli.commands import cli
from tests.app.scenes import BAR, hertz

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "python.md").read_text()


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("python") / "hertz.toml"
    path.write_text(hertz())
    return path


@pytest.fixture(scope="module")
def run(case: Path) -> mlsanm.Run:
    """By power series, on nodes that are fine at the contact."""
    fine = [{"at": [0.0, 0.0], "spacing": 0.02, "radius": 0.06, "growth": 0.2}]
    changes = {f"body.{body}.refine": fine for body in ("cylinder", "block")}
    smooth = {"solver.method": "anm", "contact.interface.regularization.eta": 1e-2}
    with warnings.catch_warnings():
        # Nodes are few.
        warnings.simplefilter("ignore", mlsanm.MlsanmWarning)
        return mlsanm.run(case, {**changes, **smooth, "output.at": [0.5, 1.0]}, out=case.parent / "run")


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, afterwards: pytest.MonkeyPatch) -> None:
    afterwards.chdir(tmp_path)


def test_every_example_of_the_page_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "cases").mkdir()
    shutil.copy(ROOT / "cases" / "hertz.toml", tmp_path / "cases")
    names: dict[str, object] = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL):
        exec(compile(block, "docs/python.md", "exec"), names)
    printed = capsys.readouterr().out
    assert "done 2886" in printed.splitlines()[0]
    assert "material.steel.nu" in printed
    assert (tmp_path / "block.png").is_file()
    assert len(list((tmp_path / "results" / "loads").glob("*/summary.json"))) == 2


def test_the_page_lists_every_function_with_its_arguments() -> None:
    for name in mlsanm._NAMES:
        assert f"`{name}" in PAGE or not inspect.isfunction(getattr(mlsanm, name)) or name == "overrides"
    for name in ("run", "check", "resume", "sweep"):
        arguments = ", ".join(inspect.signature(getattr(api, name)).parameters)
        assert f"`{name}({arguments})`" in PAGE
    for name, member in vars(mlsanm.Run).items():
        assert name.startswith("_") or f"{name}" in PAGE
        assert name.startswith("_") or inspect.getdoc(member)


def test_a_contact_is_known_anywhere_on_the_path(run: mlsanm.Run) -> None:
    stored, between = run.contact().at(), run.contact("interface").at(0.37)
    assert (stored.how, between.how) == ("stored", "series")
    assert stored.position == 1.0
    assert stored.traction is None
    assert stored.peak_pressure == run.summary["contacts"]["interface"]["peak_pressure"]
    np.testing.assert_allclose(stored.force, [0.0, 226.0], atol=226.0 * 1e-4)
    np.testing.assert_allclose(between.force[1], 0.37 * 226.0, rtol=1e-4)
    # Hertz: the peak goes with the root of the force, but for the softness of the law.
    assert between.peak_pressure == pytest.approx(stored.peak_pressure * 0.37**0.5, rel=0.1)
    np.testing.assert_allclose(run.force("press", at=0.5), [0.0, -113.0], atol=1e-9)


def test_columns_of_the_path_are_those_of_the_table(run: mlsanm.Run) -> None:
    head = next(csv.reader((run.directory / "path.csv").read_text().splitlines()))
    assert list(run.path) == head
    assert all(len(column) == run.data.rows for column in run.path.values())


def test_fields_fill_the_body_and_points_lie_between(run: mlsanm.Run) -> None:
    block = run.fields("block", at=0.5)
    assert block["stress"].shape == (len(block["points"]), 3)
    assert block["triangles"].max() == len(block["points"]) - 1
    nearest = np.hypot(*(block["points"] - [0.5, -1.0]).T).argmin()
    x, y = block["points"][nearest]
    there = run.point("block", x, y, at=0.5)
    assert there["uy"] == pytest.approx(block["displacement"][nearest, 1], rel=1e-3)
    with pytest.raises(mlsanm.RunError, match=r"saved at position 0\.5, 1, not at 0\.7"):
        run.fields("block", at=0.7)
    with pytest.raises(mlsanm.RunError, match="no body"):
        run.fields("blok")


def test_wrong_names_are_told_with_the_right_ones(run: mlsanm.Run, tmp_path: Path) -> None:
    with pytest.raises(mlsanm.RunError, match="no contact") as wrong:
        run.contact("nose")
    assert wrong.value.hint == "there are: interface"
    with pytest.raises(mlsanm.RunError, match="not a run"):
        mlsanm.open(tmp_path)
    with pytest.raises(AttributeError, match="no attribute 'solved'"):
        getattr(mlsanm, "solved")  # noqa: B009


def test_errors_are_those_of_the_commands(case: Path) -> None:
    with pytest.raises(mlsanm.CaseError) as wrong:
        mlsanm.run(case, {"solver.ordr": 15, "material.steel.nu": 0.7})
    assert {problem.key for problem in wrong.value.problems} == {"solver.ordr", "material.steel.nu"}
    with pytest.raises(mlsanm.RunError, match="5 is not the name of a file"):
        mlsanm.run(5)  # type: ignore[arg-type]
    with pytest.raises(mlsanm.RunError, match="already holds a run"):
        mlsanm.run(case, out=case.parent / "run")


def test_a_failed_and_a_stopped_run_raise_and_can_be_opened(tmp_path: Path) -> None:
    path = tmp_path / "press.toml"
    path.write_text(hertz())
    changes = {"contact.interface.accuracy": 0.1, "solver.max_steps": 1, "solver.method": "anm"}
    with pytest.raises(mlsanm.NumericalError, match=r"kept in results/press") as failed:
        mlsanm.run(path, changes)
    assert "solver.max_steps" in failed.value.hint
    assert failed.value.run.status == mlsanm.open("results/press").status == "failed"


def test_a_case_may_be_nested_dicts_and_a_run_is_shown_as_html(tmp_path: Path) -> None:
    bar = tomllib.loads(BAR)
    (tmp_path / "bar.toml").write_text(BAR)
    run, other = (
        mlsanm.run(bar, {"material.steel.nu": 0.2}),
        mlsanm.run("bar.toml", {"material.steel.nu": 0.2}),
    )
    assert run.case == other.case
    assert run.directory == Path("results/case")
    shown = run._repr_html_()
    assert "done" in shown
    assert "<table>" in shown
    with pytest.raises(mlsanm.CaseError, match="nodes"):
        mlsanm.check({**bar, "nodes": 7})


def test_stopped_runs_are_resumed() -> None:
    with pytest.raises(mlsanm.Interrupted, match="wall time"):
        mlsanm.run(tomllib.loads(BAR), max_wall=1e-9)
    whole = mlsanm.run(tomllib.loads(BAR), force=True)
    assert whole.status == "done"
    assert mlsanm.resume(whole.directory).status == "done"
    assert whole.probe is not None
    assert whole.contacts == ()
    np.testing.assert_allclose(whole.force("pull", at=0.25), [7.5, 0.0])


def test_warnings_are_pythons() -> None:
    with pytest.warns(mlsanm.MlsanmWarning, match="strain"):
        mlsanm.run(tomllib.loads(BAR), {"material.steel.E": 100.0})


def test_changes_are_written_as_toml() -> None:
    refine = [{"at": np.array([0.0, 0.5]), "spacing": np.float64(0.1)}]
    assert mlsanm.overrides({"a": True, "b": Path("x/y"), "body.block.refine": refine}) == (
        "a=true",
        'b="x/y"',
        "body.block.refine=[{ at = [0.0, 0.5], spacing = 0.1 }]",
    )
    with pytest.raises(TypeError, match="cannot hold"):
        mlsanm.overrides({"a": object()})


@pytest.mark.parametrize("name", ["run", "resume", "check", "sweep", "collect"])
def test_functions_have_the_options_of_the_commands(name: str) -> None:
    """Under the same names and with the same defaults; a resumed run has the threads of the first process."""
    command = cli.get_command(click.Context(cli), name)
    assert command is not None
    options = {one.name: one.to_info_dict()["default"] for one in command.params if one.name}
    names = {"changes": "overrides", "runs": "rundirs"}
    given = inspect.signature(getattr(mlsanm, name)).parameters
    for parameter in given.values():
        option = names.get(parameter.name, parameter.name)
        # Commands have options of the terminal instead.
        if option != "progress":
            assert option in options
            if parameter.default not in (None, parameter.empty):
                assert parameter.default == (options[option] or False) or (name, option) == (
                    "resume",
                    "threads",
                )
