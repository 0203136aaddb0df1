"""ANM against Newton-Raphson, eta-homotopy and exact contact, on the same condensed operators.

    python benchmarks/anm_vs_newton.py [--repeat 3] [--sweep] [--out benchmarks/results]

Hertz (cases/hertz.toml, about 120 contact nodes): the whole path by series of order 5 to 40, Taylor and Pade;
by Newton-Raphson with adapted steps, and with 10 and 20 levels given; eta lowered at full load; active set at
full load, and at 10 and 20 levels. Partial slip (cases/cattaneo_mindlin.toml, hyperbolic law): four stages by
ANM, by Newton-Raphson, and exactly from event to event. CPU seconds are those of the contact problem alone,
of Hertz medians; partial slip takes seconds and is run once. With --sweep also whether every combination of
order, tolerance, eta and friction, on coarse clouds, ends within its tolerance or says why not.

Writes anm_vs_newton.json and .png, and anm_sweep.json. Compare ratios within one run.
"""

from __future__ import annotations

import argparse
import itertools
import json
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.eta_homotopy import lowered  # noqa: E402
from mlsanm_cli.solve.series import coupling_of, problem_of, regularization, start_point  # noqa: E402

from mlsanm_cli.app.context import Clock, RunContext  # noqa: E402
from mlsanm_cli.app.scene.build import build_scene  # noqa: E402
from mlsanm_cli.app.scene.condense import condense_scene  # noqa: E402
from mlsanm_cli.arrays import FloatArray  # noqa: E402
from mlsanm_cli.case import load_case  # noqa: E402
from mlsanm_cli.contact.laws.active_set import solve_exact  # noqa: E402
from mlsanm_cli.continuation import AnmOptions, Follower, NewtonOptions, follow  # noqa: E402
from mlsanm_cli.errors import NumericalError  # noqa: E402
from mlsanm_cli.solve.condensed_scene import CondensedScene  # noqa: E402
from mlsanm_cli.solve.paths import load_path  # noqa: E402
from mlsanm_cli.solve.stages import factors_at  # noqa: E402
from mlsanm_cli.solve.state import PathStep  # noqa: E402
from tests.app.scenes import Quiet, hertz  # noqa: E402

ETAS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5)
ORDERS = (5, 10, 15, 20, 30, 40)
LEVELS = (10, 20)
SMOOTH = 'contact.interface.regularization.law="hyperbolic"'
FINER = [
    f"body.{body}.refine.{number}.spacing={spacing}"
    for body in ("cylinder", "block")
    for number, spacing in enumerate((0.0028, 0.00035, 0.00035))
]
Row = dict[str, Any]


def build(path: Path, *settings: str) -> CondensedScene:
    """A case, condensed."""
    loaded, context = load_case(path, settings), RunContext(Clock(), Quiet())
    return condense_scene(loaded.case, build_scene(loaded, context), context)


def with_eta(built: CondensedScene, eta: float, **solver: Any) -> CondensedScene:
    """The same operators with another eta and other solver settings."""
    (contact,) = built.case.contact
    law = contact.regularization.model_copy(update={"eta": eta})
    settings = built.case.solver.model_copy(update=solver)
    case = built.case.model_copy(
        update={"contact": (contact.model_copy(update={"regularization": law}),), "solver": settings}
    )
    return replace(built, case=case)


def timed(work: Callable[[], Row], repeat: int) -> Row:
    """What ``work`` says of itself, and its median CPU time."""
    seconds = []
    for _ in range(repeat):
        begun = time.process_time()
        row = work()
        seconds.append(time.process_time() - begun)
    return row | {"cpu_seconds": statistics.median(seconds)}


def walked(follower: Follower) -> tuple[Row, FloatArray]:
    """Counts of a path, and its last unknowns."""
    for _ in follower.steps():
        pass
    end = follower.outcome
    row = {
        "reached": end.reached,
        "reason": end.reason.value,
        "steps": end.steps,
        "iterations": end.iterations,
        "factorizations": end.factorizations,
        "solves": end.solves,
        "residual": end.residual,
    }
    return row, end.x


