"""Round things: fits, disks in shafts and grooves, rod eye, O-ring, wheel, gear flanks."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.path import Path as PathInside
from scipy.spatial import Delaunay, cKDTree

from benchmarks.scenes.bending import ALLOY, STEEL, write_mesh
from benchmarks.scenes.scene import (
    Array,
    Figure,
    Move,
    Pair,
    Result,
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
    size_of,
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


def filled_mesh(
    path: Path, move: Move, outline: Array, groups: dict[str, tuple[int, int]], step: float
) -> None:
    """Triangles inside an outline (n, 2), with inner nodes on a grid; groups are ranges of its sides."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    rows = np.arange(low[1] + 0.37 * step, high[1], 0.87 * step)
    grid = np.vstack(
        [
            np.column_stack(
                [
                    np.arange(low[0] + 0.5 * step * (i % 2) + 0.21 * step, high[0], step),
                ]
                * 2
            )
            * [1.0, 0.0]
            + [0.0, y]
            for i, y in enumerate(rows)
        ]
    )
    side = PathInside(np.vstack([outline, outline[:1]]))
    far = cKDTree(outline).query(grid)[0] > 0.6 * step
    places = np.vstack([outline, grid[far & side.contains_points(grid)]])
    cells = Delaunay(places).simplices
    corners = places[cells]
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    thick = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) > 1e-4 * step**2
    cells = cells[side.contains_points(corners.mean(axis=1)) & thick]
    count = len(outline)
    lines = {
        name: np.column_stack([np.arange(a, b), np.arange(a + 1, b + 1) % count])
        for name, (a, b) in groups.items()
    }
    write_mesh(path, move(places), cells, lines)


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


def shaft_places(count: int, radius: float, width: float) -> Array:
    """Centres (n, 2) of disks that lie to and fro in a shaft of that width, from its floor at y = 0."""
    across = width - 2.0 * radius
    rise = np.sqrt(4.0 * radius**2 - across**2)
    return np.array([[radius + (i % 2) * across, radius + i * rise] for i in range(count)])


def disks_case(count: int, friction: float, walls: str) -> tuple[dict[str, Any], float]:
    """Disks of radius 5 and weight 1 per area in a shaft 17 wide; the tangent of their lean."""
    radius, width = 5.0, 17.0
    places = shaft_places(count, radius, width)
    names = [f"disk{i}" for i in range(count)]
    bodies = [
        make_body(name, "steel", "disk", center=place.tolist(), radius=radius)
        for name, place in zip(names, places, strict=True)
    ]
    high = float(places[-1, 1] + 2.0 * radius)
    contacts, supports = [], []
    if walls == "rigid":
        contacts.append(on_plane("floor", "disk0.arc", (0.0, 0.0), (0.0, 1.0), friction))
        sides = {"left": ((0.0, 0.0), (1.0, 0.0)), "right": ((width, 0.0), (-1.0, 0.0))}
        for i, name in enumerate(names):
            side = "right" if i % 2 else "left"
            contacts.append(on_plane(f"wall{i}", f"{name}.arc", *sides[side], friction))
    else:
        bodies += [
            box("ground", "steel", (0.0, width), (-8.0, 0.0)),
            box("left", "steel", (-8.0, 0.0), (0.0, high)),
            box("right", "steel", (width, width + 8.0), (0.0, high)),
        ]
        supports = [held("ground.bottom"), held("left.left"), held("right.right")]
        contacts.append(pair("floor", "disk0.arc", "ground.top", friction))
        for i, name in enumerate(names):
            side = "right.left" if i % 2 else "left.right"
            contacts.append(pair(f"wall{i}", f"{name}.arc", side, friction))
    contacts += [pair(f"pair{i}", f"disk{i}.arc", f"disk{i - 1}.arc", friction) for i in range(1, count)]
    given = case(
        "strain",
        {"steel": STEEL},
        bodies,
        support=supports,
        contact=contacts,
        load=[weighed(f"weight{i}", name, 0.0, -1.0) for i, name in enumerate(names)],
        stage=[{f"weight{i}": 1.0 for i in range(count)}],
        probe=[probe(name, name, *place.tolist()) for name, place in zip(names, places, strict=True)],
    )
    lean = float((width - 2.0 * radius) / (places[1, 1] - places[0, 1])) if count > 1 else 0.0
    return given, lean


