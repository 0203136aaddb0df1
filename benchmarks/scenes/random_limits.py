"""Random scenes with friction whose forces or limit loads statics tells, in any frame and any units.

Drawn for ``random_scenes.py --limits``: blocks that slide or tip, plates between two blocks, linings, disks
that spin in grooves, between plates and between brake blocks, or roll, logs, feet, shrunk hubs, belts, wedges
that lock or slip back, pads that are pushed to and fro. Friction coefficients are 0.01 to 1.5.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import h5py
import numpy as np

from benchmarks.scenes.random_frames import Frame, drawn_frame
from benchmarks.scenes.scene import (
    Array,
    Figure,
    Pair,
    Refusal,
    Result,
    Scene,
    Table,
    case,
    held,
    pair,
    platen,
    polygon,
    pressed,
    pushed,
)
from benchmarks.scenes.scene import body as make_body

Rng = np.random.Generator
SLIDES = ("slid", "slip")
TIPS = ("tip", "tilt", "turn", "rotat")
GUIDED = ("between", "spin", "brake")
"""Scenes whose supports leave one axis of the drawing free."""
SPINS = (*SLIDES, "turn", "rotat", "spin")


@dataclass(frozen=True)
class Draft:
    """What is drawn upright in mm and N, written in a frame."""

    rng: Rng
    frame: Frame

    def friction(self, least: float = 0.01, most: float = 1.5) -> float:
        return float(np.exp(self.rng.uniform(np.log(least), np.log(most))))

    def between(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def materials(self, *names: str) -> tuple[dict[str, Table], float]:
        """Moduli within a factor of 100 of each other, and the least of them, upright."""
        level = 10.0 ** self.between(1.0, 5.0)
        moduli = {name: level * 10.0 ** self.between(0.0, 2.0 * (i > 0)) for i, name in enumerate(names)}
        made = {
            name: {"E": E * self.frame.stress, "nu": self.between(0.0, 0.45)} for name, E in moduli.items()
        }
        return made, level

    def block(self, name: str, material: str, x: Pair, y: Pair, rounding: float = 0.0) -> Table:
        """Sides foot, right, head, left; rounded corners belong to foot and head."""
        corners = [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])]
        more: Table = {}
        if rounding:
            more = {
                "rounding": [rounding * self.frame.length] * 4,
                "corners": ["foot", "foot", "head", "head"],
            }
        names = ["foot", "right", "head", "left"]
        return polygon(name, material, self.frame.places(corners), names=names, **more)

    def ring(self, name: str, material: str, at: Pair, radii: Pair) -> Table:
        scaled = [r * self.frame.length for r in radii]
        return make_body(name, material, "annulus", center=self.frame.at(*at), radii=scaled)

    def disk(self, name: str, material: str, at: Pair, radius: float) -> Table:
        return make_body(name, material, "disk", center=self.frame.at(*at), radius=radius * self.frame.length)

    def plane(self, name: str, slave: str, point: Pair, normal: Pair, friction: float) -> Table:
        obstacle = {"kind": "plane", "point": self.frame.at(*point), "normal": self.frame.turned(*normal)}
        return {"name": name, "slave": slave, "obstacle": obstacle, "friction": friction}

    def plate(self, name: str, side: str, x: float, y: float) -> Table:
        return platen(name, side, force=self.frame.force(x, y))

    def twist(self, name: str, side: str, moment: float, **more: object) -> Table:
        return platen(name, side, moment=moment * self.frame.length**2 * self.frame.stress, **more)

    def pressure(self, name: str, side: str, value: float, ends: Sequence[Pair] = ()) -> Table:
        part = dict(zip(("from", "to"), self.frame.places(list(ends)), strict=False))
        return pressed(name, side, value * self.frame.stress) | part

    def along(self, result: Result, contact: str) -> Array:
        """Its force, upright in N."""
        axes = np.array([self.frame.turned(1.0, 0.0), self.frame.turned(0.0, 1.0)])
        return np.asarray(axes @ result.force(contact)) / (self.frame.length * self.frame.stress)

    def figure(
        self, contact: str, axis: int, true: float, limit: float = 1.0, scale: float | None = None
    ) -> Figure:
        return Figure(
            f"{contact} {'xy'[axis]}", lambda r: float(self.along(r, contact)[axis]), true, limit, scale
        )

    def case(self, materials: dict[str, Table], bodies: list[Table], **rest: object) -> Table:
        return case(str(self.rng.choice(["strain", "stress"])), materials, bodies, **rest)


def limited(number: int) -> Scene:
    """The scene of a number."""
    rng = np.random.default_rng([19, number])
    kind, frame = list(KINDS)[number % len(KINDS)], drawn_frame(number)
    if kind in GUIDED:
        frame = replace(frame, angle=90.0 * round(frame.angle / 90.0))
    return KINDS[kind](Draft(rng, frame), f"{kind}{number}")


def slide(d: Draft, name: str) -> Scene:
    """A block under a plate, pressed, then pulled at an angle to the ground until it slides."""
    mu, wide, high = d.friction(), d.between(3.0, 10.0), d.between(1.0, 4.0)
    materials, soft = d.materials("one", "two")
    press = 2e-3 * soft * wide
    # Pulled up a little, or down: steep pulls press by themselves.
    rise = d.between(-0.3, 0.3) / max(mu, 1.0)
    limit = mu * press / (1.0 + mu * rise)
    asked, sign = d.between(1.1, 2.0), float(d.rng.choice([-1.0, 1.0]))
    rounding = float(d.rng.choice([0.0, 0.2])) * high
    bodies = [d.block("block", "one", (-wide / 2, wide / 2), (0.0, high), rounding)]
    contact: list[Table] = [d.plane("ground", "block.foot", (0.0, 0.0), (0.0, 1.0), mu)]
    support: list[Table] = []
    if d.rng.random() < 0.6:
        bodies.append(d.block("base", "two", (-wide, wide), (-high, 0.0)))
        contact = [pair("ground", "block.foot", "base.head", mu)]
        support = [held("base.foot")]
    else:
        materials.pop("two")
    given = d.case(
        materials,
        bodies,
        support=support,
        contact=contact,
        load=[
            d.plate("press", "block.head", 0.0, -press),
            d.plate("pull", "block.head", sign * asked * limit, asked * limit * rise),
        ],
        stage=[{"press": 1.0}, {"pull": 1.0}],
    )
    return Scene(name, "slide", given, refusal=Refusal(SLIDES, 1.0 + 1.0 / asked))


def tip(d: Draft, name: str) -> Scene:
    """A tower that is pressed, then pushed at its side until it slides or tips."""
    mu, wide, high = d.friction(0.1), d.between(2.0, 5.0), d.between(3.0, 8.0)
    materials, soft = d.materials("one", "two")
    # A soft foot lets the load lean out before the edge is reached.
    load = 1e-5 * soft * wide
    low, up = 0.6 * high, 0.8 * high
    tipping, sliding = load * wide / (low + up), mu * load
    if abs(tipping / sliding - 1.0) < 0.1:
        sliding, mu = 0.8 * sliding, 0.8 * mu
    limit, asked = min(tipping, sliding), 1.5
    given = d.case(
        materials,
        [
            d.block("tower", "one", (-wide / 2, wide / 2), (0.0, high)),
            d.block("base", "two", (-1.5 * wide, 1.5 * wide), (-wide, 0.0)),
        ],
        support=[held("base.foot")],
        contact=[pair("ground", "tower.foot", "base.head", mu)],
        load=[
            d.pressure("press", "tower.head", load / wide),
            d.pressure("push", "tower.left", asked * limit / (up - low), [(-wide / 2, low), (-wide / 2, up)]),
        ],
        stage=[{"press": 1.0}, {"push": 1.0}],
    )
    words = TIPS if tipping < sliding else SLIDES
    return Scene(name, "tip", given, refusal=Refusal(words, 1.0 + 1.0 / asked))


def between(d: Draft, name: str) -> Scene:
    """A plate between two blocks, pulled out: both faces slip together."""
    one, two, wide, thick = d.friction(), d.friction(), d.between(6.0, 12.0), d.between(0.8, 2.0)
    materials, soft = d.materials("one", "two", "three")
    press = 2e-3 * soft * wide
    limit, asked = (one + two) * press, 1.5
    given = d.case(
        materials,
        [
            d.block("under", "one", (-wide / 2, wide / 2), (-2.0, 0.0)),
            d.block("plate", "two", (-0.6 * wide, 0.9 * wide), (0.0, thick)),
            d.block("over", "three", (-wide / 2, wide / 2), (thick, thick + 2.0)),
        ],
        support=[held("under.foot")],
        contact=[
            pair("low", "under.head", "plate.foot", one),
            pair("up", "over.foot", "plate.head", two),
        ],
        load=[
            d.pressure("press", "over.head", press / wide),
            d.pressure("pull", "plate.right", -asked * limit / thick),
        ],
        stage=[{"press": 1.0}, {"pull": 1.0}],
    )
    # Springs hold the block above sideways.
    stiff = 0.1 * soft * d.frame.stress / d.frame.length
    along = [abs(v) * stiff for v in d.frame.turned(1.0, 0.0)]
    given["support"].append({"boundary": "over.left", "spring": along})
    return Scene(name, "between", given, refusal=Refusal(SLIDES, 1.0 + 1.0 / asked))


def lining(d: Draft, name: str) -> Scene:
    """A block with a bonded lining, pushed to and fro below the limit, then beyond."""
    mu, wide, thick = d.friction(), d.between(4.0, 8.0), d.between(0.5, 1.5)
    materials, soft = d.materials("lining", "block", "base")
    press = 2e-3 * soft * wide
    limit, asked = mu * press, 1.4
    given = d.case(
        materials,
        [
            d.block("block", "block", (-wide / 2, wide / 2), (thick, thick + 2.0)),
            d.block("lining", "lining", (-wide / 2, wide / 2), (0.0, thick)),
            d.block("base", "base", (-wide, wide), (-2.0, 0.0)),
        ],
        support=[held("base.foot")],
        contact=[
            pair("glue", "lining.head", "block.foot", 0.0) | {"friction": "bonded"},
            pair("ground", "lining.foot", "base.head", mu),
        ],
        load=[
            d.plate("press", "block.head", 0.0, -press),
            d.plate("push", "block.head", asked * limit, 0.0),
        ],
        stage=[{"press": 1.0}, {"push": -0.5}, {"push": 0.5}, {"push": 1.0}],
    )
    return Scene(name, "lining", given, refusal=Refusal(SLIDES, 3.0 + (1.0 / asked - 0.5) / 0.5))


def groove(d: Draft, name: str) -> Scene:
    """A ring in a V-groove, pressed and turned by its hub until it spins."""
    a = np.radians(d.between(25.0, 60.0))
    mu = min(d.friction(), 0.7 * float(np.tan(a)))
    materials, soft = d.materials("one")
    radius = d.between(3.0, 8.0)
    force = 1e-3 * soft * radius
    s, c = float(np.sin(a)), float(np.cos(a))
    both = force / (c * (1.0 + mu**2))
    limit, asked = mu * radius * both, 1.5
    high = radius / c
    given = d.case(
        materials,
        [d.ring("ring", "one", (0.0, high), (0.4 * radius, radius))],
        contact=[
            d.plane("left", "ring.outer", (0.0, 0.0), (s, c), mu),
            d.plane("right", "ring.outer", (0.0, 0.0), (-s, c), mu),
        ],
        load=[
            platen("press", "ring.inner", force=d.frame.force(0.0, -force), rotation="free"),
            d.twist("turn", "ring.inner", asked * limit),
        ],
        stage=[{"press": 1.0}, {"turn": 1.0}],
    )
    return Scene(name, "groove", given, refusal=Refusal(SPINS, 1.0 + 1.0 / asked))


def spin(d: Draft, name: str) -> Scene:
    """A ring between two plates, turned by its hub until it spins."""
    mu, radius = d.friction(), d.between(3.0, 8.0)
    materials, soft = d.materials("one")
    force = 1e-3 * soft * radius
    limit, asked = 2.0 * mu * force * radius, 1.5
    given = d.case(
        materials,
        [d.ring("ring", "one", (0.0, radius), (0.4 * radius, radius))],
        contact=[
            d.plane("low", "ring.outer", (0.0, 0.0), (0.0, 1.0), mu),
            d.plane("lid", "ring.outer", (0.0, 2.0 * radius), (0.0, -1.0), mu),
        ],
        load=[
            pushed("press", "lid", **_guided(d, 0.0, -force)),
            d.twist("turn", "ring.inner", asked * limit, force=[0.0, 0.0]),
        ],
        stage=[{"press": 1.0}, {"turn": 1.0}],
    )
    return Scene(name, "spin", given, refusal=Refusal(SPINS, 1.0 + 1.0 / asked))


def brake(d: Draft, name: str) -> Scene:
    """A drum on its axle between two blocks, turned until both slip."""
    mu, radius = d.friction(), d.between(4.0, 9.0)
    materials, soft = d.materials("one", "two")
    force = 1e-3 * soft * radius
    limit, asked = 2.0 * mu * force * radius, 1.5
    half = 0.6 * radius
    given = d.case(
        materials,
        [
            d.ring("drum", "one", (0.0, 0.0), (0.4 * radius, radius)),
            d.block("left", "two", (-1.7 * radius, -radius), (-half, half)),
            d.block("right", "two", (radius, 1.7 * radius), (-half, half)),
        ],
        contact=[
            pair("on-left", "drum.outer", "left.right", mu),
            pair("on-right", "drum.outer", "right.left", mu),
        ],
        load=[
            platen("axle", "drum.inner", displacement=[0.0, 0.0], rotation="free"),
            platen("push-left", "left.left", **_guided(d, force, 0.0)),
            platen("push-right", "right.right", **_guided(d, -force, 0.0)),
            d.twist("turn", "drum.inner", asked * limit),
        ],
        stage=[{"push-left": 1.0, "push-right": 1.0, "axle": 1.0}, {"turn": 1.0}],
    )
    return Scene(name, "brake", given, refusal=Refusal(SPINS, 1.0 + 1.0 / asked))


def _guided(d: Draft, x: float, y: float) -> Table:
    """A force along an axis with the other direction held, in frames at right angles."""
    x, y = d.frame.force(x, y)
    return {"fx": x, "uy": 0.0} if abs(x) > abs(y) else {"fy": y, "ux": 0.0}


def roll(d: Draft, name: str) -> Scene:
    """A disk between two plates, of which the upper one is moved along: it rolls at half of the way."""
    mu, radius = d.friction(0.1), d.between(3.0, 8.0)
    materials, _ = d.materials("one")
    down = 2e-3 * radius
    far = 2e-3 * radius * min(1.0, 3.0 * mu)
    given = d.case(
        materials,
        [d.disk("disk", "one", (0.0, radius), radius)],
        contact=[
            d.plane("low", "disk.arc", (0.0, 0.0), (0.0, 1.0), mu),
            d.plane("lid", "disk.arc", (0.0, 2.0 * radius), (0.0, -1.0), mu),
        ],
        load=[
            pushed("press", "lid", displacement=d.frame.at(0.0, -down)),
            pushed("move", "lid", displacement=d.frame.at(far, 0.0)),
        ],
        stage=[{"press": 1.0}, {"move": 1.0}],
        probe=[{"name": "middle", "body": "disk", "point": d.frame.at(0.0, radius)}],
    )
    axis = np.array(d.frame.turned(1.0, 0.0)) / d.frame.length

    figures = [
        Figure("rolled", lambda r: float(axis @ r.moved("middle")), 0.5 * far, 3.0),
        Figure("along", lambda r: float(d.along(r, "low")[0] / d.along(r, "low")[1]), 0.0, 1.0, mu),
    ]
    return Scene(name, "roll", given, figures)


def logs(d: Draft, name: str) -> Scene:
    """A log on two others: friction holds them, or not."""
    materials, soft = d.materials("wood")
    radius, weight = 10.0, 1e-3 * soft * 10.0
    apart = d.between(10.3, 15.0)
    lean = float(np.arcsin(apart / (2.0 * radius)))
    need = float(np.tan(0.5 * lean))
    # What rubs on the ground is a third of what is needed above.
    mu = need * float(d.rng.choice([0.8, 1.3, 2.0]))
    places = {
        "left": (-apart, radius),
        "right": (apart, radius),
        "top": (0.0, radius * (1.0 + 2.0 * float(np.cos(lean)))),
    }
    b = d.frame.turned(0.0, -weight / (np.pi * radius**2), d.frame.stress / d.frame.length)
    given = d.case(
        materials,
        [d.disk(n, "wood", at, radius) for n, at in places.items()],
        contact=[
            d.plane("under-left", "left.arc", (0.0, 0.0), (0.0, 1.0), mu),
            d.plane("under-right", "right.arc", (0.0, 0.0), (0.0, 1.0), mu),
            pair("on-left", "top.arc", "left.arc", mu),
            pair("on-right", "top.arc", "right.arc", mu),
        ],
        load=[{"name": n, "body": n, "kind": "body-force", "body-force": b} for n in places],
        stage=[dict.fromkeys(places, 1.0)],
    )
    if mu < need:
        return Scene(name, "logs", given, refusal=Refusal((*SLIDES, "hold"), None))
    along = 0.5 * weight * need / float(np.cos(lean) + need * np.sin(lean))
    figures = [
        d.figure("under-left", 1, 1.5 * weight),
        d.figure("under-left", 0, along, 1.0, 0.5 * weight),
        d.figure("under-right", 0, -along, 1.0, 0.5 * weight),
    ]
    return Scene(name, "logs", given, figures)


def feet(d: Draft, name: str) -> Scene:
    """A bridge on two feet of one friction, loaded off its middle, pushed low until it slides."""
    mu, wide, high = d.friction(), d.between(8.0, 14.0), d.between(2.0, 3.0)
    foot = 0.2 * wide
    materials, soft = d.materials("one", "two")
    x = [0.0, foot, foot, wide - foot, wide - foot, wide, wide, 0.0]
    y = [0.0, 0.0, 0.8, 0.8, 0.0, 0.0, high, high]
    names = ["foot1", "in1", "arch", "in2", "foot2", "right", "head", "left"]
    bridge = polygon("bridge", "one", d.frame.places(list(zip(x, y, strict=True))), names=names)
    first, last = d.between(0.2, 0.4) * wide, d.between(0.6, 0.8) * wide
    load = 5e-4 * soft * wide
    limit, asked = mu * load, 1.5
    # A low push tips nobody: its moment is below a tenth of the load's.
    up = min(high, max(0.3, 0.2 * wide / max(mu, 0.1) * 0.3))
    given = d.case(
        materials,
        [bridge, d.block("base", "two", (-0.3 * wide, 1.3 * wide), (-3.0, 0.0))],
        support=[held("base.foot")],
        contact=[
            pair("first", "bridge.foot1", "base.head", mu),
            pair("second", "bridge.foot2", "base.head", mu),
        ],
        load=[
            d.pressure("press", "bridge.head", load / (last - first), [(first, high), (last, high)]),
            d.pressure("push", "bridge.left", asked * limit / up, [(0.0, 0.0), (0.0, up)]),
        ],
        stage=[{"press": 1.0}, {"push": 1.0}],
    )
    return Scene(name, "feet", given, refusal=Refusal(SLIDES, 1.0 + 1.0 / asked))


def hub(d: Draft, name: str) -> Scene:
    """A ring shrunk on a hollow shaft, turned by tractions in the bore until it slips."""
    mu, outer = d.friction(), d.between(8.0, 12.0)
    inner, radius = 2.0, 5.0
    materials, _ = d.materials("one", "two")
    fit = 1e-3 * radius
    given = d.case(
        materials,
        [
            d.ring("shaft", "one", (0.0, 0.0), (inner, radius)),
            d.ring("ring", "two", (0.0, 0.0), (radius, outer)),
        ],
        support=[held("ring.outer")],
        contact=[pair("seat", "shaft.outer", "ring.inner", mu, interference=fit * d.frame.length)],
    )
    plane = given["model"]["plane"]
    one, two = (_flat(materials[key], plane) for key in ("one", "two"))
    compliance = radius / one[0] * ((radius**2 + inner**2) / (radius**2 - inner**2) - one[1])
    # Held outside: u = C (r - outer^2 / r).
    slope = two[0] / (1.0 - two[1] ** 2) * ((1.0 + two[1]) + (1.0 - two[1]) * outer**2 / radius**2)
    compliance += (outer**2 / radius - radius) / slope
    pressure = fit / compliance / d.frame.stress
    limit, asked = mu * pressure * radius**2 / inner**2, 1.5
    size = inner * d.frame.length
    shear = asked * limit * d.frame.stress / size
    given["load"] = [
        {
            "name": "turn",
            "boundary": "shaft.inner",
            "kind": "traction",
            "traction": [f"{-shear:.17g}*y", f"{shear:.17g}*x"],
        }
    ]
    given["stage"] = [{"seat": 1.0}, {"turn": 1.0}]
    return Scene(name, "hub", given, refusal=Refusal(SPINS, 1.0 + 1.0 / asked))


def _flat(material: Table, plane: str) -> Pair:
    """Modulus and ratio of plane stress that do the same."""
    E, nu = material["E"], material["nu"]
    return (E / (1.0 - nu**2), nu / (1.0 - nu)) if plane == "strain" else (E, nu)


def belt(d: Draft, name: str) -> Scene:
    """A belt on a part of a drum slips by Eytelwein's formula."""
    mu, angle = d.friction(0.03, 0.8), d.between(60.0, 200.0)
    radius, thick = 50.0, 1.0
    materials, soft = d.materials("one")
    pull = 2e-4 * soft
    turn = d.frame.angle
    names = {"start": 0.0, "end": angle}
    belted = make_body(
        "belt",
        "one",
        "sector",
        center=d.frame.at(0.0, 0.0),
        radii=[radius * d.frame.length, (radius + thick) * d.frame.length],
        angles=[turn, turn + angle],
    )
    ratio = float(np.exp(mu * np.radians(angle) * radius / (radius + 0.5 * thick)))
    asked = 1.4

    def pulled(load: str, side: str, traction: float) -> Table:
        at = np.radians(names[side])
        way = np.array([-np.sin(at), np.cos(at)]) * (-1.0 if side == "start" else 1.0)
        t = d.frame.turned(*(traction * way), d.frame.stress)
        return {"name": load, "kind": "traction", "boundary": f"belt.{side}", "traction": t}

    obstacle = {"kind": "disk", "center": d.frame.at(0.0, 0.0), "radius": radius * d.frame.length}
    given = d.case(
        materials,
        [belted],
        contact=[{"name": "wrap", "slave": "belt.inner", "obstacle": obstacle, "friction": mu}],
        load=[
            pulled("tight", "start", pull),
            pulled("slack", "end", pull),
            pulled("more", "start", asked * pull * (ratio - 1.0)),
        ],
        stage=[{"tight": 1.0, "slack": 1.0}, {"more": 1.0}],
    )
    return Scene(name, "belt", given, refusal=Refusal(SLIDES, 1.0 + 1.0 / asked))


