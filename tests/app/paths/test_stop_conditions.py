"""``[[stop]]``: paths that end at the exact load at which something is reached, whatever the method."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.continuation.corrector import Effort
from mlsanm_cli.continuation.path import Step
from mlsanm_cli.continuation.series import Branch
from mlsanm_cli.io.run_reader import read_run
from tests.app.runs import summary_of
from tests.app.scenes import ANM, BAR, EXACT_LAW, FAST, NEWTON, NODAL, SMOOTH, hertz, solve
from tests.case_text import contact, head, item, load, pin, pushed

HERTZ_STOP = item("stop", what="pressure", of="interface", above=1500.0)


def stopped(summary: Any, by: str) -> float:
    assert summary["status"] == "done", summary
    assert summary["stopped_by"] == by
    assert summary["stop_reason"].startswith(by)
    assert summary["stopped_at"] == summary["position"]
    return float(summary["stopped_at"])


@pytest.mark.parametrize(
    ("text", "changes"),
    [(NODAL, (ANM,)), (NODAL, (NEWTON,)), (hertz(), (EXACT_LAW,))],
    ids=["series", "newton", "exact"],
)
def test_the_peak_pressure_asked_for_is_reached_by_every_method(
    text: str, changes: tuple[str, ...], tmp_path: Path
) -> None:
    summary = solve(text + HERTZ_STOP, tmp_path / "run", *changes)
    position = stopped(summary, "pressure of interface above 1500")
    contact = summary["contacts"]["interface"]
    assert contact["peak_pressure"] == pytest.approx(1500.0, rel=1e-8)
    assert summary["factors"]["press"] == pytest.approx(position, rel=1e-12)
    if changes == (EXACT_LAW,):
        # The estimate is that of the state where the path ends, not of one beyond.
        assert summary["error_estimate"]["pressure"]["interface"] <= 0.02
        # Hertz: the peak goes with the root of the force.
        radius, modulus = 1.0, 210e3 / (2.0 * (1.0 - 0.3**2))
        force = 1500.0**2 * np.pi * radius / modulus
        assert position * 226.0 == pytest.approx(force, rel=5e-3)
    run = read_run(tmp_path / "run")
    assert [state.position for state in run.states] == [position]
    assert run.path.position[-1] == position


def test_wanted_levels_before_the_stop_are_saved_and_none_behind(tmp_path: Path) -> None:
    summary = solve(hertz() + HERTZ_STOP, tmp_path / "run", "output.at=[0.1, 0.2, 0.9]")
    position = stopped(summary, "pressure of interface above 1500")
    places = [state.position for state in read_run(tmp_path / "run").states]
    assert places == [0.1, 0.2, position]


def test_without_contact_forces_and_displacements_are_reached_in_the_stage_that_does(tmp_path: Path) -> None:
    text = BAR.probe("corner", "bar", [2.0, 1.0])
    summary = solve(text.item("stop", what="force", of="squeeze", above=20.0), tmp_path / "force")
    assert stopped(summary, "force of squeeze above 20") == pytest.approx(1.25, rel=1e-9)
    # Pulled first, then squeezed: ux = (s + nu p) L / E.
    stop = {"what": "displacement", "of": "corner", "component": "x", "above": 3.5e-4}
    summary = solve(text.item("stop", **stop), tmp_path / "moved")
    share = (3.5e-4 * 200e3 / 2.0 - 30.0) / (0.25 * 40.0)
    told = "displacement of corner in x above 0.00035"
    assert stopped(summary, told) == pytest.approx(1.0 + share, rel=1e-6)
    assert summary["probes"]["corner"]["displacement"][0] == pytest.approx(3.5e-4, rel=1e-9)


def sheared(slip: float, area: float) -> str:
    return (
        load("shear", "cylinder.flat", "platen", fx=40.0)
        .stages("press", "shear")
        .item("stop", what="slip", of="interface", above=slip)
        .item("stop", what="area", of="interface", above=area)
    )


ROUGH = (
    hertz()
    .changed("accuracy = 0.01", "accuracy = 0.02\nfriction = 0.3")
    .changed(pin("cylinder", [0.0, 1.0], ux=0.0), "")
)


def test_slip_is_reached_where_the_history_has_it(tmp_path: Path) -> None:
    text = ROUGH + sheared(slip=5e-5, area=1e3)
    summary = solve(text, tmp_path / "run")
    position = stopped(summary, "slip of interface above 5e-05")
    assert 1.0 < position < 2.0
    contact = read_run(tmp_path / "run").contacts["interface"]
    # Open places beside the contact do not slip, however much they move.
    slip = np.abs(contact.slip) * (contact.status != 0)
    assert slip[-1].max() == pytest.approx(5e-5, rel=1e-8)
    assert (slip[:-1].max(axis=1) < 5e-5).all()


def test_of_several_stops_the_first_one_ends_the_path(tmp_path: Path) -> None:
    text = ROUGH + sheared(slip=2e-5, area=0.05)
    summary = solve(text, tmp_path / "run", EXACT_LAW)
    position = stopped(summary, "area of interface above 0.05")
    assert 0.0 < position < 1.0
    contact = read_run(tmp_path / "run").contacts["interface"]
    closed = (contact.status != 0) @ contact.weight
    # Places close one by one, so that the length jumps: by one place it is not reached before.
    assert closed[-2] < 0.05 <= closed[-1] < 0.05 + 3.0 * contact.weight.max()


def test_a_limit_has_to_be_come_to_from_the_other_side(tmp_path: Path) -> None:
    """Unloading: below at the start, and of no interest there."""
    text = hertz().stages("press", "press=0").item("stop", what="force", of="press", below=100.0)
    summary = solve(text, tmp_path / "run", FAST, EXACT_LAW)
    position = stopped(summary, "force of press below 100")
    assert position == pytest.approx(2.0 - 100.0 / 226.0, rel=1e-9)


def test_a_stop_that_is_never_reached_changes_nothing(series_run: Path, tmp_path: Path) -> None:
    text = hertz() + HERTZ_STOP.changed("1500.0", "1e6")
    summary = solve(text, tmp_path / "run", "output.at=[0.3, 0.7, 1.0]", *SMOOTH)
    plain = summary_of(series_run)
    assert summary["stop_reason"] == plain["stop_reason"]
    assert "stopped_by" not in summary
    peaks = [one["contacts"]["interface"]["peak_pressure"] for one in (summary, plain)]
    assert peaks[0] == pytest.approx(peaks[1], rel=1e-9)


def test_a_load_that_turns_back_within_a_step_is_seen() -> None:
    def turns(length: float, *load: float) -> list[tuple[float, bool]]:
        branch = Branch(np.zeros((len(load), 1)), np.array(load), length)
        end = branch.evaluate(length)
        return Step(branch, *end, 0.0, length, Effort(), branch.order).limit_points

    assert not turns(0.9, 0.0, 1.0)
    assert not turns(0.9, 0.0, 2.0, -1.0)
    [(place, highest)] = turns(1.5, 0.0, 2.0, -1.0)
    assert highest
    assert place == pytest.approx(1.0, abs=1e-12)


RUBBER = (
    head("strain", strain="finite")
    .material("rubber", E=2.6, nu=0.3, law="neo-hookean")
    .body("block", "rubber", 0.2, box=([0.0, 2.0], [0.0, 1.0]))
    .item("body.refine", at=[1.0, 1.0], spacing=0.05, radius=0.3, growth=0.2)
    .support("block.bottom", ux=0.0, uy=0.0)
)
PUSHED = pushed("press", "c", uy=-0.2) + contact("c", "block.top", disk=([1.0, 2.0], 1.0))
PULLED = load("press", "block.top", "traction", traction=[0.0, -0.5]).probe("top", "block", [1.0, 1.0])


@pytest.mark.parametrize(
    ("text", "stop"),
    [
        (PUSHED, {"what": "force", "of": "c", "component": "y", "below": -0.05}),
        (PUSHED, {"what": "displacement", "of": "press", "component": "y", "below": -0.07}),
        (PULLED, {"what": "displacement", "of": "top", "component": "y", "below": -0.05}),
        (PULLED, {"what": "von_mises", "of": "top", "above": 0.1}),
    ],
)
def test_stops_at_finite_strain(text: str, stop: dict[str, Any], tmp_path: Path) -> None:
    """In contact and by power series; they had been ignored."""
    summary = solve(RUBBER + text + item("stop", **stop), tmp_path / "run")
    assert 0.0 < stopped(summary, summary["stopped_by"]) < 1.0
    run = read_run(tmp_path / "run")
    assert [state.position for state in run.states] == [summary["position"]]
    if stop["what"] == "force":
        value = summary["contacts"]["c"]["force"][1]
    elif stop["of"] == "press":
        value = run.path.displacements["press"][-1, 1]
    else:
        probe = summary["probes"]["top"]
        value = probe["von_mises"] if stop["what"] == "von_mises" else probe["displacement"][1]
    assert value == pytest.approx(stop.get("above", stop.get("below")), rel=1e-6)