def hertz_rows(built: CondensedScene, repeat: int) -> Iterator[Row]:
    """Every method at every eta."""
    condensed, weight, full = built.condensed, built.condensed.weight, factors_at(built.stages, 1.0)
    exact = solve_exact(condensed, full).pressure

    def error(x: FloatArray) -> float:
        difference = x[: len(weight)] - exact
        return float(np.sqrt((weight * difference**2).sum() / (weight * exact**2).sum()))

    def active_set(levels: int) -> Row:
        active, solves = None, 0
        for level in np.arange(1, levels + 1) / levels:
            state = solve_exact(condensed, factors_at(built.stages, float(level)), active)
            active, solves = state.active, solves + state.solves
        return {"method": "active set", "levels": levels, "factorizations": solves, "error": 0.0}

    for levels in (1, *LEVELS):
        yield timed(lambda levels=levels: active_set(levels), repeat)  # type: ignore[misc]
    for eta in ETAS:
        variant = with_eta(built, eta)
        problem = problem_of(variant, coupling_of(variant, regularization(variant)), 0)
        start = start_point(variant, problem)

        def path(options: AnmOptions | NewtonOptions, levels: Sequence[float] = (), /, **names: Any) -> Row:
            row, x = walked(follow(problem, start, 0.0, 1.0, options, levels=levels))  # noqa: B023
            return {**names, "eta": eta, **row, "error": error(x)}  # noqa: B023

        def homotopy() -> Row:
            etas = [value for value in (1.0, *ETAS) if value >= eta]  # noqa: B023
            found = list(lowered(variant, etas))  # noqa: B023
            counts = {"factorizations": sum(one.factorizations for one in found)}
            return {"method": "eta homotopy", "eta": eta, **counts, "error": error(found[-1].x)}  # noqa: B023

        for order, pade in itertools.product(ORDERS, (True, False)):
            options, name = AnmOptions(order=order, pade=pade), "Pade" if pade else "Taylor"
            yield timed(lambda o=options, n=name: path(o, method="ANM", order=o.order, series=n), repeat)  # type: ignore[misc]
        yield timed(lambda: path(NewtonOptions(), method="Newton, adapted steps"), repeat)
        for count in LEVELS:
            levels = np.arange(1, count + 1) / count
            whole = NewtonOptions(first=1.0, growth=1e6)
            yield timed(lambda v=levels, w=whole: path(w, v, method="Newton", levels=len(v)), repeat)  # type: ignore[misc]
        yield timed(homotopy, repeat)


def slip_rows(built: CondensedScene) -> Iterator[Row]:
    """Partial slip: four stages, states wanted at their ends."""

    def whole(variant: CondensedScene, **names: Any) -> Row:
        steps: list[PathStep] = []
        reason = "target reached"
        try:
            steps.extend(load_path(variant))
        except NumericalError as failure:
            reason = failure.message
        counts = ("iterations", "factorizations", "solves")
        row = {name: sum(getattr(step, name) for step in steps) for name in counts}
        residual = max(step.state.residual for step in steps)
        reached = reason == "target reached"
        return {
            **names,
            "reached": reached,
            "reason": reason,
            "steps": len(steps) - 1,
            **row,
            "residual": residual,
        }

    settings: list[tuple[float, Row]] = [
        (1e-4, {"method": "anm", "order": order, "pade": pade})
        for order, pade in itertools.product(ORDERS, (True, False))
    ]
    settings += [(eta, {"method": method}) for eta in ETAS for method in ("anm", "newton")]
    for eta, solver in settings:
        variant = with_eta(built, eta, **solver)
        yield timed(lambda v=variant, e=eta, s=solver: whole(v, eta=e, **s), 1)  # type: ignore[misc]
    (contact,) = built.case.contact
    law = contact.regularization.model_copy(update={"law": "exact"})
    rigid = built.case.model_copy(update={"contact": (contact.model_copy(update={"regularization": law}),)})
    yield timed(lambda: whole(replace(built, case=rigid), method="exact, from event to event"), 1)