def wedge(d: Draft, name: str) -> Scene:
    """A wedge between rigid flanks, driven in, then let go: it locks, or slips back."""
    angle = np.radians(d.between(8.0, 35.0))
    s, c = float(np.sin(angle)), float(np.cos(angle))
    locks = bool(d.rng.random() < 0.5)
    mu = float(np.tan(angle)) * (d.between(1.2, 2.0) if locks else d.between(0.05, 0.3))
    materials, soft = d.materials("one")
    high = 10.0
    low, up = 3.0, 3.0 + high * float(np.tan(angle))
    corners = [(-low, 0.0), (low, 0.0), (up, high), (-up, high)]
    body = polygon("wedge", "one", d.frame.places(corners), names=["foot", "right", "head", "left"])
    force = 2e-3 * soft * up
    given = d.case(
        materials,
        [body],
        contact=[
            d.plane("on-left", "wedge.left", corners[0], (c, s), mu),
            d.plane("on-right", "wedge.right", corners[1], (-c, s), mu),
        ],
        load=[d.plate("drive", "wedge.head", 0.0, -force)],
        stage=[{"drive": 1.0}, {"drive": 0.0 if locks else 0.2}],
    )
    if locks:
        # Nothing presses: what the flanks carry is along x.
        figures = [d.figure("on-left", 1, 0.0, 1.0, force)]
    else:
        figures = [d.figure("on-left", 0, 0.1 * force * (c + mu * s) / (s - mu * c))]
    return Scene(name, "wedge", given, figures)


