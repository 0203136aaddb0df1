"""Random scenes with friction whose forces or limit loads statics tells, drawn upright in mm and N.

Blocks that slide or tip, plates between two blocks, linings, disks that spin in grooves, between plates and
between brake blocks, or roll, logs, feet, shrunk hubs, belts, wedges that lock or slip back, pads that are
pushed to and fro. Friction coefficients are 0.01 to 1.5.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.scenes.parts import (
    body,
    case,
    held,
    on_disk,
    on_plane,
    pair,
    platen,
    polygon,
    pressed,
    pushed,
)
from benchmarks.scenes.scene import Array, Figure, Refusal, Result, Scene, Table
from benchmarks.scenes.variants import Frame

Pair = tuple[float, float]
SLIDES = ("slid", "slip")
TIPS = ("tip", "tilt", "turn", "rotat")
SPINS = (*SLIDES, "turn", "rotat", "spin")
"""Words that must tell what a scene does beyond its limit load."""
END = 1.0 + 1.0 / 1.5
"""Position of a limit where the last of two stages asks for 1.5 times as much."""
GUIDED = ("between", "spin", "brake")
"""Scenes whose supports leave one axis of the drawing free."""


@dataclass(frozen=True)
class Upright:
    """A result as it would be upright in mm and N."""

    result: Result
    frame: Frame

    def force(self, contact: str) -> Array:
        return np.asarray(self.result.force(contact) @ self.frame.matrix / self.frame.unit((1, 1)))

    def vectors(self, places: Array) -> Array:
        return np.asarray(places @ self.frame.matrix / self.frame.length)


Reading = Callable[[Upright], float]
Told = tuple[str, Reading, float, float, float | None]
"""Name, value, true value, limit in percent, scale."""


@dataclass(frozen=True)
class Known:
    """A case, and what statics tells: figures, or the words and position of a refusal."""

    case: Table
    figures: Sequence[Told] = ()
    refusal: Refusal | None = None

    def scene(self, name: str, kind: str, frame: Frame) -> Scene:
        """The scene in a frame."""

        def read(got: Reading) -> Callable[[Result], float]:
            return lambda result: got(Upright(result, frame))

        figures = [Figure(told[0], read(told[1]), *told[2:]) for told in self.figures]
        return Scene(name, kind, frame.case(self.case), figures, self.refusal)


def limited(number: int, frame: Frame) -> Scene:
    """The scene of a number in a frame, which is at right angles for scenes that need it."""
    kind = list(KINDS)[number % len(KINDS)]
    if kind in GUIDED:
        angle = np.pi / 2.0 * round(float(np.arctan2(frame.matrix[1, 0], frame.matrix[0, 0])) / (np.pi / 2.0))
        frame = Frame.turned(np.degrees(angle), frame.length, frame.stress)
    known = KINDS[kind](Draft(np.random.default_rng([19, number])))
    return known.scene(f"{kind}{number}", kind, frame)


@dataclass(frozen=True)
class Draft:
    """Random values and tables."""

    rng: np.random.Generator

    def friction(self, least: float = 0.01, most: float = 1.5) -> float:
        return float(np.exp(self.rng.uniform(np.log(least), np.log(most))))

    def between(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def materials(self, *names: str) -> tuple[dict[str, Table], float]:
        """Moduli within a factor of 100 of each other, and the least of them."""
        level = 10.0 ** self.between(1.0, 5.0)
        moduli = {name: level * 10.0 ** self.between(0.0, 2.0 * (i > 0)) for i, name in enumerate(names)}
        return {name: {"E": E, "nu": self.between(0.0, 0.45)} for name, E in moduli.items()}, level

    def known(
        self,
        materials: dict[str, Table],
        bodies: list[Table],
        words: Sequence[str] = (),
        position: float | None = END,
        figures: Sequence[Told] = (),
        **rest: Any,
    ) -> Known:
        """``words`` tell that there is no equilibrium beyond a ``position``; without stages every load has
        its own."""
        stages = rest.pop("stage", None) or [{load["name"]: 1.0} for load in rest.get("load", ())]
        plane = str(self.rng.choice(["strain", "stress"]))
        given = case(plane, materials, bodies, **rest, stage=stages)
        return Known(given, figures, Refusal(words, position) if words else None)


def block(name: str, material: str, x: Pair, y: Pair, rounding: float = 0.0) -> Table:
    """Sides foot, right, head, left; rounded corners belong to foot and head."""
    corners = [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])]
    rounded = {"rounding": [rounding] * 4, "corners": ["foot", "foot", "head", "head"]} if rounding else {}
    return polygon(name, material, corners, names=["foot", "right", "head", "left"], **rounded)


def even(name: str, material: str, half: float, y: Pair, rounding: float = 0.0) -> Table:
    """A block on both sides of x = 0."""
    return block(name, material, (-half, half), y, rounding)


def ring(name: str, material: str, at: Pair, radii: Pair) -> Table:
    return body(name, material, "annulus", center=list(at), radii=list(radii))


def part(pressure: Table, *ends: Pair) -> Table:
    """A pressure on a part of its side."""
    return pressure | dict(zip(("from", "to"), map(list, ends), strict=True))


def component(contact: str, axis: int, true: float, scale: float | None = None) -> Told:
    """One component of a contact's force."""
    return f"{contact} {'xy'[axis]}", lambda up: float(up.force(contact)[axis]), true, 1.0, scale


