"""Things that turn, lean or slide: a brake, ladders, logs, a slider on a spring, a belt on a drum."""

from __future__ import annotations

import numpy as np

from benchmarks.scenes.bending import STEEL
from benchmarks.scenes.scene import (
    Figure,
    Refusal,
    Scene,
    Table,
    box,
    case,
    force_at,
    held,
    on_disk,
    on_plane,
    pair,
    platen,
    polygon,
    pressed,
    probe,
    pushed,
    scene,
    size_of,
    solid,
    weighed,
)
from benchmarks.scenes.scene import body as make_body


@scene
def brake_shoe() -> Scene:
    """A lever with a round nose, hinged at its end, on a drum that runs towards the hinge."""
    friction, force = 0.4, 60.0
    corners = [(0, 10), (42, 10), (50, -3), (58, 10), (120, 10), (120, 22), (0, 22)]
    radius = 3.0 / (1.0 / float(np.sin(np.arctan(8.0 / 13.0))) - 1.0)
    lever = polygon(
        "lever",
        "steel",
        corners,
        names=["low", "down", "up", "beyond", "right", "top", "left"],
        rounding=[0.0, 2.0, radius, 2.0, 0.0, 0.0, 0.0],
        corners=["", "", "nose", "", "", "", ""],
    )
    given = case(
        "stress",
        {"steel": STEEL},
        [lever],
        contact=[on_plane("drum", "lever.nose", (50.0, 0.0), (0.0, 1.0), friction)],
        load=[
            platen("hinge", "lever.left", ux=0.0, uy=0.0, hinge=[0.0, 16.0]),
            pressed("press", "lever.top", force / 10.0) | {"from": [100.0, 22.0], "to": [110.0, 22.0]},
            pushed("turn", "drum", ux=-0.1, uy=0.0),
        ],
        stage=[{"press": 1.0, "hinge": 1.0}, {"turn": 1.0}],
    )
    across = 105.0 * force / (50.0 - 16.0 * friction)
    figures = [
        Figure("across", force_at("drum", 1), across),
        Figure("along", size_of("drum"), friction * across),
    ]
    return Scene("brake_shoe", "brake", given, figures)


def ladder_case(climb: float) -> tuple[Table, float, float]:
    """A ladder with round ends at 60 degrees on a rough floor and a smooth wall; the force on the wall, and
    how much may ``climb`` on it before it slips."""
    friction, weight, angle, radius, length = 0.4, 10.0, np.radians(60.0), 3.0, 94.0
    along = np.array([-np.cos(angle), np.sin(angle)])
    foot = np.array([radius - length * along[0], radius])
    head = foot + length * along
    across = radius * np.array([along[1], -along[0]])
    ends = radius * along
    points = [foot - ends + across, head + ends + across, head + ends - across, foot - ends - across]
    ladder = polygon(
        "ladder",
        "wood",
        [(float(x), float(y)) for x, y in points],
        names=["upper", "top", "lower", "bottom"],
        rounding=[radius] * 4,
        corners=["foot", "head", "head", "foot"],
    )
    loads = [weighed("weight", "ladder", 0.0, -weight / (2.0 * radius * length + np.pi * radius**2))]
    high, arm = float(head[1]), 0.5 * float(foot[0] - head[0])
    at = foot + 0.85 * length * along + across
    if climb:
        ways = {"from": (at - 2.0 * along).tolist(), "to": (at + 2.0 * along).tolist()}
        traction = {"kind": "traction", "boundary": "ladder.upper", "traction": [0.0, -0.25 * climb]}
        loads.append({"name": "climb", **traction, **ways})
    given = case(
        "strain",
        {"wood": solid(10e3, 0.3)},
        [ladder],
        contact=[
            on_plane("floor", "ladder.foot", (0.0, 0.0), (0.0, 1.0), friction),
            on_plane("wall", "ladder.head", (0.0, 0.0), (1.0, 0.0)),
        ],
        load=loads,
        stage=[{"weight": 1.0}, {"climb": 1.0}] if climb else [],
    )
    most = weight * (friction * high - arm) / (float(foot[0] - at[0]) - friction * high)
    return given, weight * arm / high, most


@scene
def ladder() -> Scene:
    """A ladder of its own weight."""
    given, wall, _ = ladder_case(0.0)
    figures = [
        Figure("wall", force_at("wall", 0), wall),
        Figure("floor along", force_at("floor", 0, -1.0), wall),
        Figure("floor", force_at("floor", 1), 10.0),
    ]
    return Scene("ladder", "ladder", given, figures)


