"""Bodies that friction holds in many contacts: bearing, piles, capstan, arch, teeth; judged by statics."""

from __future__ import annotations

import numpy as np

from benchmarks.scenes.bending import STEEL
from benchmarks.scenes.machines import arch, bearing
from benchmarks.scenes.scene import (
    Array,
    Figure,
    Pair,
    Result,
    Scene,
    Table,
    case,
    force_at,
    held,
    on_disk,
    on_plane,
    pair,
    platen,
    polygon,
    scene,
    solid,
    weighed,
)
from benchmarks.scenes.scene import body as make_body


def bearing_case(stages: list[Table]) -> Table:
    """Six rollers with a clearance between rings, two of them at equal distance from below the shaft."""
    return bearing(6, -60.0, 3.998, 0.1, stage=stages)


def _carried(side: str) -> Figure:
    """The load of the shaft on all rollers."""

    def up(result: Result) -> float:
        return abs(sum(float(result.force(f"{side}{i}")[1]) for i in range(6)))

    return Figure(f"carried by {side}", up, 400.0)


@scene
def bearing_friction() -> Scene:
    """Six rollers with clearance and friction, of which two carry."""
    figures = [
        _carried("in"),
        _carried("out"),
        Figure("left and right", lambda r: float(r.force("in0")[1] / r.force("in5")[1]), 1.0),
    ]
    return Scene("bearing_friction", "roller bearing", bearing_case([{"shaft": 1.0}]), figures)


@scene
def bearing_unloaded() -> Scene:
    """The same, unloaded to a tenth."""
    given = bearing_case([{"shaft": 1.0}, {"shaft": 0.1}])
    up = _carried("in")
    return Scene("bearing_unloaded", "roller bearing", given, [Figure(up.what, up.got, 40.0)])


def pile_places(radius: float, apart: float) -> Array:
    """Centres (6, 2) of disks in rows of three, two and one, the lowest ``apart``."""
    rise = float(np.sqrt(4.0 * radius**2 - 0.25 * apart**2))
    rows = [(count, level) for level, count in enumerate((3, 2, 1))]
    return np.array(
        [
            [apart * (i - 0.5 * (count - 1)), radius + level * rise]
            for count, level in rows
            for i in range(count)
        ]
    )


@scene
def six_disk_pile() -> Scene:
    """Rows of three, two and one disks that friction alone keeps together; one force is free in statics."""
    radius, weight, friction = 10.0, 30.0, 0.65
    places = pile_places(radius, 20.6)
    above = [(3, 0), (3, 1), (4, 1), (4, 2), (5, 3), (5, 4)]
    contacts = [on_plane(f"floor{i}", f"disk{i}.arc", (0.0, 0.0), (0.0, 1.0), friction) for i in range(3)]
    contacts += [pair(f"{i}on{j}", f"disk{i}.arc", f"disk{j}.arc", friction) for i, j in above]
    given = case(
        "strain",
        {"wood": solid(10e3, 0.3)},
        [
            make_body(f"disk{i}", "wood", "disk", center=place.tolist(), radius=radius)
            for i, place in enumerate(places)
        ],
        contact=contacts,
        load=[weighed(f"weight{i}", f"disk{i}", 0.0, -weight / (np.pi * radius**2)) for i in range(6)],
        stage=[{f"weight{i}": 1.0 for i in range(6)}],
    )

    def floor(result: Result) -> float:
        return sum(float(result.force(f"floor{i}")[1]) for i in range(3))

    figures = [
        Figure("floor", floor, 6.0 * weight),
        Figure("left and right", lambda r: float(r.force("floor0")[0] / -r.force("floor2")[0]), 1.0),
        Figure("top", force_at("5on3", 1), 0.5 * weight),
    ]
    return Scene("six_disk_pile", "logs", given, figures)


@scene
def capstan() -> Scene:
    """A belt on half of a drum, its slack end under a dead load, its tight end drawn until all slips."""
    radius, thick, friction, slack = 50.0, 1.0, 0.3, 2.0
    belt = make_body(
        "belt", "belt", "sector", center=[0.0, 0.0], radii=[radius, radius + thick], angles=[0.0, 180.0]
    )
    given = case(
        "stress",
        {"belt": solid(1e4, 0.3)},
        [belt],
        contact=[on_disk("wrap", "belt.inner", (0.0, 0.0), radius, friction)],
        load=[
            {"name": "slack", "kind": "traction", "boundary": "belt.end", "traction": [0.0, -slack]},
            platen("tight", "belt.start", fx=0.0, uy=-0.1, rotation="free"),
        ],
        stage=[{"slack": 1.0, "tight": 0.2}, {"tight": 1.0}],
    )
    ratio = float(np.exp(friction * np.pi * radius / (radius + 0.5 * thick)))
    tight = Figure("tight", lambda r: abs(float(r.exerted("tight")[1])), slack * thick * ratio)
    return Scene("capstan", "belt", given, [tight])


@scene
def arch_of_seven() -> Scene:
    """Seven stones of an arch on two abutments."""
    return arch("arch_of_seven", 7)


def rack(root: float, tip: float, side: float, offset: float) -> list[Pair]:
    """Points of a bar with four teeth, from its back: roots at ``root``, tips at ``tip``, flanks inclined by
    20 degrees, the teeth half a pitch of 20 wide at the middle of their height."""
    lean = 0.5 * (tip - root) * side * float(np.tan(np.radians(20.0)))
    points = []
    for middle in offset + 20.0 * np.arange(4):
        points += [(middle - 5.0 - lean, root), (middle - 5.0 + lean, tip)]
        points += [(middle + 5.0 - lean, tip), (middle + 5.0 + lean, root)]
    back = root - 20.0 * side
    ends = offset - 12.0, offset + 72.0
    return [(ends[0], back), (ends[0], root), *points, (ends[1], root), (ends[1], back)]


@scene
def four_teeth() -> Scene:
    """A rack pushed along another one: four pairs of flanks, straight between rounded tips and roots."""
    bodies = []
    for name, side, offset in (("lower", 1.0, 0.0), ("upper", -1.0, 10.0)):
        points = rack(-4.0 * side, 4.0 * side - 0.5 * side, side, offset)
        count = len(points)
        names = [f"side{i}" for i in range(count)]
        for tooth in range(4):
            names[2 + 4 * tooth], names[4 + 4 * tooth] = f"left{tooth}", f"right{tooth}"
        names[-1] = "back"
        rounding = [0.0, 0.0, *[1.5, 1.5, 1.5, 1.5] * 4, 0.0, 0.0]
        bodies.append((name, points, names, rounding, side))
    made = []
    for name, points, names, rounding, side in bodies:
        if side > 0.0:  # counter-clockwise
            points, names, rounding = points[::-1], [*names[-2::-1], names[-1]], rounding[::-1]
        made.append(polygon(name, "steel", points, names=names, rounding=rounding))
    given = case(
        "strain",
        {"steel": STEEL},
        made,
        support=[held("lower.back")],
        contact=[pair(f"flank{i}", f"upper.left{i}", f"lower.right{i}", 0.1) for i in range(4)],
        load=[platen("push", "upper.back", fx=-400.0, uy=0.0)],
    )

    def along(result: Result) -> float:
        return abs(sum(float(result.force(f"flank{i}")[0]) for i in range(4)))

    return Scene("four_teeth", "teeth", given, [Figure("along", along, 400.0)])
