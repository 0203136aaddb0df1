"""Round things that fit: shrunk rings, rod eyes, an O-ring, a pinned disk."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.scenes.bending import ALLOY, STEEL
from benchmarks.scenes.mesh_files import filled_mesh, write_mesh
from benchmarks.scenes.scene import (
    Figure,
    Move,
    Scene,
    box,
    case,
    held,
    on_plane,
    pair,
    pinned,
    platen,
    polygon,
    probe,
    scene,
    solid,
    weighed,
)
from benchmarks.scenes.scene import body as make_body

BRASS = solid(112e3, 0.35)
INNER, OUTER, FIT = 31.0, 33.0, 0.024


def fit_pressure(inner: float, outer: float, fit: float) -> float:
    """Of a brass ring on a solid steel shaft in plane stress, by Lamé."""
    ring = ((outer**2 + inner**2) / (outer**2 - inner**2) + 0.35) / 112e3
    return fit / (inner * (ring + 0.7 / 210e3))


def shrink_case(spacing: float | None) -> dict[str, Any]:
    ring = make_body("ring", "brass", "annulus", center=[0.0, 0.0], radii=[INNER, OUTER])
    shaft = make_body("shaft", "steel", "disk", center=[0.0, 0.0], radius=INNER)
    if spacing is not None:
        ring["spacing"] = shaft["spacing"] = spacing
    return case(
        "stress",
        {"steel": STEEL, "brass": BRASS},
        [ring, shaft],
        contact=[pair("fit", "ring.inner", "shaft.arc", interference=FIT)],
        probe=[probe("out", "ring", OUTER, 0.0)],
    )


def shrink_figures() -> list[Figure]:
    pressure = fit_pressure(INNER, OUTER, FIT)
    grows = 2.0 * pressure * INNER**2 * OUTER / (112e3 * (OUTER**2 - INNER**2))
    return [
        Figure("peak", lambda r: r.peak("fit"), pressure, 3.0),
        # Free to turn and to shift together, the pair is held somewhere: the mean motion is not judged.
        Figure("grows", lambda r: r.moved("out")[0], grows, 2.0),
    ]


@scene
def shrink_auto() -> Scene:
    """Nothing asked of the clouds."""
    return Scene("shrink_auto", "shrink fit", shrink_case(None), shrink_figures())


@scene
def shrink_equal() -> Scene:
    """Four spacings across the ring, the same in the shaft."""
    return Scene("shrink_equal", "shrink fit", shrink_case(0.5), shrink_figures())


def keyed_shaft_mesh(path: Path, move: Move) -> None:
    """A shaft of radius 10 with a keyway 5 wide and 3 deep, its round side one group; nodes are not used."""
    half = float(np.arcsin(0.25))
    around = np.linspace(0.5 * np.pi + half, 2.5 * np.pi - half, 181)
    arc = 10.0 * np.column_stack([np.cos(around), np.sin(around)])
    low, top = 7.0, float(10.0 * np.cos(half))
    wall = np.linspace(top, low, 9)[1:]
    right = np.column_stack([np.full(8, 2.5), wall])
    floor = np.column_stack([np.linspace(2.5, -2.5, 13)[1:], np.full(12, low)])
    left = np.column_stack([np.full(7, -2.5), wall[::-1][1:]])
    filled_mesh(path, move, np.vstack([arc, right, floor, left]), {"round": (0, 180)}, 0.6)


@scene
def shrink_keyway() -> Scene:
    """A hub on a shaft with a keyway."""
    given = case(
        "stress",
        {"steel": STEEL},
        [
            make_body("hub", "steel", "annulus", center=[0.0, 0.0], radii=[10.0, 16.0]),
            make_body("shaft", "steel", "mesh", file="shaft.msh", use="outline"),
        ],
        contact=[pair("fit", "shaft.round", "hub.inner", interference=0.01)],
        probe=[probe("below", "hub", 0.0, -16.0), probe("above", "hub", 0.0, 16.0)],
    )
    return Scene("shrink_keyway", "shrink fit", given, files={"shaft.msh": keyed_shaft_mesh}, elements=True)


def eye_mesh(path: Path, move: Move) -> None:
    """An eye of radii 10 and 18 with a shank of 12 x 30 to the right; one outline and a hole, by quads."""
    half = float(np.arcsin(6.0 / 18.0))
    start = 18.0 * np.cos(half)
    n, m = 96, 8
    shank_n, long_n = 12, 30
    # Angles of the outer nodes: those between -half and half belong to the shank, evenly in y.
    inside = np.arcsin(np.linspace(-6.0, 6.0, shank_n + 1) / 18.0)
    rest = np.linspace(half, 2.0 * np.pi - half, n + 1)[1:-1]
    around = np.concatenate([inside, rest])
    radial = np.linspace(0.0, 1.0, m + 1)
    places, cells = [], []
    for t in radial:
        r = 10.0 + 8.0 * t
        places.append(np.column_stack([r * np.cos(around), r * np.sin(around)]))
    count = len(around)
    number = np.arange((m + 1) * count).reshape(m + 1, count)
    for i in range(m):
        for j in range(count):
            q = (j + 1) % count
            cells.append([number[i, j], number[i + 1, j], number[i + 1, q], number[i, q]])
    last, root = (m + 1) * count, number[m, : shank_n + 1]
    y = 18.0 * np.sin(inside)
    columns = [root]
    for step in np.linspace(0.0, 1.0, long_n + 1)[1:]:
        x0 = 18.0 * np.cos(inside)
        places.append(np.column_stack([x0 + step * (start + 30.0 - x0), y]))
        columns.append(np.arange(last, last + shank_n + 1))
        last += shank_n + 1
    for a, b in itertools.pairwise(columns):
        cells += [[a[j], b[j], b[j + 1], a[j + 1]] for j in range(shank_n)]
    bore = number[0]
    lines = {
        "bore": np.column_stack([bore, np.roll(bore, -1)]),
        "end": np.column_stack([columns[-1][:-1], columns[-1][1:]]),
    }
    write_mesh(path, move(np.vstack(places)), np.array(cells), lines)


@scene
def rod_eye() -> Scene:
    """A rod eye from a mesh on a pin whose middle is held, pulled at its shank."""
    given = case(
        "stress",
        {"steel": STEEL},
        [
            make_body("eye", "steel", "mesh", file="eye.msh"),
            make_body("pin", "steel", "annulus", center=[-0.1, 0.0], radii=[4.0, 9.9]),
        ],
        support=[held("pin.inner")],
        contact=[pair("bore", "pin.outer", "eye.bore")],
        load=[platen("pull", "eye.end", fx=800.0)],
        probe=[probe("back", "eye", -18.0, 0.0)],
    )
    return Scene(
        "rod_eye",
        "rod eye from a mesh",
        given,
        [Figure("bore", lambda r: abs(r.force("bore")[0]), 800.0)],
        files={"eye.msh": eye_mesh},
        elements=True,
    )


@scene
def rod_eye_outline() -> Scene:
    """The same, its outline filled anew."""
    base = rod_eye()
    bodies = [dict(one, shape={**one["shape"]}) for one in base.case["body"]]
    bodies[0]["shape"]["use"] = "outline"
    return replace(base, name="rod_eye_outline", case={**base.case, "body": bodies})


@scene
def rod_eye_gap() -> Scene:
    """The pin drawn in the middle of the bore: the pull closes the gap first."""
    base = rod_eye()
    bodies = [base.case["body"][0], make_body("pin", "steel", "annulus", center=[0.0, 0.0], radii=[4.0, 9.9])]
    return replace(base, name="rod_eye_gap", case={**base.case, "body": bodies}, elements=False)


@scene
def o_ring() -> Scene:
    """A soft ring in a rectangular groove, squeezed by a lid until it meets the walls."""
    groove = [
        (-10.0, -5.0),
        (10.0, -5.0),
        (10.0, 4.5),
        (3.1, 4.5),
        (3.1, 0.0),
        (-3.1, 0.0),
        (-3.1, 4.5),
        (-10.0, 4.5),
    ]
    names = ["bottom", "right", "top2", "wall2", "floor", "wall1", "top1", "left"]
    given = case(
        "strain",
        {"rubber": solid(8.0, 0.45), "alloy": ALLOY},
        [
            make_body("seal", "rubber", "disk", center=[0.0, 3.0], radius=3.0),
            polygon("groove", "alloy", groove, names=names),
            box("lid", "alloy", (-10.0, 10.0), (6.0, 10.0)),
        ],
        support=[held("groove.bottom")],
        contact=[
            pair("floor", "seal.arc", "groove.floor"),
            pair("wall1", "seal.arc", "groove.wall1"),
            pair("wall2", "seal.arc", "groove.wall2"),
            pair("lid", "seal.arc", "lid.bottom"),
        ],
        load=[platen("close", "lid.top", uy=-0.6)],
    )
    return Scene("o_ring", "O-ring in a groove", given, elements=True, straight_walls=True)


@scene
def o_ring_rigid() -> Scene:
    """The same in a groove that is a rigid polyline."""
    corners = [[8.0, 4.5], [3.1, 4.5], [3.1, 0.0], [-3.1, 0.0], [-3.1, 4.5], [-8.0, 4.5]]
    given = case(
        "strain",
        {"rubber": solid(8.0, 0.45)},
        [make_body("seal", "rubber", "disk", center=[0.0, 3.0], radius=3.0)],
        contact=[
            {"name": "groove", "slave": "seal.arc", "obstacle": {"kind": "polyline", "points": corners}},
            on_plane("lid", "seal.arc", (0.0, 6.0), (0.0, -1.0)),
        ],
        load=[{"name": "close", "kind": "obstacle", "obstacle": "lid", "uy": -0.6}],
    )
    return Scene("o_ring_rigid", "O-ring in a groove", given, elements=True, straight_walls=True)


@scene
def pinned_disk() -> Scene:
    """A disk held at its top node on a smooth plane may turn about it: that must be held, and told."""
    given = case(
        "strain",
        {"steel": STEEL},
        [
            make_body("disk", "steel", "disk", center=[0.0, 5.0], radius=5.0),
            box("block", "steel", (-20.0, 20.0), (-20.0, 0.0)),
        ],
        support=[held("block.bottom"), pinned("disk", (0.0, 10.0), "ux")],
        contact=[pair("foot", "disk.arc", "block.top")],
        load=[weighed("weight", "disk", 0.0, -5.0)],
        probe=[probe("side", "disk", 5.0, 5.0)],
    )
    modulus = 210e3 / (1.0 - 0.3**2) / 2.0
    load = float(5.0 * np.pi * 25.0)
    return Scene(
        "pinned_disk",
        "motions that nothing resists",
        given,
        [
            Figure("force", lambda r: abs(r.force("foot")[1]), load),
            Figure("peak", lambda r: r.peak("foot"), float(np.sqrt(load * modulus / np.pi / 5.0)), 2.0),
        ],
    )
