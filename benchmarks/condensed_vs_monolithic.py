"""Condensed against monolithic ANM: CPU time of a whole path over the number of nodes.

    python benchmarks/condensed_vs_monolithic.py [--budget SECONDS] [--sizes N]

``cases/hertz.toml`` at eta = 1e-3 on clouds of 2,000 to 50,000 nodes, both routes on the same clouds,
operators, scales and tolerance, one after the other in one process with warm kernels, one thread. Times are
CPU seconds of the program's own phases. Set-up is clouds, operators and the bodies' factors for both, and the
condensation for the condensed route. The monolithic one borrows its scales from there and is not charged for
it; it is charged for its own tangents alone. A monolithic path that would take more than the budget is
stopped after a step, and the rest of its path counted at the same CPU time per factorisation, as many as the
condensed path needed: such results are marked ``stopped``. Writes condensed_vs_monolithic.json and .png to
benchmarks/results.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from mlsanm_cli.app.context import Clock, RunContext
from mlsanm_cli.app.scene.build import build_scene
from mlsanm_cli.app.scene.condense import condense_scene
from mlsanm_cli.case import load_case
from mlsanm_cli.solve.paths import path_of
from mlsanm_cli.solve.state import State

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from tests.app.scenes import Quiet  # noqa: E402

CASE = ROOT / "cases" / "hertz.toml"
# Spacing far away, under the contact, and its growth.
SIZES = (
    (0.2, 0.004, 0.25),
    (0.1, 0.004, 0.12),
    (0.05, 0.003, 0.08),
    (0.03, 0.003, 0.05),
    (0.018, 0.003, 0.03),
)
SHARED = ("cloud", "operators", "factorization")
AT = (0.25, 0.5, 0.75, 1.0)


def settings(far: float, fine: float, growth: float) -> tuple[str, ...]:
    """Overrides of the case."""
    chosen = ["contact.interface.regularization.eta=1e-3", f"output.at={list(AT)}"]
    for body in ("cylinder", "block"):
        chosen.append(f"body.{body}.spacing={far}")
        for number, spacing in enumerate((fine, fine / 4.0, fine / 4.0)):
            zone = f"body.{body}.refine.{number}"
            chosen += [f"{zone}.spacing={spacing}", f"{zone}.growth={growth}"]
    return tuple(chosen)


def measure(
    formulation: str, overrides: tuple[str, ...], budget: float
) -> tuple[dict[str, Any], list[State]]:
    """Times and counts of one path, and the states at common load levels."""
    loaded = load_case(CASE, (*overrides, 'solver.method="anm"', f'solver.formulation="{formulation}"'))
    clock = Clock()
    context = RunContext(clock, Quiet())
    built = condense_scene(loaded.case, build_scene(loaded, context), context)
    steps, states, stopped = [], [], False
    path = path_of(built)
    while True:
        with clock.phase("continuation"):
            step = next(path, None)
        if step is None:
            break
        steps.append(step)
        states += step.saved
        if clock.seconds["continuation"] > budget and step.state.position < AT[-1]:
            stopped = True
            break
    own = SHARED if formulation == "monolithic" else (*SHARED, "condensation")
    figures = {
        "nodes": sum(len(body.model.cloud.points) for body in built.scene.bodies.values()),
        "contact_nodes": len(built.condensed.weight),
        "set_up": sum(clock.seconds[phase] for phase in own),
        "condensation": clock.seconds["condensation"],
        "continuation": clock.seconds["continuation"],
        "steps": len(steps) - 1,
        "factorizations": sum(step.factorizations for step in steps),
        "solves": sum(step.solves for step in steps),
        "stopped": stopped,
    }
    return figures, states


def compared(overrides: tuple[str, ...], budget: float) -> dict[str, Any]:
    """Both routes on one cloud."""
    condensed, ours = measure("condensed", overrides, np.inf)
    monolithic, theirs = measure("monolithic", overrides, budget)
    if monolithic["stopped"]:
        monolithic["continuation"] *= condensed["factorizations"] / monolithic["factorizations"]
    for one in (condensed, monolithic):
        one["seconds"] = one["set_up"] + one["continuation"]
    peak = max(float(state.pressure.max()) for state in ours)
    differences = [
        float(np.abs(a.pressure - b.pressure).max()) / peak for a, b in zip(ours, theirs, strict=False)
    ]
    return {
        "condensed": condensed,
        "monolithic": monolithic,
        "ratio": monolithic["seconds"] / condensed["seconds"],
        "largest_difference_of_pressure": max(differences, default=None),
    }


def draw(path: Path, results: list[dict[str, Any]]) -> None:
    """CPU seconds over nodes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    nodes = [one["condensed"]["nodes"] for one in results]
    for route, marker, colour in (("condensed", "o", "C0"), ("monolithic", "s", "C1")):
        axes.loglog(
            nodes, [one[route]["seconds"] for one in results], f"-{marker}", color=colour, label=route
        )
        axes.loglog(
            nodes, [one[route]["set_up"] for one in results], ":", color=colour, label=f"{route}, set-up"
        )
    cut = [one["monolithic"] for one in results if one["monolithic"]["stopped"]]
    if cut:
        axes.loglog(
            [one["nodes"] for one in cut],
            [one["seconds"] for one in cut],
            "s",
            color="C1",
            mfc="white",
            label="stopped, the rest by its rate",
        )
    for one in results:
        place = (one["monolithic"]["nodes"], one["monolithic"]["seconds"])
        axes.annotate(f"{one['ratio']:.0f}x", place, textcoords="offset points", xytext=(-6, 7), ha="right")
    axes.set(xlabel="nodes", ylabel="CPU seconds, one thread")
    axes.set_title("Hertz contact, eta = 1e-3: a whole path by ANM")
    axes.grid(which="both", alpha=0.3)
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--budget", type=float, default=150.0, help="CPU seconds of one monolithic path")
    parser.add_argument("--sizes", type=int, default=len(SIZES), help="how many clouds, the smallest first")
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks" / "results")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for formulation in ("condensed", "monolithic"):  # kernels loaded before anything counts
        measure(formulation, settings(*SIZES[0]), 1.0)
    results = []
    for size in SIZES[: arguments.sizes]:
        one = compared(settings(*size), arguments.budget)
        results.append(one)
        condensed, monolithic = one["condensed"], one["monolithic"]
        difference = one["largest_difference_of_pressure"]
        seen = "none seen" if difference is None else f"{difference:.1e}"
        print(
            f"{condensed['nodes']:6d} nodes  condensed {condensed['seconds']:7.2f} s  "
            f"monolithic {monolithic['seconds']:8.2f} s{' (stopped)' if monolithic['stopped'] else ''}  "
            f"ratio {one['ratio']:.1f}  difference {seen}",
            flush=True,
        )
        (arguments.out / "condensed_vs_monolithic.json").write_text(json.dumps(results, indent=1) + "\n")
        draw(arguments.out / "condensed_vs_monolithic.png", results)


if __name__ == "__main__":
    main()
