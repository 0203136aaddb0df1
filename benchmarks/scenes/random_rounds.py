"""Random scenes of :mod:`random_limits` with round bodies: disks that spin or roll, logs, hubs."""

from __future__ import annotations

import numpy as np

from benchmarks.scenes.parts import Pair, held, pair, platen, pushed
from benchmarks.scenes.random_draft import SLIDES, SPINS, Draft
from benchmarks.scenes.scene import Figure, Refusal, Scene, Table


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
