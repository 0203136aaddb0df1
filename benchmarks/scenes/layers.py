"""Flat contacts: joints, layers, sheets, punches, pads, bricks, dovetails."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.scenes.bending import ALLOY, RUBBER, STEEL, write_mesh
from benchmarks.scenes.scene import (
    Figure,
    Move,
    Refusal,
    Scene,
    box,
    case,
    force_at,
    held,
    on_disk,
    on_plane,
    pair,
    pinned,
    platen,
    polygon,
    pressed,
    probe,
    pushed,
    scene,
    solid,
    weighed,
)
from benchmarks.scenes.scene import body as make_body

FRICTION = 0.3


def lap_case(pull: float, friction: float) -> dict[str, Any]:
    """Two strips of 60 x 3 that overlap on 20, clamped by pressure, pulled apart along x."""
    clamp = "20.0 if abs(x - 50.0) < 10.0 else 0.0"
    return case(
        "stress",
        {"steel": STEEL},
        [box("lower", "steel", (0.0, 60.0), (-3.0, 0.0)), box("upper", "steel", (40.0, 100.0), (0.0, 3.0))],
        support=[held("lower.left"), held("upper.right", "uy")],
        contact=[
            pair("lap", "upper.bottom", "lower.top", friction),
            on_plane("anvil", "lower.bottom", (0.0, -3.0), (0.0, 1.0)),
        ],
        load=[
            {"name": "clamp", "boundary": "upper.top", "kind": "pressure", "pressure": clamp},
            platen("pull", "upper.right", fx=pull, uy=0.0),
        ],
        stage=[{"clamp": 1.0}, {"pull": 1.0}],
    )


@scene
def lap_joint() -> Scene:
    """Pulled by two thirds of what friction carries."""
    given = lap_case(80.0, FRICTION)
    del given["support"][1]
    return Scene(
        "lap_joint",
        "lap joint clamped and pulled",
        given,
        [
            Figure("shear", lambda r: abs(r.force("lap")[0]), 80.0),
            Figure("left", lambda r: abs(r.exerted("lower.left")[0]), 80.0),
        ],
    )


@scene
def lap_joint_slides() -> Scene:
    """Pulled beyond the limit: both strips are guided, so that the clamping force alone presses."""
    given = lap_case(240.0, FRICTION)
    del given["support"][1]
    given["load"][1] = platen("pull", "upper.right", fx=240.0)
    given["load"][1]["rotation"] = "fixed"
    return Scene(
        "lap_joint_slides",
        "lap joint clamped and pulled",
        given,
        refusal=Refusal(("slide",), 1.0 + 0.3 * 400.0 / 240.0),
    )


@scene
def receding_layer() -> Scene:
    """A layer on a block, pressed in the middle: its ends lift."""
    given = case(
        "strain",
        {"alloy": ALLOY, "steel": STEEL},
        [
            box("layer", "alloy", (-20.0, 20.0), (0.0, 2.0)),
            box("block", "steel", (-25.0, 25.0), (-20.0, 0.0)),
        ],
        support=[held("block.bottom")],
        contact=[
            pair("seat", "layer.bottom", "block.top"),
            on_disk("roller", "layer.top", (0.0, 10.0), 8.0),
        ],
        load=[pushed("press", "roller", fy=-150.0)],
        probe=[probe("end", "layer", 20.0, 1.0)],
    )
    return Scene(
        "receding_layer",
        "receding layer",
        given,
        [
            Figure("seat", lambda r: r.force("seat")[1], 150.0),
            Figure("roller", lambda r: -r.force("roller")[1], 150.0),
        ],
        elements=True,
    )


@scene
def receding_layer_pressure() -> Scene:
    """The same under a pressure on a part of its top."""
    given = case(
        "strain",
        {"alloy": ALLOY},
        [
            box("layer", "alloy", (-20.0, 20.0), (0.0, 2.0)),
            box("block", "alloy", (-25.0, 25.0), (-20.0, 0.0)),
        ],
        support=[held("block.bottom")],
        contact=[pair("seat", "layer.bottom", "block.top")],
        load=[
            {
                "name": "press",
                "boundary": "layer.top",
                "kind": "pressure",
                "pressure": "100*(1 - x**2) if abs(x) < 1 else 0",
            }
        ],
        probe=[probe("end", "layer", 20.0, 1.0)],
    )
    return Scene(
        "receding_layer_pressure",
        "receding layer",
        given,
        [Figure("seat", lambda r: r.force("seat")[1], 400.0 / 3.0)],
        elements=True,
    )


@scene
def sheet_soft_base() -> Scene:
    """A stiff sheet on a soft base under a rigid roller."""
    given = case(
        "strain",
        {"steel": STEEL, "rubber": RUBBER},
        [
            box("sheet", "steel", (-15.0, 15.0), (0.0, 1.0)),
            box("base", "rubber", (-20.0, 20.0), (-12.0, 0.0)),
        ],
        support=[held("base.bottom")],
        contact=[
            pair("seat", "sheet.bottom", "base.top"),
            on_disk("roller", "sheet.top", (0.0, 9.0), 8.0),
        ],
        load=[pushed("press", "roller", uy=-0.4)],
        probe=[probe("end", "sheet", 15.0, 0.5)],
    )
    return Scene("sheet_soft_base", "sheet on a soft base", given, elements=True)


@scene
def elastic_punch() -> Scene:
    """A narrow block with sharp corners pressed into a wide one."""
    given = case(
        "strain",
        {"steel": STEEL, "alloy": ALLOY},
        [box("punch", "steel", (-5.0, 5.0), (0.0, 10.0)), box("block", "alloy", (-25.0, 25.0), (-20.0, 0.0))],
        support=[held("block.bottom")],
        contact=[pair("face", "punch.bottom", "block.top")],
        load=[platen("press", "punch.top", uy=-0.05)],
        probe=[probe("under", "block", 0.0, 0.0), probe("beside", "block", 12.0, 0.0)],
    )
    return Scene("elastic_punch", "elastic punch with sharp corners", given, elements=True)


@scene
def elastic_punch_friction() -> Scene:
    """The same by force with friction: the displacement lies between smooth and rough."""
    given = case(
        "strain",
        {"steel": STEEL, "alloy": ALLOY},
        [box("punch", "steel", (-5.0, 5.0), (0.0, 10.0)), box("block", "alloy", (-25.0, 25.0), (-20.0, 0.0))],
        support=[held("block.bottom")],
        contact=[pair("face", "punch.bottom", "block.top", 0.25)],
        load=[platen("press", "punch.top", fy=-3000.0), platen("shear", "punch.top", fx=300.0)],
        stage=[{"press": 1.0}, {"shear": 1.0}],
    )
    return Scene(
        "elastic_punch_friction",
        "elastic punch with sharp corners",
        given,
        [
            Figure("normal", lambda r: r.force("face")[1], 3000.0),
            Figure("shear", lambda r: -r.force("face")[0], 300.0),
        ],
    )


@scene
def block_on_block() -> Scene:
    """Two blocks of one width, of one material: an even pressure."""
    given = case(
        "stress",
        {"steel": STEEL},
        [box("upper", "steel", (0.0, 12.0), (8.0, 14.0)), box("lower", "steel", (0.0, 12.0), (0.0, 8.0))],
        support=[
            held("lower.bottom", "uy"),
            pinned("lower", (0.0, 0.0), "ux"),
            pinned("upper", (0.0, 8.0), "ux"),
        ],
        contact=[pair("face", "upper.bottom", "lower.top")],
        load=[pressed("press", "upper.top", 80.0)],
        probe=[probe("top", "upper", 6.0, 14.0)],
    )
    return Scene(
        "block_on_block",
        "block on block",
        given,
        [
            Figure("force", lambda r: r.force("face")[1], 960.0),
            Figure("peak", lambda r: r.peak("face"), 80.0, 3.0),
            Figure("top", lambda r: r.moved("top")[1], -80.0 * 14.0 / 210e3),
        ],
    )


@scene
def block_on_wider_block() -> Scene:
    """Of its own weight."""
    given = case(
        "strain",
        {"steel": STEEL},
        [box("upper", "steel", (0.0, 12.0), (8.0, 20.0)), box("lower", "steel", (-10.0, 30.0), (0.0, 8.0))],
        support=[held("lower.bottom"), pinned("upper", (6.0, 20.0), "ux")],
        contact=[pair("face", "upper.bottom", "lower.top")],
        load=[weighed("weight", "upper", 0.0, -5.0)],
        probe=[probe("top", "upper", 6.0, 20.0)],
    )
    return Scene(
        "block_on_wider_block",
        "block on block",
        given,
        [Figure("force", lambda r: r.force("face")[1], 720.0)],
        elements=True,
    )


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
    return Scene(
        "fretting_pad_friction",
        "fretting pad with rounded corners",
        pad_load(pad_base(pad, "pad.face", 0.4)),
        [
            Figure("normal", lambda r: abs(r.force("face")[1]), 600.0),
            Figure("shear", lambda r: abs(r.force("face")[0]), 90.0),
        ],
        files={"pad.msh": pad_mesh},
    )


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


def dovetail_case(friction: float) -> dict[str, Any]:
    """A tongue in a slot whose flanks lean inward, pulled out; drawn touching."""
    run, rise = 2.0, 3.0
    tongue = [(-6.0, 0.0), (6.0, 0.0), (4.0, 3.0), (4.0, 8.0), (-4.0, 8.0), (-4.0, 3.0)]
    slot = [
        (-15.0, -8.0),
        (15.0, -8.0),
        (15.0, 3.0),
        (4.0, 3.0),
        (6.0 + run / rise, -1.0),
        (-6.0 - run / rise, -1.0),
        (-4.0, 3.0),
        (-15.0, 3.0),
    ]
    return case(
        "strain",
        {"steel": STEEL},
        [
            polygon("tongue", "steel", tongue, names=["foot", "flank2", "neck2", "top", "neck1", "flank1"]),
            polygon(
                "slot",
                "steel",
                slot,
                names=["bottom", "right", "top2", "flank2", "floor", "flank1", "top1", "left"],
            ),
        ],
        support=[held("slot.bottom")],
        contact=[
            pair("right", "tongue.flank2", "slot.flank2", friction),
            pair("left", "tongue.flank1", "slot.flank1", friction),
        ],
        load=[platen("pull", "tongue.top", fy=300.0)],
        probe=[probe("head", "tongue", 0.0, 3.0)],
    )


@scene
def dovetail() -> Scene:
    """Frictionless: each flank carries half of the pull over the cosine."""
    slope = 2.0 / 3.0
    return Scene(
        "dovetail",
        "dovetail",
        dovetail_case(0.0),
        [
            Figure("right up", lambda r: -r.force("right")[1], 150.0),
            Figure("left up", lambda r: -r.force("left")[1], 150.0),
            Figure("right across", lambda r: -r.force("right")[0], 150.0 / slope),
        ],
        elements=True,
    )


@scene
def dovetail_friction() -> Scene:
    """With friction each flank still carries half."""
    return Scene(
        "dovetail_friction",
        "dovetail",
        dovetail_case(0.15),
        [
            Figure("right up", lambda r: -r.force("right")[1], 150.0),
            Figure("left up", lambda r: -r.force("left")[1], 150.0),
        ],
    )


@scene
def wedge_blocks() -> Scene:
    """A wedge of half angle 20 degrees between two blocks on springs, frictionless."""
    lean = float(np.tan(np.radians(20.0)))
    force, spring = 200.0, 500.0
    wedge = [(-3.0, 0.0), (3.0, 0.0), (3.0 + 10.0 * lean, 10.0), (-3.0 - 10.0 * lean, 10.0)]
    right = [(3.0, 0.0), (20.0, 0.0), (20.0, 10.0), (3.0 + 10.0 * lean, 10.0)]
    left = [(-x, y) for x, y in right]
    given = case(
        "strain",
        {"steel": STEEL},
        [
            polygon("wedge", "steel", wedge, names=["tip", "right", "top", "left"]),
            polygon("block1", "steel", left, names=["floor", "back", "top", "face"]),
            polygon("block2", "steel", right, names=["floor", "back", "top", "face"]),
        ],
        support=[
            {"boundary": "block1.back", "spring": [spring, 0.0]},
            {"boundary": "block2.back", "spring": [spring, 0.0]},
            held("block1.floor", "uy"),
            held("block2.floor", "uy"),
        ],
        contact=[pair("left", "wedge.left", "block1.face"), pair("right", "wedge.right", "block2.face")],
        load=[platen("drive", "wedge.top", fy=-force)],
    )
    across = 0.5 * force / lean
    return Scene(
        "wedge_blocks",
        "wedge between sprung blocks",
        given,
        [
            Figure("right across", lambda r: -r.force("right")[0], across),
            Figure("right up", lambda r: r.force("right")[1], 0.5 * force),
            Figure("left across", lambda r: r.force("left")[0], across),
            Figure("spring", lambda r: abs(r.exerted("block2.back")[0]), across),
        ],
        elements=True,
    )


@scene
def wedge_friction() -> Scene:
    """Driven with friction until the flanks slip: across = P/2 (cos a - mu sin a) / (sin a + mu cos a)."""
    base = wedge_blocks()
    given = {**base.case, "contact": [dict(one, friction=0.1) for one in base.case["contact"]]}
    a, mu, force = float(np.radians(20.0)), 0.1, 200.0
    across = 0.5 * force * (np.cos(a) - mu * np.sin(a)) / (np.sin(a) + mu * np.cos(a))
    return Scene(
        "wedge_friction",
        "wedge between sprung blocks",
        given,
        [
            Figure("right across", lambda r: -r.force("right")[0], float(across), 2.0),
            Figure("right up", lambda r: r.force("right")[1], 0.5 * force),
        ],
    )