def sweep(folder: Path) -> Iterator[Row]:
    """Combinations of order, tolerance, eta, friction and load on coarse clouds."""
    text = hertz().replace('[reference]\nsolution = "hertz-line"', "")
    sheared = text.replace('[[support]]\nbody = "cylinder"\nnear = [0.0, 1.0]\nux = 0.0\n', "")
    sheared = sheared.replace("fy = -226.0", "force = [0.0, -226.0]")
    sheared += '\n[[load]]\nname = "shear"\nboundary = "cylinder.flat"\nkind = "platen"\nfx = 50.0\n'
    sheared += "[[stage]]\npress = 1.0\n[[stage]]\nshear = 1.0\n"
    rough = ('master = "block.top"', 'master = "block.top"\nfriction = 0.5')
    scenes = {
        "hertz, mu 0": text,
        "hertz, mu 0.5": text.replace(*rough),
        "partial slip, mu 0.5": sheared.replace(*rough),
    }
    for name, content in scenes.items():
        case = folder / "sweep.toml"
        case.write_text(content)
        built = build(case)
        for order, eta, exponent in itertools.product((5, 10, 20, 30, 40), (*ETAS, 1e-6), range(4, 13, 2)):
            tolerance = 10.0**-exponent
            variant = with_eta(built, eta, method="anm", order=order, tolerance=tolerance)
            row: Row = {"scene": name, "order": order, "eta": eta, "tolerance": tolerance}
            steps, residual = 0, 0.0
            try:
                for step in load_path(variant):
                    steps, residual = steps + 1, max(residual, step.state.residual)
                row["end"] = "done"
            except NumericalError as failure:
                row["end"] = failure.message
            yield row | {"steps": steps, "residual": residual, "within": residual <= tolerance}


def draw(path: Path, results: dict[str, list[Row]]) -> None:
    """Factorisations and CPU time over eta."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.5, 7.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 2)
    labels = {"factorizations": "dense factorisations", "cpu_seconds": "CPU seconds, contact problem"}
    for number, (key, label) in enumerate(labels.items()):
        for row, (name, curves) in enumerate(
            {
                "Hertz, one stage": hertz_curves(results["hertz"]),
                "Partial slip, four stages": slip_curves(results["slip"]),
            }.items()
        ):
            place = axes[row][number]
            for (curve, rows), marker in zip(curves.items(), itertools.cycle("osdP^v*X"), strict=False):
                place.loglog(
                    [r["eta"] for r in rows], [r[key] for r in rows], f"-{marker}", label=curve, ms=4, lw=1.2
                )
            for line in horizontal(results["hertz" if row == 0 else "slip"]):
                place.axhline(line[key], color="0.4", ls=line["style"], lw=1.0, label=line["name"])
            place.set(xlabel="eta over the largest pressure", ylabel=label, title=name)
            place.invert_xaxis()
            place.grid(which="both", alpha=0.25)
    for row in range(2):
        axes[row][0].legend(fontsize=6, ncols=2, framealpha=0.6)
    figure.savefig(path, dpi=110)


def hertz_curves(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Rows of each method, by name."""
    curves: dict[str, list[Row]] = {}
    for row in rows:
        if "eta" not in row or row.get("order", 20) not in (5, 20):
            continue
        name = row["method"]
        if name == "ANM":
            name = f"ANM, order {row['order']}, {row['series']}"
        elif "levels" in row:
            name = f"Newton, {row['levels']} levels"
        curves.setdefault(name, []).append(row)
    return curves


def slip_curves(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """The same for partial slip."""
    names = {"anm": "ANM, order 20, Pade", "newton": "Newton, adapted steps"}
    return {
        name: [row for row in rows if row["method"] == method and "order" not in row and row["reached"]]
        for method, name in names.items()
    }


def horizontal(rows: Sequence[Row]) -> Iterator[Row]:
    """Exact contact, which knows no eta."""
    styles = iter((":", "--", "-."))
    for row in rows:
        if "eta" not in row:
            levels = row.get("levels")
            name = row["method"] if levels is None else f"active set, {levels} level{'s'[: levels > 1]}"
            yield row | {"name": name, "style": next(styles)}


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--sweep", action="store_true")
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks" / "results")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    results: dict[str, Any] = {}
    pressed = build(ROOT / "cases" / "hertz.toml", *FINER)
    sheared = build(ROOT / "cases" / "cattaneo_mindlin.toml", SMOOTH)
    results["nodes"] = {name: len(b.condensed.weight) for name, b in (("hertz", pressed), ("slip", sheared))}
    for name, rows in (("hertz", hertz_rows(pressed, arguments.repeat)), ("slip", slip_rows(sheared))):
        results[name] = []
        for row in rows:
            results[name].append(row)
            print(name, json.dumps(row), flush=True)
    (arguments.out / "anm_vs_newton.json").write_text(json.dumps(results, indent=1) + "\n")
    draw(arguments.out / "anm_vs_newton.png", results)
    if arguments.sweep:
        found = []
        for row in sweep(arguments.out):
            found.append(row)
            print(json.dumps(row), flush=True)
        (arguments.out / "sweep.toml").unlink()
        (arguments.out / "anm_sweep.json").write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
