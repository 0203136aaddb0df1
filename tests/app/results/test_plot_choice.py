"""Single pictures of ``mlsanm plot``: what is asked for, along lines, of several runs, moving; models."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from mlsanm_cli.app.check import check
from mlsanm_cli.app.results import plot as plot_module
from mlsanm_cli.app.results.choice import Choice
from mlsanm_cli.app.results.curves import loop_picture, path_picture, traction_picture
from mlsanm_cli.app.results.marks import marks_at
from mlsanm_cli.app.results.plot import pictures, plot
from mlsanm_cli.app.run import run as run_case
from mlsanm_cli.case import stored_case
from mlsanm_cli.cli import main
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.run_reader import read_path, read_run
from tests.app.output.test_paraview import CYLINDER
from tests.app.scenes import BAR, PATCH, Quiet, done, hertz, solve

FFMPEG = """
words = sys.argv
count = len(sys.stdin.buffer.read())
text = f"{words[words.index('-s') + 1]} {words[words.index('-r') + 1]} {count}"
open(words[-1], "w").write(text)
"""
"""A program that writes what it was asked for."""


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Pictures that are drawn."""
    kept: list[Any] = []
    for name in ("draw", "plot_bodies"):
        monkeypatch.setattr(plot_module, name, lambda path, picture: kept.append(picture))
    return kept


def test_kinds_contacts_and_files_are_chosen(punches_run: Path, tmp_path: Path) -> None:
    files = plot(punches_run, choice=Choice(what=("pressure", "peak")))
    names = {"plot_pressure_under-left.png", "plot_pressure_under-right.png", "plot_peak.png"}
    assert {file.name for file in files} == names
    files = plot(punches_run, choice=Choice(contact="under-left"))
    assert [file.name for file in files] == ["plot_pressure_under-left.png"]
    out = tmp_path / "left.svg"
    assert plot(punches_run, choice=Choice(what=("pressure",), contact="under-left", out=out)) == [out]
    assert out.read_text().startswith("<?xml")


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        (Choice(contact="midle"), "no contact"),
        (Choice(out=Path("a.png")), "-o names one picture"),
        (Choice(what=("force",), out=Path("a.jpg")), "picture formats are"),
        (Choice(what=("traction",)), "nothing for traction"),
        (Choice(what=("line",)), "a line is missing"),
        (Choice(along="block.tp"), "no boundary"),
        (Choice(along="0,0:0"), "neither a boundary nor a line"),
        (Choice(along="9,9:8,8"), "no body"),
        (Choice(what=("bodies",), at=(0.123,)), "saved at position"),
        (Choice(what=("force",), contact="under-left"), "not apply to force"),
        (Choice(animate=True, what=("bodies",)), "animation"),
    ],
)
def test_choices_of_what_there_is_not_are_told(punches_run: Path, choice: Choice, message: str) -> None:
    with pytest.raises(RunError, match=message):
        plot(punches_run, choice=choice)


def test_bodies_are_coloured_by_the_field_asked_for(hertz_run: Path, drawn: list[Any]) -> None:
    plot(hertz_run, choice=Choice(field="yy", at=(0.7,)))
    (picture,) = drawn
    state = next(state for state in read_run(hertz_run).states if state.position == 0.7)
    assert picture.bodies[1].scalar.tolist() == state.bodies["block"]["stress"][:, 1].tolist()
    assert picture.label == "stress yy"
    assert picture.title == "position 0.7, press x 0.7"
    assert [name for *_, name in picture.marks.arrows] == ["press"]
    ((points, normals),) = picture.marks.held
    np.testing.assert_allclose(points[:, 1], -2.0, atol=1e-6)
    assert normals.tolist() == [[0.0, -1.0]] * len(normals)
    assert len(picture.marks.nodes) == 2


@pytest.mark.usefixtures("by_nodes")
def test_units_are_labels_and_change_nothing(tmp_path: Path, drawn: list[Any]) -> None:
    units = PATCH.table("units", length="mm", stress="MPa", force="N/mm")
    plain, named = solve(PATCH, tmp_path / "a"), solve(units, tmp_path / "b")
    assert plain["contacts"] == named["contacts"]
    plot(tmp_path / "b", choice=Choice(what=("pressure", "force")))
    pressure, force = drawn
    below = pressure.panels[-1]
    assert (below.x_label, pressure.panels[0].y_label) == ("distance from the middle [mm]", "pressure [MPa]")
    assert force.panels[0].y_label == "contact force per unit thickness [N/mm]"