@scene
def ladder_slips() -> Scene:
    """Somebody climbs it."""
    given, _, most = ladder_case(30.0)
    return Scene("ladder_slips", "ladder", given, refusal=Refusal(("slide", "slip"), 1.0 + most / 30.0))


@scene
def log_pile() -> Scene:
    """Three logs, which friction alone keeps together."""
    radius, apart, friction, weight = 10.0, 10.5, 0.4, 30.0
    lean = float(np.arcsin(apart / (2.0 * radius)))
    places = {
        "left": (-apart, radius),
        "right": (apart, radius),
        "top": (0.0, radius * (1.0 + 2.0 * np.cos(lean))),
    }
    given = case(
        "strain",
        {"wood": solid(10e3, 0.3)},
        [
            make_body(n, "wood", "disk", center=[float(x), float(y)], radius=radius)
            for n, (x, y) in places.items()
        ],
        contact=[
            on_plane("under-left", "left.arc", (0.0, 0.0), (0.0, 1.0), friction),
            on_plane("under-right", "right.arc", (0.0, 0.0), (0.0, 1.0), friction),
            pair("on-left", "top.arc", "left.arc", friction),
            pair("on-right", "top.arc", "right.arc", friction),
        ],
        load=[weighed(n, n, 0.0, -weight / (np.pi * radius**2)) for n in places],
        stage=[dict.fromkeys(places, 1.0)],
    )
    # The lower logs' balance: what rubs above rubs below.
    slope = float(np.sin(lean) / (1.0 + np.cos(lean)))
    along = 0.5 * weight * slope / float(np.cos(lean) + slope * np.sin(lean))
    figures = [
        Figure("under left", force_at("under-left", 1), 1.5 * weight),
        Figure("along left", size_of("under-left"), along),
        Figure("along right", size_of("under-right"), along),
        Figure("on left", force_at("on-left", 1), 0.5 * weight),
    ]
    return Scene("log_pile", "logs", given, figures)


@scene
def spring_slider() -> Scene:
    """Jenkins' element: a block on a spring is pushed, slides, and slides half of the way back."""
    given = case(
        "strain",
        {"steel": STEEL},
        [box("block", "steel", (0.0, 20.0), (0.0, 10.0)), box("base", "steel", (-20.0, 40.0), (-20.0, 0.0))],
        support=[held("base.bottom"), {"boundary": "block.left", "spring": [300.0, 0.0]}],
        contact=[pair("slide", "block.bottom", "base.top", 0.3)],
        load=[pressed("press", "block.top", 5.0), pressed("push", "block.left", 9.0)],
        stage=[{"press": 1.0}, {"push": 1.0}, {"push": 0.0}],
        probe=[probe("middle", "block", 10.0, 5.0)],
    )
    figures = [
        Figure("friction", force_at("slide", 0), 30.0),
        Figure("moved", lambda r: float(r.moved("middle")[0]), 0.01, 3.0),
    ]
    return Scene("spring_slider", "slider", given, figures)


@scene
def belt_drum() -> Scene:
    """A belt on half of a drum slips by Eytelwein's formula, its tension acting at half of its thickness."""
    radius, thick, friction, pull, more = 50.0, 1.0, 0.3, 2.0, 5.0

    def pulled(name: str, end: str, traction: float) -> Table:
        return {"name": name, "kind": "traction", "boundary": f"belt.{end}", "traction": [0.0, -traction]}

    given = case(
        "stress",
        {"belt": solid(1e4, 0.3)},
        [
            make_body(
                "belt",
                "belt",
                "sector",
                center=[0.0, 0.0],
                radii=[radius, radius + thick],
                angles=[0.0, 180.0],
            )
        ],
        contact=[on_disk("wrap", "belt.inner", (0.0, 0.0), radius, friction)],
        load=[pulled("tight", "start", pull), pulled("slack", "end", pull), pulled("more", "start", more)],
        stage=[{"tight": 1.0, "slack": 1.0}, {"more": 1.0}],
    )
    limit = float(np.exp(friction * np.pi * radius / (radius + 0.5 * thick)))
    return Scene(
        "belt_drum", "belt", given, refusal=Refusal(("slide", "slip"), 1.0 + pull * (limit - 1.0) / more)
    )
