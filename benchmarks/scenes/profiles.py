"""Wavy and rough profiles: many patches at once, by rigid polylines and by curves of meshes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.scenes.halfplane import rough_contact
from benchmarks.scenes.mesh_files import write_mesh
from benchmarks.scenes.scene import (
    Array,
    Figure,
    Move,
    Scene,
    Table,
    box,
    case,
    held,
    platen,
    probe,
    scene,
    solid,
)
from benchmarks.scenes.scene import body as make_body

YOUNG, POISSON = 70e3, 0.3
PLANE = YOUNG / (1.0 - POISSON**2)


def polyline_case(profile: Array, wide: float, deep: float, force: float) -> Table:
    """A rigid profile (n, 2), pressed on a block between smooth walls."""
    return case(
        "strain",
        {"alloy": solid(YOUNG, POISSON)},
        [box("block", "alloy", (0.0, wide), (-deep, 0.0))],
        support=[held("block.bottom", "uy"), held("block.left", "ux"), held("block.right", "ux")],
        contact=[
            {
                "name": "face",
                "slave": "block.top",
                "obstacle": {"kind": "polyline", "points": profile.tolist()},
            }
        ],
        load=[{"name": "press", "kind": "obstacle", "obstacle": "face", "fy": -force}],
    )


def wave(count: int, height: float, points: int) -> Array:
    """``count`` waves of length 1, lowest points at 0, from trough to trough of the rigid surface."""
    x = np.linspace(0.0, count, count * points + 1)
    return np.column_stack([x, 0.5 * height * (1.0 + np.cos(2.0 * np.pi * x))])


def westergaard(height: float, mean: float) -> tuple[float, float]:
    """Peak pressure and half width of a wave of length 1 and of that height, under a mean pressure."""
    full = 0.5 * np.pi * PLANE * height
    half = float(np.arcsin(np.sqrt(mean / full)) / np.pi)
    return 2.0 * float(np.sqrt(mean * full)), half


def wavy(name: str, count: int, deep: float) -> Scene:
    """So many waves of a rigid profile by a polyline, on a block so deep; Westergaard."""
    height, mean = 0.002, 20.0
    peak, _half = westergaard(height, mean)
    given = polyline_case(wave(count, height, 40), float(count), deep, mean * count)
    return Scene(
        name,
        "wavy and rough profiles",
        given,
        [
            Figure("force", lambda r: abs(r.force("face")[1]), mean * count),
            Figure("peak", lambda r: r.peak("face"), peak, 4.0),
            Figure("patches", lambda r: float(r.patches("face")), float(count), 0.1),
        ],
    )


@scene
def wavy_rigid() -> Scene:
    """Ten waves, 401 points."""
    return wavy("wavy_rigid", 10, 5.0)


@scene
def wavy_rigid_40() -> Scene:
    """Forty waves."""
    return wavy("wavy_rigid_40", 40, 20.0)


def wavy_mesh(path: Path, move: Move) -> None:
    """A block of 8 x 4 above y = 0 whose bottom has eight waves of height 0.002."""
    x = np.linspace(0.0, 8.0, 8 * 24 + 1)
    low = 0.001 * (1.0 + np.cos(2.0 * np.pi * x))
    t = np.linspace(0.0, 1.0, 13) ** 1.5
    y = low + t[:, None] * (4.0 - low)
    number = np.arange(y.size).reshape(y.shape)
    cells = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=2).reshape(
        -1, 4
    )
    lines = {
        "wavy": np.column_stack([number[0, :-1], number[0, 1:]]),
        "right": np.column_stack([number[:-1, -1], number[1:, -1]]),
        "top": np.column_stack([number[-1, :-1], number[-1, 1:]]),
        "left": np.column_stack([number[:-1, 0], number[1:, 0]]),
    }
    write_mesh(path, move(np.column_stack([np.tile(x, len(t)), y.ravel()])), cells, lines)


@scene
def wavy_elastic() -> Scene:
    """Eight waves of an elastic body, from a mesh, on a block of the same material; Westergaard."""
    mean = 10.0
    full = 0.5 * np.pi * 0.5 * PLANE * 0.002
    peak = 2.0 * float(np.sqrt(mean * full))
    given = case(
        "strain",
        {"alloy": solid(YOUNG, POISSON)},
        [
            make_body("wavy", "alloy", "mesh", file="wavy.msh", use="outline"),
            box("block", "alloy", (0.0, 8.0), (-4.0, 0.0)),
        ],
        support=[
            held("block.bottom", "uy"),
            *(held(f"{b}.{s}", "ux") for b in ("block", "wavy") for s in ("left", "right")),
        ],
        contact=[{"name": "face", "slave": "wavy.wavy", "master": "block.top"}],
        load=[platen("press", "wavy.top", fy=-mean * 8.0)],
    )
    return Scene(
        "wavy_elastic",
        "wavy and rough profiles",
        given,
        [
            Figure("force", lambda r: abs(r.force("face")[1]), mean * 8.0),
            Figure("peak", lambda r: r.peak("face"), peak, 4.0),
            Figure("patches", lambda r: float(r.patches("face")), 8.0, 0.1),
        ],
        files={"wavy.msh": wavy_mesh},
    )


def rough(points: int, seed: int) -> Array:
    """A rough profile (n, 2) of length 10, symmetric about both its ends, lowest point at 0."""
    rng = np.random.default_rng(seed)
    x = np.linspace(0.0, 10.0, points)
    y = np.zeros(points)
    for k in range(2, 61):
        y += k**-1.3 * rng.normal() * np.cos(np.pi * k * x / 10.0)
    y *= 0.004 / (y.max() - y.min())
    return np.column_stack([x, y - y.min()])


def rough_scene(name: str, seed: int, mean: float) -> Scene:
    profile = rough(1201, seed)
    told = rough_contact(profile, PLANE, mean)
    given = polyline_case(profile, 10.0, 10.0, mean * 10.0)
    return Scene(
        name,
        "wavy and rough profiles",
        given,
        [
            Figure("force", lambda r: abs(r.force("face")[1]), mean * 10.0),
            Figure("peak", lambda r: r.peak("face"), told.peak, 5.0),
            Figure("patches", lambda r: float(r.patches("face")), float(told.patches), 5.0),
        ],
    )


@scene
def rough_light() -> Scene:
    """A rough rigid profile of 1201 points, about ten patches; half-plane by Fourier series."""
    return rough_scene("rough_light", 5, 12.0)


@scene
def rough_heavy() -> Scene:
    """More of them."""
    return rough_scene("rough_heavy", 6, 40.0)


@scene
def profile_table() -> Scene:
    """A body's side by a curve through points, without a mesh of the user's own; Westergaard."""
    mean = 10.0
    full = 0.5 * np.pi * 0.5 * PLANE * 0.002
    x = np.linspace(8.0, 0.0, 8 * 24 + 1)
    low = 0.001 * (1.0 + np.cos(2.0 * np.pi * x))
    sides = [
        {"name": "wavy", "points": np.column_stack([x, low]).tolist()},
        {"name": "left", "to": [0.0, 4.0]},
        {"name": "top", "to": [8.0, 4.0]},
        {"name": "right"},
    ]
    given = case(
        "strain",
        {"alloy": solid(YOUNG, POISSON)},
        [
            make_body("wavy", "alloy", "outline", sides=sides),
            box("block", "alloy", (0.0, 8.0), (-4.0, 0.0)),
        ],
        support=[
            held("block.bottom", "uy"),
            *(held(f"{b}.{s}", "ux") for b in ("block", "wavy") for s in ("left", "right")),
        ],
        contact=[{"name": "face", "slave": "wavy.wavy", "master": "block.top"}],
        load=[platen("press", "wavy.top", fy=-mean * 8.0)],
    )
    return Scene(
        "profile_table",
        "wavy and rough profiles",
        given,
        [
            Figure("force", lambda r: abs(r.force("face")[1]), mean * 8.0),
            Figure("peak", lambda r: r.peak("face"), 2.0 * float(np.sqrt(mean * full)), 4.0),
        ],
    )


@scene
def step_probe() -> Scene:
    """A single rigid wave of a probe over a strip, between walls: a whole wave, one patch."""
    height, mean = 0.003, 30.0
    peak, _ = westergaard(height, mean)
    given = polyline_case(wave(1, height, 80), 1.0, 2.0, mean)
    given["probe"] = [probe("deep", "block", 0.5, -1.5)]
    return Scene(
        "step_probe",
        "wavy and rough profiles",
        given,
        [
            Figure("force", lambda r: abs(r.force("face")[1]), mean),
            Figure("peak", lambda r: r.peak("face"), peak, 3.0),
        ],
    )