def test_stress_along_a_boundary_is_the_pressure_there(hertz_run: Path, drawn: list[Any]) -> None:
    plot(hertz_run, choice=Choice(along="block.top", field="yy", at=(0.3, 1.0)))
    (panel,) = drawn[0].panels
    first, last = panel.curves
    assert (first.label, last.label) == ("position 0.3", "position 1")
    assert (panel.x_label, panel.y_label) == ("arc length", "stress yy")
    contact = read_run(hertz_run).contacts["interface"]
    assert -last.y.min() == pytest.approx(contact.pressure[-1].max(), rel=0.02)
    assert np.ptp(first.x) == pytest.approx(4.0)


def test_stress_along_a_line_has_its_peak_where_hertz_has_it(hertz_run: Path, drawn: list[Any]) -> None:
    plot(hertz_run, choice=Choice(along="0,0:0,-0.3"))
    (curve,) = drawn[0].panels[0].curves
    contact = read_run(hertz_run).contacts["interface"]
    peak = float(contact.pressure[-1].max())
    half = 2.0 * 226.0 / (np.pi * peak)
    # Plane strain, nu = 0.3: 0.558 p0, 0.7 half-widths deep.
    assert curve.y.max() == pytest.approx(0.557 * peak, rel=0.03)
    assert curve.x[curve.y.argmax()] == pytest.approx(0.70 * half, rel=0.05)


def test_runs_are_drawn_over_each_other(
    hertz_run: Path, punches_run: Path, drawn: list[Any], tmp_path: Path
) -> None:
    out = tmp_path / "both.png"
    plot([hertz_run, punches_run], choice=Choice(what=("peak",), out=out))
    plot([hertz_run, hertz_run], choice=Choice(along="block.top", out=out))
    labels = [[curve.label for curve in picture.panels[0].curves] for picture in drawn]
    assert labels[0] == ["hertz", "punches, under-left", "punches, under-right"]
    assert len(labels[1]) == 2
    for choice in (Choice(out=out), Choice(what=("bodies",), out=out)):
        with pytest.raises(RunError, match="one kind of picture"):
            plot([hertz_run, punches_run], choice=choice)
    with pytest.raises(RunError, match="into one picture"):
        plot([hertz_run, punches_run], choice=Choice(what=("peak",)))


def test_tractions_and_hysteresis_are_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done(CYLINDER, tmp_path / "run")
    files = plot(tmp_path / "run", choice=Choice(what=("hysteresis", "loop")))
    assert {file.name for file in files} == {"plot_hysteresis_drum.png", "plot_loop_drum.png"}
    run = read_run(tmp_path / "run")
    case, path = stored_case(run.case_resolved), read_path(tmp_path / "run")
    (force,) = path_picture([run], [case], "force", Choice()).panels[0].curves
    assert force.y == pytest.approx(np.hypot(*(path[f"contact.drum.force_{axis}"] for axis in "xy")))
    picture = traction_picture(run, case, "drum", Choice(at=(0.5,)))
    assert picture.title == "Tangential traction, drum, position 0.5, down x 0.5"
    (panel,) = picture.panels
    limit, _, traction = panel.curves
    # Closed places are within their limits, those that slip at them.
    slips = np.zeros(len(traction.x), dtype=bool)
    for begin, end, _, label in panel.bands:
        slips |= (label == "slip") & (traction.x > begin) & (traction.x < end)
    assert np.abs(traction.y[slips]) == pytest.approx(limit.y[slips], rel=1e-9)
    assert (np.abs(traction.y) <= limit.y * (1.0 + 1e-9)).all()
    # A tangential force that is round-off is no loop.
    monkeypatch.setitem(run.contacts["drum"]._members, "traction", 1e-9 * run.contacts["drum"].traction)
    assert not {kind for kind, _, _ in pictures(run, case, Choice())} & {"loop", "hysteresis"}
    with pytest.raises(RunError, match="no tangential force"):
        loop_picture(run, case, "drum", Choice())