def slide(d: Draft) -> Known:
    """A block under a plate, pressed, then pulled at an angle to the ground until it slides."""
    mu, wide, high = d.friction(), d.between(3.0, 10.0), d.between(1.0, 4.0)
    materials, soft = d.materials("one", "two")
    press = 2e-3 * soft * wide
    # Pulled up a little, or down: steep pulls press by themselves.
    rise = d.between(-0.3, 0.3) / max(mu, 1.0)
    pull, asked = mu * press / (1.0 + mu * rise), d.between(1.1, 2.0)
    bodies = [even("block", "one", wide / 2, (0.0, high), float(d.rng.choice([0.0, 0.2])) * high)]
    contact, support = on_plane("ground", "block.foot", (0.0, 0.0), (0.0, 1.0), mu), []
    if d.rng.random() < 0.6:
        bodies.append(even("base", "two", wide, (-high, 0.0)))
        contact, support = pair("ground", "block.foot", "base.head", mu), [held("base.foot")]
    else:
        materials.pop("two")
    sideways = float(d.rng.choice([-1.0, 1.0])) * asked * pull
    return d.known(
        materials,
        bodies,
        SLIDES,
        1.0 + 1.0 / asked,
        support=support,
        contact=[contact],
        load=[
            platen("press", "block.head", force=[0.0, -press]),
            platen("pull", "block.head", force=[sideways, asked * pull * rise]),
        ],
    )


def tip(d: Draft) -> Known:
    """A tower that is pressed, then pushed at its side until it slides or tips."""
    mu, wide, high = d.friction(0.1), d.between(2.0, 5.0), d.between(3.0, 8.0)
    materials, soft = d.materials("one", "two")
    # A soft foot lets the load lean out before the edge is reached.
    load = 1e-5 * soft * wide
    low, up = 0.6 * high, 0.8 * high
    tipping, sliding = load * wide / (low + up), mu * load
    if abs(tipping / sliding - 1.0) < 0.1:
        sliding, mu = 0.8 * sliding, 0.8 * mu
    push = pressed("push", "tower.left", 1.5 * min(tipping, sliding) / (up - low))
    return d.known(
        materials,
        [
            even("tower", "one", wide / 2, (0.0, high)),
            even("base", "two", 1.5 * wide, (-wide, 0.0)),
        ],
        TIPS if tipping < sliding else SLIDES,
        support=[held("base.foot")],
        contact=[pair("ground", "tower.foot", "base.head", mu)],
        load=[
            pressed("press", "tower.head", load / wide),
            part(push, (-wide / 2, low), (-wide / 2, up)),
        ],
    )


