"""``mlsanm check``: everything except solving; ``mlsanm warmup``: compilation of the kernels."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mlsanm_cli.app.checks.check import Verdicts, all_of
from mlsanm_cli.app.checks.quality import MODEL, Quality, assess, ratio_message
from mlsanm_cli.app.checks.references import read_case
from mlsanm_cli.app.context import Clock, Console, RunContext
from mlsanm_cli.app.output.parts import model_bodies
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.build import build_scene, cpu_seconds, load_kernels, memory_mb, node_counts
from mlsanm_cli.app.scene.loads import amounts_of, table_of
from mlsanm_cli.case import Case, Force, ObstacleMotion, Platen
from mlsanm_cli.io.vtu import write_parts
from mlsanm_cli.kernels.aot.jit import is_warm
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

NOTED_RATIO = 1.5
"""Ratio of facing spacings above which there is a note; ``quality`` warns if it affects the result."""


def check(
    case_path: Path,
    *,
    overrides: tuple[str, ...] = (),
    write: Path | None = None,
    picture: Path | None = None,
    threads: int = 1,
    console: Console,
) -> Mapping[str, Any]:
    """Validates a case, builds its scene, and reports sizes, quality and cost. ``write`` is a VTU file of the
    model, ``picture`` a picture of it. Raises the errors that ``run`` raises before it solves."""
    clock = Clock()
    loaded = read_case(case_path, overrides)
    case = loaded.case
    prepared = build_scene(loaded, RunContext(clock, console))
    quality = assess(case, prepared)
    warnings: list[str] = []
    Verdicts(lambda check: warnings.append(check.text)).judge(all_of(MODEL, quality))
    for warning in warnings:
        console.warning(warning)
    if write is not None:
        write_parts(write, "body", model_bodies(prepared))
        console.note(f"model written to {write}")
    if picture is not None:
        from mlsanm_cli.app.results.marks import draw_model

        draw_model(picture, case, prepared)
        console.note(f"picture written to {picture}")
    unknowns = sum(int(p.candidate.sum()) * (2 if p.friction else 1) for p in prepared.pairings)
    nodes = sum(int(body["nodes"]) for body in quality.bodies.values())
    return {
        "case": str(case_path),
        "title": case.title,
        "plane": case.model.plane,
        "nodes": nodes,
        "unknowns": 2 * nodes,
        # Contact grids are refined in the run.
        "contact_unknowns": None if prepared.ranges else unknowns,
        "loads": len(case.moved),
        "stages": len(case.stage),
        "estimated_memory_mb": round(memory_mb(case, node_counts(prepared.boundaries))),
        "estimated_cpu_seconds": round(cpu_seconds(case, prepared), 1),
        "bodies": {
            name: figures | {"finest": float(prepared.models[name].cloud.spacing.min())}
            for name, figures in quality.figures(prepared.models)["bodies"].items()
        },
        "contacts": {
            one.name: {
                "slave_nodes": len(one.slave.index),
                "paired": len(one.position),
                "candidates": int(one.candidate.sum()),
                "smallest_gap": float(one.gap[one.candidate].min()),
                "reach": float(one.gap[one.candidate].max()),
                "spacing_ratio": quality.spacing_ratio[one.name],
            }
            for one in prepared.pairings
        },
        "boundaries": _conditions(case),
        "notes": [*prepared.notes, *_notes(prepared, quality, warnings)],
        "warnings": warnings,
        "seconds": {phase: clock.seconds[phase] for phase in ("jit", "cloud", "operators")},
        "threads": threads,
    }


def _conditions(case: Case) -> dict[str, dict[str, str]]:
    """Conditions on every boundary (or single node) in x and y; boundaries not listed are free."""
    found: dict[str, dict[str, str]] = {}

    def add(where: str, x: str, y: str) -> None:
        row = found.setdefault(where, {"x": "", "y": ""})
        for axis, text in (("x", x), ("y", y)):
            row[axis] = ", ".join(filter(None, (row[axis], text)))

    for support in case.support:
        place = f"{support.body} near {support.near}" if support.place is None else support.place.label
        springs = [f"spring {k:g}" if k else "" for k in support.spring or (0.0, 0.0)]
        held = ["" if value is None else "held" for value in (support.ux, support.uy)]
        add(place, *(", ".join(filter(None, both)) for both in zip(held, springs, strict=True)))
    for load in case.load:
        if isinstance(load, ObstacleMotion):
            place = f"obstacle of {load.obstacle}"
        else:
            place = " and ".join(place.label for place in load.places) or load.owner
        if isinstance(load, Platen | ObstacleMotion):
            moved = {axis: f"{kind} {value:g}" for axis, (kind, value) in load.control.items()}
            described = [moved.get(axis, "") for axis in "xy"]
        else:
            amounts = [part or None for part in load.total] if isinstance(load, Force) else amounts_of(load)
            amounts = ("table",) if table_of(load) else amounts
            texts = [
                "" if part is None else part if isinstance(part, str) else f"{part:g}" for part in amounts
            ]
            # One amount acts in both directions.
            described = [f"{load.kind} {text}" if text else "" for text in (*texts, *texts, "", "")[:2]]
        add(place, *(f"{text} ({load.name})" if text else "" for text in described))
    for contact in case.contact:
        for role, label in zip(("slave", "master"), contact.names, strict=False):
            add(label, *[f"{role} of {contact.name}"] * 2)
    return {where: {axis: text or "free" for axis, text in row.items()} for where, row in found.items()}


def _notes(prepared: SceneModel, quality: Quality, warnings: Collection[str]) -> list[str]:
    """Notes on contact pairs and stencils that need no warning."""
    notes = []
    for pairing in prepared.pairings:
        ratio = quality.spacing_ratio[pairing.name]
        message = "; ".join(ratio_message(pairing, ratio))
        if pairing.name in prepared.ranges:
            notes.append(f"contact {pairing.name}: pressures use a contact grid unless they reach a corner")
        elif ratio > NOTED_RATIO and message not in warnings:
            notes.append(message)
        drawn = float(pairing.gap.min()) if pairing.interference == 0.0 and not pairing.bonded else 0.0
        if -drawn > COARSE_ROUND_OFF * float(np.abs(pairing.points).max()):
            notes.append(
                f"contact {pairing.name}: the surfaces overlap by {-drawn:.3g} as drawn and press on each "
                f"other before any load; draw them touching, or give contact.{pairing.name}.interference"
            )
        unpaired = len(pairing.slave.index) - len(pairing.position)
        if unpaired:
            other = "obstacle" if pairing.master is None else "master"
            notes.append(f"contact {pairing.name}: {unpaired} slave nodes do not face the {other}")
    for name, model in prepared.models.items():
        if model.stencils.enlarged:
            notes.append(
                f"body {name}: {model.stencils.enlarged} stencils needed more nodes than "
                f"{model.settings.stencil_size}; an even cloud (lower growth) avoids that"
            )
    return notes


def warmup(console: Console) -> Mapping[str, Any]:
    """Compiles the kernels, or loads them. Returns CPU ``seconds``, whether they were ``compiled`` now, and
    whether the code is ``kept`` for later runs, in which ``cache_directory``."""
    clock = Clock()
    with clock.phase("jit"):
        warm = is_warm()
    place = load_kernels(RunContext(clock, console)).place
    return {
        "seconds": clock.seconds["jit"],
        "compiled": not warm,
        "kept": place is not None,
        "cache_directory": None if place is None else str(place),
    }
