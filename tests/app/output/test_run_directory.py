"""What a run leaves on disk: the files, their layout, and that they agree with each other."""

from __future__ import annotations

import csv
import tomllib
from pathlib import Path

import h5py
import meshio
import numpy as np
import pytest

from mlsanm_cli.app.run import run
from mlsanm_cli.case import load_case
from mlsanm_cli.io.run_reader import read_run
from mlsanm_cli.memo import Memo
from tests.app.runs import assert_same_results, events_of, stored, summary_of, undeclared
from tests.app.scenes import BAR, FAST, NODAL, Quiet, done, hertz, solve
from tests.case_text import pin


def numbers(directory: Path) -> dict[str, np.ndarray]:
    """Every numeric dataset of run.h5 but the times."""
    return {name: one for name, one in stored(directory).items() if np.asarray(one).dtype.kind in "fiu"}


@pytest.mark.parametrize("fixture", ["hertz_run", "series_run", "punches_run", "bar_run"])
def test_everything_written_is_in_the_schema(fixture: str, request: pytest.FixtureRequest) -> None:
    assert not undeclared(request.getfixturevalue(fixture))


def test_layout_of_the_run_file(hertz_run: Path, series_run: Path) -> None:
    with h5py.File(series_run / "run.h5", "r") as file:
        assert set(file["series"]) == {str(step) for step in range(1, summary_of(series_run)["steps"] + 1)}
    with h5py.File(hertz_run / "run.h5", "r") as file:
        assert file.attrs["format"] == 1
        assert file.attrs["status"] == "done"
        for name in ("mlsanm_version", "git", "argv", "case_hash", "versions", "cpu", "threads"):
            assert name in file.attrs
        assert file.attrs["case_hash"] == load_case(hertz_run / "resolved.toml").case_hash
        assert file["case/resolved"].asstr()[()] == (hertz_run / "resolved.toml").read_text()
        assert "Half-disk" in file["case/raw"].asstr()[()]
        assert set(file["path/resultants"]) >= {"press", "block.bottom"}
        assert (np.diff(file["contacts/interface/arc_length"][...]) > 0.0).all()
        assert file["fields/position"][...].tolist() == [0.3, 0.7, 1.0]


def test_vtu_files_hold_the_stored_fields(hertz_run: Path) -> None:
    with h5py.File(hertz_run / "run.h5", "r") as file:
        for number, (state, body) in enumerate((s, b) for s in range(3) for b in ("cylinder", "block")):
            mesh = meshio.read(hertz_run / f"fields_{number:04d}.vtu")
            stored = file[f"fields/{state}/{body}"]
            assert mesh.points[:, :2].tolist() == file[f"bodies/{body}/points"][...].tolist()
            found = {name: mesh.point_data[name] for name in ("displacement", "stress", "von_mises")}
            assert found["displacement"][:, :2].tolist() == stored["displacement"][...].tolist()
            xx, yy, xy, zz = found["stress"][:, [0, 4, 1, 8]].T
            assert np.stack([xx, yy, xy], axis=1).tolist() == stored["stress"][...].tolist()
            # Plane strain: the stress across the plane is nu times the trace in it.
            assert zz == pytest.approx(0.3 * (xx + yy), rel=1e-12, abs=1e-9)
            assert found["von_mises"].tolist() == stored["von_mises"][...].tolist()
            expected = np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3.0 * xy**2)
            assert found["von_mises"] == pytest.approx(expected, rel=1e-10, abs=1e-8)
    collection = (hertz_run / "fields.pvd").read_text()
    assert collection.count("<DataSet") == 6
    assert 'timestep="0.3"' in collection


def test_resolved_case_gives_the_same_results(hertz_run: Path, tmp_path: Path) -> None:
    again = tmp_path / "again"
    run(hertz_run / "resolved.toml", out=again, console=Quiet(), memo=Memo())
    assert_same_results(hertz_run, again)
    assert (again / "resolved.toml").read_text() == (hertz_run / "resolved.toml").read_text()
    # Nodes of one body are drawn by its own seed.
    short = ("body.block.seed=1", "solver.max_steps=1")
    run(hertz_run / "resolved.toml", overrides=short, out=tmp_path / "other", console=Quiet())
    one, other = numbers(hertz_run), numbers(tmp_path / "other")
    assert np.array_equal(other["bodies/cylinder/points"], one["bodies/cylinder/points"])
    assert not np.array_equal(other["bodies/block/points"], one["bodies/block/points"])