def between(d: Draft) -> Known:
    """A plate between two blocks, pulled out: both faces slip together."""
    one, two, wide, thick = d.friction(), d.friction(), d.between(6.0, 12.0), d.between(0.8, 2.0)
    materials, soft = d.materials("one", "two", "three")
    press = 2e-3 * soft * wide
    return d.known(
        materials,
        [
            even("under", "one", wide / 2, (-2.0, 0.0)),
            block("plate", "two", (-0.6 * wide, 0.9 * wide), (0.0, thick)),
            even("over", "three", wide / 2, (thick, thick + 2.0)),
        ],
        SLIDES,
        # Springs hold the block above sideways.
        support=[held("under.foot"), {"boundary": "over.left", "spring": [0.1 * soft, 0.0]}],
        contact=[
            pair("low", "under.head", "plate.foot", one),
            pair("up", "over.foot", "plate.head", two),
        ],
        load=[
            pressed("press", "over.head", press / wide),
            pressed("pull", "plate.right", -1.5 * (one + two) * press / thick),
        ],
    )


def lining(d: Draft) -> Known:
    """A block with a bonded lining, pushed to and fro below the limit, then beyond."""
    mu, wide, thick = d.friction(), d.between(4.0, 8.0), d.between(0.5, 1.5)
    materials, soft = d.materials("lining", "block", "base")
    press, asked = 2e-3 * soft * wide, 1.4
    return d.known(
        materials,
        [
            even("block", "block", wide / 2, (thick, thick + 2.0)),
            even("lining", "lining", wide / 2, (0.0, thick)),
            even("base", "base", wide, (-2.0, 0.0)),
        ],
        SLIDES,
        3.0 + (1.0 / asked - 0.5) / 0.5,
        stage=[{"press": 1.0}, {"push": -0.5}, {"push": 0.5}, {"push": 1.0}],
        support=[held("base.foot")],
        contact=[
            pair("glue", "lining.head", "block.foot", "bonded"),
            pair("ground", "lining.foot", "base.head", mu),
        ],
        load=[
            platen("press", "block.head", force=[0.0, -press]),
            platen("push", "block.head", force=[asked * mu * press, 0.0]),
        ],
    )


def groove(d: Draft) -> Known:
    """A ring in a V-groove, pressed and turned by its hub until it spins."""
    a = np.radians(d.between(25.0, 60.0))
    mu, radius = min(d.friction(), 0.7 * float(np.tan(a))), d.between(3.0, 8.0)
    materials, soft = d.materials("one")
    force, s, c = 1e-3 * soft * radius, float(np.sin(a)), float(np.cos(a))
    twist = mu * radius * force / (c * (1.0 + mu**2))
    return d.known(
        materials,
        [ring("ring", "one", (0.0, radius / c), (0.4 * radius, radius))],
        SPINS,
        contact=[
            on_plane("left", "ring.outer", (0.0, 0.0), (s, c), mu),
            on_plane("right", "ring.outer", (0.0, 0.0), (-s, c), mu),
        ],
        load=[
            platen("press", "ring.inner", force=[0.0, -force], rotation="free"),
            platen("turn", "ring.inner", moment=1.5 * twist),
        ],
    )


def spin(d: Draft) -> Known:
    """A ring between two plates, turned by its hub until it spins."""
    mu, radius = d.friction(), d.between(3.0, 8.0)
    materials, soft = d.materials("one")
    force = 1e-3 * soft * radius
    return d.known(
        materials,
        [ring("ring", "one", (0.0, radius), (0.4 * radius, radius))],
        SPINS,
        contact=[
            on_plane("low", "ring.outer", (0.0, 0.0), (0.0, 1.0), mu),
            on_plane("lid", "ring.outer", (0.0, 2.0 * radius), (0.0, -1.0), mu),
        ],
        load=[
            pushed("press", "lid", fy=-force, ux=0.0),
            platen("turn", "ring.inner", moment=3.0 * mu * force * radius, force=[0.0, 0.0]),
        ],
    )


