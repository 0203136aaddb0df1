"""Gaps given as expressions, profiles and outlines through points, against closed formulas."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import EXACT_LAW, Quiet, done, refused
from tests.case_text import FLOOR, Scene, body, contact, load, polyline, scene, support

E, NU = 1000.0, 0.3
HEAD = scene("strain", "stuff", E=E)
CLAMP = support("lower.bottom", uy=0.0)


def between_rollers(name: str, y: tuple[float, float]) -> Scene:
    sides = support([f"{name}.left", f"{name}.right"], ux=0.0)
    return body(name, "stuff", box=((0.0, 1.0), y)) + sides


UPPER, LOWER = between_rollers("upper", (0.0, 1.0)), between_rollers("lower", (-1.0, 0.0))


def press(force: float) -> Scene:
    return load("press", "upper.top", "platen", fy=force)


def on_plane(gap: str | float) -> Scene:
    return contact("c", "upper.bottom", obstacle=FLOOR, gap=gap)


def westergaard(x: FloatArray, length: float, load: float, full: float) -> FloatArray:
    """Pressures of a wave of this ``length`` and its deepest contact at x = 0 under a mean pressure ``load``,
    which ``full`` flattens (Johnson, Contact Mechanics, 1985, section 13.2)."""
    phase, edge = np.sin(np.pi * x / length) ** 2, load / full
    root = np.sqrt(np.maximum(edge - phase, 0.0))
    return 2.0 * load * np.abs(np.cos(np.pi * x / length)) / edge * root


def contact_of(text: str, directory: Path, *overrides: str) -> Any:
    done(text, directory, *overrides)
    return read_run(directory).contacts["c"]


@pytest.mark.parametrize(("below", "waves"), [("plane", 2), ("swapped", 1)])
def test_a_wavy_gap_on_flat_faces(below: str, waves: int, tmp_path: Path) -> None:
    length, height = 1.0 / waves, 1e-4
    modulus = E / (1.0 - NU**2) / (1.0 if below == "plane" else 2.0)
    full = np.pi * modulus * height / length
    mean = 0.3 * full
    gap = f"{height}*(1 - cos(2*pi*(x - {0.5 * length})*{waves}))"
    text = HEAD + UPPER + press(-mean)
    pair = LOWER + CLAMP + contact("c", "lower.top", "upper.bottom", gap=gap)
    text += on_plane(gap) if below == "plane" else pair
    found = contact_of(text, tmp_path / "run", EXACT_LAW, "contact.c.accuracy=1e-2")
    pressure, x, lengths = found.pressure[-1], found.points[:, 0], found.weight
    expected = westergaard(x - 0.5 * length, length, mean, full)
    error = np.sqrt((lengths @ (pressure - expected) ** 2) / (lengths @ expected**2))
    assert error <= 5e-3
    assert pressure.max() == pytest.approx(expected.max(), rel=5e-3)


def test_a_crowned_gap_is_hertz_contact(tmp_path: Path) -> None:
    radius, force = 10.0, 2.0
    modulus = E / (1.0 - NU**2) / 2.0
    text = HEAD.body("upper", "stuff", box=((-2.0, 2.0), (0.0, 2.0)))
    text = text.body("lower", "stuff", box=((-2.0, 2.0), (-2.0, 0.0))) + CLAMP + press(-force)
    text = text.pin("lower", [0.0, -2.0], ux=0.0).pin("upper", [0.0, 2.0], ux=0.0)
    text = text.contact("c", "upper.bottom", "lower.top", gap=f"x**2/{2.0 * radius}")
    found = contact_of(text, tmp_path / "run")
    half = np.sqrt(4.0 * force * radius / (np.pi * modulus))
    peak = np.sqrt(force * modulus / (np.pi * radius))
    assert found.pressure[-1].max() == pytest.approx(peak, rel=5e-3)
    loaded = found.points[found.pressure[-1] > 1e-3 * peak, 0]
    assert np.abs(loaded).max() == pytest.approx(half, rel=2e-2)


def test_a_constant_gap_is_as_if_drawn(tmp_path: Path) -> None:
    text = HEAD + UPPER + load("press", "upper.top", "platen", uy=-0.01) + on_plane(0.004)
    found = contact_of(text, tmp_path / "run")
    stiff = E * (1.0 - NU) / ((1.0 + NU) * (1.0 - 2.0 * NU))
    np.testing.assert_allclose(found.pressure[-1], 0.006 * stiff, rtol=1e-6)


def test_a_gap_without_a_value_is_told_by_its_key(tmp_path: Path) -> None:
    text = HEAD + UPPER + press(-1.0) + on_plane("sqrt(x - 0.5)")
    refused(text, tmp_path / "run", "contact.c.gap", "has no value")


MODULUS = 70e3 / 0.91


def under_profile(
    points: FloatArray, force: float, directory: Path, accuracy: float
) -> tuple[FloatArray, FloatArray]:
    """Places along x and pressures, in order, at the end of a run without warnings."""
    console = Quiet()
    text = (
        scene("strain", "alloy", E=70e3)
        .body("block", "alloy", box=([0.0, points[-1, 0]], [-2.0, 0.0]))
        .support("block.bottom", uy=0.0)
        .support("block.left", ux=0.0)
        .support("block.right", ux=0.0)
        .contact("face", "block.top", obstacle=polyline(*points.tolist()), accuracy=accuracy)
        .pushed("press", "face", fy=-force)
    )
    done(text, directory, console=console)
    assert not console.warnings
    found = read_run(directory).contacts["face"]
    x = found.points[:, 0]
    order = np.argsort(x)
    return x[order], found.pressure[-1][order]


def test_a_small_summit_apart_from_the_others_touches(tmp_path: Path) -> None:
    """Narrower than intervals and spacings there: neither means over wide hats nor nodes see it."""
    x = np.linspace(0.0, 2.0, 801)
    radius, force, at = 100.0, 40.0, 1.75
    wide = 2.0 * np.sqrt(force * radius / (np.pi * MODULUS))
    ratio = (at - 0.6) / wide
    gap = 0.5 * wide**2 / radius * (ratio * np.sqrt(ratio**2 - 1.0) - np.arccosh(ratio))
    summit = (gap + 1e-4) * np.exp(-(((x - at) / 0.02) ** 4))
    profile = np.column_stack([x, 0.5 * (x - 0.6) ** 2 / radius - summit])
    place, pressure = under_profile(profile, force, tmp_path, 0.05)
    assert pressure[np.abs(place - at) < 0.02].max(initial=0.0) > 0.0
