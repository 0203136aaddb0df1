"""Random scenes of two curved bodies: any contrast of stiffness, curvature, offset, friction, nu up to 0.49.

Drawn for ``random_scenes.py --pairs``. Both bodies are blocks; their facing sides are curves, convex or
hollow, with a slope where they meet.
"""

from __future__ import annotations

import numpy as np

from benchmarks.scenes.parts import body as make_body
from benchmarks.scenes.parts import case, held, pair, platen, probe
from benchmarks.scenes.scene import Array, Table

POINTS = 41


def drawn_pair(number: int) -> tuple[Table, list[str]]:
    """The case of a number, and the contacts that no sharp corner can reach."""
    rng = np.random.default_rng([13, number])
    contrast = 10.0 ** rng.uniform(-3.0, 3.0)
    moduli = 1e3 * np.array([1.0, contrast])
    ratios = rng.uniform(0.0, 0.49, 2)
    plane = str(rng.choice(["strain", "stress"]))
    wide, high = float(rng.uniform(2.0, 8.0)), float(rng.uniform(2.0, 5.0))
    radius = wide * float(10.0 ** rng.uniform(-0.3, 1.5))
    # Of the lower side, as a part of the relative one: hollow, flat or convex.
    own = float(rng.choice([0.0, rng.uniform(-3.0, -0.2), rng.uniform(0.2, 0.8)]))
    own = float(np.clip(own / radius, -0.6 / wide, 0.6 / wide))
    other = 1.0 / radius - own
    offset = float(rng.uniform(-0.15, 0.15)) * wide
    skew = float(rng.uniform(-0.3, 0.3)) / wide
    half = float(10.0 ** rng.uniform(-1.6, -0.6)) * wide
    half = min(half, 0.3 * radius)
    x = np.linspace(-0.5, 0.5, POINTS)

    def lower_side(x: Array) -> Array:
        return -0.5 * own * x**2 * (1.0 + skew * x)

    base_wide = 2.0 * wide
    low = base_wide * x
    up = offset + wide * x
    above = 0.5 * other * (up - offset) ** 2
    above += float((lower_side(up) - above).max())
    top = float(above.max()) + high
    below, face = _points(low, lower_side(low)), _points(up, above)
    lower = make_body(
        "lower",
        "one",
        "outline",
        sides=[
            {"name": "left", "to": [float(low[0]), -high]},
            {"name": "bottom", "to": [float(low[-1]), -high]},
            {"name": "right", "to": below[-1]},
            {"name": "face", "points": below[::-1]},
        ],
    )
    upper = make_body(
        "upper",
        "two",
        "outline",
        sides=[
            {"name": "face", "points": face},
            {"name": "right", "to": [float(up[-1]), top]},
            {"name": "top", "to": [float(up[0]), top]},
            {"name": "left", "to": face[0]},
        ],
    )
    plane_moduli = moduli / (1.0 - ratios**2) if plane == "strain" else moduli
    force = np.pi * half**2 / (4.0 * radius) / float((1.0 / plane_moduli).sum())
    friction = float(rng.choice([0.0, rng.uniform(0.05, 0.8)]))
    loads = [platen("press", "upper.top", fy=-force, ux=0.0)]
    stages = [{"press": 1.0}]
    if friction and rng.random() < 0.7:
        loads[0].pop("ux")
        slope = abs(float(own * offset)) + 0.05
        loads.append(
            platen(
                "shear", "upper.top", fx=float(rng.uniform(-0.6, 0.6)) * max(friction - slope, 0.02) * force
            )
        )
        stages.append({"shear": 1.0})
    return case(
        plane,
        {
            name: {"E": float(E), "nu": float(nu)}
            for name, E, nu in zip(("one", "two"), moduli, ratios, strict=True)
        },
        [lower, upper],
        support=[held("lower.bottom")],
        contact=[pair("joint", "upper.face", "lower.face", friction)],
        load=loads,
        stage=stages,
        probe=[probe("middle", "upper", offset, top - 0.5 * high)],
    ), ["joint"]


def _points(x: Array, y: Array) -> list[list[float]]:
    return np.column_stack([x, y]).tolist()
