"""Contacts that go all around, or up to corners next to walls, and the degree that is left to the program."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.formulas import LameRing, press_fit
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import done, prepared, solve
from tests.case_text import body_force, scene, support

FIT = (
    scene("stress")
    .body("hub", "steel", annulus=([0.0, 0.0], [10.0, 16.0]))
    .body("shaft", "steel", annulus=([0.0, 0.0], [4.0, 10.0]))
    .contact("fit", "shaft.outer", "hub.inner", interference=0.01)
)


def test_a_fit_has_the_pressure_of_lame_all_around(tmp_path: Path) -> None:
    angle = np.radians([3.0, 75.0, -30.0, -36.0])
    text = FIT
    for name in ("hub", "shaft"):
        for k, a in enumerate(angle.tolist()):
            text = text.probe(f"{name}{k}", name, [10.0 * np.cos(a), 10.0 * np.sin(a)])
    summary = solve(text, tmp_path / "fit")
    fit = read_run(tmp_path / "fit").contacts["fit"]
    # A contact grid, not the nodes of a surface of 60 times their distance.
    assert len(fit.pressure[-1]) < 40
    shaft, hub = LameRing(4.0, 10.0, 1.0, 210e3, 0.3), LameRing(10.0, 16.0, 1.0, 210e3, 0.3)
    pressure = press_fit(shaft, hub, 0.01)
    assert fit.pressure[-1] == pytest.approx(pressure, rel=2e-3)
    # Beneath the surface, too: intervals of the grid are chords no longer there.
    for name in ("hub", "shaft"):
        for k, a in enumerate(angle):
            xx, yy, xy = summary["probes"][f"{name}{k}"]["stress"]
            c, s = np.cos(a), np.sin(a)
            assert xx * c * c + yy * s * s + 2.0 * xy * c * s == pytest.approx(-pressure, rel=0.01)
            assert (yy - xx) * c * s + xy * (c * c - s * s) == pytest.approx(0.0, abs=0.01 * pressure)


def test_a_clamped_ring_on_a_rigid_mandrel_is_pressed_evenly(tmp_path: Path) -> None:
    """Radial displacement a r + b / r: 0 outside and the interference inside."""
    ring = scene("strain", E=3500.0).body("ring", "steel", annulus=([0.0, 0.0], [1.0, 2.0]))
    mandrel = {"kind": "disk", "center": [0.0, 0.0], "radius": 1.0}
    ring = ring.support("ring.outer", ux=0.0, uy=0.0).contact("fit", "ring.inner", obstacle=mandrel)
    done(ring, tmp_path / "run", "contact.fit.interference=2e-4")
    a, b = np.linalg.solve([[1.0, 1.0], [2.0, 0.5]], [2e-4, 0.0])
    expected = -3500.0 / (1.3 * 0.4) * (a - 0.4 * b)
    pressure = read_run(tmp_path / "run").contacts["fit"].pressure[-1]
    assert pressure == pytest.approx(expected, rel=5e-3)


def test_a_fit_that_is_pulled_aside_may_open_anywhere(tmp_path: Path) -> None:
    """Where the range of a closed contact begins has no part in it: pulled down or aside is the same."""
    held = support("shaft.inner", ux=0.0, uy=0.0)
    peaks: list[float] = []
    for way in ([2.0, 0.0], [0.0, -2.0]):
        pull = body_force("pull", "hub", way)
        summary = done(FIT + held + pull, tmp_path / str(len(peaks)), "contact.fit.accuracy=0.01")
        peaks.append(summary["contacts"]["fit"]["peak_pressure"])
    assert peaks[1] == pytest.approx(peaks[0], rel=5e-3)


@pytest.mark.parametrize(
    ("setting", "degrees"),
    [
        ((), {"hub": 4, "shaft": 4}),
        (("mls.degree=3",), {"hub": 3, "shaft": 3}),
        (("mls.neighbors=18",), {"hub": 2, "shaft": 2}),
    ],
)
def test_the_degree_that_is_left_to_us(setting: tuple[str, ...], degrees: dict[str, int]) -> None:
    models = prepared(FIT, *setting).models
    assert {name: model.settings.degree for name, model in models.items()} == degrees


@pytest.mark.usefixtures("by_nodes")
def test_bodies_with_nodal_contacts_have_degree_2() -> None:
    models = prepared(FIT).models
    assert {model.settings.degree for model in models.values()} == {2}


def test_a_bent_beam_is_pressed_on_along_its_own_normal(tmp_path: Path) -> None:
    """Its lower side moves outwards along two round posts, by as much as it turns."""
    span, high, down = 100.0, 10.0, 0.5
    summary = solve(
        scene("stress")
        .body("beam", "steel", box=([-55.0, 55.0], [0.0, high]))
        .pin("beam", [0.0, high], ux=0.0)
        .pushed("press", "top", uy=-down)
        .contact("left", "beam.bottom", disk=([-0.5 * span, -5.0], 5.0))
        .contact("right", "beam.bottom", disk=([0.5 * span, -5.0], 5.0))
        .contact("top", "beam.top", disk=([0.0, high + 5.0], 5.0))
        .probe("out", "beam", [-52.0, 0.5 * high])
        .probe("in", "beam", [-48.0, 0.5 * high]),
        tmp_path / "run",
    )
    moved = {name: np.array(probe["displacement"]) for name, probe in summary["probes"].items()}
    turned = (moved["in"][1] - moved["out"][1]) / 4.0
    assert turned == pytest.approx(-3.0 * down / span, rel=0.1)
    for name, sign in (("left", -1.0), ("right", 1.0)):
        along, up = summary["contacts"][name]["force"]
        assert along / up == pytest.approx(sign * turned, rel=0.02)


def test_a_fit_that_is_pushed_aside_is_alike_at_every_scale(tmp_path: Path) -> None:
    """Friction around a closed surface."""

    def push(scale: float) -> float:
        text = scene("stress", "soft", E=1.0).material("hard", E=60.0, nu=0.3)
        text = text.body("inner", "hard", annulus=([0.0, 0.0], [0.5 * scale, scale]))
        text = text.body("outer", "soft", annulus=([0.0, 0.0], [scale, 1.6 * scale]))
        text = text.support("outer.outer", ux=0.0, uy=0.0)
        text = text.load("push", "inner.inner", "platen", ux=4e-5 * scale, uy=0.0)
        text = text.contact("fit", "inner.outer", "outer.inner", friction=0.3, interference=1e-4 * scale)
        found = solve(text.stages("fit push=0.0", "fit push"), tmp_path / str(scale))
        return float(found["forces"]["push"][0]) / scale

    assert push(0.94) == pytest.approx(push(1.0), rel=1e-3)