@pytest.mark.usefixtures("monkeypatch")  # grids must not begin with those of other tests
def test_units_do_not_matter(tmp_path: Path) -> None:
    """N and mm against N and m: lengths 1e-3, stresses 1e6.

    Round-off may cut the steps elsewhere, and inside a step the series holds to solver.tolerance only.
    """
    solve(hertz(), tmp_path / "mm", FAST, "output.at=[0.6, 1.0]")
    solve(hertz(length=1e-3, stress=1e6), tmp_path / "m", FAST, "output.at=[0.6, 1.0]")
    one, other = numbers(tmp_path / "mm"), numbers(tmp_path / "m")

    def compare(name: str, factor: float, row: int | slice = slice(None), bound: float = 1e-9) -> None:
        expected, found = one[name][row], other[name][row] / factor
        assert np.abs(found - expected).max() <= bound * np.abs(expected).max(), name

    compare("bodies/block/points", 1e-3)
    compare("contacts/interface/points", 1e-3)
    compare("contacts/interface/pressure", 1e6, -1, bound=1e-7)
    compare("contacts/interface/gap", 1e-3, -1, bound=1e-7)
    compare("path/resultants/block.bottom", 1e3, -1)
    compare("fields/1/block/displacement", 1e-3, bound=1e-8)
    compare("fields/1/block/von_mises", 1e6, bound=1e-7)
    compare("fields/0/block/von_mises", 1e6, bound=1e-7)
    for found in (one, other):
        assert (found["path/residual"] <= 1e-8).all()


def test_two_contacts(punches_run: Path) -> None:
    summary = summary_of(punches_run)
    left, right = summary["contacts"]["under-left"], summary["contacts"]["under-right"]
    assert summary["status"] == "done"
    assert right["force"][1] > 1.3 * left["force"][1] > 0.0
    for name in ("left", "right"):
        contact = summary["contacts"][f"under-{name}"]["force"]
        # The platen holds uy alone; between nodes the directions of pressures turn with the arc.
        assert contact[0] == pytest.approx(0.0, abs=1e-8 * contact[1])
        assert summary["forces"][name] == pytest.approx([0.0, -contact[1]], rel=1e-9, abs=0.0)
    table = np.genfromtxt(punches_run / "interface_under-left.csv", delimiter=",", names=True)
    assert table["x"].mean() == pytest.approx(-0.7, abs=0.02)
    assert table["pressure"].max() == left["peak_pressure"]


def test_no_contact_means_one_solve_per_load(bar_run: Path) -> None:
    summary = summary_of(bar_run)
    assert summary["contacts"] == {}
    assert summary["contact_unknowns"] == 0
    assert (summary["elastic_factorizations"], summary["solves"], summary["factorizations"]) == (1, 2, 0)
    assert 0.2 <= summary["stability"] <= 3.0
    with h5py.File(bar_run / "run.h5", "r") as file:
        assert file["path/position"][...].tolist() == [0.0, 0.5, 1.0, 1.25, 2.0]
        assert file["path/factors/pull"][...].tolist() == [0.0, 0.5, 1.0, 1.0, 1.0]
        assert file["path/factors/squeeze"][...].tolist() == [0.0, 0.0, 0.0, 0.25, 1.0]
        assert file["fields/position"][...].tolist() == [0.5, 1.25, 2.0]
        for state, (xx, yy) in enumerate(((15.0, 0.0), (30.0, -10.0), (30.0, -40.0))):
            stress = file[f"fields/{state}/bar/stress"][...]
            assert np.abs(stress - [xx, yy, 0.0]).max() <= 1e-9
            points = file["bodies/bar/points"][...]
            strain = np.array([xx - 0.25 * yy, yy - 0.25 * xx]) / 200e3
            assert np.abs(file[f"fields/{state}/bar/displacement"][...] - strain * points).max() <= 1e-14
        assert file["path/resultants/bar.left"][-1] == pytest.approx([-30.0, 0.0], abs=1e-9)
        assert file["path/resultants/squeeze"][-1] == pytest.approx([0.0, -80.0], abs=1e-9)


