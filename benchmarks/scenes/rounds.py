"""Disks in shafts and grooves, a wheel on its rail, gear flanks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.scenes.bending import ALLOY, STEEL
from benchmarks.scenes.mesh_files import filled_mesh
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
    platen,
    polygon,
    probe,
    scene,
    size_of,
    weighed,
)
from benchmarks.scenes.scene import body as make_body


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


def groove(name: str, friction: float, elastic: bool) -> Scene:
    judged = elastic and not friction
    figures = groove_figures(friction > 0.0)
    return Scene(name, "disk in a groove", groove_case(friction, elastic), figures, elements=judged)


@scene
def disk_groove_rigid() -> Scene:
    return groove("disk_groove_rigid", 0.0, False)


@scene
def disk_groove_elastic() -> Scene:
    return groove("disk_groove_elastic", 0.0, True)


@scene
def disk_groove_friction() -> Scene:
    return groove("disk_groove_friction", 0.3, False)


@scene
def disk_groove_elastic_friction() -> Scene:
    return groove("disk_groove_elastic_friction", 0.3, True)


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
