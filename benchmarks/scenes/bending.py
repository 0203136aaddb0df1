"""Scenes of bodies that bend: rings, frames, brackets, portals, strips that are heated."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.scenes.mesh_files import write_mesh
from benchmarks.scenes.scene import (
    FORCE,
    Figure,
    Move,
    Scene,
    box,
    case,
    held,
    on_disk,
    on_plane,
    pair,
    pinned,
    platen,
    polygon,
    probe,
    pushed,
    scene,
    solid,
)
from benchmarks.scenes.scene import body as make_body

STEEL, ALLOY, NYLON, RUBBER = (
    solid(210e3, 0.3),
    solid(71e3, 0.33),
    solid(2.8e3, 0.38),
    solid(900.0, 0.4),
)


@scene
def ring_plates() -> Scene:
    """Radius over thickness 20, squeezed by rigid plates; nothing else holds it."""
    given = case(
        "strain",
        {"alloy": ALLOY},
        [make_body("ring", "alloy", "annulus", center=[0.0, 0.0], radii=[29.25, 30.75])],
        contact=[
            on_plane("lower", "ring.outer", (0.0, -30.75), (0.0, 1.0)),
            on_plane("upper", "ring.outer", (0.0, 30.75), (0.0, -1.0)),
        ],
        load=[pushed("press", "upper", uy=-0.9)],
        probe=[probe("side", "ring", 30.75, 0.0)],
    )
    return Scene("ring_plates", "thin ring between plates", given, elements=True)


@scene
def ring_blocks() -> Scene:
    """The same ring between elastic blocks, by force: what each block transfers is the load."""
    given = case(
        "strain",
        {"alloy": ALLOY, "steel": STEEL},
        [
            make_body("ring", "alloy", "annulus", center=[0.0, 0.0], radii=[29.25, 30.75]),
            box("lower", "steel", (-10.0, 10.0), (-40.75, -30.75)),
            box("upper", "steel", (-10.0, 10.0), (30.75, 40.75)),
        ],
        support=[held("lower.bottom")],
        contact=[pair("foot", "ring.outer", "lower.top"), pair("head", "ring.outer", "upper.bottom")],
        load=[platen("press", "upper.top", fy=-8.0)],
        probe=[probe("side", "ring", 30.75, 0.0)],
    )
    return Scene(
        "ring_blocks",
        "thin ring between plates",
        given,
        [
            Figure("foot", lambda r: r.force("foot")[1], 8.0),
            Figure("head", lambda r: r.force("head")[1], -8.0),
        ],
        elements=True,
    )


@scene
def ring_turned_plates() -> Scene:
    """Plates at 17 degrees: no symmetry about an axis of the drawing."""
    c, s = float(np.cos(np.radians(73.0))), float(np.sin(np.radians(73.0)))
    given = case(
        "strain",
        {"alloy": ALLOY},
        [make_body("ring", "alloy", "annulus", center=[0.0, 0.0], radii=[29.25, 30.75])],
        contact=[
            on_plane("lower", "ring.outer", (-30.75 * c, -30.75 * s), (c, s)),
            on_plane("upper", "ring.outer", (30.75 * c, 30.75 * s), (-c, -s)),
        ],
        load=[pushed("press", "upper", ux=-0.9 * c, uy=-0.9 * s)],
    )
    return Scene("ring_turned_plates", "thin ring between plates", given, elements=True)


def frame_mesh(path: Path, move: Move) -> None:
    """A closed frame of 40 x 30, 3 thick, of quads of 0.75."""
    wide, high, thick = 40.0, 30.0, 3.0
    nx, ny = 53, 40
    x, y = np.linspace(0.0, wide, nx + 1), np.linspace(0.0, high, ny + 1)
    x[np.argmin(np.abs(x - thick))], x[np.argmin(np.abs(x - wide + thick))] = thick, wide - thick
    cells: list[Any] = []
    lines: dict[str, list[Any]] = {"bottom": [], "top": []}
    used: dict[tuple[int, int], int] = {}

    def node(i: int, j: int) -> int:
        return used.setdefault((i, j), len(used))

    for i in range(nx):
        for j in range(ny):
            mid = 0.5 * (x[i] + x[i + 1]), 0.5 * (y[j] + y[j + 1])
            hollow = thick < mid[0] < wide - thick and thick < mid[1] < high - thick
            if not hollow:
                cells.append([node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)])
    for i in range(nx):
        lines["bottom"].append([node(i, 0), node(i + 1, 0)])
        lines["top"].append([node(i, ny), node(i + 1, ny)])
    places = np.array([[x[i], y[j]] for i, j in used])
    write_mesh(path, move(places), np.array(cells), {name: np.array(each) for name, each in lines.items()})


@scene
def closed_frame() -> Scene:
    """A closed frame from a mesh, clamped below, pressed by a rigid roller off its middle."""
    given = case(
        "stress",
        {"steel": STEEL},
        [make_body("frame", "steel", "mesh", file="frame.msh")],
        support=[held("frame.bottom")],
        contact=[on_disk("roller", "frame.top", (16.0, 36.0), 6.0)],
        load=[pushed("press", "roller", uy=-0.2)],
        probe=[probe("corner", "frame", 40.0, 30.0)],
    )
    return Scene("closed_frame", "clamped frame", given, files={"frame.msh": frame_mesh}, elements=True)


C_FRAME = [
    (0.0, 0.0),
    (30.0, 0.0),
    (30.0, 6.0),
    (6.0, 6.0),
    (6.0, 30.0),
    (30.0, 30.0),
    (30.0, 36.0),
    (0.0, 36.0),
]


@scene
def c_frame() -> Scene:
    """A C-frame with filleted corners, held at its back, opened by a rigid roller in its mouth."""
    names = ["bottom", "tip", "lower", "back", "upper", "tip2", "top", "rear"]
    given = case(
        "stress",
        {"steel": STEEL},
        [polygon("frame", "steel", C_FRAME, names=names, rounding=[0.0, 0.0, 0.0, 2.0, 2.0, 0.0, 0.0, 0.0])],
        support=[held("frame.bottom")],
        contact=[on_disk("roller", "frame.upper", (25.0, 25.0), 5.0)],
        load=[pushed("open", "roller", uy=0.3)],
        probe=[probe("tip", "frame", 30.0, 36.0)],
    )
    return Scene("c_frame", "clamped frame", given, elements=True)


BRACKET = [(0.0, 0.0), (8.0, 0.0), (8.0, 22.0), (30.0, 22.0), (30.0, 28.0), (0.0, 28.0)]


@scene
def bracket() -> Scene:
    """An angle with rounded corners, clamped below, its arm pressed by a rigid roller near the tip."""
    names = ["foot", "inside", "under", "tip", "top", "back"]
    given = case(
        "stress",
        {"alloy": ALLOY},
        [polygon("angle", "alloy", BRACKET, names=names, rounding=[0.0, 0.0, 3.0, 1.5, 1.5, 5.0])],
        support=[held("angle.foot")],
        contact=[on_disk("roller", "angle.top", (24.0, 33.0), 5.0)],
        load=[pushed("press", "roller", uy=-0.1)],
        probe=[probe("tip", "angle", 30.0, 25.0)],
    )
    return Scene("bracket", "bracket with rounded corners", given, elements=True)


PORTAL = [
    (0.0, 0.0),
    (4.0, 0.0),
    (4.0, 36.0),
    (46.0, 36.0),
    (46.0, 0.0),
    (50.0, 0.0),
    (50.0, 40.0),
    (0.0, 40.0),
]


def portal_case(rounding: float) -> dict[str, Any]:
    names = ["foot1", "inside1", "under", "inside2", "foot2", "right", "top", "left"]
    corners = [0.0, 0.0, rounding, rounding, 0.0, 0.0, 0.0, 0.0]
    return case(
        "stress",
        {"steel": STEEL},
        [polygon("portal", "steel", PORTAL, names=names, rounding=corners)],
        support=[held("portal.foot1"), held("portal.foot2")],
        contact=[on_disk("roller", "portal.top", (18.0, 48.0), 8.0)],
        load=[pushed("press", "roller", uy=-0.25)],
        probe=[probe("corner", "portal", 50.0, 40.0)],
    )


@scene
def portal() -> Scene:
    """Two clamped posts and a beam with fillets under a rigid roller off the middle."""
    return Scene("portal", "portal frame", portal_case(2.0), elements=True)


@scene
def portal_sharp() -> Scene:
    """The same with sharp inner corners."""
    return Scene("portal_sharp", "portal frame", portal_case(0.0), elements=True)


@scene
def bimetal_stop() -> Scene:
    """Two bonded layers of different expansion, one end held, the other against a round stop; Timoshenko."""
    E, rise, thick, at, gap = 70e3, 50.0, 1.0, 58.0, 0.4
    low, high = 23e-6, 13e-6
    given = case(
        "stress",
        {"low": solid(E, 0.3, alpha=low), "high": solid(E, 0.3, alpha=high)},
        [
            box("lower", "low", (0.0, 60.0), (0.0, thick)),
            box("upper", "high", (0.0, 60.0), (thick, 2 * thick)),
        ],
        support=[held("lower.left", "ux"), held("upper.left", "ux"), pinned("lower", (0.0, 0.0), "uy")],
        contact=[
            {"name": "bond", "slave": "upper.bottom", "master": "lower.top", "friction": "bonded"},
            on_disk("stop", "upper.top", (at, 2 * thick + gap + 5.0), 5.0),
        ],
        load=[
            {"name": "heat_low", "kind": "temperature", "body": "lower", "temperature": rise},
            {"name": "heat_high", "kind": "temperature", "body": "upper", "temperature": rise},
        ],
    )
    curvature = 0.75 * (low - high) * rise / thick
    stiff = E * (2 * thick) ** 3 / 12.0
    # The top face moves by what the section below it grows, too.
    free = 0.5 * curvature * at**2 + 0.5 * (low + high) * rise * 2 * thick
    force = 3.0 * stiff * (free - gap) / at**3
    return Scene(
        "bimetal_stop",
        "bimetal against a stop",
        given,
        [Figure("force", lambda r: abs(r.force("stop")[1]), force, 2.0)],
    )


@scene
def heated_bar_stop() -> Scene:
    """What can be written of it: a bar that grows by heat until it meets a wall; plane stress, 1D formula."""
    E, alpha, rise, length, gap = 71e3, 23e-6, 60.0, 100.0, 0.05
    given = case(
        "stress",
        {"alloy": solid(E, 0.33, alpha=alpha)},
        [box("bar", "alloy", (0.0, length), (-3.0, 3.0))],
        support=[held("bar.left", "ux"), pinned("bar", (0.0, -3.0), "uy")],
        contact=[on_plane("stop", "bar.right", (length + gap, 0.0), (-1.0, 0.0))],
        load=[{"name": "heat", "kind": "temperature", "body": "bar", "temperature": rise}],
        probe=[probe("mid", "bar", 50.0, 0.0)],
    )
    stress = E * (alpha * rise - gap / length)
    return Scene(
        "heated_bar_stop",
        "bimetal against a stop",
        given,
        [
            Figure("force", lambda r: abs(r.force("stop")[0]), stress * 6.0, FORCE),
            Figure("peak", lambda r: r.peak("stop"), stress, 3.0),
            Figure("mid", lambda r: r.moved("mid")[0], 0.5 * gap, 1.0),
        ],
    )
