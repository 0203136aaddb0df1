"""Random scenes with friction whose forces or limit loads statics tells, in any frame and any units.

Drawn for ``random_scenes.py --limits``: blocks that slide or tip, plates between two blocks, linings, disks
that spin in grooves, between plates and between brake blocks, or roll, logs, feet, shrunk hubs, belts, wedges
that lock or slip back, pads that are pushed to and fro. Friction coefficients are 0.01 to 1.5.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import h5py
import numpy as np

from benchmarks.scenes.parts import body as make_body
from benchmarks.scenes.parts import held, pair, polygon
from benchmarks.scenes.random_draft import SLIDES, TIPS, Draft
from benchmarks.scenes.random_frames import drawn_frame
from benchmarks.scenes.random_rounds import brake, groove, hub, logs, roll, spin
from benchmarks.scenes.scene import Figure, Refusal, Result, Scene, Table

GUIDED = ("between", "spin", "brake")
"""Scenes whose supports leave one axis of the drawing free."""


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
