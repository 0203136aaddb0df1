"""Assemblies: leaf springs, a tyre, a heated fit, a closed crack, a lever, pins that share a load."""

from __future__ import annotations

import numpy as np

from benchmarks.scenes.bending import ALLOY, STEEL
from benchmarks.scenes.scene import (
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
    scene,
    solid,
    weighed,
)
from benchmarks.scenes.scene import body as make_body


@scene
def leaf_springs() -> Scene:
    """Three leaves of unlike length, clamped at the left, loaded at the tip of the longest: as beams that
    touch at the tips of the shorter ones."""
    lengths, load = (60.0, 45.0, 30.0), 20.0
    bodies = [
        box(f"leaf{i}", "steel", (0.0, long), (-2.0 * i - 2.0, -2.0 * i)) for i, long in enumerate(lengths)
    ]
    given = case(
        "strain",
        {"steel": STEEL},
        bodies,
        support=[held(f"leaf{i}.left") for i in range(3)],
        contact=[pair("one", "leaf1.top", "leaf0.bottom"), pair("two", "leaf2.top", "leaf1.bottom")],
        load=[{"name": "tip", "boundary": "leaf0.right", "kind": "traction", "traction": [0.0, -load / 2.0]}],
        probe=[probe("tip", "leaf0", lengths[0], -1.0)],
    )
    stiffness = STEEL["E"] / (1.0 - STEEL["nu"] ** 2) * 2.0**3 / 12.0

    def bent(force_at: float, seen_at: float) -> float:
        near, far = sorted((force_at, seen_at))
        return float(near**2 * (3.0 * far - near) / (6.0 * stiffness))

    long, middle, short = lengths
    tips = np.array(
        [[2.0 * bent(middle, middle), -bent(short, middle)], [-bent(middle, short), 2.0 * bent(short, short)]]
    )
    one, two = np.linalg.solve(tips, [load * bent(long, middle), 0.0])
    figures = [
        Figure("one (beams)", lambda r: abs(float(r.force("one")[1])), float(one)),
        Figure("two (beams)", lambda r: abs(float(r.force("two")[1])), float(two)),
        Figure(
            "tip (beams)",
            lambda r: float(r.moved("tip")[1]),
            one * bent(middle, long) - load * bent(long, long),
        ),
    ]
    return Scene("leaf_springs", "leaf springs", given, figures)


@scene
def tyre() -> Scene:
    """A tyre bonded on a wheel of its own material, held by nothing but bond and rail: Hertz."""
    weight = float(np.pi * 16.0**2)
    given = case(
        "strain",
        {"steel": STEEL},
        [
            make_body("wheel", "steel", "disk", center=[0.0, 20.0], radius=16.0),
            make_body("tyre", "steel", "annulus", center=[0.0, 20.0], radii=[16.0, 20.0]),
            box("rail", "steel", (-60.0, 60.0), (-60.0, 0.0)),
        ],
        support=[held("rail.bottom")],
        contact=[
            {"name": "bond", "slave": "tyre.inner", "master": "wheel.arc", "friction": "bonded"},
            pair("tread", "tyre.outer", "rail.top"),
        ],
        load=[weighed("weight", "wheel", 0.0, -1.0)],
    )
    modulus = STEEL["E"] / (1.0 - STEEL["nu"] ** 2) / 2.0
    figures = [
        Figure("tread", lambda r: float(r.force("tread")[1]), weight),
        Figure("peak", lambda r: r.peak("tread"), float(np.sqrt(weight * modulus / (np.pi * 20.0)))),
    ]
    return Scene("tyre", "wheel on a rail", given, figures)


@scene
def heated_fit() -> Scene:
    """A hub shrunk on a shaft, then heated until half of the interference is gone: Lame."""
    inner, outer, fit, expansion = 10.0, 18.0, 0.02, 1.2e-5
    given = case(
        "stress",
        {"hot": STEEL | {"alpha": expansion}, "cold": STEEL},
        [
            make_body("hub", "hot", "annulus", center=[0.0, 0.0], radii=[inner, outer]),
            make_body("shaft", "cold", "disk", center=[0.0, 0.0], radius=inner),
        ],
        contact=[pair("fit", "shaft.arc", "hub.inner", interference=fit)],
        load=[
            {
                "name": "warm",
                "body": "hub",
                "kind": "temperature",
                "temperature": fit / 2.0 / (expansion * inner),
            }
        ],
        stage=[{"fit": 1.0}, {"warm": 1.0}],
    )
    ring = (outer**2 + inner**2) / (outer**2 - inner**2)
    pressure = fit / 2.0 / inner * STEEL["E"] / (ring + 1.0)

    def mean(result: Result) -> float:
        return result.pressed("fit") / (2.0 * np.pi * inner)

    return Scene("heated_fit", "shrink fit", given, [Figure("mean pressure", mean, float(pressure))])


