"""Gaps given as expressions, on surfaces drawn flat, against closed formulas."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mlsanm_cli.app.run import run
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import CaseError
from mlsanm_cli.io.run_reader import ContactData, read_run
from tests.app.scenes import Quiet, solve
from tests.case_text import body, box, contact, head, load, material, pin, plane, support

E, NU = 1000.0, 0.3
HEAD = head("strain") + material("stuff", E=E, nu=NU)
CLAMP = support("lower.bottom", uy=0.0)


def block(name: str, x: tuple[float, float], y: tuple[float, float]) -> str:
    return body(name, "stuff", shape=box(x, y))


def between_rollers(name: str, y: tuple[float, float]) -> str:
    sides = support(f"{name}.left", ux=0.0) + support(f"{name}.right", ux=0.0)
    return block(name, (0.0, 1.0), y) + sides


UPPER, LOWER = between_rollers("upper", (0.0, 1.0)), between_rollers("lower", (-1.0, 0.0))


def press(force: float) -> str:
    return load("press", "upper.top", "platen", fy=force)


def on_plane(gap: str | float) -> str:
    return contact("c", "upper.bottom", obstacle=plane([0.0, 0.0], [0.0, 1.0]), gap=gap)


def westergaard(x: FloatArray, length: float, load: float, full: float) -> FloatArray:
    """Pressures of a wave of this ``length`` and its deepest contact at x = 0 under a mean pressure ``load``,
    which ``full`` flattens (Johnson, Contact Mechanics, 1985, section 13.2)."""
    phase, edge = np.sin(np.pi * x / length) ** 2, load / full
    root = np.sqrt(np.maximum(edge - phase, 0.0))
    return 2.0 * load * np.abs(np.cos(np.pi * x / length)) / edge * root


def contact_of(text: str, directory: Path, *overrides: str) -> ContactData:
    summary = solve(text, directory, *overrides)
    assert summary["status"] == "done", summary
    return read_run(directory).contacts["c"]


@pytest.mark.parametrize(("below", "waves"), [("plane", 2), ("swapped", 1)])
def test_a_wavy_gap_on_flat_faces(below: str, waves: int, tmp_path: Path) -> None:
    length, height = 1.0 / waves, 1e-4
    modulus = E / (1.0 - NU**2) / (1.0 if below == "plane" else 2.0)
    full = np.pi * modulus * height / length
    mean = 0.3 * full
    gap = f"{height}*(1 - cos(2*pi*(x - {0.5 * length})*{waves}))"
    text = HEAD + UPPER
    text += press(-mean)
    if below == "plane":
        text += on_plane(gap)
    else:
        text += LOWER
        text += CLAMP + contact("c", "lower.top", "upper.bottom", gap=gap)
    found = contact_of(
        text, tmp_path / "run", "contact.c.regularization.law=exact", "contact.c.accuracy=5e-3"
    )
    pressure, x = found.pressure[-1], found.points[:, 0]
    expected = westergaard(x - 0.5 * length, length, mean, full)
    lengths = found.weight
    error = np.sqrt((lengths @ (pressure - expected) ** 2) / (lengths @ expected**2))
    assert error <= 5e-3
    assert pressure.max() == pytest.approx(expected.max(), rel=5e-3)


@pytest.mark.usefixtures("by_nodes")
def test_nodes_know_the_gap_as_grids_do(tmp_path: Path) -> None:
    modulus, height = E / (1.0 - NU**2) / 2.0, 1e-3
    full = np.pi * modulus * height
    text = HEAD + CLAMP + press(-0.5 * full)
    for part, edge in ((UPPER, "bottom"), (LOWER, "top")):
        fine = f"refine = [{{ along = '{edge}', spacing = 0.08, radius = 0.0 }}]\nshape"
        text += part.replace("shape", fine)
    text += contact("c", "upper.bottom", "lower.top", gap=f"{height}*(1 - cos(2*pi*x - pi))")
    found = contact_of(text, tmp_path / "run", "contact.c.regularization.law=exact")
    pressure, x = found.pressure[-1], found.points[:, 0]
    expected = westergaard(x - 0.5, 1.0, 0.5 * full, full)
    assert np.sqrt(((pressure - expected) ** 2).sum() / (expected**2).sum()) <= 0.08


def test_a_crowned_gap_is_hertz_contact(tmp_path: Path) -> None:
    radius, force = 10.0, 2.0
    modulus = E / (1.0 - NU**2) / 2.0
    text = HEAD + block("upper", (-2.0, 2.0), (0.0, 2.0)) + block("lower", (-2.0, 2.0), (-2.0, 0.0)) + CLAMP
    text += press(-force) + pin("lower", [0.0, -2.0], ux=0.0) + pin("upper", [0.0, 2.0], ux=0.0)
    text += contact("c", "upper.bottom", "lower.top", gap=f"x**2/{2.0 * radius}")
    found = contact_of(text, tmp_path / "run")
    half = np.sqrt(4.0 * force * radius / (np.pi * modulus))
    peak = np.sqrt(force * modulus / (np.pi * radius))
    assert found.pressure[-1].max() == pytest.approx(peak, rel=5e-3)
    loaded = found.points[found.pressure[-1] > 1e-3 * peak, 0]
    assert np.abs(loaded).max() == pytest.approx(half, rel=2e-2)


def test_a_constant_gap_is_as_if_drawn(tmp_path: Path) -> None:
    text = HEAD + UPPER
    text += press(-1.0).replace("fy = -1.0", "uy = -0.01") + on_plane(0.004)
    found = contact_of(text, tmp_path / "run")
    stiff = E * (1.0 - NU) / ((1.0 + NU) * (1.0 - 2.0 * NU))
    np.testing.assert_allclose(found.pressure[-1], 0.006 * stiff, rtol=1e-6)


def test_a_gap_without_a_value_is_told_by_its_key(tmp_path: Path) -> None:
    case = tmp_path / "case.toml"
    text = HEAD + UPPER
    case.write_text(text + press(-1.0) + on_plane("sqrt(x - 0.5)"))
    with pytest.raises(CaseError, match=r"contact.c.gap.*has no value"):
        run(case, out=tmp_path / "run", console=Quiet())
