"""Every check passes on sound values and warns or fails on others."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.checks import end, quality, states
from mlsanm_cli.app.checks.check import Check, Verdicts
from mlsanm_cli.app.checks.energy import EnergyErrors
from mlsanm_cli.app.checks.limits import LIMITS
from mlsanm_cli.app.finite import checks as finite
from mlsanm_cli.app.finite.states import deformation, overlap, stability
from mlsanm_cli.cloud.cloud import build_cloud
from mlsanm_cli.cloud.curves import rectangle
from mlsanm_cli.cloud.spacing import Spacing
from mlsanm_cli.errors import NumericalError

ARM = SimpleNamespace(name="arm", has_nodes=False, material="steel")
CASE: Any = SimpleNamespace(body=[ARM], touching=(), contact=())
PAIRS = [SimpleNamespace(name=name, grid=None, friction=0.0, bodies=("arm",)) for name in ("pin", "bolt")]
BUILT: Any = SimpleNamespace(
    case=CASE,
    scene=SimpleNamespace(bodies={"arm": None}),
    condensed=SimpleNamespace(pairings=PAIRS, probes=()),
    stays_open=True,
)


def ended(**values: Any) -> Any:
    given = {"case": CASE, "built": BUILT, "energies": EnergyErrors({"arm": 0.0}), "imbalance": {"arm": 0.0}}
    return SimpleNamespace(**given | values)


def estimates(displacement: float | None = 0.0, **figures: Any) -> Iterable[Check]:
    missing = "" if displacement is not None else "too few nodes; use finer nodes"
    return end.estimates(BUILT, {"displacement": displacement, "pressure": {}} | figures, missing)


def model(closest: float = 0.8, hole: float = 1.1, growth: float = 0.2, nodes: bool = False) -> Any:
    cloud = {"closest": closest, "hole": hole, "growth": growth}
    body = SimpleNamespace(name="arm", has_nodes=nodes, refine=())
    return SimpleNamespace(case=SimpleNamespace(body=[body]), bodies={"arm": cloud})


def gap(size: float) -> Any:
    points = np.array([[0.0, 0.0], [1.0, 2.0]])
    models = {"arm": SimpleNamespace(cloud=SimpleNamespace(points=points))}
    pairing = SimpleNamespace(name="pin", bodies=("arm",), gap=np.array([size, 9.0]), closed_by=0.0)
    return SimpleNamespace(prepared=SimpleNamespace(models=models, pairings=[pairing]))


def rough(coefficient: float) -> Any:
    contact = SimpleNamespace(
        name="pin", friction=coefficient, regularization=SimpleNamespace(friction_law="memory")
    )
    return SimpleNamespace(case=SimpleNamespace(load=(), touching=[contact]))


def state(residual: float = 0.0, is_finite: bool = True, **more: Any) -> Any:
    return SimpleNamespace(residual=residual, position=0.5, is_finite=is_finite, **more)


def deformed(stretch: float, waves: float) -> Iterable[Check]:
    """One node of a body, stretched in x."""
    model = SimpleNamespace(cloud=SimpleNamespace(points=np.zeros((1, 2))))
    body = SimpleNamespace(
        gradient=lambda own: np.array([[stretch - 1.0], [0.0], [0.0], [0.0]]),
        ellipticity=lambda own, factors: np.array([waves]),
        law=SimpleNamespace(kind="neo-hookean"),
        elastic=SimpleNamespace(model=model),
    )
    scene: Any = SimpleNamespace(parts=lambda values: {"arm": values}, bodies={"arm": body})
    last: Any = SimpleNamespace(displacement=None, factors=None, position=0.5)
    return deformation(scene, last)


def twisted(angle: float) -> Iterable[Check]:
    """A square whose top is turned over: at pi it is a bow tie."""
    cloud = build_cloud(rectangle((-1.0, 1.0), (-1.0, 1.0)), Spacing(0.4), 0)
    x, y = cloud.points.T
    moved = np.stack([x * (np.cos(angle * (0.5 + 0.5 * y)) - 1.0), np.zeros_like(x)], axis=1)
    body = SimpleNamespace(elastic=SimpleNamespace(model=SimpleNamespace(cloud=cloud)))
    scene: Any = SimpleNamespace(
        in_increments=True,
        shown=lambda state: moved.ravel(),
        parts=lambda values: {"arm": values},
        bodies={"arm": body},
        contacts=SimpleNamespace(pairs=[]),
    )
    last: Any = SimpleNamespace(position=0.5, driven=None)
    return overlap(scene, last)


def touched(**errors: Any) -> Any:
    contact = SimpleNamespace(name="pin", sides=[SimpleNamespace(body="arm")])
    scene = SimpleNamespace(contacts=SimpleNamespace(pairs=[contact]))
    return SimpleNamespace(case=CASE, scene=scene, errors={"displacement": None} | errors)


BY_SERIES = EnergyErrors({"arm": 0.0}, name="series_energy_error", what="the work of stresses in")
Found = Callable[[float], Iterable[Check]]
CASES: dict[str, tuple[Found, float, float]] = {
    "force_balance": (lambda x: end.balance(ended(imbalance={"leg": 0.001, "arm": x})), 0.02, 0.05),
    "energy_error": (lambda x: end.work(ended(energies=EnergyErrors({"leg": 0.001, "arm": x}))), 0.02, -0.05),
    "single_nodes": (
        lambda x: end.single_nodes(ended(energies=EnergyErrors({}, pointed={"arm": x}))),
        0.02,
        0.04,
    ),
    "strain": (lambda x: end.strain(ended(energies=EnergyErrors({}, {"arm": x}))), 0.05, 0.2),
    "linear_residual": (lambda x: end.linear_residual(ended(linear_residual=x)), 1e-9, 1e-3),
    "peak_stress": (
        lambda x: end.peak_stress(ended(peaks={"arm": {"stress": 30.0, "place": (1.0, 2.0), "error": x}})),
        0.01,
        0.04,
    ),
    "no_pressure": (
        lambda x: end.no_pressure(ended(case=SimpleNamespace(touching=[None] * int(x)))),
        0.0,
        1.0,
    ),
    "displacement_error": (lambda x: estimates(x, probes={"tip": 0.009}), 0.009, 0.37),
    "force_error": (lambda x: estimates(force={"pin": x}), 0.004, 0.006),
    "series_energy_error": (
        lambda x: end.work(ended(energies=replace(BY_SERIES, bodies={"arm": x}))),
        0.005,
        0.02,
    ),
    "node_distance": (lambda x: quality.clouds(model(closest=x)), 0.6, 0.4),
    "node_hole": (lambda x: quality.clouds(model(hole=x)), 1.2, 1.7),
    "spacing_growth": (lambda x: quality.clouds(model(growth=x)), 0.3, 0.31),
    "mesh_growth": (lambda x: quality.clouds(model(growth=x, nodes=True)), 0.5, 0.7),
    "initial_gap": (lambda x: quality.initial_gap(gap(2.0 * x)), 0.1, 0.5),
    "friction_coefficient": (lambda x: quality.friction(rough(x)), 0.9, 40.0),
    "finite": (lambda x: states.finite(BUILT, state(is_finite=not x)), 0.0, 1.0),
    "volume_ratio": (lambda x: deformed(x, 1.0), 0.2, -0.1),
    "ellipticity": (lambda x: deformed(1.0, x), 0.2, 0.05),
    "stability": (lambda x: stability(BUILT, state(solver={"stability": x})), 0.5, 0.1),
    "finite_force_error": (lambda x: finite.estimates(touched(contacts={"pin": x})), 0.01, 0.02),
    "rough_pressure_error": (lambda x: estimates(pressure={"pin": x, "bolt": 0.01}), 0.04, 0.12),
}


COUNTS = {"no_pressure", "finite"}


@pytest.mark.parametrize("name", CASES)
def test_a_check_passes_and_warns_or_fails(name: str) -> None:
    found, sound, bad = CASES[name]
    assert all(check.outcome == "passed" for check in found(sound))
    (check,) = [check for check in found(bad) if check.outcome != "passed"]
    assert check.name == name
    assert check.value == pytest.approx(bad if LIMITS[name].lower else abs(bad))
    assert check.outcome == ("warned" if LIMITS[name].warns is not None else "failed")
    assert check.limit == LIMITS[name].first


@pytest.mark.parametrize("name", [name for name in CASES if name not in COUNTS])
def test_nan_is_never_sound(name: str) -> None:
    check = next(check for check in CASES[name][0](np.nan) if check.name == name)
    assert check.outcome != "passed"


@pytest.mark.parametrize(("angle", "outcome"), [(0.5, "passed"), (3.0, "failed")])
def test_a_body_that_touches_itself(angle: float, outcome: str) -> None:
    (check,) = [check for check in twisted(angle) if check.name == "self_overlap"]
    assert check.outcome == outcome


def test_a_residual_is_compared_with_the_tolerance() -> None:
    built: Any = SimpleNamespace(case=SimpleNamespace(solver=SimpleNamespace(tolerance=1e-8)))
    outcomes = [next(states.residual(built, state(residual=x))).outcome for x in (1e-9, 1e-7, np.nan)]
    assert outcomes == ["passed", "failed", "failed"]


@pytest.mark.parametrize("name", LIMITS)
def test_outcomes(name: str) -> None:
    limit = LIMITS[name]
    beyond = -1.0 if limit.lower else 1.0
    for level, outcome in ((limit.warns, "warned"), (limit.fails, "failed")):
        if level is not None:
            past = Check(name, level + 0.01 * beyond, "")
            assert (past.outcome, past.limit) == (outcome, level)
            assert Check(name, level, "").outcome != outcome
    assert Check(name, np.nan, "", fails=1.0).outcome == "failed"


def test_verdicts_keep_the_worst_warn_once_and_fail() -> None:
    told: list[str] = []
    verdicts = Verdicts(lambda check: told.append(check.text))

    def balance(error: float, place: str) -> Check:
        return Check("force_balance", error, f"{place} {error}", "finer nodes", place)

    verdicts.judge(balance(*one) for one in ((0.01, "arm"), (0.05, "arm"), (0.04, "arm"), (0.02, "leg")))
    assert told == ["arm 0.05; finer nodes"]
    with pytest.raises(NumericalError, match=r"leg 0\.2"):
        verdicts.judge([balance(0.2, "leg"), balance(0.3, "leg")])
    assert verdicts.rows == [
        {"name": "force_balance", "place": "arm", "value": 0.05, "limit": 0.03, "outcome": "warned"},
        {"name": "force_balance", "place": "leg", "value": 0.2, "limit": 0.1, "outcome": "failed"},
    ]
    resumed = Verdicts(lambda check: told.append(check.text))
    resumed.judge([balance(0.01, "leg")])
    assert resumed.take_up(verdicts.plain[:1]) == ["arm 0.05; finer nodes"]
    resumed.judge([balance(0.05, "arm")])
    assert len(told) == 1


def test_estimates_that_are_missing() -> None:
    (check,) = estimates(None)
    assert (check.name, check.outcome) == ("missing_estimates", "warned")


def test_the_probe_with_the_largest_error_is_named() -> None:
    (check,) = [one for one in estimates(0.01, probes={"tip": 0.05, "root": 0.02}) if one.outcome != "passed"]
    assert "at probe tip" in check.message
    assert "body.arm.spacing" in check.hint