def brake(d: Draft) -> Known:
    """A drum on its axle between two blocks, turned until both slip."""
    mu, radius = d.friction(), d.between(4.0, 9.0)
    materials, soft = d.materials("one", "two")
    force, half = 1e-3 * soft * radius, 0.6 * radius
    return d.known(
        materials,
        [
            ring("drum", "one", (0.0, 0.0), (0.4 * radius, radius)),
            block("left", "two", (-1.7 * radius, -radius), (-half, half)),
            block("right", "two", (radius, 1.7 * radius), (-half, half)),
        ],
        SPINS,
        stage=[{"push-left": 1.0, "push-right": 1.0, "axle": 1.0}, {"turn": 1.0}],
        contact=[
            pair("on-left", "drum.outer", "left.right", mu),
            pair("on-right", "drum.outer", "right.left", mu),
        ],
        load=[
            platen("axle", "drum.inner", displacement=[0.0, 0.0], rotation="free"),
            platen("push-left", "left.left", fx=force, uy=0.0),
            platen("push-right", "right.right", fx=-force, uy=0.0),
            platen("turn", "drum.inner", moment=3.0 * mu * force * radius),
        ],
    )


def roll(d: Draft) -> Known:
    """A disk between two plates, of which the upper one is moved along: it rolls at half of the way."""
    mu, radius = d.friction(0.1), d.between(3.0, 8.0)
    materials, _ = d.materials("one")
    far = 2e-3 * radius * min(1.0, 3.0 * mu)

    def rolled(up: Upright) -> float:
        return float(up.vectors(up.result.moved("middle"))[0])

    def along(up: Upright) -> float:
        return float(up.force("low")[0] / up.force("low")[1])

    return d.known(
        materials,
        [body("disk", "one", "disk", center=[0.0, radius], radius=radius)],
        figures=[("rolled", rolled, 0.5 * far, 3.0, None), ("along", along, 0.0, 1.0, mu)],
        contact=[
            on_plane("low", "disk.arc", (0.0, 0.0), (0.0, 1.0), mu),
            on_plane("lid", "disk.arc", (0.0, 2.0 * radius), (0.0, -1.0), mu),
        ],
        load=[
            pushed("press", "lid", displacement=[0.0, -2e-3 * radius]),
            pushed("move", "lid", displacement=[far, 0.0]),
        ],
        probe=[{"name": "middle", "body": "disk", "point": [0.0, radius]}],
    )


def logs(d: Draft) -> Known:
    """A log on two others: friction holds them, or not."""
    materials, soft = d.materials("wood")
    radius, weight, apart = 10.0, 1e-2 * soft, d.between(10.3, 15.0)
    lean = float(np.arcsin(apart / (2.0 * radius)))
    need = float(np.tan(0.5 * lean))
    # What rubs on the ground is a third of what is needed above.
    mu = need * float(d.rng.choice([0.8, 1.3, 2.0]))
    high = radius * (1.0 + 2.0 * float(np.cos(lean)))
    places = {"left": [-apart, radius], "right": [apart, radius], "top": [0.0, high]}
    fall = [0.0, -weight / (np.pi * radius**2)]
    along = 0.5 * weight * need / float(np.cos(lean) + need * np.sin(lean))
    figures = [
        component("under-left", 1, 1.5 * weight),
        component("under-left", 0, along, 0.5 * weight),
        component("under-right", 0, -along, 0.5 * weight),
    ]
    return d.known(
        materials,
        [body(n, "wood", "disk", center=at, radius=radius) for n, at in places.items()],
        (*SLIDES, "hold", "roll") if mu < need else (),
        None,
        () if mu < need else figures,
        stage=[dict.fromkeys(places, 1.0)],
        contact=[
            on_plane("under-left", "left.arc", (0.0, 0.0), (0.0, 1.0), mu),
            on_plane("under-right", "right.arc", (0.0, 0.0), (0.0, 1.0), mu),
            pair("on-left", "top.arc", "left.arc", mu),
            pair("on-right", "top.arc", "right.arc", mu),
        ],
        load=[{"name": n, "body": n, "kind": "body-force", "body-force": fall} for n in places],
    )


