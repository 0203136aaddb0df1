"""Random scenes with friction: no accepted state may break a law (random_scenes.py --friction).

Half-disks and blocks on blocks, friction coefficients from 0.05 to 1.5, stiffness ratios from 1 to 100, shear
inside and beyond the friction limit under force or displacement control, three to five random stages, exact
and smooth law.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mlsanm_cli.io.run_reader import Dataset
from tests.case_text import box, half_disk, head

DISK = half_disk([0.0, 1.0], 1.0)
BLOCK, LOWER = box([-0.5, 0.5], [0.0, 0.6]), box([-1.0, 1.0], [-1.0, 0.0])
ZONE = {"at": [0.0, 0.0], "radius": 0.07, "growth": 0.3}


def scene(seed: int, law: str) -> str:
    """A random case."""
    rng = np.random.default_rng(seed)
    disk = rng.uniform() < 0.6
    mu = float(np.exp(rng.uniform(np.log(0.05), np.log(1.5))))
    ratio = float(np.exp(rng.uniform(0.0, np.log(100.0))))
    nu, nu_stiff = rng.uniform(0.0, 0.45, 2)
    modulus = 1.0 / ((1.0 - nu**2) + (1.0 - nu_stiff**2) / ratio)
    half = rng.uniform(0.02, 0.06)
    force = float(0.25 * np.pi * modulus * half**2) if disk else float(rng.uniform(1e-4, 5e-3))
    forced = rng.uniform() < 0.6
    limit = mu * force
    shear = limit * rng.uniform(0.3, 1.6) if forced else limit / modulus * rng.uniform(1.0, 8.0)
    stages = ["press" if rng.uniform() < 0.8 else "press shear=0.3"]
    for _ in range(rng.integers(2, 5)):
        stage = f"shear={rng.choice([-1.0, -0.5, 0.0, 0.5, 1.0])}"
        if rng.uniform() < 0.3:
            stage += f" press={rng.uniform(0.6, 1.5)}"
        stages.append(stage)
    plane = str(rng.choice(["strain", "stress"]))
    top, slave, shape = ("flat", "arc", DISK) if disk else ("top", "bottom", BLOCK)
    upper, lower = (0.15, 0.15) if disk else (0.07, 0.09)
    fine = [0.006, 0.006 * rng.uniform(0.8, 1.3)] if disk else []
    refine: list[Any] = [[ZONE | {"spacing": float(spacing)}] for spacing in fine] or [None, None]
    return (
        head(plane)
        .material("soft", E=1.0, nu=float(nu))
        .material("stiff", E=ratio, nu=float(nu_stiff))
        .body("upper", "soft", upper, shape, seed=seed, refine=refine[0])
        .body("lower", "stiff", lower, LOWER, seed=seed, refine=refine[1], clamped="bottom")
        .load("press", f"upper.{top}", "platen", fy=-force)
        .load("shear", f"upper.{top}", "platen", **{"fx" if forced else "ux": float(shear)})
        .contact("interface", f"upper.{slave}", "lower.top", friction=mu, regularization={"law": law})
        .stages(*stages)
    )


def faults(summary: Mapping[str, Any], contact: Dataset, law: str) -> list[str]:
    """What is wrong with the states of a run that were accepted. The friction limit of the regularised law is
    mu (p + eta): where pressures vanish, its tractions are beyond mu p."""
    found = []
    figures = summary["contacts"]["interface"]
    if law == "exact" and figures["max_cone_ratio"] > 1.0 + 1e-7:  # of pressures 1e-6 of the largest, too
        found.append(f"cone {figures['max_cone_ratio']}")
    work = contact.dissipated_work
    if np.diff(work).min(initial=0.0) < -1e-8 * np.abs(work).max(initial=0.0):
        found.append("work falls")
    # Pressures and tractions on the slave are what the platen, its only other support, exerts.
    n_x, n_y = contact.normal[0]
    pressed, rubbed = contact.pressure[-1] @ contact.weight, contact.traction[-1] @ contact.weight
    own = np.array([pressed * n_x + rubbed * n_y, pressed * n_y - rubbed * n_x])
    applied = sum(np.array(summary["forces"][load]) for load in ("press", "shear"))
    # Tractions are linear along the surface, not lumped at its nodes.
    if np.abs(own + applied).max() > 2e-5 * np.abs(applied).max():
        found.append(f"balance {own} {applied}")
    if summary["residual"] > 1e-8:
        found.append(f"residual {summary['residual']}")
    return found
