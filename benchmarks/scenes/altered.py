"""Scenes with other materials, loads and friction, judged by variants instead of figures."""

from __future__ import annotations

import copy
import zlib
from dataclasses import replace

import numpy as np

from benchmarks.scenes.scene import Scene
from benchmarks.scenes.variants import times

POISSON_RATIOS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.45, 0.48)
MODULI = ("E", "E1", "E2", "E3", "G12")
LOADS = (
    *("traction", "pressure", "force", "fx", "fy", "moment", "displacement", "ux", "uy"),
    *("body-force", "rotation", "temperature"),
)
PLANES = {"strain": "stress", "stress": "strain"}


def altered(scene: Scene, seed: int) -> Scene:
    """The scene with moduli up to 5 times larger or smaller, other Poisson's ratios, all loads 0.5 to 1.6
    times as large, and friction, interferences and the plane changed. It has no figures and no limit load."""
    rng = np.random.default_rng([seed, zlib.crc32(scene.name.encode())])
    given = copy.deepcopy(scene.case)
    for material in given["material"].values():
        factor = float(10.0 ** rng.uniform(-0.7, 0.7))
        material.update({key: factor * material[key] for key in MODULI if key in material})
        if "nu" in material:
            material["nu"] = float(rng.choice(POISSON_RATIOS))
    factor = float(rng.uniform(0.5, 1.6))
    for load in given.get("load", []):
        load.update({key: times(load[key], factor) for key in LOADS if key in load})
    for contact in given.get("contact", []):
        friction = contact.get("friction")
        if isinstance(friction, float):
            contact["friction"] = float(rng.uniform(0.6, 1.5)) * friction or float(
                rng.choice([0.0, 0.0, 0.1, 0.3])
            )
        if isinstance(contact.get("interference"), float):
            contact["interference"] *= float(rng.uniform(0.6, 1.4))
    if rng.random() < 0.3:
        given["model"]["plane"] = PLANES[given["model"]["plane"]]
    # References are found by name.
    name = f"{scene.name} altered"
    return replace(scene, name=name, case=given, figures=(), refusal=None, elements=False)
