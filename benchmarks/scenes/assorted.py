"""Scenes of machines and of the laboratory: a sheared crack, a T-bolt, a disc split between jaws, loads that
turn back, a block held by friction, a strip lifted off its bed, a disk that settles in a rough groove."""

from __future__ import annotations

import h5py
import numpy as np

from benchmarks.scenes.scene import (
    PEAK,
    PLACE,
    Figure,
    Refusal,
    Result,
    Scene,
    Table,
    box,
    case,
    force_at,
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

STEEL = solid(210e3, 0.3)


@scene
def settling_disk() -> Scene:
    """A heavy disk settles in a rough right-angled groove: it slips down both flanks, free to turn."""
    radius, friction, weight = 8.0, 0.2, 0.02
    given = case(
        "strain",
        {"plastic": solid(1.8e3, 0.4)},
        [make_body("disk", "plastic", "disk", center=[0.0, radius * float(np.sqrt(2.0))], radius=radius)],
        contact=[
            on_plane(name, "disk.arc", (0.0, 0.0), (lean, 1.0), friction)
            for name, lean in (("left", 1.0), ("right", -1.0))
        ],
        load=[weighed("weight", "disk", 0.0, -weight)],
    )
    across = 0.5 * weight * np.pi * radius**2 * (1.0 - friction) / (1.0 + friction)
    figures = [Figure(name, size_of(name), across) for name in ("left", "right")]
    return Scene("settling_disk", "disks in a groove", given, figures)


@scene
def shear_crack() -> Scene:
    """A crack between two glued blocks, pressed shut and sheared: it slips by 4 tau a / E' at its middle."""
    half, press, shear, friction, wide = 5.0, 40.0, 50.0, 0.3, 60.0
    loads: list[Table] = []
    for name, side, sign in (("up", "top", 1.0), ("low", "bottom", -1.0)):
        loads.append(
            {"name": f"press-{name}", "kind": "pressure", "boundary": f"{name}.{side}", "pressure": press}
        )
        for where, value in (
            (side, [sign * shear, 0.0]),
            ("right", [0.0, shear]),
            ("left", [0.0, -shear]),
        ):
            one = {"kind": "traction", "boundary": f"{name}.{where}", "traction": value}
            loads.append({"name": f"shear-{name}-{where}", **one})
    faces = {"slave": "up.bottom", "master": "low.top"}
    ends = ((-wide, -half), (-half, half), (half, wide))
    given = case(
        "strain",
        {"aluminium": solid(70e3, 0.33)},
        [
            box("up", "aluminium", (-wide, wide), (0.0, wide)),
            box("low", "aluminium", (-wide, wide), (-wide, 0.0)),
        ],
        support=[pinned("low", (-wide, -wide)), pinned("low", (wide, -wide), "uy")],
        contact=[
            {"name": name, **faces, "friction": law, "from": [a, 0.0], "to": [b, 0.0]}
            for name, law, (a, b) in zip(
                ("glue-left", "crack", "glue-right"), ("bonded", friction, "bonded"), ends, strict=True
            )
        ],
        load=loads,
        stage=[
            {one["name"]: 1.0 for one in loads if one["name"].startswith(start)}
            for start in ("press", "shear")
        ],
        probe=[probe("above", "up", 0.0, 0.0), probe("below", "low", 0.0, 0.0)],
    )
    slip = 4.0 * (shear - friction * press) * half * (1.0 - 0.33**2) / 70e3
    slipped = Figure("slip", lambda r: float((r.moved("above") - r.moved("below"))[0]), slip, PLACE)
    return Scene("shear_crack", "crack", given, [slipped])


@scene
def t_bolt() -> Scene:
    """The head of a T-bolt is pulled against both shoulders of its slot."""
    head = polygon(
        "bolt",
        "steel",
        [(-4, 20), (-4, 0), (-9, 0), (-9, -7), (9, -7), (9, 0), (4, 0), (4, 20)],
        names=["shank-l", "under-l", "l", "bottom", "r", "under-r", "shank-r", "end"],
        rounding=[0.0, 1.0, 0.8, 0.0, 0.0, 0.8, 1.0, 0.0],
    )
    corners = [(25, 10), (5, 10), (5, 0), (10, 0), (10, -8)]
    slot = polygon(
        "slot",
        "iron",
        [(-25, 10), (-25, -20), (25, -20), *corners, *[(-x, y) for x, y in corners[:0:-1]]],
        names=[
            "l", "base", "r", "top-r", "neck-r", "shoulder-r", "wall-r", "floor",
            "wall-l", "shoulder-l", "neck-l", "top-l",
        ],
        rounding=[0.0] * 5 + [0.8, 1.5, 1.0, 1.0, 1.5, 0.8, 0.0],
    )  # fmt: skip
    given = case(
        "strain",
        {"steel": STEEL, "iron": solid(110e3, 0.26)},
        [head, slot],
        support=[held("slot.base")],
        contact=[pair(side, f"bolt.under-{side}", f"slot.shoulder-{side}") for side in "lr"],
        load=[platen("pull", "bolt.end", fy=4000.0)],
    )
    figures = [Figure(f"shoulder {side}", force_at(side, 1, -1.0), 2000.0) for side in "lr"]
    return Scene("t_bolt", "T-bolt", given, figures)


@scene
def brazilian_disc() -> Scene:
    """A disc of rock between two jaws of 1.5 times its radius, in metres and pascals."""
    radius, jaw, force = 0.025, 0.0375, 2e5
    angles = np.radians(np.linspace(-30.0, 30.0, 31))

    def clamp(name: str, sign: float) -> Table:
        face = np.column_stack([jaw * np.sin(angles), sign * (radius - jaw + jaw * np.cos(angles))])
        high, back = float(face[0, 1]), sign * 0.045
        sides = [
            {"name": "face", "points": face.tolist()},
            {"name": "flank-a", "to": [0.025, high]},
            {"name": "side-a", "to": [0.025, back]},
            {"name": "back", "to": [-0.025, back]},
            {"name": "side-b", "to": [-0.025, high]},
            {"name": "flank-b"},
        ]
        return make_body(name, "steel", "outline", sides=sides)

    given = case(
        "stress",
        {"rock": solid(30e9, 0.25), "steel": solid(200e9, 0.3)},
        [
            make_body("disc", "rock", "disk", center=[0.0, 0.0], radius=radius),
            clamp("top", 1.0),
            clamp("low", -1.0),
        ],
        support=[held("low.back")],
        contact=[pair("above", "disc.arc", "top.face"), pair("below", "disc.arc", "low.face")],
        load=[platen("press", "top.back", fy=-force)],
        probe=[probe("middle", "disc", 0.0, 0.0)],
    )
    split = force / (np.pi * radius)
    peak = float(np.sqrt(force / (1.0 / 30e9 + 1.0 / 200e9) * (1.0 / radius - 1.0 / jaw) / np.pi))

    figures = [
        Figure("tension", lambda r: float(r.summary["probes"]["middle"]["stress"][0]), split),
        Figure("compression", lambda r: float(r.summary["probes"]["middle"]["stress"][1]), -3.0 * split),
        Figure("peak", lambda r: r.peak("above"), peak, PEAK),
    ]
    return Scene("brazilian_disc", "disc between jaws", given, figures)


@scene
def pushed_back() -> Scene:
    """A half-disk is pressed, pushed to 0.7 of its friction, and pushed back (Mindlin and Deresiewicz)."""
    radius, press, friction, part, back = 10.0, 300.0, 0.4, 0.7, 0.3
    push = part * friction * press
    given = case(
        "strain",
        {"steel": STEEL},
        [
            make_body("nose", "steel", "half-disk", center=[0.0, radius], radius=radius, side="lower"),
            box("base", "steel", (-15.0, 15.0), (-20.0, 0.0)),
        ],
        support=[held("base.bottom")],
        contact=[pair("foot", "nose.arc", "base.top", friction)],
        load=[platen("press", "nose.flat", fy=-press), platen("push", "nose.flat", fx=push)],
        stage=[{"press": 1.0}, {"push": 1.0}, {"push": -back}],
    )
    largest = float(np.sqrt(press * 210e3 / (2.0 * (1.0 - 0.3**2)) / (np.pi * radius)))
    stuck, turned = np.sqrt(1.0 - part), np.sqrt(1.0 - part * (1.0 + back) / 2.0)
    middle = friction * largest * abs((1.0 - stuck) - 2.0 * (1.0 - turned))

    def traction(result: Result) -> float:
        with h5py.File(result.folder / "run.h5") as file:
            one = file["contacts/foot"]
            x, values = one["points"][:, 0], one["traction"][-1]
        order = np.argsort(x)
        return abs(float(np.interp(0.0, x[order], values[order])))

    figures = [
        Figure("push", force_at("foot", 0), back * push),
        Figure("traction in the middle", traction, float(middle), PEAK),
    ]
    return Scene("pushed_back", "load cycle", given, figures)


@scene
def block_between_jaws() -> Scene:
    """A block between two jaws is held by friction alone until it is too heavy."""
    friction, press, weight = 0.2, 500.0, 250.0
    given = case(
        "strain",
        {"steel": STEEL, "wood": solid(10e3, 0.3)},
        [
            box("block", "wood", (-10.0, 10.0), (-15.0, 15.0)),
            box("left", "steel", (-20.0, -10.0), (-10.0, 10.0)),
            box("right", "steel", (10.0, 20.0), (-10.0, 10.0)),
        ],
        support=[held("left.left")],
        contact=[
            pair("on-left", "block.left", "left.right", friction),
            pair("on-right", "block.right", "right.left", friction),
        ],
        load=[
            platen("clamp", "right.right", fx=-press, uy=0.0),
            weighed("weight", "block", 0.0, -weight / 600.0),
        ],
        stage=[{"clamp": 1.0}, {"weight": 1.0}],
    )
    refusal = Refusal(("slide", "slip"), 1.0 + 2.0 * friction * press / weight)
    return Scene("block_between_jaws", "clamp", given, refusal=refusal)


@scene
def lifted_strip() -> Scene:
    """A strip on a floor, lifted at its end: what is off the floor bends as a beam clamped without moment."""
    long, thick, weight, lift = 100.0, 4.0, 0.8, 20.0
    modulus, poisson = 70e3, 0.33
    given = case(
        "strain",
        {"aluminium": solid(modulus, poisson)},
        [box("strip", "aluminium", (0.0, long), (0.0, thick))],
        support=[pinned("strip", (0.0, 0.0), "ux")],
        contact=[on_plane("floor", "strip.bottom", (0.0, 0.0), (0.0, 1.0))],
        load=[
            weighed("weight", "strip", 0.0, -weight / thick),
            {"name": "lift", "kind": "traction", "boundary": "strip.right", "traction": [0.0, lift / thick]},
        ],
        stage=[{"weight": 1.0}, {"lift": 1.0}],
        probe=[probe("end", "strip", long, thick / 2.0)],
    )
    free, stiffness = 2.0 * lift / weight, modulus / (1.0 - poisson**2) * thick**3 / 12.0
    figures = [
        Figure("floor", force_at("floor", 1), weight * long - lift),
        Figure("end", lambda r: float(r.moved("end")[1]), weight * free**4 / (24.0 * stiffness), PLACE),
    ]
    return Scene("lifted_strip", "lifts off", given, figures)