def feet(d: Draft) -> Known:
    """A bridge on two feet of one friction, loaded off its middle, pushed low until it slides."""
    mu, wide, high = d.friction(), d.between(8.0, 14.0), d.between(2.0, 3.0)
    materials, soft = d.materials("one", "two")
    inner = [0.2 * wide, 0.8 * wide]
    x = [0.0, inner[0], inner[0], inner[1], inner[1], wide, wide, 0.0]
    y = [0.0, 0.0, 0.8, 0.8, 0.0, 0.0, high, high]
    names = ["foot1", "in1", "arch", "in2", "foot2", "right", "head", "left"]
    first, last = d.between(0.2, 0.4) * wide, d.between(0.6, 0.8) * wide
    load = 5e-4 * soft * wide
    # A low push tips nobody: its moment is below a tenth of the load's.
    up = min(high, max(0.3, 0.2 * wide / max(mu, 0.1) * 0.3))
    return d.known(
        materials,
        [
            polygon("bridge", "one", list(zip(x, y, strict=True)), names=names),
            block("base", "two", (-0.3 * wide, 1.3 * wide), (-3.0, 0.0)),
        ],
        SLIDES,
        support=[held("base.foot")],
        contact=[
            pair("first", "bridge.foot1", "base.head", mu),
            pair("second", "bridge.foot2", "base.head", mu),
        ],
        load=[
            part(pressed("press", "bridge.head", load / (last - first)), (first, high), (last, high)),
            part(pressed("push", "bridge.left", 1.5 * mu * load / up), (0.0, 0.0), (0.0, up)),
        ],
    )


def hub(d: Draft) -> Known:
    """A ring shrunk on a hollow shaft, turned by tractions in the bore until it slips."""
    mu, outer, inner, radius, fit = d.friction(), d.between(8.0, 12.0), 2.0, 5.0, 5e-3
    materials, _ = d.materials("one", "two")
    made = d.known(
        materials,
        [ring("shaft", "one", (0.0, 0.0), (inner, radius)), ring("ring", "two", (0.0, 0.0), (radius, outer))],
        SPINS,
        stage=[{"seat": 1.0}, {"turn": 1.0}],
        support=[held("ring.outer")],
        contact=[pair("seat", "shaft.outer", "ring.inner", mu, interference=fit)],
    )
    strain = made.case["model"]["plane"] == "strain"
    # Modulus and ratio of plane stress that do the same.
    flat = [
        (m["E"] / (1.0 - m["nu"] ** 2), m["nu"] / (1.0 - m["nu"])) if strain else (m["E"], m["nu"])
        for m in materials.values()
    ]
    compliance = radius / flat[0][0] * ((radius**2 + inner**2) / (radius**2 - inner**2) - flat[0][1])
    # Held outside: u = C (r - outer^2 / r).
    E, nu = flat[1]
    slope = E / (1.0 - nu**2) * ((1.0 + nu) + (1.0 - nu) * outer**2 / radius**2)
    compliance += (outer**2 / radius - radius) / slope
    shear = 1.5 * mu * fit / compliance * radius**2 / inner**3
    turn = {"name": "turn", "boundary": "shaft.inner", "kind": "traction"}
    made.case["load"] = [turn | {"traction": [f"{-shear:.17g}*y", f"{shear:.17g}*x"]}]
    return made


def belt(d: Draft) -> Known:
    """A belt on a part of a drum slips by Eytelwein's formula."""
    mu, angle, radius, thick, asked = d.friction(0.03, 0.8), d.between(60.0, 200.0), 50.0, 1.0, 1.4
    materials, soft = d.materials("one")
    pull = 2e-4 * soft
    ratio = float(np.exp(mu * np.radians(angle) * radius / (radius + 0.5 * thick)))
    ends = {"start": [0.0, -1.0], "end": [-np.sin(np.radians(angle)), np.cos(np.radians(angle))]}

    def pulled(load: str, side: str, traction: float) -> Table:
        by = [float(traction * v) for v in ends[side]]
        return {"name": load, "kind": "traction", "boundary": f"belt.{side}", "traction": by}

    return d.known(
        materials,
        [
            body(
                "belt",
                "one",
                "sector",
                center=[0.0, 0.0],
                radii=[radius, radius + thick],
                angles=[0.0, angle],
            )
        ],
        SLIDES,
        1.0 + 1.0 / asked,
        stage=[{"tight": 1.0, "slack": 1.0}, {"more": 1.0}],
        contact=[on_disk("wrap", "belt.inner", (0.0, 0.0), radius, mu)],
        load=[
            pulled("tight", "start", pull),
            pulled("slack", "end", pull),
            pulled("more", "start", asked * pull * (ratio - 1.0)),
        ],
    )