@scene
def closed_crack() -> Scene:
    """Two blocks glued along a part of their faces and touching along the rest, pressed: as one block."""
    given = case(
        "strain",
        {"soft": solid(1000.0, 0.3)},
        [box("low", "soft", (0.0, 10.0), (0.0, 5.0)), box("high", "soft", (0.0, 10.0), (5.0, 10.0))],
        support=[held("low.bottom", "uy"), pinned("low", (0.0, 0.0), "ux")],
        contact=[
            {
                "name": "glue",
                "slave": "high.bottom",
                "master": "low.top",
                "friction": "bonded",
                "from": [4.0, 5.0],
                "to": [10.0, 5.0],
            },
            pair("crack", "high.bottom", "low.top") | {"from": [0.0, 5.0], "to": [4.0, 5.0]},
        ],
        load=[pressed("press", "high.top", 10.0)],
        probe=[probe("top", "high", 5.0, 10.0)],
    )
    figures = [
        Figure("crack carries", lambda r: float(r.force("crack")[1]), 40.0),
        Figure("peak", lambda r: r.peak("crack"), 10.0, 3.0),
        Figure("top", lambda r: float(r.moved("top")[1]), -10.0 * 10.0 * (1.0 - 0.3**2) / 1000.0),
    ]
    return Scene("closed_crack", "crack", given, figures)


@scene
def fulcrum() -> Scene:
    """A lever on a round fulcrum, pulled down at one end, held down by a stop at the other."""
    given = case(
        "strain",
        {"steel": STEEL, "alloy": ALLOY},
        [
            box("beam", "steel", (-30.0, 60.0), (0.0, 6.0)),
            make_body("fulcrum", "steel", "half-disk", center=[0.0, -8.0], radius=8.0, side="upper"),
            box("stop", "alloy", (-30.0, -20.0), (6.0, 16.0)),
        ],
        support=[held("fulcrum.flat"), held("stop.top")],
        contact=[
            pair("pivot", "fulcrum.arc", "beam.bottom"),
            pair("hold", "beam.top", "stop.bottom"),
        ],
        load=[{"name": "tip", "boundary": "beam.right", "kind": "traction", "traction": [0.0, -5.0]}],
        probe=[probe("end", "beam", 60.0, 3.0)],
    )

    def balance(result: Result) -> float:
        return float(abs(result.force("pivot")[1]) - abs(result.force("hold")[1]))

    return Scene("fulcrum", "lever on a fulcrum", given, [Figure("balance", balance, 30.0)])


@scene
def two_pins() -> Scene:
    """A plate with two holes on rigid pins of unlike clearance, pulled: the tighter one carries more."""
    holes = [
        {"name": "tight", "center": [-20.0, 0.0], "radius": 5.0},
        {"name": "loose", "center": [5.0, 0.0], "radius": 5.0},
    ]
    plate = polygon(
        "plate",
        "steel",
        [(-40.0, -10.0), (40.0, -10.0), (40.0, 10.0), (-40.0, 10.0)],
        names=["low", "right", "up", "left"],
        holes=holes,
    )
    given = case(
        "stress",
        {"steel": STEEL},
        [plate],
        contact=[
            on_disk("first", "plate.tight", (-20.01, 0.0), 4.99),
            on_disk("second", "plate.loose", (4.96, 0.0), 4.95),
        ],
        load=[{"name": "pull", "boundary": "plate.right", "kind": "traction", "traction": [200.0, 0.0]}],
        probe=[probe("end", "plate", 40.0, 0.0)],
    )

    def both(result: Result) -> float:
        return float(result.force("first")[0] + result.force("second")[0])

    return Scene("two_pins", "plate on two pins", given, [Figure("both", both, -4000.0)], elements=True)
