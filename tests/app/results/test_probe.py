"""`[[probe]]` and `mlsanm probe`: values at points and levels against formulas and against each other."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.check import check
from mlsanm_cli.app.results import probe
from mlsanm_cli.app.results.choice import QUANTITIES, Choice
from mlsanm_cli.app.results.curves import loop_picture
from mlsanm_cli.app.results.path_lookup import SERIES, level_at
from mlsanm_cli.case import stored_case
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.run_reader import read_run
from tests.app.runs import summary_of
from tests.app.scenes import BAR, PATCH, SHEARED, SMOOTH, Quiet, done, hertz, refused, solve

LOAD = -226.0
PROBES = (
    'probe=[{name="below", body="block", point=[0.003, -0.05]},'
    '{name="top", body="cylinder", point=[0.0, 1.0]}]'
)
POINT = (0.003, -0.05)


@pytest.fixture(scope="module")
def hertz_probes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Hyperbolic law as it is, fields saved as in hertz_run: what is saved tells how fine grids are."""
    directory = tmp_path_factory.mktemp("probe") / "hertz"
    done(hertz(), directory, PROBES, "output.at=[0.3, 0.7, 1.0]", *SMOOTH)
    return directory


@pytest.fixture(scope="module")
def friction_nodes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Smooth law with friction, pressed and sheared."""
    directory = tmp_path_factory.mktemp("probe") / "rubbing"
    probes = 'probe=[{name="p", body="block", point=[0.02, -0.05]}]'
    history = ("stage=[{press=1.0},{shear=1.0}]", "output.at=[1.4, 2.0]")
    done(SHEARED, directory, *SMOOTH, probes, *history)
    return directory


def values(row: dict[str, Any]) -> Any:
    return np.array([row[key] for key in ("ux", "uy", "xx", "yy", "xy", "von_mises")])


def test_linear_fields_are_exact(tmp_path: Path) -> None:
    """Uniaxial stress: E = 200e3, nu = 0.25, pulled by 30, then squeezed by 40."""
    summary = solve(BAR.probe("p", "bar", [1.3, 0.7]), tmp_path / "bar")
    for position, pull, squeeze in ((0.0, 0.0, 0.0), (0.3, 9.0, 0.0), (1.0, 30.0, 0.0), (1.6, 30.0, -24.0)):
        strain = (pull - 0.25 * squeeze) / 200e3, (squeeze - 0.25 * pull) / 200e3
        mises = np.sqrt(pull**2 - pull * squeeze + squeeze**2)
        exact = np.array([1.3 * strain[0], 0.7 * strain[1], pull, squeeze, 0.0, mises])
        scale = np.array([1e-4, 1e-4, 30.0, 30.0, 30.0, 30.0])
        (named,) = probe.probe_named(tmp_path / "bar", [position], "p")
        (field,) = probe.probe_point(tmp_path / "bar", [position], "bar", (1.3, 0.7))
        assert np.abs((values(named) - exact) / scale).max() <= 1e-9
        assert np.abs((values(field) - exact) / scale).max() <= 1e-9
        (force,) = probe.probe_force(tmp_path / "bar", [position], "pull")
        assert force["fx"] == pytest.approx(pull, abs=1e-9)
    assert summary["probes"]["p"]["stress"] == pytest.approx([30.0, -40.0, 0.0], abs=1e-9)


def test_saved_fields_give_only_levels_that_they_span(tmp_path: Path) -> None:
    solve(BAR, tmp_path / "bar", "output.at=[0.5]")
    (row,) = probe.probe_point(tmp_path / "bar", [0.8], "bar", (1.3, 0.7), "stress")
    assert (row["xx"], row["yy"]) == pytest.approx((24.0, 0.0), abs=1e-8)
    with pytest.raises(RunError, match=r"saved at position 0\.5 only"):
        probe.probe_point(tmp_path / "bar", [1.2], "bar", (1.3, 0.7))


def test_probes_see_what_the_fields_show(hertz_probes: Path) -> None:
    """Rows condensed with the contact against fields solved for, inside a step and at its end."""
    run = read_run(hertz_probes)
    assert level_at(run, 0.3).how == SERIES
    largest: dict[float, float] = {}
    for name, body, point in (("below", "block", POINT), ("top", "cylinder", (0.0, 1.0))):
        named = probe.probe_named(hertz_probes, [0.3, 1.0], name)
        field = probe.probe_point(hertz_probes, [0.3, 1.0], body, point)
        for one, other in zip(named, field, strict=True):
            difference = np.abs(values(one) - values(other))
            # Saved fields are interpolated, those of the contact too; named probes know them in closed form.
            assert difference[:2].max() <= 1e-3 * np.abs(values(other)[:2]).max()
            # Far from the contact nodes are coarse: fits to them are off by some percent of the little there.
            scale = largest.setdefault(one["position"], np.abs(values(one)[2:]).max())
            assert difference[2:].max() <= 2e-2 * scale
    assert run.probes["below"].stress.shape == (run.rows, 3)


def test_forces_between_steps_are_those_applied(hertz_probes: Path) -> None:
    levels = [0.123, 0.5, 0.987]
    for name, sign in (("press", 1.0), ("interface", -1.0)):
        rows = probe.probe_force(hertz_probes, levels, name)
        assert [row["fy"] for row in rows] == pytest.approx([sign * LOAD * at for at in levels], rel=1e-4)
        assert {row["how"] for row in rows} == {SERIES}


@pytest.mark.parametrize("scene", ["hertz_probes", "friction_nodes"])
def test_series_lead_to_the_stored_rows(scene: str, request: pytest.FixtureRequest) -> None:
    directory = request.getfixturevalue(scene)
    run = read_run(directory)
    rows = run.path.position
    chosen = [row for row in range(2, len(rows) - 1, 2) if rows[row] - rows[row - 1] > 1e-4]
    assert len(chosen) >= 3
    for row in chosen:
        before = float(rows[row] - 1e-9)
        (near,) = probe.probe_contact(directory, [before], "interface")
        assert near["how"] == SERIES
        contact = run.contacts["interface"]
        for quantity in set(QUANTITIES) & set(near):
            stored = getattr(contact, quantity)
            assert np.abs(near[quantity] - stored[row]).max() <= 1e-6 * np.abs(stored).max()
        for name in run.probes:
            (seen,) = probe.probe_named(directory, [before], name, "stress")
            stress = run.probes[name].stress
            assert (
                np.abs([seen[key] for key in ("xx", "yy", "xy")] - stress[row]).max()
                <= 1e-6 * np.abs(stress).max()
            )


def test_friction_between_steps(friction_nodes: Path) -> None:
    (force,) = probe.probe_force(friction_nodes, [1.37], "interface")
    assert force["fx"] == pytest.approx(-0.37 * 50.0, rel=1e-4)
    assert force["fy"] == pytest.approx(226.0, rel=1e-4)
    (contact,) = probe.probe_contact(friction_nodes, [1.37], "interface", ["traction", "pressure"])
    assert (
        np.abs(contact["traction"]) <= 0.4 * (contact["pressure"] + 0.01 * contact["pressure"].max())
    ).all()
    assert set(contact) == {"position", "how", "arc_length", "x", "y", "traction", "pressure"}
    run = read_run(friction_nodes)
    loop = loop_picture(run, stored_case(run.case_resolved), "interface", Choice())
    assert "by shear" in loop.panels[0].x_label
    (named,) = probe.probe_named(friction_nodes, [1.4], "p")
    (field,) = probe.probe_point(friction_nodes, [1.4], "block", (0.02, -0.05))
    assert values(named) == pytest.approx(values(field), rel=0.01, abs=1e-6)


@pytest.mark.usefixtures("by_nodes")
def test_a_stage_that_moves_nothing_is_known_all_along(tmp_path: Path) -> None:
    solve(PATCH, tmp_path / "patch", "stage=[{press=0.5},{press=0.5},{press=1.0}]")
    (row,) = probe.probe_contact(tmp_path / "patch", [1.5], "interface", ["pressure"])
    assert row["pressure"] == pytest.approx(50.0)
    (row,) = probe.probe_contact(tmp_path / "patch", [2.49], "interface", ["pressure"])
    assert row["pressure"] == pytest.approx(74.5)


def test_exact_laws_are_interpolated_between_stored_states(tmp_path: Path) -> None:
    """With an error estimate; a run that stores the state tells how good it is."""
    coarse = ("contact.interface.accuracy=0.01", "output.fields=[]")
    solve(hertz(), tmp_path / "even", *coarse)
    solve(hertz(), tmp_path / "asked", *coarse, "output.at=[0.37, 1.0]")
    (force,) = probe.probe_force(tmp_path / "even", [0.37], "press")
    assert force["fy"] == pytest.approx(0.37 * LOAD)
    assert (force["how"], force["error"]) == ("interpolated", pytest.approx(0.0, abs=1e-9))
    (found,) = probe.probe_contact(tmp_path / "even", [0.37], "interface")
    (stored,) = probe.probe_contact(tmp_path / "asked", [0.37], "interface")
    assert (found["how"], stored["how"]) == ("interpolated", "stored")
    exact = np.interp(found["arc_length"], stored["arc_length"], stored["pressure"])
    error = np.abs(found["pressure"] - exact).max() / exact.max()
    assert 0.5 * error < found["error"] < 2.0 * error
    with pytest.raises(RunError, match=r"between positions 0 and 0\.05") as refused:
        probe.probe_contact(tmp_path / "even", [0.02], "interface")
    assert "output.at" in refused.value.hint


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda run: probe.probe_force(run, [1.01], "press"), "goes from 0 to 1"),
        (lambda run: probe.probe_force(run, [-0.1], "press"), "goes from 0 to 1"),
        (lambda run: probe.probe_force(run, [float("nan")], "press"), "does not reach"),
        (lambda run: probe.probe_force(run, [float("inf")], "press"), "does not reach"),
        (lambda run: probe.probe_force(run, [-float("inf")], "press"), "does not reach"),
        (lambda run: probe.probe_force(run, [1.0], "pres"), "there are: press"),
        (lambda run: probe.probe_contact(run, [1.0], "nose"), "there are: interface"),
        (lambda run: probe.probe_contact(run, [1.0], "interface", ["slip"]), "no friction"),
        (lambda run: probe.probe_named(run, [1.0], "tip"), "there are: below, top"),
        (lambda run: probe.probe_point(run, [1.0], "bloc", POINT), "there are: cylinder, block"),
        (lambda run: probe.probe_point(run, [1.0], "block", (0.0, 0.01)), "outside body"),
        (lambda run: probe.probe_point(run, [0.4], "block", POINT), "saved at position 0.3, 0.7, 1 only"),
    ],
)
def test_what_cannot_be_told_is_an_error(call: Any, words: str, hertz_probes: Path) -> None:
    with pytest.raises(RunError) as error:
        call(hertz_probes)
    assert words in f"{error.value.message} {error.value.hint}"


def test_a_position_alone_gives_the_figures_of_all_contacts(hertz_probes: Path) -> None:
    (row,) = probe.probe_everything(hertz_probes, [1.0])
    known = summary_of(hertz_probes)["contacts"]["interface"]
    assert [row[key] for key in ("peak_pressure", "half_width")] == pytest.approx(
        [known["peak_pressure"], known["half_width"]]
    )
    assert [row["fx"], row["fy"]] == pytest.approx(known["force"], rel=1e-3, abs=1e-3)
    with pytest.raises(RunError, match="does not reach position 3"):
        probe.probe_everything(hertz_probes, [3.0])


def test_what_there_is_to_probe(hertz_probes: Path) -> None:
    found = probe.contents(hertz_probes)
    expected = {"path": [0.0, 1.0], "contacts": ["interface"], "probes": ["below", "top"]}
    assert {key: found[key] for key in expected} == expected
    assert "interface" in found["forces"]
    assert found["fields_at"] == [0.3, 0.7, 1.0]


@pytest.mark.parametrize("point", [[2.0, 0.5], [2.0 + 3e-8, 0.5], [1.0, -1e-7]])
def test_probes_on_a_boundary_are_given_to_some_digits(point: list[float], tmp_path: Path) -> None:
    (tmp_path / "bar.toml").write_text(BAR.probe("p", "bar", point))
    check(tmp_path / "bar.toml", console=Quiet())


INSIDE = BAR.probe("p", "bar", [1.0, 0.5])


@pytest.mark.parametrize(
    ("text", "key", "words"),
    [
        (BAR.probe("p", "bar", [2.00001, 0.5]), "probe.p.point", "outside body"),
        (BAR.probe("p", "bar", [2.1, 0.5]), "probe.p.point", "outside body"),
        (INSIDE.probe("p", "bar", [1.0, 0.5]), "probe.p.name", "another probe"),
    ],
)
def test_wrong_probes(text: str, key: str, words: str, tmp_path: Path) -> None:
    refused(text, tmp_path / "bar", key, words)