def pad(d: Draft, name: str) -> Scene:
    """A pad with rounded corners is pressed and pushed to and fro: its loop is what it dissipates."""
    mu, wide, high = d.friction(0.05), d.between(3.0, 6.0), d.between(1.0, 3.0)
    materials, soft = d.materials("one", "two")
    press = 1e-3 * soft * wide
    shear = d.between(0.5, 0.9) * mu * press
    given = d.case(
        materials,
        [
            d.block("pad", "one", (-wide / 2, wide / 2), (0.0, high), 0.3 * high),
            d.block("base", "two", (-wide, wide), (-high, 0.0)),
        ],
        support=[held("base.foot")],
        contact=[pair("fret", "pad.foot", "base.head", mu)],
        load=[d.plate("press", "pad.head", 0.0, -press), d.plate("shear", "pad.head", shear, 0.0)],
        stage=[{"press": 1.0}, *({"shear": way} for way in (1.0, -1.0, 1.0, -1.0, 1.0))],
    )

    def ratio(result: Result) -> float:
        with h5py.File(result.folder / "run.h5") as file:
            work, place = file["contacts/fret/dissipated_work"][:], file["path/position"][:]
            moved = file["path/displacements/shear"][:]
        # What is pushed settles in the first turn: the second one closes.
        later = place >= 4.0 - 1e-9
        factor = np.interp(place[later], [4.0, 5.0, 6.0], [1.0, -1.0, 1.0])
        force = np.array(d.frame.force(shear, 0.0))
        along = moved[later] @ force
        # Chords of two sizes tell what lies between a curve and its chords.
        turn = int(np.argmin(factor))
        every, other = np.arange(len(factor)), np.r_[0 : turn + 1 : 2, turn, turn : len(factor) : 2, -1]
        fine, coarse = (
            float((0.5 * (f[1:] + f[:-1]) * np.diff(u)).sum())
            for f, u in ((factor[one], along[one]) for one in (every, other))
        )
        loop = fine + (fine - coarse) / 3.0
        # What settles to rest hardly has a loop: then it counts against the elastic work.
        least = 0.01 * float(np.ptp(along))
        return 1.0 + (float(work[later][-1] - work[later][0]) - loop) / max(loop, least)

    return Scene(name, "pad", given, [Figure("dissipated over loop", ratio, 1.0, 0.1)])


KINDS: dict[str, Callable[[Draft, str], Scene]] = {
    one.__name__: one
    for one in (slide, tip, between, lining, groove, spin, brake, roll, logs, feet, hub, belt, wedge, pad)
}
