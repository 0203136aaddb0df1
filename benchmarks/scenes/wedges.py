"""Flanges, wedges, coatings and inclusions: a tee pulled off a plane, a rigid wedge, a plug let go, a ladder
that bends, a coating of the base's own material, a disk that grips in its hole."""

from __future__ import annotations

import h5py
import numpy as np

from benchmarks.scenes.bending import STEEL
from benchmarks.scenes.machines import half_disk
from benchmarks.scenes.scene import (
    Array,
    Figure,
    Pair,
    Result,
    Scene,
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
    size_of,
    solid,
)

MODULUS = 210e3 / (1.0 - 0.3**2)


@scene
def flange_pulled() -> Scene:
    """A tee bolted to a plane and pulled: its flange touches at both of its ends only, which pry."""
    half = [(60.0, 0.0), (60.0, 12.0), (40.0, 12.0), (32.0, 12.0), (6.0, 12.0), (6.0, 60.0)]
    points = half + [(-x, y) for x, y in reversed(half)]
    names = ["end", "rim", "bolt", "inner", "web", "top", "web2", "inner2", "bolt2", "rim2", "end2", "foot"]
    rounding = [5.0 if abs(x) == 6.0 and y == 12.0 else 0.0 for x, y in points]
    given = case(
        "stress",
        {"steel": STEEL},
        [polygon("tee", "steel", points, names=names, rounding=rounding)],
        support=[pinned("tee", (0.0, 60.0), "ux")],
        contact=[on_plane("base", "tee.foot", (0.0, 0.0), (0.0, 1.0))],
        load=[
            pressed("pull", "tee.top", -25.0),
            pressed("one", "tee.bolt", 27.0),
            pressed("two", "tee.bolt2", 27.0),
        ],
        probe=[probe("middle", "tee", 0.0, 0.0)],
    )
    return Scene("flange_pulled", "flange", given, elements=True)


@scene
def wedge_indenter() -> Scene:
    """A rigid wedge of 5 degrees: pressures are an inverse hyperbolic cosine (Johnson 1985, section 5.2)."""
    slope, load = float(np.tan(np.radians(5.0))), 2000.0
    half = load / (MODULUS * slope)
    points = [[-15.0, 15.0 * slope], [0.0, 0.0], [15.0, 15.0 * slope]]
    given = case(
        "strain",
        {"steel": STEEL},
        [box("block", "steel", (-30.0, 30.0), (-40.0, 0.0))],
        support=[held("block.bottom")],
        contact=[{"name": "tip", "slave": "block.top", "obstacle": {"kind": "polyline", "points": points}}],
        load=[pushed("press", "tip", fy=-load)],
    )

    def profile(result: Result) -> tuple[Array, Array]:
        with h5py.File(result.folder / "run.h5") as file:
            one = file["contacts/tip"]
            x, p = one["points"][:] @ along(result), one["pressure"][-1]
        return x[np.argsort(x)], p[np.argsort(x)]

    def along(result: Result) -> Array:
        force = result.force("tip")
        return np.asarray(np.array([-force[1], force[0]]) / np.hypot(*force))

    def quarter(result: Result) -> float:
        x, p = profile(result)
        middle = 0.5 * (x[p > 0.0].min() + x[p > 0.0].max())
        return float(np.interp(middle + 0.25 * np.ptp(x[p > 0.0]), x, p))

    figures = [
        Figure("aside", force_at("tip", 0), 0.0, 1.0, load),
        Figure("half-width", lambda r: 0.5 * float(np.ptp(profile(r)[0][profile(r)[1] > 0.0])), half, 3.0),
        Figure("half way out", quarter, MODULUS * slope / np.pi * float(np.arccosh(2.0)), 3.0),
    ]
    return Scene("wedge_indenter", "wedge", given, figures)


@scene
def plug_let_go() -> Scene:
    """A plug of half angle 20 degrees and friction 0.2 that springs out as it is let go: its slip turns."""
    sine, cosine, last = float(np.sin(np.radians(20.0))), float(np.cos(np.radians(20.0))), 0.01
    slope = sine / cosine

    def high(x: float) -> float:
        return 8.0 - slope * x

    plug = [(-15.0, -high(-15.0)), (12.0, -high(12.0)), (12.0, high(12.0)), (-15.0, high(-15.0))]
    upper: list[Pair] = [(-10.0, high(-10.0)), (9.0, high(9.0)), (9.0, 30.0), (-10.0, 30.0)]
    names = ["face", "right", "back", "left"]
    given = case(
        "strain",
        {"steel": STEEL},
        [
            polygon("plug", "steel", plug, names=["low", "tip", "high", "back"]),
            polygon("upper", "steel", upper, names=names),
            polygon("lower", "steel", [(x, -y) for x, y in upper], names=names),
        ],
        support=[held("upper.back"), held("lower.back")],
        contact=[pair("above", "upper.face", "plug.high", 0.2), pair("below", "lower.face", "plug.low", 0.2)],
        load=[platen("drive", "plug.back", fx=300.0, uy=0.0)],
        stage=[{"drive": 1.0}, {"drive": last}],
    )
    across = 0.5 * last * 300.0 * (cosine + 0.2 * sine) / (sine - 0.2 * cosine)
    figures = [
        Figure("along", size_of("above"), 0.5 * last * 300.0),
        Figure("across", force_at("above", 1), across),
    ]
    return Scene("plug_let_go", "wedge", given, figures)


