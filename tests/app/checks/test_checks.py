"""Every check passes on sound values and warns or fails on others."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.checks import end
from mlsanm_cli.app.checks.check import Check, Verdicts
from mlsanm_cli.app.checks.energy import EnergyErrors
from mlsanm_cli.app.checks.limits import LIMITS
from mlsanm_cli.app.checks.peaks import Peak
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
        lambda x: end.peak_stress(ended(peaks={"arm": Peak(30.0, (1.0, 2.0), x)})),
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
    "rough_pressure_error": (lambda x: estimates(pressure={"pin": x, "bolt": 0.01}), 0.04, 0.12),
}


@pytest.mark.parametrize("name", CASES)
def test_a_check_passes_and_warns_or_fails(name: str) -> None:
    found, sound, bad = CASES[name]
    assert all(check.outcome == "passed" for check in found(sound))
    (check,) = [check for check in found(bad) if check.outcome != "passed"]
    assert (check.name, check.value) == (name, abs(bad))
    assert check.outcome == ("warned" if LIMITS[name].warns is not None else "failed")
    assert check.limit == LIMITS[name].first
    nan = [check for check in found(np.nan if name != "no_pressure" else 1.0) if check.name == name]
    assert nan[0].outcome != "passed"


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