def disk_figures(count: int, lean: float) -> list[Figure]:
    """Statics: what lies above goes down each pair along its centres as displaced, its horizontal part to the
    walls."""
    weight = float(np.pi * 25.0)
    places = shaft_places(count, 5.0, 17.0)

    def across(pair: int) -> Callable[[Result], float]:
        names = f"disk{pair}", f"disk{pair - 1}"
        drawn = places[pair] - places[pair - 1]

        def ratio(result: Result) -> float:
            now = drawn + result.moved(names[0]) - result.moved(names[1])
            force = result.force(f"pair{pair}")
            return abs(float(force[0] / force[1] * now[1] / now[0]))

        return ratio

    figures = [Figure("floor", lambda r: abs(r.force("floor")[1]), count * weight)]
    figures += [Figure(f"across to up, pair{i}", across(i), 1.0, 0.3) for i in range(1, count)]
    for i in range(count):
        above = ((count - i) if i else 0) + ((count - i - 1) if i + 1 < count else 0)
        figures.append(Figure(f"wall{i}", size_of(f"wall{i}"), above * weight * lean))
    return figures


@scene
def disks_shaft_rigid() -> Scene:
    """Six disks in a rigid shaft."""
    given, lean = disks_case(6, 0.0, "rigid")
    return Scene("disks_shaft_rigid", "disks in a shaft", given, disk_figures(6, lean))


@scene
def disks_shaft_elastic() -> Scene:
    """Three disks between elastic walls."""
    given, lean = disks_case(3, 0.0, "elastic")
    return Scene("disks_shaft_elastic", "disks in a shaft", given, disk_figures(3, lean))


@scene
def disks_shaft_friction() -> Scene:
    """Six with friction: not determined by statics, but for the sum of what the walls and the floor carry."""
    given, _ = disks_case(6, 0.2, "rigid")

    def up(result: object) -> float:
        return float(sum(abs(result.force(n)[1]) for n in ("floor", *(f"wall{i}" for i in range(6)))))  # type: ignore[attr-defined]

    return Scene(
        "disks_shaft_friction", "disks in a shaft", given, [Figure("up", up, float(6.0 * np.pi * 25.0))]
    )


def groove_case(friction: float, elastic: bool) -> dict[str, Any]:
    """A disk of radius 6 in a groove with flanks at 30 and 50 degrees, of its weight."""
    a, b, radius = np.radians(30.0), np.radians(50.0), 6.0
    # Touching points below the centre at (0, 0): normals lean to the left by a on the right flank.
    right = radius * np.array([np.sin(a), -np.cos(a)])
    left = radius * np.array([-np.sin(b), -np.cos(b)])
    disk = make_body("disk", "steel", "disk", center=[0.0, 0.0], radius=radius)
    bodies, supports = [disk], []
    if elastic:
        along_right, along_left = np.array([np.cos(a), np.sin(a)]), np.array([-np.cos(b), np.sin(b)])
        # The bottom of the groove is where both flanks meet.
        t, _ = np.linalg.solve(np.column_stack([along_right, -along_left]), left - right)
        low = right + t * along_right
        up_r = low + 14.0 * along_right
        up_l = low + 14.0 * along_left
        base = float(low[1]) - 8.0
        points: list[Pair] = [
            (float(up_l[0]), base),
            (float(up_r[0]), base),
            (float(up_r[0]), float(up_r[1])),
            (float(low[0]), float(low[1])),
            (float(up_l[0]), float(up_l[1])),
        ]
        names = ["bottom", "side2", "right", "left", "side1"]
        bodies.append(polygon("groove", "alloy", points, names=names))
        supports = [held("groove.bottom")]
        contacts = [
            pair("right", "disk.arc", "groove.right", friction),
            pair("left", "disk.arc", "groove.left", friction),
        ]
    else:
        contacts = [
            on_plane("right", "disk.arc", tuple(right.tolist()), (-np.sin(a), np.cos(a)), friction),
            on_plane("left", "disk.arc", tuple(left.tolist()), (np.sin(b), np.cos(b)), friction),
        ]
        for one in contacts:
            one["obstacle"]["normal"] = [float(v) for v in one["obstacle"]["normal"]]
    materials = {"steel": STEEL, "alloy": ALLOY} if elastic else {"steel": STEEL}
    return case(
        "strain",
        materials,
        bodies,
        support=supports,
        contact=contacts,
        load=[weighed("weight", "disk", 0.0, -2.0)],
        probe=[probe("top", "disk", 0.0, 6.0)],
    )


