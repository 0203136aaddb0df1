"""Newton-Raphson, and the monolithic formulation: the same states by other ways."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from mlsanm_cli.app.checks.verdicts import LINEAR_LIMIT
from mlsanm_cli.app.results.path_lookup import INTERPOLATED, level_at, pressures_at
from mlsanm_cli.contact.laws.coupling import DenseCoupling
from mlsanm_cli.contact.laws.regularized_friction import RegularizedFriction
from mlsanm_cli.contact.monolithic.system import SparseCoupling
from mlsanm_cli.io.run_reader import read_run
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.fields import fields_of
from mlsanm_cli.solve.paths import path_of
from mlsanm_cli.solve.series import coupling_of, regularization
from mlsanm_cli.solve.state import State
from tests.app.scenes import (
    ANM,
    COARSE,
    HOLONOMIC,
    NEWTON,
    NODAL,
    PATCH,
    SHEARED,
    SMOOTH_LAW,
    built,
    done,
    hertz,
    solve,
)
from tests.contact.derivatives import tangent_times

CASES = Path(__file__).parents[3] / "cases"
AGREE = 1e-7
"""Largest difference of pressures, tractions and displacements, relative to the largest pressure and
displacement."""


def published(name: str) -> str:
    """A published case without its reference."""
    return (CASES / f"{name}.toml").read_text().partition("[reference]")[0]


def assert_agree(one: State, other: State, peak: float) -> None:
    assert one.position == other.position
    assert np.abs(one.pressure - other.pressure).max() <= AGREE * peak
    assert np.abs(one.traction - other.traction).max(initial=0.0) <= AGREE * peak


def saved(scene: CondensedScene, **solver: Any) -> list[State]:
    """The wanted states, maybe by another method or tolerance; no step exceeds the tolerance."""
    settings = scene.case.solver.model_copy(update=solver)
    steps = list(path_of(replace(scene, case=scene.case.model_copy(update={"solver": settings}))))
    assert max(step.state.residual for step in steps) <= settings.tolerance
    return [state for step in steps for state in step.saved]


@pytest.mark.parametrize(
    ("text", "at", "settings"),
    [
        (published("hertz"), [0.3, 0.7, 1.0], (SMOOTH_LAW, "contact.*.accuracy=0.03")),
        (published("block_slide"), [0.5, 1.0, 1.5, 2.0, 2.5, 3.0], (SMOOTH_LAW, "contact.*.accuracy=0.1")),
        (
            published("cattaneo_mindlin"),
            [0.5, 1.0, 1.5, 2.0, 3.0, 4.0],
            (SMOOTH_LAW, "contact.*.accuracy=0.03"),
        ),
        (SHEARED, [1.0, 1.4, 2.0], (HOLONOMIC, "stage=[{press=1.0},{shear=1.0}]")),
    ],
    ids=["hertz", "block_slide", "cattaneo_mindlin", "without memory"],
)
def test_newton_finds_the_states_of_series(
    text: str, at: list[float], settings: tuple[str, ...], tmp_path: Path
) -> None:
    scene = built(text, tmp_path, f"output.at={at}", *settings)
    # Inside a step a series is as good as its residual, times what the contact makes of that.
    series = saved(scene, method="anm", tolerance=1e-10)
    newton = saved(scene, method="newton")
    assert [state.position for state in newton] == at
    for one, other in zip(series, newton, strict=True):
        assert_agree(one, other, float(one.pressure.max()))
        assert (one.status == other.status).all()
        # Dissipation, where the law has any, is summed by trapezoids over the steps, which differ.
        works = np.nan_to_num(one.work), np.nan_to_num(other.work)
        assert np.abs(works[0] - works[1]).max(initial=0.0) <= 1e-3 * works[0].max(initial=1.0)


def test_what_newton_stores(tmp_path: Path) -> None:
    solve(NODAL, tmp_path / "series", "output.at=[0.3, 0.7, 1.0]", ANM)
    summary = done(NODAL, tmp_path / "run", "output.at=[0.3, 0.7, 1.0]", NEWTON)
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


def test_a_path_by_newton_cut_short_says_so(tmp_path: Path) -> None:
    summary = solve(hertz(), tmp_path / "run", NEWTON, "solver.max_steps=3")
    assert (summary["status"], summary["steps"]) == ("failed", 3)
    assert "max steps" in summary["stop_reason"]


LAW = "contact.interface.regularization"
SMOOTH = (SMOOTH_LAW, f"{LAW}.eta=0.1")
FRICTIONAL = (*COARSE, SMOOTH_LAW, f"{LAW}.eta=0.02", f"{LAW}.stick=1e-2")
EVEN = [
    f"body.{body}.{key}"
    for body, spacing in (("cylinder", 0.1), ("block", 0.08))
    for key in (f"spacing={spacing}", "refine=[]")
]

# Both motions are unknown, and the support at the side carries a part of what pushes along it.
PUSHED = PATCH.changed("fy = -200.0", "force = [30.0, -200.0]")
# Unknown rotation, all forces of the platen in balance with the contact's.
TILTING = PATCH.changed("fy = -200.0", 'fy = -200.0\nrotation = "free"').changed(
    'boundary = "upper.left"', 'body = "upper"\nnear = [1.0, 2.0]'
)
FRICTION = published("cattaneo_mindlin")
TURNED = ("stage=[{press=1.0}, {shear=1.0}, {shear=0.5}]", "output.at=[1.0, 1.7, 2.0, 3.0]")
ONCE = (HOLONOMIC, "stage=[{press=1.0, shear=1.0}]", "output.at=[0.7, 1.0]")
SCENES: dict[str, tuple[str, tuple[str, ...]]] = {
    "hertz": (published("hertz"), (*COARSE, *SMOOTH, "output.at=[0.4, 1.0]")),
    "memory": (FRICTION, (*FRICTIONAL, *TURNED)),
    "holonomic": (FRICTION, (*FRICTIONAL, *ONCE)),
    "ghost": (hertz(), (*COARSE, SMOOTH[1], "mls.scheme=ghost")),
    "pushed": (PUSHED, SMOOTH),
    "tilting": (TILTING, SMOOTH),
    "collocation": (published("paper"), (*EVEN, SMOOTH[1], "mls.scheme=collocation")),
}


def formulated(name: str, formulation: str, directory: Path) -> CondensedScene:
    """A scene without its reference, ready for its path by a formulation.

    Inside steps states keep the tolerance, and differ by some ten times it.
    """
    text, overrides = SCENES[name]
    sharp = ("solver.tolerance=1e-10", f"solver.formulation={formulation}")
    return built(text.partition("[reference]")[0], directory, *overrides, *sharp)


@pytest.mark.usefixtures("by_nodes")
@pytest.mark.parametrize("scene", SCENES)
def test_both_formulations_reach_the_same_states(scene: str, tmp_path: Path) -> None:
    one, other = (formulated(scene, formulation, tmp_path) for formulation in ("condensed", "monolithic"))
    ours, theirs = saved(one), saved(other)
    assert len(ours) == len(one.case.output.at or (1.0,))
    peak = max(float(state.pressure.max()) for state in ours)
    for a, b in zip(ours, theirs, strict=True):
        assert_agree(a, b, peak)
        assert np.abs(a.motion - b.motion).max(initial=0.0) <= AGREE * np.abs(a.motion).max(initial=0.0)
        fields, _ = fields_of(one, [a], stress=False)[0]
        found, linear = fields_of(other, [b], stress=False)[0]
        assert linear <= LINEAR_LIMIT
        for name in fields:
            largest = np.abs(fields[name].displacement).max()
            assert np.abs(fields[name].displacement - found[name].displacement).max() <= AGREE * largest
    assert len(theirs[0].displacement) == sum(body.model.unknowns for body in other.scene.bodies.values())
    assert not len(ours[0].displacement)


@pytest.mark.usefixtures("by_nodes")
@pytest.mark.parametrize("scene", ["pushed", "ghost"])
def test_tangents_undo_the_residuals_derivative(scene: str, tmp_path: Path) -> None:
    made = formulated(scene, "monolithic", tmp_path)
    coupling = coupling_of(made, regularization(made))
    problem = RegularizedFriction.frictionless(coupling, made.stages[0], made.stages[1])
    rng = np.random.default_rng(1)
    x, v = rng.uniform(0.5, 1.5, (2, problem.size)) * problem.scale
    found = problem.tangent(x, 0.3).solve(tangent_times(problem, x, 0.3, v))
    assert np.abs((found - v) / problem.scale).max() <= 1e-6
    moved = problem.residual(x, 1.0) - problem.residual(x, 0.0)
    assert problem.load_derivative(x, 0.3) == pytest.approx(moved, abs=1e-9)
    assert np.abs(moved).max() > 0.1


@pytest.mark.usefixtures("by_nodes")
@pytest.mark.parametrize("scene", ["memory", "pushed"])
def test_rows_are_the_condensed_ones_at_what_the_bodies_answer(scene: str, tmp_path: Path) -> None:
    made = formulated(scene, "monolithic", tmp_path)
    law = regularization(made)
    ours, theirs = coupling_of(made, law).with_stick_compliance(), DenseCoupling.of(made.condensed, law)
    assert isinstance(ours, SparseCoupling)
    rng, c = np.random.default_rng(2), made.condensed
    p = law.pressure * rng.uniform(0.0, 1.0, len(c.weight))
    t = law.pressure * rng.normal(size=len(c.friction_nodes))
    f = np.asarray(rng.uniform(size=made.stages.shape[1]))
    q = law.motion * rng.normal(size=len(law.motion))
    u = [c.displacement(made.scene, name, (f, q, p, t)).ravel() for name in made.scene.bodies]
    found = ours(f, np.concatenate([p, t, q, *u]))
    wanted = theirs.with_stick_compliance()(f, np.concatenate([p, t, q]))
    assert found[: len(wanted)] == pytest.approx(wanted, rel=1e-7, abs=1e-7 * np.abs(wanted).max())
    assert np.abs(found[len(wanted) :]).max() <= 1e-9
    u[0][:] *= 1.001
    assert np.abs(ours(f, np.concatenate([p, t, q, *u]))[len(wanted) :]).max() > 1e-6


@pytest.mark.usefixtures("by_nodes")
def test_the_published_route_on_a_coarser_cloud(tmp_path: Path) -> None:
    summary = done((CASES / "paper.toml").read_text(), tmp_path / "run", *EVEN)
    assert summary["contacts"]["interface"]["reference"]["pressure_error_l2"] <= 0.2
    assert summary["linear_residual"] <= 1e-9
    # Scales and certificate come from the condensed problem, whose cost is told apart.
    assert summary["seconds"]["condensation"] > 0.0
    assert summary["seconds"]["continuation"] > summary["seconds"]["factorization"]
