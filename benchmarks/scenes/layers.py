"""Flat contacts: layers, sheets, punches, blocks, dovetails, wedges between blocks."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.scenes.bending import ALLOY, RUBBER, STEEL
from benchmarks.scenes.scene import (
    Figure,
    Scene,
    box,
    case,
    held,
    on_disk,
    pair,
    pinned,
    platen,
    polygon,
    pressed,
    probe,
    pushed,
    scene,
    weighed,
)

FRICTION = 0.3


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