def test_output_is_as_asked_for(tmp_path: Path) -> None:
    overrides = ("output.vtu=false", 'output.fields=["von_mises"]', "output.at=[0.0, 2.0]")
    solve(BAR, tmp_path / "bar", *overrides)
    assert not list((tmp_path / "bar").glob("fields*"))
    with h5py.File(tmp_path / "bar" / "run.h5", "r") as file:
        assert file["fields/position"][...].tolist() == [0.0, 2.0]
        assert list(file["fields/1/bar"]) == ["von_mises"]
        assert not file["fields/0/bar/von_mises"][...].any()
    resolved = tomllib.loads((tmp_path / "bar" / "resolved.toml").read_text())
    assert resolved["output"]["fields"] == ["von_mises"]
    assert resolved["solver"]["order"] == 20


def test_console_is_told(tmp_path: Path) -> None:
    """A platen whose horizontal force is zero and that nothing resists is held, and the run says so."""
    text = NODAL.changed("fy = -226.0", "force = [0.0, -226.0]")
    text = text.changed(pin("cylinder", [0.0, 1.0], ux=0.0), "")
    console = Quiet()
    summary = done(text, tmp_path / "run", "body.cylinder.refine.0.growth=0.31", console=console)
    assert console.phases[0].startswith("placing nodes")
    assert console.steps[0] == 0.0
    assert console.steps[-1] == 1.0
    assert any("ux is fixed at 0" in note for note in console.notes)
    assert [text.partition(" [")[0] for text in console.warnings] == summary["warnings"]
    assert [one["check"] for one in events_of(tmp_path / "run", "warning")] == [
        text.rpartition(" [")[2].rstrip("]") for text in console.warnings
    ]
    assert "grows by 0.31" in console.warnings[0]


def test_the_path_as_a_table(hertz_run: Path) -> None:
    with (hertz_run / "path.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    table = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
    summary = summary_of(hertz_run)
    contact = summary["contacts"]["interface"]
    assert len(rows) == summary["steps"] + 1
    assert table["position"][[0, -1]].tolist() == [0.0, summary["position"]]
    assert set(table["stage"]) == {1.0}
    assert table["factor.press"].tolist() == table["position"].tolist()
    for axis, value, load in zip("xy", contact["force"], summary["forces"]["press"], strict=True):
        scale = np.abs(contact["force"]).max()
        assert table[f"contact.interface.force_{axis}"][-1] == pytest.approx(value, abs=1e-6 * scale)
        assert table[f"force.press_{axis}"][-1] == load
    assert table["contact.interface.peak_pressure"][-1] == contact["peak_pressure"]
    closed = table["contact.interface.closed_length"][-1]
    assert closed == pytest.approx(2.0 * contact["half_width"], rel=0.2)
    # Pressed along its own way the platen works: a little more than half of force times way.
    work = table["work.press"][-1] / (table["force.press_y"][-1] * table["displacement.press_y"][-1])
    assert 0.45 < work < 0.65
    assert (np.diff(table["work.press"]) >= 0.0).all()


def test_arc_lengths_are_those_of_the_slave(patch_run: Path, hertz_run: Path) -> None:
    """The grid of a patch's contact lies on its master, against whose direction the slave runs."""
    for directory in (patch_run, hertz_run):
        (contact,) = read_run(directory).contacts.values()
        arc, points = contact.arc_length, contact.points
        assert arc[0] >= 0.0
        np.testing.assert_allclose(np.diff(arc), np.hypot(*np.diff(points, axis=0).T), rtol=1e-3, atol=1e-9)
    (contact,) = read_run(patch_run).contacts.values()
    # A bottom runs to the right, from its own left end.
    np.testing.assert_allclose(contact.arc_length, contact.points[:, 0], atol=1e-12)