@scene
def coating_hertz() -> Scene:
    """A bonded coating of the base's own material, thinner than the contact is wide: Hertz' peak."""
    given = case(
        "strain",
        {"steel": STEEL},
        [
            half_disk("nose", "steel", 10.0),
            box("coat", "steel", (-8.0, 8.0), (-0.3, 0.0)),
            box("base", "steel", (-8.0, 8.0), (-8.0, -0.3)),
        ],
        support=[held("base.bottom")],
        contact=[
            pair("bond", "coat.bottom", "base.top", friction="bonded"),
            pair("tip", "nose.arc", "coat.top"),
        ],
        load=[platen("press", "nose.flat", ux=0.0, fy=-300.0)],
    )
    peak = float(np.sqrt(300.0 * 0.5 * MODULUS / (10.0 * np.pi)))
    return Scene("coating_hertz", "layer", given, [Figure("peak", lambda r: r.peak("tip"), peak, 3.0)])


@scene
def disk_grips() -> Scene:
    """A disk of the plate's own material in its hole, pressed by 60 and 100: friction of 0.5 holds all of it,
    and stresses are uniform."""
    sides = ["bottom", "right", "top", "left"]
    hole = {"center": [0.0, 0.0], "radius": 4.0, "name": "hole"}
    square: list[Pair] = [(-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0)]
    given = case(
        "strain",
        {"steel": solid(210e3, 0.3)},
        [
            body("fibre", "steel", "disk", center=[0.0, 0.0], radius=4.0),
            polygon("plate", "steel", square, names=sides, holes=[hole]),
        ],
        support=[held("plate.bottom", "uy"), held("plate.left", "ux")],
        contact=[pair("rim", "fibre.arc", "plate.hole", 0.5)],
        load=[pressed("across", "plate.right", 60.0), pressed("down", "plate.top", 100.0)],
    )
    figures = [
        Figure("peak", lambda r: r.peak("rim"), 100.0, 3.0),
        Figure("mean", lambda r: r.pressed("rim") / (8.0 * np.pi), 80.0),
    ]
    return Scene("disk_grips", "inclusion", given, figures)


@scene
def ladder_bends() -> Scene:
    """A slender ladder between floor and wall, whose rounded ends roll as it bends, with friction at both."""
    long, thick, radius = 100.0, 3.0, 1.4
    way = np.array([0.5, 0.5 * np.sqrt(3.0)])
    across = 0.5 * thick * np.array([-way[1], way[0]])
    corners = [-across, long * way - across, long * way + across, across]
    # Centres of the roundings of the corners that touch.
    inset = radius * np.array([way, across / (0.5 * thick)])
    floor = (corners[0] + inset[0] + inset[1])[1] - radius
    wall = (corners[1] - inset[0] + inset[1])[0] + radius
    rungs = [(share * long * way + across).tolist() for share in (0.6, 0.64)]
    given = case(
        "stress",
        {"wood": solid(10e3, 0.3)},
        [
            polygon(
                "ladder",
                "wood",
                [(float(x), float(y)) for x, y in corners],
                names=["under", "end", "over", "foot"],
                rounding=[radius] * 4,
            )
        ],
        contact=[
            on_plane(
                "floor",
                ["ladder.foot", "ladder.corner1", "ladder.corner4"],
                (0.0, float(floor)),
                (0.0, 1.0),
                0.5,
            ),
            on_plane(
                "wall",
                ["ladder.end", "ladder.corner2", "ladder.corner3"],
                (float(wall), 0.0),
                (-1.0, 0.0),
                0.3,
            ),
        ],
        load=[
            {"name": "man", "boundary": "ladder.over", "kind": "traction", "traction": [0.0, -0.5]}
            | {"from": rungs[0], "to": rungs[1]}
        ],
    )

    def both(axis: int, sign: float) -> Figure:
        def got(result: Result) -> float:
            return sign * float(result.force("floor")[axis] + result.force("wall")[axis])

        return Figure("along the load" if axis else "across", got, 2.0 if axis else 0.0, 1.0, 2.0)

    return Scene("ladder_bends", "ladder", given, [both(1, 1.0), both(0, 1.0)])