def groove_figures(friction: bool) -> list[Figure]:
    a, b = np.radians(30.0), np.radians(50.0)
    weight = float(2.0 * np.pi * 36.0)
    right = weight * np.sin(b) / np.sin(a + b)
    left = weight * np.sin(a) / np.sin(a + b)
    if friction:
        return [Figure("sum", lambda r: r.force("right")[1] + r.force("left")[1], weight)]
    return [
        Figure("right", lambda r: float(np.hypot(*r.force("right"))), float(right)),
        Figure("left", lambda r: float(np.hypot(*r.force("left"))), float(left)),
    ]


@scene
def disk_groove_rigid() -> Scene:
    return Scene("disk_groove_rigid", "disk in a groove", groove_case(0.0, False), groove_figures(False))


@scene
def disk_groove_elastic() -> Scene:
    return Scene(
        "disk_groove_elastic",
        "disk in a groove",
        groove_case(0.0, True),
        groove_figures(False),
        elements=True,
    )


@scene
def disk_groove_friction() -> Scene:
    return Scene("disk_groove_friction", "disk in a groove", groove_case(0.3, False), groove_figures(True))


@scene
def disk_groove_elastic_friction() -> Scene:
    return Scene(
        "disk_groove_elastic_friction", "disk in a groove", groove_case(0.3, True), groove_figures(True)
    )


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
    return Scene(
        "rod_eye_outline",
        base.kind,
        {**base.case, "body": bodies},
        base.figures,
        files=base.files,
        elements=True,
    )


@scene
def rod_eye_gap() -> Scene:
    """The pin drawn in the middle of the bore: the pull closes the gap first."""
    base = rod_eye()
    bodies = [base.case["body"][0], make_body("pin", "steel", "annulus", center=[0.0, 0.0], radii=[4.0, 9.9])]
    return Scene("rod_eye_gap", base.kind, {**base.case, "body": bodies}, base.figures, files=base.files)


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
def wheel_rail() -> Scene:
    """A wheel on a rail, pressed, then driven by half of what friction carries: Hertz, and statics."""
    load, radius = 1500.0, 50.0
    given = case(
        "strain",
        {"steel": STEEL},
        [
            make_body("wheel", "steel", "half-disk", center=[0.0, radius], radius=radius, side="lower"),
            box("rail", "steel", (-100.0, 100.0), (-100.0, 0.0)),
        ],
        support=[held("rail.bottom")],
        contact=[pair("tread", "wheel.arc", "rail.top", 0.3)],
        load=[platen("axle", "wheel.flat", fy=-load), platen("drive", "wheel.flat", fx=0.15 * load)],
        stage=[{"axle": 1.0}, {"drive": 1.0}],
    )
    modulus = 210e3 / (1.0 - 0.3**2) / 2.0
    peak = float(np.sqrt(load * modulus / (np.pi * radius)))
    return Scene(
        "wheel_rail",
        "wheel on rail with traction",
        given,
        [
            Figure("peak", lambda r: r.peak("tread"), peak, 1.5),
            Figure("normal", lambda r: abs(r.force("tread")[1]), load),
            Figure("shear", lambda r: abs(r.force("tread")[0]), 0.15 * load),
        ],
    )


