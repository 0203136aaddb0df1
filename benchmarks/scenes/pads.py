"""Pads on bases, and piles of bricks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.scenes.bending import STEEL
from benchmarks.scenes.mesh_files import write_mesh
from benchmarks.scenes.scene import (
    Figure,
    Move,
    Refusal,
    Scene,
    box,
    case,
    force_at,
    held,
    on_plane,
    pair,
    platen,
    polygon,
    probe,
    scene,
    solid,
    weighed,
)
from benchmarks.scenes.scene import body as make_body


def pad_load(given: dict[str, Any]) -> dict[str, Any]:
    given["load"] = [platen("press", "pad.top", fy=-600.0), platen("shear", "pad.top", fx=90.0)]
    given["stage"] = [{"press": 1.0}, {"shear": 1.0}]
    return given


PAD = [(-4.0, 0.0), (4.0, 0.0), (4.0, 6.0), (-4.0, 6.0)]


@scene
def fretting_pad() -> Scene:
    """Flat pad with rounded corners as a polygon: its face and arcs are one surface of three pieces.

    The peak is a half-plane's (1,200 pieces of equal pressure), where the pad's own shape is worth 3 %. The
    mesh below has other corners: pressures end after the first third of the first of its 24 pieces.
    """
    pad = polygon("pad", "steel", PAD, names=["face", "right", "top", "left"], rounding=[2.0, 2.0, 0.0, 0.0])
    given = pad_base(pad, "", 0.0)
    given["contact"][0]["slave"] = ["pad.corner1", "pad.face", "pad.corner2"]
    given["load"] = [platen("press", "pad.top", fy=-600.0)]
    given["probe"] = [probe("beside", "block", 8.0, 0.0)]
    return Scene(
        "fretting_pad",
        "fretting pad with rounded corners",
        given,
        [
            Figure("normal", lambda r: r.force("face")[1], 600.0),
            Figure("peak", lambda r: r.peak("face"), 863.9, 5.0),
        ],
    )


def pad_base(pad: dict[str, Any], slave: str, friction: float) -> dict[str, Any]:
    return case(
        "strain",
        {"steel": STEEL},
        [pad, box("block", "steel", (-20.0, 20.0), (-20.0, 0.0))],
        support=[held("block.bottom")],
        contact=[pair("face", slave, "block.top", friction)],
    )


@scene
def fretting_pad_face() -> Scene:
    """What a user may write instead: the flat face only. Its roundings belong to the contact all the same."""
    pad = polygon("pad", "steel", PAD, names=["face", "right", "top", "left"], rounding=[2.0, 2.0, 0.0, 0.0])
    return Scene(
        "fretting_pad_face",
        "fretting pad with rounded corners",
        pad_load(pad_base(pad, "pad.face", 0.4)),
        [
            Figure("normal", lambda r: abs(r.force("face")[1]), 600.0),
            Figure("shear", lambda r: abs(r.force("face")[0]), 90.0),
        ],
    )


def pad_mesh(path: Path, move: Move) -> None:
    """The pad's face and corners as one group of a mesh, corners of radius 2 by 24 pieces each."""
    across = np.concatenate(
        [
            -2.0 - 2.0 * np.sin(np.linspace(0.5 * np.pi, 0.0, 25)),
            np.linspace(-2.0, 2.0, 41)[1:-1],
            2.0 + 2.0 * np.sin(np.linspace(0.0, 0.5 * np.pi, 25)),
        ]
    )
    over = np.maximum(np.abs(across) - 2.0, 0.0)
    low = 2.0 - np.sqrt(np.maximum(4.0 - over**2, 0.0))
    up = np.linspace(0.0, 1.0, 25) ** 1.3
    x = np.tile(across, (len(up), 1))
    y = low + up[:, None] * (6.0 - low)
    number = np.arange(x.size).reshape(x.shape)
    cells = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=2).reshape(
        -1, 4
    )
    lines = {
        "face": np.column_stack([number[0, :-1], number[0, 1:]]),
        "top": np.column_stack([number[-1, :-1], number[-1, 1:]]),
    }
    write_mesh(path, move(np.column_stack([x.ravel(), y.ravel()])), cells, lines)


@scene
def fretting_pad_mesh() -> Scene:
    """Face and arcs as one group of a mesh, whose outline is filled anew; pressed only."""
    pad = make_body("pad", "steel", "mesh", file="pad.msh", use="outline")
    given = pad_base(pad, "pad.face", 0.0)
    given["load"] = [platen("press", "pad.top", fy=-600.0)]
    given["probe"] = [probe("beside", "block", 8.0, 0.0)]
    return Scene(
        "fretting_pad_mesh",
        "fretting pad with rounded corners",
        given,
        [Figure("force", lambda r: abs(r.force("face")[1]), 600.0)],
        files={"pad.msh": pad_mesh},
        elements=True,
    )


@scene
def fretting_pad_friction() -> Scene:
    """The same, pressed and sheared."""
    pad = make_body("pad", "steel", "mesh", file="pad.msh", use="outline")
    given = pad_load(pad_base(pad, "pad.face", 0.4))
    return replace(fretting_pad_face(), name="fretting_pad_friction", case=given, files={"pad.msh": pad_mesh})


def bricks(wide: float, high: float, friction: float, push: float) -> dict[str, Any]:
    """Three bricks on the ground, of their own weight of 1 per area, then a body force sideways."""
    names = [f"brick{i}" for i in range(3)]
    contacts = [on_plane("joint0", "brick0.bottom", (0.0, 0.0), (0.0, 1.0), friction)]
    contacts += [pair(f"joint{i}", f"brick{i}.bottom", f"brick{i - 1}.top", friction) for i in (1, 2)]
    loads = [weighed(f"weight{i}", name, 0.0, -1.0) for i, name in enumerate(names)]
    loads += [weighed(f"quake{i}", name, push, 0.0) for i, name in enumerate(names)]
    return case(
        "strain",
        {"stone": solid(20e3, 0.2)},
        [box(name, "stone", (0.0, wide), (i * high, (i + 1) * high)) for i, name in enumerate(names)],
        contact=contacts,
        load=loads,
        stage=[{f"weight{i}": 1.0 for i in range(3)}, {f"quake{i}": 1.0 for i in range(3)}],
    )


@scene
def bricks_hold() -> Scene:
    """Below both limits: every joint carries what lies above it."""
    given = bricks(6.0, 2.0, 0.5, 0.3)
    weight = 12.0
    return Scene(
        "bricks_hold",
        "stack of bricks that slides or tips",
        given,
        [Figure(f"normal {i}", force_at(f"joint{i}", 1), (3 - i) * weight) for i in range(3)]
        + [Figure(f"shear {i}", force_at(f"joint{i}", 0, -1.0), 0.3 * (3 - i) * weight) for i in range(3)],
    )


@scene
def bricks_slide() -> Scene:
    """Slides at a body force of 0.25 of the weight; 0.5 asked for."""
    return Scene(
        "bricks_slide",
        "stack of bricks that slides or tips",
        bricks(6.0, 2.0, 0.25, 0.5),
        refusal=Refusal(("slide",), 1.5),
    )


@scene
def bricks_tip() -> Scene:
    """Tips about an edge of the ground joint at 6/6 of 0.5; friction would hold 0.8."""
    return Scene(
        "bricks_tip",
        "stack of bricks that slides or tips",
        bricks(3.0, 2.0, 0.8, 0.75),
        refusal=Refusal(("tip", "tilt", "turn", "rotat"), 1.0 + 0.5 / 0.75, 5.0),
    )