def test_a_path_is_a_moving_picture(
    series_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plot_module, "FRAMES", 5)
    (file,) = plot(series_run, choice=Choice(animate=True, out=tmp_path / "p.gif"))
    with Image.open(file) as picture:
        assert getattr(picture, "n_frames") == 5  # noqa: B009
        first = np.asarray(picture.convert("RGB")).astype(int)
        picture.seek(4)
        last = np.asarray(picture.convert("RGB")).astype(int)
    assert np.abs(first - last).sum() > 0
    assert file.stat().st_size < 1e6
    (file,) = plot(series_run, choice=Choice(animate=True, what=("bodies",)))
    assert file.name == "plot_bodies.gif"
    with Image.open(file) as picture:
        assert getattr(picture, "n_frames") == 3  # noqa: B009


def test_mp4_by_ffmpeg(series_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plot_module, "FRAMES", 5)
    monkeypatch.setenv("PATH", str(tmp_path))
    moving = Choice(animate=True, out=tmp_path / "p.mp4")
    with pytest.raises(RunError, match="ffmpeg, which is not on PATH"):
        plot(series_run, choice=moving)
    program = tmp_path / "ffmpeg"
    program.write_text(f"#!{sys.executable}\nimport sys\n" + FFMPEG)
    program.chmod(0o755)
    assert plot(series_run, choice=moving) == [tmp_path / "p.mp4"]
    size, rate, frames = (tmp_path / "p.mp4").read_text().split()
    width, height = map(int, size.split("x"))
    # Five frames, half a second each, the last one three times as long.
    assert rate == "1000/500"
    assert int(frames) == 3 * width * height * (5 + 2)
    program.write_text(f"#!{sys.executable}\nimport sys\nsys.exit('Unknown encoder')")
    with pytest.raises(RunError, match="ffmpeg failed: Unknown encoder"):
        plot(series_run, choice=moving)


def test_arrows_point_as_their_factors_say_and_go_with_the_bodies(tmp_path: Path) -> None:
    solve(BAR.changed("squeeze = 1.0", "squeeze = 1.0\npull = -1.0"), tmp_path / "run")
    run = read_run(tmp_path / "run")
    case = stored_case(run.case_resolved)
    first, _, last = (marks_at(run, case, state, 100.0).arrows for state in run.states)
    assert {name for *_, name in first} == {"pull"}
    assert {name for *_, name in last} == {"pull", "squeeze"}
    for arrows, sign in ((first, 1.0), (last, -1.0)):
        pulls = [(point, direction) for point, direction, _, name in arrows if name == "pull"]
        np.testing.assert_allclose([direction for _, direction in pulls], [[sign, 0.0]] * len(pulls))
    state = run.states[-1].bodies["bar"]["displacement"]
    right = np.abs(run.bodies["bar"].points[:, 0] - 2.0) < 1e-9
    moved = 2.0 + 100.0 * state[right, 0].mean()
    np.testing.assert_allclose([point[0] for point, _ in pulls], moved, rtol=1e-6)


def test_moving_pictures_of_a_run_go_with_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plot_module, "FRAMES", 2)
    solve(BAR, tmp_path / "run")
    (file,) = plot(tmp_path / "run", choice=Choice(animate=True))
    run_case(tmp_path / "run.toml", out=tmp_path / "run", force=True, console=Quiet())
    assert not file.exists()


def test_the_model_is_drawn_before_it_is_solved(tmp_path: Path, capsys: Any) -> None:
    case = tmp_path / "drum.toml"
    case.write_text(CYLINDER)
    assert main(["check", str(case), "--picture", str(tmp_path / "model.png"), "--quiet"]) == 0
    with Image.open(tmp_path / "model.png") as picture:
        assert picture.size[0] > 300
    with pytest.raises(RunError, match="picture formats are"):
        check(case, picture=tmp_path / "model.doc", console=Quiet())


def test_the_command_takes_all_of_it(hertz_run: Path, tmp_path: Path, capsys: Any) -> None:
    out = tmp_path / "a.pdf"
    words = ["--what", "pressure", "--contact", "interface", "--at", "0.5", "-o", str(out)]
    assert main(["plot", str(hertz_run), *words]) == 0
    assert capsys.readouterr().out.strip() == str(out)
    assert out.read_bytes().startswith(b"%PDF")
    case = tmp_path / "units.toml"
    case.write_text(hertz() + "[units]\nlength = 3\n")
    assert main(["check", str(case)]) == 2
    assert "units.length: expected a text" in capsys.readouterr().err
