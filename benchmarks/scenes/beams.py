"""Scenes of beams and plates: cantilevers, hooks, beams on posts and pins."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.scenes.bending import ALLOY, NYLON, STEEL
from benchmarks.scenes.scene import (
    PEAK,
    Figure,
    Result,
    Scene,
    box,
    case,
    held,
    on_disk,
    pair,
    pinned,
    polygon,
    pressed,
    probe,
    pushed,
    scene,
    solid,
    weighed,
)
from benchmarks.scenes.scene import body as make_body


@scene
def late_cantilever() -> Scene:
    """The tip comes to rest on a round elastic stop at about half of the load."""
    given = case(
        "stress",
        {"nylon": NYLON, "steel": STEEL},
        [
            box("beam", "nylon", (0.0, 40.0), (0.0, 3.0)),
            make_body("stop", "steel", "half-disk", center=[37.0, -8.5], radius=6.0, side="upper"),
        ],
        support=[held("beam.left"), held("stop.flat")],
        contact=[pair("rest", "beam.bottom", "stop.arc")],
        load=[pressed("push", "beam.top", 0.1)],
        probe=[probe("tip", "beam", 40.0, 1.5)],
    )
    modulus = 1.0 / (1.0 / NYLON["E"] + 1.0 / STEEL["E"])

    def over_hertz(result: Result) -> float:
        """Elements that look for the closest places as drawn, far apart, would see the stop less curved."""
        force = float(np.hypot(*result.force("rest")))
        return result.peak("rest") / float(np.sqrt(force * modulus / (np.pi * 6.0)))

    return Scene(
        "late_cantilever",
        "late contact of a cantilever",
        given,
        [
            Figure("peak over Hertz'", over_hertz, 1.0, PEAK),
            Figure("up (elements)", lambda r: r.force("rest")[1], 0.7667),
            Figure("tip down (elements)", lambda r: r.moved("tip")[1], -2.7175),
        ],
    )


@scene
def late_cantilever_rigid() -> Scene:
    """The same over a rigid disk."""
    given = case(
        "stress",
        {"nylon": NYLON},
        [box("beam", "nylon", (0.0, 40.0), (0.0, 3.0))],
        support=[held("beam.left")],
        contact=[on_disk("rest", "beam.bottom", (37.0, -8.5), 6.0)],
        load=[pressed("push", "beam.top", 0.1)],
        probe=[probe("tip", "beam", 40.0, 1.5)],
    )
    return Scene("late_cantilever_rigid", "late contact of a cantilever", given, elements=True)


HOOK = [(0.0, 0.0), (20.0, 0.0), (22.0, -1.5), (25.0, -1.5), (26.5, 0.0), (26.5, 1.6), (0.0, 1.6)]


def hook_case(friction: float) -> dict[str, Any]:
    names = ["under", "ramp", "nose", "back", "tip", "top", "root"]
    rounding = [0.0, 0.5, 0.4, 0.4, 0.0, 0.0, 0.0]
    return case(
        "stress",
        {"nylon": NYLON},
        [polygon("hook", "nylon", HOOK, names=names, rounding=rounding)],
        support=[held("hook.root")],
        contact=[on_disk("cam", "hook.nose", (23.5, -5.5), 4.0, friction)],
        load=[pushed("lift", "cam", uy=1.0)],
        probe=[probe("tip", "hook", 26.5, 1.6)],
    )


@scene
def snap_hook() -> Scene:
    """A thin hook lifted by a cam below its nose, frictionless."""
    return Scene("snap_hook", "snap hook on a cam", hook_case(0.0), elements=True)


@scene
def snap_hook_friction() -> Scene:
    """A thin hook lifted by a cam with friction, that then moves on."""
    given = hook_case(0.2)
    given["load"][0] = pushed("lift", "cam", uy=1.0, ux=0.0)
    given["load"].append(pushed("slide", "cam", uy=0.0, ux=0.3))
    given["stage"] = [{"lift": 1.0}, {"slide": 1.0}]
    return Scene("snap_hook_friction", "snap hook on a cam", given)


@scene
def beam_two_posts() -> Scene:
    """A beam that lies on two posts of another material, pressed from above."""
    given = case(
        "stress",
        {"steel": STEEL, "alloy": ALLOY},
        [
            box("beam", "steel", (0.0, 80.0), (20.0, 26.0)),
            box("post1", "alloy", (5.0, 15.0), (0.0, 20.0)),
            box("post2", "alloy", (60.0, 70.0), (0.0, 20.0)),
        ],
        support=[held("post1.bottom"), held("post2.bottom")],
        contact=[pair("left", "post1.top", "beam.bottom"), pair("right", "post2.top", "beam.bottom")],
        load=[pressed("push", "beam.top", 1.0)],
        probe=[probe("mid", "beam", 37.5, 20.0), probe("end", "beam", 80.0, 20.0)],
    )
    return Scene(
        "beam_two_posts",
        "beam on two posts",
        given,
        [Figure("both", lambda r: abs(r.force("left")[1] + r.force("right")[1]), 80.0)],
        elements=True,
    )


@scene
def plate_rigid_pins() -> Scene:
    """A plate under pressure on two rigid pins."""
    given = case(
        "strain",
        {"cast": solid(110e3, 0.25)},
        [box("plate", "cast", (-20.0, 20.0), (0.0, 8.0))],
        contact=[
            on_disk("left", "plate.bottom", (-14.0, -5.0), 5.0),
            on_disk("right", "plate.bottom", (16.0, -5.0), 5.0),
        ],
        load=[pressed("push", "plate.top", 50.0)],
        probe=[probe("mid", "plate", 0.0, 0.0)],
    )
    return Scene(
        "plate_rigid_pins",
        "plate on two pins",
        given,
        [
            Figure("left", lambda r: r.force("left")[1], 2000.0 * 16.0 / 30.0),
            Figure("right", lambda r: r.force("right")[1], 2000.0 * 14.0 / 30.0),
        ],
        elements=True,
        supports=[pinned("plate", (0.0, 4.0), "ux")],
    )


@scene
def plate_weight_pins() -> Scene:
    """A plate of its own weight on two elastic pins."""
    given = case(
        "strain",
        {"cast": solid(110e3, 0.25), "steel": STEEL},
        [
            box("plate", "cast", (-20.0, 20.0), (0.0, 8.0)),
            make_body("pin1", "steel", "half-disk", center=[-14.0, -5.0], radius=5.0, side="upper"),
            make_body("pin2", "steel", "half-disk", center=[16.0, -5.0], radius=5.0, side="upper"),
        ],
        support=[held("pin1.flat"), held("pin2.flat")],
        contact=[pair("left", "pin1.arc", "plate.bottom"), pair("right", "pin2.arc", "plate.bottom")],
        load=[weighed("weight", "plate", 0.0, -6.25)],
        probe=[probe("mid", "plate", 0.0, 0.0)],
    )
    return Scene(
        "plate_weight_pins",
        "plate on two pins",
        given,
        [
            Figure("left", lambda r: abs(r.force("left")[1]), 2000.0 * 16.0 / 30.0),
            Figure("right", lambda r: abs(r.force("right")[1]), 2000.0 * 14.0 / 30.0),
        ],
        elements=True,
        supports=[pinned("plate", (0.0, 4.0), "ux")],
    )
