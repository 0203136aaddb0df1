"""The regularised laws in one system: its derivatives, collocation, friction with history, two methods."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sparse
from scipy.sparse.linalg import spsolve

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation.problem import Problem
from mlsanm_cli.io.run_reader import read_run
from mlsanm_cli.paper import system as system_module
from mlsanm_cli.paper.system import Collocation, System, Tangent
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.paths import load_path
from mlsanm_cli.solve.state import State
from tests.app.scenes import NEWTON, NODAL, SHEARED, SMOOTH, built, done, hertz, refused, solve
from tests.case_text import scene
from tests.mechanics.bodies import boundary_values, build, with_body_force
from tests.mechanics.test_body import HELDS, patch


def tangent_times(problem: Problem, x: FloatArray, lam: float, v: FloatArray) -> FloatArray:
    """The derivative of the residual along v; central differences are exact for quadratic equations."""
    return 0.5 * (problem.residual(x + v, lam) - problem.residual(x - v, lam))


def highest_terms(problem: Problem, x: FloatArray, lam: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Along x(a) = sum x_r a^r, (order + 1, size), lam(a) likewise: the residual's coefficient of a^order,
    interpolated; what tangent, load derivative and right-hand side make of it; the largest coefficient."""
    order = len(lam) - 1
    nodes = np.cos(np.pi * (np.arange(2 * order + 1) + 0.5) / (2 * order + 1))
    powers = nodes[:, None] ** np.arange(order + 1)
    residuals = [problem.residual(p @ x, float(p @ lam)) for p in powers]
    coefficients = np.linalg.solve(nodes[:, None] ** np.arange(2 * order + 1), np.array(residuals))
    expected = tangent_times(problem, x[0], lam[0], x[order])
    expected += problem.load_derivative(x[0], lam[0]) * lam[order]
    expected -= problem.series_rhs(x[:order], lam[:order])
    return coefficients[order], expected, float(np.abs(coefficients).max())


LAW = "contact.interface.regularization"


def states(scene: CondensedScene, law: str = "hyperbolic", **solver: Any) -> list[State]:
    """The requested states, by another law, method or tolerance."""
    case = scene.case
    (contact,) = case.contact
    chosen = contact.model_copy(
        update={"regularization": contact.regularization.model_copy(update={"law": law})}
    )
    settings = case.solver.model_copy(update=solver)
    case = case.model_copy(update={"solver": settings, "contact": (chosen,)})
    return [state for step in load_path(replace(scene, case=case)) for state in step.saved]


@pytest.mark.parametrize("text", [hertz(), SHEARED], ids=["frictionless", "friction"])
def test_tangents_and_series_are_derivatives_of_the_residual(text: str, tmp_path: Path) -> None:
    problem, rng = System(built(text, tmp_path, *SMOOTH)), np.random.default_rng(1)
    x, v = rng.uniform(0.5, 1.5, (2, problem.size)) * problem.scale
    found = problem.tangent(x, 0.3).solve(tangent_times(problem, x, 0.3, v))
    assert np.abs((found - v) / problem.scale).max() <= 1e-6
    series = rng.normal(size=(4, problem.size)) * problem.scale
    coefficient, expected, largest = highest_terms(problem, series, rng.normal(size=4))
    assert np.abs(coefficient - expected).max() <= 1e-9 * largest


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
@pytest.mark.parametrize("held", HELDS)
def test_collocation_reproduces_polynomials(degree: int, held: dict[str, tuple[bool, bool]]) -> None:
    body, exact = patch(degree, held)
    source = with_body_force(body, boundary_values(body, exact.displacement, exact.stress), exact.force)
    equations = Collocation(body)
    expected = exact.displacement(body.model.cloud.points).ravel()
    assert np.abs(equations.residual_vector(source, expected)).max() <= 1e-11 * np.abs(expected).max()
    found = spsolve(sparse.csc_matrix(equations.matrix), equations.choice @ source)
    assert np.abs(found - expected).max() <= 1e-9 * np.abs(expected).max()


def test_collocation_knows_single_held_nodes() -> None:
    body, _ = patch(2, HELDS[0])
    held = build(body.model.cloud, {"bottom": (False, True)}, held_nodes=((0, 0),))
    rows = Collocation(held).matrix.toarray()
    assert rows[0].tolist() == np.eye(len(rows))[0].tolist()


@pytest.mark.parametrize(
    ("text", "changes"),
    [(SHEARED, "output.at=[0.5, 1.0, 1.6, 2.0, 3.0]"), (hertz(), "mls.scheme=collocation")],
    ids=["history", "collocation"],
)
def test_newton_has_the_states_of_series(text: str, changes: str, tmp_path: Path) -> None:
    scene = built(text, tmp_path, *SMOOTH, changes)
    series, newton = states(scene, tolerance=1e-10), states(scene, method="newton")
    peak = max(float(state.pressure.max()) for state in series)
    assert [state.position for state in newton] == [*(scene.case.output.at or (1.0,))]
    for one, other in zip(series, newton, strict=True):
        assert np.abs(one.pressure - other.pressure).max() <= 1e-7 * peak
        assert np.abs(one.traction - other.traction).max(initial=0.0) <= 1e-7 * peak
        largest = np.abs(one.work).max(initial=1e-30)
        assert np.abs(one.work - other.work).max(initial=0.0) <= 1e-6 * largest