def wedge(d: Draft) -> Known:
    """A wedge between rigid flanks, driven in, then let go: it locks, or slips back."""
    angle, locks = np.radians(d.between(8.0, 35.0)), bool(d.rng.random() < 0.5)
    s, c, t = float(np.sin(angle)), float(np.cos(angle)), float(np.tan(angle))
    mu = t * (d.between(1.2, 2.0) if locks else d.between(0.05, 0.3))
    materials, soft = d.materials("one")
    low, up = 3.0, 3.0 + 10.0 * t
    corners = [(-low, 0.0), (low, 0.0), (up, 10.0), (-up, 10.0)]
    force = 2e-3 * soft * up
    # Where nothing presses, what the flanks carry is along x.
    back = component("on-left", 0, 0.1 * force * (c + mu * s) / (s - mu * c))
    return d.known(
        materials,
        [polygon("wedge", "one", corners, names=["foot", "right", "head", "left"])],
        stage=[{"drive": 1.0}, {"drive": 0.0 if locks else 0.2}],
        figures=[component("on-left", 1, 0.0, force) if locks else back],
        contact=[
            on_plane("on-left", "wedge.left", corners[0], (c, s), mu),
            on_plane("on-right", "wedge.right", corners[1], (-c, s), mu),
        ],
        load=[platen("drive", "wedge.head", force=[0.0, -force])],
    )


def pad(d: Draft) -> Known:
    """A pad with rounded corners is pressed and pushed to and fro: its loop is what it dissipates."""
    mu, wide, high = d.friction(0.05), d.between(3.0, 6.0), d.between(1.0, 3.0)
    materials, soft = d.materials("one", "two")
    press = 1e-3 * soft * wide
    shear = d.between(0.5, 0.9) * mu * press

    def ratio(up: Upright) -> float:
        place = up.result.read("path/position")
        # What is pushed settles in the first turn: the second one closes.
        later = place >= 4.0 - 1e-9
        work = up.result.read("contacts/fret/dissipated_work")[later] / up.frame.unit((2, 1))
        factor = np.interp(place[later], [4.0, 5.0, 6.0], [1.0, -1.0, 1.0])
        along = shear * up.vectors(up.result.read("path/displacements/shear")[later])[:, 0]
        # Chords of two sizes tell what lies between a curve and its chords.
        turn = int(np.argmin(factor))
        every, other = np.arange(len(factor)), np.r_[0 : turn + 1 : 2, turn, turn : len(factor) : 2, -1]
        fine, coarse = (
            float((0.5 * (f[1:] + f[:-1]) * np.diff(u)).sum())
            for f, u in ((factor[one], along[one]) for one in (every, other))
        )
        loop = fine + (fine - coarse) / 3.0
        # What settles to rest hardly has a loop: then it counts against the elastic work.
        return 1.0 + (float(work[-1] - work[0]) - loop) / max(loop, 0.01 * float(np.ptp(along)))

    return d.known(
        materials,
        [
            even("pad", "one", wide / 2, (0.0, high), 0.3 * high),
            even("base", "two", wide, (-high, 0.0)),
        ],
        stage=[{"press": 1.0}, *({"shear": way} for way in (1.0, -1.0, 1.0, -1.0, 1.0))],
        figures=[("dissipated over loop", ratio, 1.0, 0.1, None)],
        support=[held("base.foot")],
        contact=[pair("fret", "pad.foot", "base.head", mu)],
        load=[
            platen("press", "pad.head", force=[0.0, -press]),
            platen("shear", "pad.head", force=[shear, 0.0]),
        ],
    )


KINDS: dict[str, Callable[[Draft], Known]] = {
    one.__name__: one
    for one in (slide, tip, between, lining, groove, spin, brake, roll, logs, feet, hub, belt, wedge, pad)
}
