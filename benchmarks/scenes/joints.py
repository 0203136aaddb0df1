"""Joints and grips: a lap joint, a twisted bush, a wedge anchor, a dowel, a bar clamp, a tilted punch."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.scenes.bending import STEEL
from benchmarks.scenes.scene import (
    PLACE,
    Figure,
    Refusal,
    Result,
    Scene,
    Table,
    body,
    box,
    case,
    force_at,
    held,
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
)


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
    given = lap_case(80.0, 0.3)
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
    given = lap_case(240.0, 0.3)
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
def rubber_bush() -> Scene:
    """A bush bonded to a core that is turned, in a rigid sleeve."""
    shear, nu, inner, outer, angle = 1.0, 0.45, 8.0, 14.0, 0.01
    given = case(
        "strain",
        {"rubber": solid(2.0 * shear * (1.0 + nu), nu), "steel": STEEL},
        [
            body("core", "steel", "annulus", center=[0.0, 0.0], radii=[4.0, inner]),
            body("bush", "rubber", "annulus", center=[0.0, 0.0], radii=[inner, outer]),
        ],
        support=[held("bush.outer")],
        contact=[pair("bond", "bush.inner", "core.outer") | {"friction": "bonded"}],
        load=[platen("turn", "core.inner", rotation=angle, hinge=[0.0, 0.0], ux=0.0, uy=0.0)],
        probe=[probe("middle", "bush", 11.0, 0.0)],
    )
    twist = angle / (inner**-2 - outer**-2)

    def moment(result: Result) -> float:
        return abs(float(result.summary["plates"]["core.inner"]["moment"]))

    figures = [
        Figure(
            "moved", lambda r: float(np.hypot(*r.moved("middle"))), twist * (1.0 / 11.0 - 11.0 / outer**2)
        ),
        Figure("moment", moment, 4.0 * np.pi * shear * twist),
    ]
    return Scene("rubber_bush", "bush", given, figures)


@scene
def expansion_anchor() -> Scene:
    """A wedge that spreads two jaws against smooth walls."""
    friction, angle, drive = 0.2, float(np.radians(12.0)), 800.0
    wide, low, high, slope = 8.0, 5.0, 60.0, float(np.tan(angle))
    top = wide + high * slope
    wedge = polygon(
        "wedge",
        "steel",
        [(-wide, low), (wide, low), (top, low + high), (-top, low + high)],
        names=["tip", "right", "head", "left"],
    )

    def jaw(name: str, side: float) -> Table:
        points = [(wide - low * slope, 0.0), (40.0, 0.0), (40.0, 50.0), (wide + (50.0 - low) * slope, 50.0)]
        moved = [(side * x, y) for x, y in points]
        return polygon(name, "steel", moved, names=["foot", "wall", "top", "face"])

    given = case(
        "strain",
        {"steel": STEEL},
        [wedge, jaw("right", 1.0), jaw("left", -1.0)],
        contact=[
            pair("face-right", "right.face", "wedge.right", friction),
            pair("face-left", "left.face", "wedge.left", friction),
            on_plane("wall-right", "right.wall", (40.0, 0.0), (-1.0, 0.0)),
            on_plane("wall-left", "left.wall", (-40.0, 0.0), (1.0, 0.0)),
            on_plane("floor-right", "right.foot", (0.0, 0.0), (0.0, 1.0)),
            on_plane("floor-left", "left.foot", (0.0, 0.0), (0.0, 1.0)),
        ],
        load=[platen("drive", "wedge.head", force=[0.0, -drive])],
    )
    across = 0.5 * drive / float(np.tan(angle + np.arctan(friction)))
    figures = [
        Figure("right wall", force_at("wall-right", 0, -1.0), across),
        Figure("left wall", force_at("wall-left", 0), across),
        Figure("floor", force_at("floor-right", 1), 0.5 * drive),
    ]
    return Scene("expansion_anchor", "anchor", given, figures)


@scene
def dowel() -> Scene:
    """A round dowel in two grooves whose curves are points of its circle, sheared."""
    radius, gap, force = 8.0, 0.5, 100.0
    first = float(np.arcsin(gap / radius))
    edge = float(np.sqrt(radius**2 - gap**2))

    def beam(name: str, side: float) -> Table:
        angles = np.linspace(first, np.pi - first, 31)
        groove = [[side * radius * float(np.cos(a)), -side * radius * float(np.sin(a))] for a in angles]
        groove[0], groove[-1] = [side * edge, -side * gap], [-side * edge, -side * gap]
        sides = [
            {"name": "back", "to": [side * 60.0, -side * 40.0]},
            {"name": "one-end", "to": [side * 60.0, -side * gap]},
            {"name": "one-face", "to": groove[0]},
            {"name": "groove", "points": groove},
            {"name": "other-face", "to": [-side * 60.0, -side * gap]},
            {"name": "other-end", "to": [-side * 60.0, -side * 40.0]},
        ]
        return body(name, "wood", "outline", sides=sides)

    given = case(
        "strain",
        {"wood": solid(10e3, 0.35)},
        [
            beam("lower", 1.0),
            beam("upper", -1.0),
            body("dowel", "wood", "disk", center=[0.0, 0.0], radius=radius),
        ],
        support=[held("lower.back")],
        contact=[pair("below", "dowel.arc", "lower.groove"), pair("above", "dowel.arc", "upper.groove")],
        load=[platen("shear", "upper.back", fx=force, uy=0.0)],
    )
    figures = [
        Figure("below", force_at("below", 0, -1.0), force),
        Figure("above", force_at("above", 0), force),
        Figure(
            "balance",
            lambda r: float(r.force("below")[1] + r.force("above")[1]),
            0.0,
            scale=force,
        ),
    ]
    return Scene("dowel", "dowel", given, figures)


@scene
def lever_rollers() -> Scene:
    """A bar on two rollers of different size, on two levels, loaded beside its middle."""
    force, at, first, second = 300.0, 40.0, 20.0, 85.0
    base = [(0, 0), (60, 0), (60, 8), (120, 8), (120, -20), (0, -20)]
    given = case(
        "strain",
        {"steel": STEEL},
        [
            box("bar", "steel", (0.0, 100.0), (20.0, 35.0)),
            body("large", "steel", "disk", center=[first, 10.0], radius=10.0),
            body("small", "steel", "disk", center=[second, 14.0], radius=6.0),
            polygon("base", "steel", base, names=["floor", "riser", "step", "right", "bottom", "left"]),
        ],
        support=[held("base.bottom"), pinned("bar", (0.0, 35.0), "ux")],
        contact=[
            pair("on-large", "large.arc", "bar.bottom"),
            pair("on-small", "small.arc", "bar.bottom"),
            pair("under-large", "large.arc", "base.floor"),
            pair("under-small", "small.arc", "base.step"),
        ],
        load=[pressed("press", "bar.top", 0.25 * force) | {"from": [at - 2, 35.0], "to": [at + 2, 35.0]}],
    )
    on_small = force * (at - first) / (second - first)
    figures = [
        Figure("on large", force_at("on-large", 1, -1.0), force - on_small),
        Figure("on small", force_at("on-small", 1, -1.0), on_small),
        Figure("under large", force_at("under-large", 1), force - on_small),
        Figure("under small", force_at("under-small", 1), on_small),
    ]
    return Scene("lever_rollers", "rollers", given, figures)


@scene
def bar_clamp() -> Scene:
    """An arm around a column, which friction on both sides of it keeps from sliding down."""
    high, away, force, radius = 40.0, 55.0, 50.0, 2.0
    friction = 1.25 * high / (2.0 * away + 10.0)
    deep = radius / float(np.sin(np.arctan(5.0 / 8.0))) - radius
    points: list[tuple[float, float]] = [
        (60, -6),
        (60, 6),
        (14, 6),
        (14, 70),
        (-26, 70),
        (-26, high - 9),
        (-18, high - 9),
    ]
    points += [(-18, high - 5), (deep - 10, high), (-18, high + 5), (-18, 58), (6, 58), (6, 6)]
    points += [(8, 5), (-deep, 0), (8, -5)]
    arcs = {2: 4.0, 8: radius, 10: 3.0, 11: 3.0, 14: radius}
    arm = polygon(
        "arm",
        "steel",
        points,
        names=[{1: "seat"}.get(i, f"side{i}") for i in range(16)],
        rounding=[arcs.get(i, 0.0) for i in range(16)],
        corners=[{8: "far", 14: "near"}.get(i, "") for i in range(16)],
    )
    column = [[0.0, -100.0], [0.0, 54.0], [-10.0, 54.0], [-10.0, -100.0]]

    def nose(name: str) -> Table:
        obstacle = {"kind": "polyline", "points": column}
        return {"name": name, "slave": f"arm.{name}", "obstacle": obstacle, "friction": friction}

    given = case(
        "stress",
        {"steel": STEEL},
        [arm],
        contact=[nose("near"), nose("far")],
        load=[pressed("press", "arm.seat", force / 6.0) | {"from": [away - 3, 6.0], "to": [away + 3, 6.0]}],
    )

    def both(result: Result) -> np.ndarray:
        return np.asarray(result.force("near") + result.force("far"))

    figures = [
        Figure("up", lambda r: float(both(r)[1]), force),
        Figure("couple", lambda r: float(both(r)[0]), 0.0, scale=force),
        # Moments about the near nose, of what rubs on the far one too.
        Figure(
            "moment",
            lambda r: float(-high * r.force("far")[0] - 10.0 * r.force("far")[1]),
            force * away,
        ),
    ]
    return Scene("bar_clamp", "clamp", given, figures)


@scene
def tilted_punch() -> Scene:
    """A rigid flat punch at an angle to a large block: pressures like sqrt((b - s) / s) over a width b."""
    modulus, tilt, width = 1000.0 / 0.91, 0.004, 1.5
    punch = [[-10.0, 8.0], [-10.0, 10.0 * tilt], [0.0, 0.0], [0.0, 8.0]]
    given = case(
        "strain",
        {"block": solid(1000.0, 0.3)},
        [box("block", "block", (-60.0, 60.0), (-60.0, 0.0))],
        support=[held("block.bottom")],
        contact=[
            {"name": "punch", "slave": "block.top", "obstacle": {"kind": "polyline", "points": punch}},
        ],
        load=[pushed("press", "punch", ux=0.0, fy=-0.25 * np.pi * modulus * tilt * width)],
    )
    figures = [Figure("width", lambda r: 2.0 * r.half_width("punch"), width, PLACE)]
    return Scene("tilted_punch", "punch", given, figures)
