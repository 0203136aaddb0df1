"""The cases with friction: block, wedge, shear patch, partial slip; and the laws that states must keep."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.peers.scenes import REFERENCE, read_profile
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.io.run_reader import Dataset
from tests.cases.test_published import Run, solve

FRICTION = 0.3


@pytest.fixture(scope="module")
def exact(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Press, shear, unload, reverse by the exact law."""
    return solve("cattaneo_mindlin", tmp_path_factory.mktemp("friction") / "exact")


def contact_of(run: Run) -> Any:
    return run[1].contacts["interface"]


def row(run: Run, position: float) -> int:
    return int(np.flatnonzero(run[1].path.position == position)[0])


def even(contact: Dataset, traction: FloatArray, x: FloatArray) -> FloatArray:
    """The part of a traction that is even about the middle, at coordinates x."""
    order = np.argsort(contact.points[:, 0])
    nodes, values = contact.points[order, 0], traction[order]
    return 0.5 * (np.interp(x, nodes, values) + np.interp(-x, nodes, values))


def cattaneo(x: FloatArray, half: float, peak: float, part: float) -> FloatArray:
    stick = half * np.sqrt(1.0 - part)
    outer, inner = (np.sqrt(np.maximum(0.0, 1.0 - (x / r) ** 2)) for r in (half, stick))
    return np.asarray(FRICTION * peak * (outer - stick / half * inner))


def off(found: FloatArray, expected: FloatArray, over: FloatArray) -> float:
    return float(np.linalg.norm(found - expected) / np.linalg.norm(over))


def check_laws(run: Run, tolerance: float) -> None:
    """Cone, resultants, work, unknowns."""
    summary, data = run
    contact, path = contact_of(run), data.path
    figures = summary["contacts"]["interface"]
    assert figures["max_cone_ratio"] <= 1.0 + 1e-9
    assert summary["contact_unknowns"] == 2 * len(contact.arc_length)
    n_x, n_y = contact.normal.T
    pressed, rubbed = contact.pressure * contact.weight, contact.traction * contact.weight
    force_x, force_y = pressed @ n_x + rubbed @ n_y, pressed @ n_y - rubbed @ n_x
    applied = path.resultants["press"] + path.resultants["shear"]
    scale = np.abs(applied).max()
    assert np.abs(force_x + applied[:, 0]).max() <= 1e-9 * scale
    assert np.abs(force_y + applied[:, 1]).max() <= 1e-9 * scale
    assert np.diff(contact.dissipated_work).min() >= -1e-9 * contact.dissipated_work.max()
    assert figures["dissipated_work"] == contact.dissipated_work[-1] > 0.0
    assert path.residual.max() <= tolerance
    # What sticks, slips and is open is told of every node.
    closed = contact.status > 0
    assert contact.pressure[closed].min() >= -1e-11 * contact.pressure.max()
    assert figures["stick_nodes"] + figures["slip_nodes"] == closed[-1].sum()
    limit = FRICTION * contact.pressure
    slipping = (contact.status == 2) & (contact.pressure > 0.1 * contact.pressure.max())
    ratio = np.abs(contact.traction[slipping]) / limit[slipping]
    assert ratio.min() >= 0.98


def test_laws_of_the_exact_history(exact: Run) -> None:
    check_laws(exact, 1e-10)
    assert exact[0]["elastic_factorizations"] == 2


def test_reversal(exact: Run) -> None:
    contact, x = contact_of(exact), np.linspace(-0.065, 0.065, 2001)
    first, last = (even(contact, contact.traction[row(exact, p)], x) for p in (2.0, 4.0))
    assert off(last, -first, first) <= 0.02
    # On these finite bodies the shear is that of the half-plane within 1.7 %.
    assert off(first, -cattaneo(x, 0.05, 2884.7, 0.5), first) <= 0.02
    stick = contact.points[contact.status[row(exact, 2.0)] == 1, 0]
    assert 0.5 * np.ptp(stick) == pytest.approx(0.05 * np.sqrt(0.5), rel=0.01)


def test_the_history_is_that_of_finite_elements(exact: Run) -> None:
    assert exact[0]["nodes"] <= 400
    contact, x = contact_of(exact), np.linspace(-0.055, 0.055, 4001)
    for position, name in ((2.0, "slip"), (4.0, "history")):
        reference = read_profile(REFERENCE / f"{name}.csv", "traction").even()
        expected = np.interp(x, reference.x, reference.values)
        # Measured: 0.15 and 0.33 %.
        assert off(even(contact, contact.traction[row(exact, position)], x), expected, expected) <= 4e-3


def small(half: float) -> list[str]:
    """Overrides for a half-width of ``half`` instead of 0.05 on the same bodies and clouds."""
    scale = (half / 0.05) ** 2
    return [f"load.press.force=[0.0,{-226.566 * scale!r}]", f"load.shear.force=[{33.9849 * scale!r},0.0]"]


def test_cattaneo_and_mindlin(tmp_path: Path) -> None:
    run = solve("cattaneo_mindlin", tmp_path / "small", *small(0.01))
    contact, x = contact_of(run), np.linspace(-0.013, 0.013, 2001)
    first = cattaneo(x, 0.01, 2884.7 / 5.0, 0.5)
    unloading = first - 2.0 * cattaneo(x, 0.01, 2884.7 / 5.0, 0.25)
    for position, expected, bar in ((2.0, first, 5e-3), (3.0, unloading, 5e-3), (4.0, -first, 3e-3)):
        found = even(contact, contact.traction[row(run, position)], x)
        assert off(found, -expected, first) <= bar
    assert run[0]["nodes"] <= 400


def test_partial_slip_by_power_series(tmp_path: Path) -> None:
    # Half of its nodes, and no way back.
    short = ("stage=[{press=1.0}, {shear=1.0}]", "output.at=[2.0]")
    few = ("body.*.refine.0.growth=0.5", "body.*.refine.0.radius=0.105")
    run = solve("paper_partial_slip", tmp_path / "run", *short, *few)
    contact, x = contact_of(run), np.linspace(-0.11, 0.11, 401)
    found, expected = even(contact, contact.traction[-1], x), -cattaneo(x, 0.1, 5769.3, 0.5)
    # Sixteen nodes carry pressure; the middle, away from where slip begins, is nearer.
    assert off(found, expected, expected) <= 0.12
    middle = np.abs(x) <= 0.05
    assert off(found[middle], expected[middle], expected[middle]) <= 0.03
    stick = contact.points[contact.status[-1] == 1, 0]
    assert abs(0.5 * np.ptp(stick) - 0.1 * np.sqrt(0.5)) <= 0.0125