def test_friction_remembers(tmp_path: Path) -> None:
    """Sheared, let go, sheared back: what has slipped keeps tractions."""
    history = (
        "stage=[{press=1.0}, {shear=1.0}, {shear=0.0}, {shear=-1.0}]",
        "output.at=[1.0, 2.0, 3.0, 4.0]",
    )
    summary = done(SHEARED, tmp_path / "run", *SMOOTH, *history, "solver.increments=10")
    contact = read_run(tmp_path / "run").contacts["interface"]
    position = read_run(tmp_path / "run").path.position
    pressed, sheared, released, back = (
        contact.traction[int(np.flatnonzero(position == at)[0])] for at in (1.0, 2.0, 3.0, 4.0)
    )
    largest = np.abs(sheared).max()
    assert np.abs(released - pressed).max() > 0.2 * largest
    weight = contact.weight
    assert weight @ released == pytest.approx(0.0, abs=1e-6 * weight @ np.abs(sheared))
    # Collocated bodies balance their loads to 4e-5, both ways alike.
    assert weight @ back == pytest.approx(-weight @ sheared, rel=2e-6)
    assert np.diff(contact.dissipated_work).min() >= -0.01 * contact.dissipated_work[-1]
    assert summary["contacts"]["interface"]["max_cone_ratio"] <= 1.1


def test_smaller_parameters_lead_to_the_exact_law(tmp_path: Path) -> None:
    errors, sheared = [], (*SMOOTH, "output.at=[2.0]")
    (exact,) = states(built(SHEARED, tmp_path, *sheared), method="active-set", law="exact")
    for small in (1e-2, 1e-3):
        parameters = (f"{LAW}.eta={small}", f"{LAW}.stick={small}")
        (found,) = states(built(SHEARED, tmp_path, *sheared, *parameters))
        errors.append(float(np.abs(found.traction - exact.traction).max()))
    largest = np.abs(exact.traction).max()
    assert errors[1] < 0.5 * errors[0] < 0.5 * largest


@pytest.mark.parametrize("method", ["anm", "newton"])
def test_factorisations_are_those_made(method: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made, tangent = [], Tangent.__init__

    def counted(*given: Any) -> None:
        made.append(1)
        tangent(*given)

    monkeypatch.setattr(system_module.Tangent, "__init__", counted)
    summary = done(SHEARED, tmp_path / "run", *SMOOTH, f"solver.method={method}", "output.at=[0.7, 2.0]")
    assert summary["factorizations"] == len(made) > 0


def test_sliding_as_a_whole_ends_the_run(tmp_path: Path) -> None:
    summary = solve(SHEARED, tmp_path / "run", *SMOOTH, "load.shear.fx=180.0", "solver.max_steps=200")
    assert summary["status"] == "failed"
    assert 1.3 < summary["position"] < 1.6


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        (("solver.polish=true",), "solver.polish", "remove it"),
        ((f"{LAW}.friction_law=holonomic",), f"{LAW}.friction_law", "remove it"),
        (("mls.scheme=ghost",), "mls.scheme", "least-squares"),
        (("mls.scheme=collocation",), "mls.scheme", "hyperbolic"),
    ],
)
def test_what_is_gone_is_told(changes: tuple[str, ...], key: str, words: str, tmp_path: Path) -> None:
    refused(NODAL, tmp_path / "run", key, words, *changes)


def test_automatic_clouds_resolve_nodal_pressures(tmp_path: Path) -> None:
    """A published case for contact grids, by the regularised law instead."""
    hertz_case = (Path(__file__).parents[2] / "cases/hertz.toml").read_text()
    summary = done(hertz_case, tmp_path / "run", NEWTON, "output.vtu=false")
    contact = summary["contacts"]["interface"]
    assert contact["peak_pressure"] == pytest.approx(contact["reference"]["peak_pressure"], rel=0.01)


def test_bodies_that_float_on_the_law_are_named(tmp_path: Path) -> None:
    """Beside a loaded contact the law holds a light body off by what the warning says."""
    text = scene("strain", E=1.0)
    for name, x, force in (("loaded", 0.0, -1e-3), ("light", 3.0, -1e-6)):
        text = (
            text.body(name, "steel", 0.25, box=([x, x + 1.0], [0.0, 1.0]))
            .body(f"{name}-floor", "steel", 0.25, box=([x, x + 1.0], [-1.0, 0.0]))
            .support(f"{name}-floor.bottom", ux=0.0, uy=0.0)
            .load(name, f"{name}.top", "platen", ux=0.0, fy=force)
            .contact(f"{name}-foot", f"{name}.bottom", f"{name}-floor.top", friction=0.3)
        )
    laws = [f'contact.{name}-foot.regularization.law="hyperbolic"' for name in ("loaded", "light")]
    floating = solve(text, tmp_path / "floating", *laws)
    solve(text, tmp_path / "exact")
    (found,) = [one for one in floating["checks"] if one["name"] == "law_gap" and one["outcome"] == "warned"]
    assert found["place"] == "contact light-foot"
    down = [read_run(tmp_path / name).path.displacements["light"][-1, 1] for name in ("floating", "exact")]
    assert (down[0] - down[1]) / abs(down[0]) == pytest.approx(found["value"], rel=0.4)
