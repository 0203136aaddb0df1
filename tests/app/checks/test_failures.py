"""A run whose numbers are wrong never ends as done, whichever it is; and it tells where it is worst."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

from mlsanm_cli.app.analysis import small_strain
from mlsanm_cli.app.checks import end
from mlsanm_cli.contact.response import coercivity as certificate
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.io.files import read_summary
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.fields import fields_of
from mlsanm_cli.solve.paths import load_path
from mlsanm_cli.solve.state import Checkpoint, PathStep, State
from tests.app.runs import events_of
from tests.app.scenes import ANM, BAR, EXACT_LAW, NODAL, PATCH, SHEARED, Quiet, hertz, solve
from tests.case_text import Scene

Mutation = Callable[[pytest.MonkeyPatch, float], None]
Change = Callable[[State, float], State]
NAN = float("nan")
ONCE = (EXACT_LAW, "stage=[{press=1.0}, {shear=1.0}]", "output.at=[2.0]")
"""Nothing turns back, which would only take longer."""


def altered(change: Change, saved: bool = False) -> Mutation:
    """A path whose last state, or last saved state, is another."""

    def mutate(patch: pytest.MonkeyPatch, bad: float) -> None:
        def path(built: CondensedScene, start: Checkpoint | None) -> Iterator[PathStep]:
            for step in load_path(built, start):
                if step.state.position < len(built.case.stage):
                    yield step
                elif saved:
                    yield replace(step, saved=tuple(change(state, bad) for state in step.saved))
                else:
                    yield replace(step, state=change(step.state, bad))

        patch.setattr(small_strain, "load_path", path)

    return mutate


def scaled(name: str) -> Mutation:
    return altered(lambda state, factor: replace(state, **{name: factor * getattr(state, name)}))


def systems(patch: pytest.MonkeyPatch, bad: float) -> None:
    """The first of the saved states has this error of the linear systems, the others none."""
    values = iter([bad, 1e-12])

    def found(*arguments: Any, **options: Any) -> Any:
        return [(fields, next(values, 1e-12)) for fields, _ in fields_of(*arguments, **options)]

    patch.setattr(small_strain, "fields_of", found)


def system_of_one_body(patch: pytest.MonkeyPatch, bad: float) -> None:
    kept = Condensed.checked_displacements

    def displacement(self: Condensed, scene: Any, name: str, *state: Any) -> Any:
        found, residual = kept(self, scene, name, *state)
        return found, np.full_like(residual, bad) if name == "upper" else residual

    patch.setattr(Condensed, "checked_displacements", displacement)


def returned(name: str) -> Mutation:
    return lambda patch, bad: patch.setattr(end, name, lambda *arguments: bad)


def of_parts(name: str, part: str) -> Mutation:
    """A figure of every body, or contact, that is off."""
    return lambda patch, bad: patch.setattr(end, name, lambda built, state: {part: bad})


NO_FIELDS = ("output.fields=[]", "output.at=[0.5, 1.0]")
FAILURES: list[tuple[str, str | Scene, tuple[str, ...], Mutation, tuple[float, ...]]] = [
    ("residual", PATCH, (), altered(lambda state, bad: replace(state, residual=bad)), (1e3, NAN)),
    ("residual", PATCH, (), altered(lambda state, bad: replace(state, residual=bad), saved=True), (NAN,)),
    *[("finite", SHEARED, ONCE, scaled(name), (NAN,)) for name in ("pressure", "gap", "motion", "traction")],
    ("friction_limit", SHEARED, ONCE, scaled("traction"), (20.0,)),
    ("force_balance", PATCH, (), of_parts("force_balance", "upper"), (1e3, NAN)),
    ("linear_residual", PATCH, ("output.at=[0.5, 1.0]",), systems, (1e3, NAN)),
    ("linear_residual", PATCH, NO_FIELDS, systems, (1e3,)),
    ("linear_residual", PATCH, (), system_of_one_body, (NAN,)),
    ("pressed_spacings", PATCH, (), returned("spacing_ratio"), (9.0, NAN)),
    ("force_mismatch", PATCH, (), of_parts("force_mismatch", "interface"), (0.2,)),
]


@pytest.mark.usefixtures("by_nodes")
@pytest.mark.parametrize(
    ("name", "text", "settings", "mutate", "bad"),
    [(*one, bad) for *one, values in FAILURES for bad in values],
)
def test_a_run_with_a_wrong_number_fails(
    name: str,
    text: str | Scene,
    settings: tuple[str, ...],
    mutate: Mutation,
    bad: float,
    tmp_path: Path,
    afterwards: pytest.MonkeyPatch,
) -> None:
    mutate(afterwards, bad)
    summary = solve(text, tmp_path / "run", *settings)
    failed = [check["name"] for check in summary["checks"] if check["outcome"] == "failed"]
    assert (summary["status"], failed) == ("failed", [name]), summary["stop_reason"]
    if name in ("finite", "friction_limit"):
        nodes = summary["failure"]["worst_nodes"]
        assert len(nodes) == 10
        assert name == "finite" or max(node["cone_ratio"] for node in nodes) > 1.0


@pytest.mark.usefixtures("by_nodes")
@pytest.mark.parametrize("bad", [0.0, float("nan")])
@pytest.mark.parametrize(("text", "name"), [(PATCH, "contact_stability"), (BAR, "bulk_stability")])
def test_a_certificate(
    text: str, name: str, bad: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(certificate, name, lambda *arguments: bad)
    summary = solve(text, tmp_path / "run")
    assert (summary["status"], "stability" in summary["stop_reason"]) == ("failed", True)
    # Nothing was solved: the model is shown.
    mesh = meshio.read(tmp_path / "run" / "failure.vtu")
    assert {"normal", "partner", "spacing"} <= mesh.point_data.keys()


@pytest.mark.usefixtures("by_nodes")
def test_a_search_for_contact_without_end_tells_of_the_certificate(tmp_path: Path) -> None:
    zones = [(0.0, 0.032, 0.07), (-0.05, 0.004, 0.004), (0.05, 0.004, 0.004)]
    refine = ", ".join(f"{{at=[{x}, 0.0], spacing={h}, radius={r}}}" for x, h, r in zones)
    coarse = [f"body.{body}.refine=[{refine}]" for body in ("cylinder", "block")]
    summary = solve(hertz(), tmp_path / "run", "mls.degree=6", "body.*.spacing=0.8", *coarse)
    assert (summary["status"], "stability" in summary["stop_reason"]) == ("failed", True)
    assert summary["hint"].startswith("use mls.degree = 2")
    assert summary["stability"] < -1.0


@pytest.mark.parametrize("text", [hertz(), NODAL])
def test_slave_and_master_feel_the_same(tmp_path: Path, text: str) -> None:
    summary = solve(text, tmp_path / "run", EXACT_LAW)
    assert 0.0 <= summary["contacts"]["interface"]["force_mismatch"] <= 1e-6
    assert summary["limits"]["force_mismatch"] == 0.1


def test_what_a_failed_path_leaves(tmp_path: Path) -> None:
    console = Quiet()
    summary = solve(NODAL, tmp_path / "run", ANM, "solver.max_steps=9", console=console)
    assert summary["status"] == "failed"
    assert console.errors == [(summary["stop_reason"], summary["hint"])]
    failure = read_summary(tmp_path / "run" / "summary.json")["failure"]
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
