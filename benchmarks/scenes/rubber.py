"""Scenes at finite strain: bushes, rolls, seals and bodies that pass each other.

Finite elements are total Lagrangian with Newton's method: nine-node quads (72 x 8 and 48 x 8 graded),
six-node triangles (8,192 in a disk), pressures by penalties, extrapolated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.scenes.scene import (
    Figure,
    Result,
    Scene,
    Table,
    body,
    case,
    force_at,
    held,
    on_plane,
    pair,
    platen,
    pushed,
    scene,
)

SOFT = {"rubber": {"E": 3.0, "nu": 0.4, "law": "neo-hookean"}}


def finite(materials: Mapping[str, Table], bodies: Sequence[Table], **rest: Any) -> Table:
    """A case in plane strain at finite strain."""
    made = case("strain", materials, bodies, **rest)
    made["model"]["strain"] = "finite"
    return made


@scene
def rubber_bush_turned() -> Scene:
    """A bush whose sleeve is pressed by a quarter of its wall and turned by 23 degrees."""
    given = finite(
        {"rubber": {"E": 3.0, "nu": 0.44, "law": "neo-hookean"}},
        [body("bush", "rubber", "annulus", center=[0.0, 0.0], radii=[10.0, 20.0])],
        support=[held("bush.outer")],
        load=[platen("sleeve", "bush.inner", ux=2.5, uy=-1.0, rotation=0.4, hinge=[0.0, 0.0])],
    )
    figures = [
        Figure("force x", lambda r: r.exerted("sleeve")[0], 102.328),
        Figure("force y", lambda r: r.exerted("sleeve")[1], -40.931),
    ]
    return Scene("rubber_bush_turned", "finite strain", given, figures)


@scene
def rubber_halves_pass() -> Scene:
    """Half a disk is pushed over another one, from aside until it is on its top."""
    given = finite(
        SOFT,
        [
            body("low", "rubber", "half-disk", center=[0.0, 0.0], radius=10.0, side="upper"),
            body("high", "rubber", "half-disk", center=[-9.0, 18.5], radius=10.0, side="lower"),
        ],
        support=[held("low.flat")],
        load=[platen("push", "high.flat", ux=9.0, uy=0.0)],
        contact=[pair("nip", "high.arc", "low.arc")],
    )
    figures = [
        Figure("force y", force_at("nip", 1), 2.2455),
        Figure("force x", force_at("nip", 0), 0.0, scale=2.2455),
    ]
    return Scene("rubber_halves_pass", "finite strain", given, figures)


@scene
def rubber_roll_flattened() -> Scene:
    """A roll between two plates that come closer by three tenths."""
    given = finite(
        SOFT,
        [body("roll", "rubber", "disk", center=[0.0, 0.0], radius=10.0)],
        load=[pushed("press", "upper", uy=-6.0)],
        contact=[
            on_plane("upper", "roll.arc", (0.0, 10.0), (0.0, -1.0)),
            on_plane("lower", "roll.arc", (0.0, -10.0), (0.0, 1.0)),
        ],
    )
    figures = [
        Figure("force above", force_at("upper", 1, -1.0), 14.799),
        Figure("force below", force_at("lower", 1), 14.799),
    ]
    return Scene("rubber_roll_flattened", "finite strain", given, figures)


@scene
def bulb_seal() -> Scene:
    """Half a tube, clamped at both ends, that a door squeezes by a quarter of its height."""
    given = finite(
        SOFT,
        [body("bulb", "rubber", "sector", center=[0.0, 0.0], radii=[4.0, 6.0], angles=[0.0, 180.0])],
        support=[held("bulb.start"), held("bulb.end")],
        load=[pushed("shut", "door", uy=-1.5)],
        contact=[on_plane("door", "bulb.outer", (0.0, 6.0), (0.0, -1.0))],
    )
    figures = [Figure("force y", force_at("door", 1, -1.0), 0.7875)]
    return Scene("bulb_seal", "finite strain", given, figures)


@scene
def rubber_ring_rolled() -> Scene:
    """A thick ring pressed on a rough road and rolled by 1 radian, 5 % further than its hub turns."""
    given = finite(
        {"rubber": {"E": 3.0, "nu": 0.3, "law": "neo-hookean"}},
        [body("ring", "rubber", "annulus", center=[0.0, 1.0], radii=[0.5, 1.0])],
        load=[
            platen("press", "ring.inner", uy=-0.05, rotation=0.0, hinge=[0.0, 1.0]),
            platen("roll", "ring.inner", ux=1.05, rotation=-1.0, hinge=[0.0, 1.0]),
        ],
        contact=[on_plane("road", "ring.outer", (0.0, 0.0), (0.0, 1.0), 0.5)],
        stage=[{"press": 1.0}, {"roll": 1.0}],
    )
    # Fifty increments.
    figures = [
        Figure("force x", force_at("road", 0), -0.0524, 2.0),
        Figure("force y", force_at("road", 1), 0.1675),
    ]
    return Scene("rubber_ring_rolled", "finite strain", given, figures)


def column(name: str, **rest: Any) -> Table:
    """A column of eight thicknesses, whose foot is clamped; its load is called press."""
    steel = {"E": 1000.0, "nu": 0.0, "law": "saint-venant-kirchhoff"}
    column = body(name, "steel", "rectangle", x=[-0.5, 0.5], y=[0.0, 8.0])
    return finite({"steel": steel}, [column], support=[held(f"{name}.bottom")], **rest)


def lost_at(result: Result) -> float:
    """Position of the first loss of stability."""
    return float(result.summary["finite_strain"]["bifurcations"][0]["position"])


@scene
def column_buckles() -> Scene:
    """Straight, under 1.1 of the force that it bears: by 6 x 24 nine-node quads, and Euler's less 1.4 %."""
    load = {"name": "press", "boundary": "column.top", "kind": "traction", "traction": [0.0, -1.1 * 3.16779]}
    figures = [Figure("critical part", lost_at, 1.0 / 1.1)]
    return Scene("column_buckles", "finite strain", column("column", load=[load]), figures)


@scene
def column_between_walls() -> Scene:
    """Its top goes down by twice the shortening that it bears, and does not turn."""
    load = {"name": "press", "boundary": "column.top", "kind": "displacement", "uy": -0.2}
    walls = [
        on_plane(name, f"column.{name}", (side * 0.7, 0.0), (-side, 0.0))
        for name, side in (("left", -1.0), ("right", 1.0))
    ]
    figures = [Figure("critical part", lost_at, 0.0123908 * 8.0 / 0.2)]
    given = column("column", load=[load], contact=walls)
    return Scene("column_between_walls", "finite strain", given, figures)
