"""The monolithic formulation: the same states as the condensed one, by another way."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mlsanm_cli.app.assessment.checks import LINEAR_LIMIT
from mlsanm_cli.contact.laws.coupling import DenseCoupling
from mlsanm_cli.contact.laws.regularized_friction import RegularizedFriction
from mlsanm_cli.contact.monolithic.system import SparseCoupling
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.fields import fields_of
from mlsanm_cli.solve.paths import path_of
from mlsanm_cli.solve.series import coupling_of, regularization
from mlsanm_cli.solve.state import State
from tests.app.scenes import COARSE, PATCH, built_of, hertz, solve
from tests.contact.derivatives import tangent_times

pytestmark = pytest.mark.usefixtures("by_nodes")

CASES = Path(__file__).parents[2] / "cases"
AGREE = 1e-7
"""Largest difference of pressures, tractions and displacements, relative to the largest pressure and
displacement."""
# Inside steps states keep the tolerance, and differ by some ten times it.
SHARP = "solver.tolerance=1e-10"

LAW = "contact.interface.regularization"
SMOOTH = (f'{LAW}.law="hyperbolic"', f"{LAW}.eta=0.1", f"{LAW}.stick=1e-2")
FRICTIONAL = (*COARSE, *SMOOTH, f"{LAW}.eta=0.02")

EVEN = (
    *("body.cylinder.spacing=0.1", "body.cylinder.refine=[]"),
    *("body.block.spacing=0.08", "body.block.refine=[]"),
)

# Both motions are unknown, and the support at the side carries a part of what pushes along it.
PUSHED = PATCH.replace("fy = -200.0", "force = [30.0, -200.0]")
# Unknown rotation, all forces of the platen in balance with the contact's.
TILTING = PATCH.replace("fy = -200.0", 'fy = -200.0\nrotation = "free"').replace(
    'boundary = "upper.left"', 'body = "upper"\nnear = [1.0, 2.0]'
)
SCENES: dict[str, tuple[str, tuple[str, ...]]] = {
    "hertz": ("hertz", (*COARSE, *SMOOTH[:2], "output.at=[0.4, 1.0]")),
    "memory": (
        "cattaneo_mindlin",
        (*FRICTIONAL, "stage=[{press=1.0}, {shear=1.0}, {shear=0.5}]", "output.at=[1.0, 1.7, 2.0, 3.0]"),
    ),
    "holonomic": (
        "cattaneo_mindlin",
        (
            *FRICTIONAL,
            f'{LAW}.friction_law="holonomic"',
            "stage=[{press=1.0, shear=1.0}]",
            "output.at=[0.7, 1.0]",
        ),
    ),
    "ghost": (hertz(), (*COARSE, SMOOTH[1], 'mls.scheme="ghost"')),
    "pushed": (PUSHED, SMOOTH[:2]),
    "tilting": (TILTING, SMOOTH[:2]),
    "collocation": ("paper", (*EVEN, SMOOTH[1], 'mls.scheme="collocation"')),
}


def build(scene: str, formulation: str, directory: Path) -> CondensedScene:
    """A scene without its reference, ready for its path."""
    text, overrides = SCENES[scene]
    if "\n" not in text:
        text = (CASES / f"{text}.toml").read_text()
    case = directory / "case.toml"
    case.write_text(text.partition("[reference]")[0])
    return built_of(case, *overrides, SHARP, f'solver.formulation="{formulation}"')


def saved(built: CondensedScene) -> list[State]:
    return [state for step in path_of(built) for state in step.saved]


@pytest.mark.parametrize("scene", SCENES)
def test_both_formulations_reach_the_same_states(scene: str, tmp_path: Path) -> None:
    one, other = (build(scene, formulation, tmp_path) for formulation in ("condensed", "monolithic"))
    ours, theirs = saved(one), saved(other)
    assert len(ours) == len(one.case.output.at or (1.0,))
    peak = max(float(state.pressure.max()) for state in ours)
    for a, b in zip(ours, theirs, strict=True):
        assert a.position == b.position
        assert np.abs(a.pressure - b.pressure).max() <= AGREE * peak
        assert np.abs(a.traction - b.traction).max(initial=0.0) <= AGREE * peak
        assert np.abs(a.motion - b.motion).max(initial=0.0) <= AGREE * np.abs(a.motion).max(initial=0.0)
        fields, _ = fields_of(one, [a], stress=False)[0]
        found, linear = fields_of(other, [b], stress=False)[0]
        assert linear <= LINEAR_LIMIT
        for name in fields:
            largest = np.abs(fields[name].displacement).max()
            assert np.abs(fields[name].displacement - found[name].displacement).max() <= AGREE * largest
    assert len(theirs[0].displacement) == sum(body.model.unknowns for body in other.scene.bodies.values())
    assert not len(ours[0].displacement)


@pytest.mark.parametrize("scene", ["pushed", "ghost"])
def test_tangents_undo_the_residuals_derivative(scene: str, tmp_path: Path) -> None:
    built = build(scene, "monolithic", tmp_path)
    problem = RegularizedFriction.frictionless(
        coupling_of(built, regularization(built)), built.stages[0], built.stages[1]
    )
    rng = np.random.default_rng(1)
    x, v = rng.uniform(0.5, 1.5, (2, problem.size)) * problem.scale
    found = problem.tangent(x, 0.3).solve(tangent_times(problem, x, 0.3, v))
    assert np.abs((found - v) / problem.scale).max() <= 1e-6
    moved = problem.residual(x, 1.0) - problem.residual(x, 0.0)
    assert problem.load_derivative(x, 0.3) == pytest.approx(moved, abs=1e-9)
    assert np.abs(moved).max() > 0.1


@pytest.mark.parametrize("scene", ["memory", "pushed"])
def test_rows_are_the_condensed_ones_at_what_the_bodies_answer(scene: str, tmp_path: Path) -> None:
    built = build(scene, "monolithic", tmp_path)
    law = regularization(built)
    ours, theirs = coupling_of(built, law).with_stick_compliance(), DenseCoupling.of(built.condensed, law)
    assert isinstance(ours, SparseCoupling)
    rng, c = np.random.default_rng(2), built.condensed
    p, t = (
        law.pressure * rng.uniform(0.0, 1.0, len(c.weight)),
        law.pressure * rng.normal(size=len(c.friction_nodes)),
    )
    f = np.asarray(rng.uniform(size=built.stages.shape[1]))
    q = law.motion * rng.normal(size=len(law.motion))
    u = [c.displacement(built.scene, name, (f, q, p, t)).ravel() for name in built.scene.bodies]
    found = ours(f, np.concatenate([p, t, q, *u]))
    wanted = theirs.with_stick_compliance()(f, np.concatenate([p, t, q]))
    assert found[: len(wanted)] == pytest.approx(wanted, rel=1e-7, abs=1e-7 * np.abs(wanted).max())
    assert np.abs(found[len(wanted) :]).max() <= 1e-9
    u[0][:] *= 1.001
    assert np.abs(ours(f, np.concatenate([p, t, q, *u]))[len(wanted) :]).max() > 1e-6


def test_the_published_route_on_a_coarser_cloud(tmp_path: Path) -> None:
    summary = solve((CASES / "paper.toml").read_text(), tmp_path / "run", *EVEN)
    assert summary["status"] == "done"
    assert summary["contacts"]["interface"]["reference"]["pressure_error_l2"] <= 0.2
    assert summary["linear_residual"] <= 1e-9
    # Scales and certificate come from the condensed problem, whose cost is told apart.
    assert summary["seconds"]["condensation"] > 0.0
    assert summary["seconds"]["continuation"] > summary["seconds"]["factorization"]