@scene
def wheel_whole() -> Scene:
    """A whole wheel, held by a rotating platen at its hub, on a rail of another material."""
    load, radius = 1200.0, 40.0
    given = case(
        "strain",
        {"steel": STEEL, "alloy": ALLOY},
        [
            make_body("wheel", "steel", "annulus", center=[0.0, radius], radii=[8.0, radius]),
            box("rail", "alloy", (-90.0, 90.0), (-90.0, 0.0)),
        ],
        support=[held("rail.bottom")],
        contact=[pair("tread", "wheel.outer", "rail.top")],
        load=[platen("axle", "wheel.inner", fy=-load)],
    )
    modulus = 1.0 / ((1.0 - 0.3**2) / 210e3 + (1.0 - 0.33**2) / 71e3)
    peak = float(np.sqrt(load * modulus / (np.pi * radius)))
    return Scene(
        "wheel_whole",
        "wheel on rail with traction",
        given,
        [
            Figure("peak", lambda r: r.peak("tread"), peak, 1.5),
            Figure("half width", lambda r: r.half_width("tread"), float(2 * load / np.pi / peak), 2.0),
        ],
    )


@scene
def gear_flanks() -> Scene:
    """Two involute flanks that touch on the line of action: curves from points."""
    # Of either involute at its pitch point: r sin(20 degrees).
    radius = 30.0 * float(np.sin(np.radians(20.0)))
    given = case(
        "strain",
        {"steel": STEEL},
        [
            make_body("driver", "steel", "mesh", file="driver.msh", use="outline"),
            make_body("driven", "steel", "mesh", file="driven.msh", use="outline"),
        ],
        support=[held("driven.back")],
        contact=[pair("flank", "driver.flank", "driven.flank")],
        load=[platen("torque", "driver.back", fy=-400.0)],
    )
    modulus = 210e3 / (1.0 - 0.3**2) / 2.0
    peak = float(np.sqrt(400.0 * modulus / (np.pi * 0.5 * radius)))
    return Scene(
        "gear_flanks",
        "gear flanks from points",
        given,
        [
            Figure("force", lambda r: abs(r.force("flank")[1]), 400.0),
            Figure("peak", lambda r: r.peak("flank"), peak, 3.0),
        ],
        files={"driver.msh": flank_mesh(1.0), "driven.msh": flank_mesh(-1.0)},
    )


def flank_mesh(side: float) -> Callable[[Path, Move], None]:
    """Writes a tooth's flank about its pitch point at the origin, the line of action upright, 8 deep."""

    def write(path: Path, move: Move) -> None:
        angle = np.radians(20.0)
        base = 30.0 * np.cos(angle)
        at = np.tan(angle)  # roll angle at the pitch point
        roll = at + np.linspace(-0.24, 0.24, 97)
        curve = base * np.column_stack(
            [np.sin(roll) - roll * np.cos(roll), np.cos(roll) + roll * np.sin(roll)]
        )
        pitch = base * np.array([np.sin(at) - at * np.cos(at), np.cos(at) + at * np.sin(at)])
        # The normal of an involute is tangent to its base circle: turned upright.
        normal = np.array([np.cos(at), -np.sin(at)])
        tangent = np.array([np.sin(at), np.cos(at)])
        local = np.column_stack([(curve - pitch) @ tangent, (curve - pitch) @ normal])
        # Convex towards the other flank: below for the driver, above for the driven one.
        local[:, 1] = side * np.abs(local[:, 1])
        local[:, 0] *= side
        local = local[np.argsort(side * local[:, 0])]
        a, b = local[0], local[-1]
        far = side * 10.0
        down = np.linspace(b[1], far, 15)[1:]
        back = np.linspace(b[0], a[0], 15)[1:]
        up = np.linspace(far, a[1], 15)[1:-1]
        outline = np.vstack(
            [
                local,
                np.column_stack([np.full(14, b[0]), down]),
                np.column_stack([back, np.full(14, far)]),
                np.column_stack([np.full(13, a[0]), up]),
            ]
        )
        groups = {"flank": (0, 96), "back": (96 + 14, 96 + 28)}
        filled_mesh(path, move, outline, groups, 0.6)

    return write


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
