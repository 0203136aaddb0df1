"""Runs a scene as a user would, and judges what came of it."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from benchmarks.scenes.scene import Array, Figure, Move, Result, Scene, Table, listed, write_mesh

SIDES = 1e-6
"""How far what a body receives may be from what is reported of it, over the largest force."""
PATIENCE = 150.0
"""CPU seconds after which a run has failed: wall seconds would depend on what else runs."""
REFERENCE = Path(__file__).parent / "reference.json"


@dataclass(frozen=True)
class Ran:
    """A run: exit code (-1: too long), summary, what it printed."""

    code: int
    summary: Table
    said: str
    folder: Path

    @property
    def result(self) -> Result:
        return Result(self.summary, self.folder)

    @property
    def message(self) -> str:
        told = self.summary.get("stop_reason") if self.code == 3 else None
        hint = self.summary.get("hint") or ""
        lines = [line for line in self.said.splitlines() if line.strip()]
        return f"{told} | hint: {hint}" if told else " / ".join(lines[-6:])


@dataclass(frozen=True)
class Verdict:
    """``outcome`` of a scene with (what, value, reference, error in percent, limit) of every figure."""

    scene: str
    kind: str
    outcome: str
    figures: Sequence[tuple[str, float, float, float, float]] = ()
    message: str = ""
    warnings: Sequence[str] = ()
    nodes: int | None = None
    cpu: float | None = None
    sides: float | None = None
    estimate: Table | None = None
    variants: list[Table] = field(default_factory=list)

    def table(self) -> Table:
        return asdict(self)


def run_case(
    scene: Scene, given: Table, folder: Path, move: Move | None = None, patience: float = PATIENCE
) -> Ran:
    """Write a case and its files, and run it in a process of its own."""
    folder.mkdir(parents=True, exist_ok=True)
    for file in scene.files:
        write_mesh(file, folder / file.name, move)
    (folder / "case.toml").write_text(tomli_w.dumps(given))
    command = [sys.executable, "-m", "mlsanm_cli", "run", "case.toml", "--out", "run", "--force"]
    environment = dict(os.environ, OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
    limit = f"ulimit -t {patience:.0f}; exec " + shlex.join([*command, "-q"])
    done = subprocess.run(
        ["bash", "-c", limit], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode < 0 or done.returncode > 128:
        return Ran(-1, {}, f"over {patience:.0f} CPU seconds", folder / "run")
    summary = folder / "run" / "summary.json"
    told = json.loads(summary.read_text()) if done.returncode in (0, 3) and summary.exists() else {}
    return Ran(done.returncode, told, done.stderr or done.stdout, folder / "run")


def known() -> dict[str, Table]:
    """Figures by finite elements, of the scenes that have them."""
    return json.loads(REFERENCE.read_text()) if REFERENCE.exists() else {}


def by_elements(scene: Scene) -> list[Figure]:
    """Those whose two meshes agree well enough to judge by."""
    figures = []
    for what, entry in known().get(scene.name, {}).get("figures", {}).items():
        sort, _, key = what.partition(" ")
        limit = scene.limits[sort]
        if entry["change"] <= limit / 3.0:
            figures.append(_figure(sort, key, entry["value"], limit))
    return figures


def _figure(sort: str, key: str, value: Any, limit: float) -> Figure:
    if sort == "peak":
        return Figure(f"peak {key} (FE)", lambda r: r.peak(key), float(value), limit)
    vector = np.array(value)
    size = float(np.hypot(*vector))

    def along(result: Result) -> float:
        """The size, plus what is across."""
        if sort == "force":
            got = result.force(key)
        elif sort == "moved":
            got = result.moved(key)
        else:
            first, other = key.split(",")
            got = result.moved(other) - result.moved(first)
        return size + float(np.hypot(*(got - vector))) * (1.0 if got @ vector >= size**2 else -1.0)

    return Figure(f"{sort} {key} (FE)", along, size, limit)


def judged(scene: Scene, ran: Ran) -> Verdict:
    """The outcome in words."""
    summary = ran.summary
    told = {
        "message": ran.message if ran.code else "",
        "warnings": summary.get("warnings", ()),
        "nodes": summary.get("nodes"),
        "cpu": (summary.get("seconds") or {}).get("total"),
        "estimate": summary.get("error_estimate"),
    }

    def verdict(
        outcome: str, figures: Sequence[tuple[str, float, float, float, float]] = (), **more: Any
    ) -> Verdict:
        return Verdict(scene.name, scene.kind, outcome, figures, **{**told, **more})

    if ran.code not in (0, 2, 3) or "Traceback" in ran.said:
        return verdict("too long" if ran.code == -1 else "crashed", message=ran.said[-600:])
    if scene.refusal is not None:
        return _refusal(scene, ran, verdict)
    if ran.code:
        return verdict("refused")
    figures = []
    for figure in (*scene.figures, *by_elements(scene)):
        got = figure.got(ran.result)
        figures.append((figure.what, got, figure.true, figure.error(got), figure.limit))
    sides = imbalance(scene.case, ran.result)
    wrong = any(not abs(error) <= limit for *_, error, limit in figures) or (
        sides is not None and sides > SIDES
    )
    if not figures:
        return verdict("without a reference", sides=sides)
    outcome = ("wrong with a warning" if told["warnings"] else "silently wrong") if wrong else "right"
    return verdict(outcome, figures, sides=sides)


def _refusal(scene: Scene, ran: Ran, verdict: Callable[..., Verdict]) -> Verdict:
    """Where there is no equilibrium: refused at the right place, with words that tell why."""
    refusal = scene.refusal
    assert refusal is not None
    text = " ".join([ran.message if ran.code else "", *ran.summary.get("warnings", ())]).lower()
    says = any(word in text for word in refusal.words)
    if refusal.position is None:
        return verdict("right" if says else ("refused" if ran.code else "silently wrong"))
    at = float(ran.summary.get("position") or 0.0)
    error = 100.0 * (at / refusal.position - 1.0)
    figures = [("position", at, refusal.position, error, refusal.limit)]
    if ran.code == 0:
        return verdict("wrong with a warning" if ran.summary.get("warnings") else "silently wrong", figures)
    return verdict("right" if says and abs(error) <= refusal.limit else "refused", figures)


def imbalance(given: Table, result: Result) -> float | None:
    """Largest sum of reported forces on a body, over the largest force; None if nothing is loaded.

    Contacts count with what their slaves received, on slave and master: a master that felt another force
    shows in the sum with its supports.
    """
    sums = {one["name"]: np.zeros(2) for one in given["body"]}
    free = {name: np.ones(2, bool) for name in sums}
    largest = 0.0

    def add(name: str, force: Array) -> None:
        nonlocal largest
        sums[name] += force
        largest = max(largest, float(np.abs(force).max()))

    for one in given.get("contact", []):
        force = result.force(one["name"])
        largest = max(largest, result.size(one["name"]))
        add(listed(one["slave"])[0].split(".")[0], force)
        if "master" in one:
            add(listed(one["master"])[0].split(".")[0], -force)
    held = set()
    for one in given.get("support", []):
        if "boundary" in one:
            first, *others = listed(one["boundary"])
            held.add("+".join([first, *(side.split(".")[1] for side in others)]))
        else:
            free[one["body"]] &= np.array([key not in one for key in ("ux", "uy")])
    for region in result.summary["forces"]:
        if region.partition(" from ")[0] in held:
            add(region.split(".")[0], result.exerted(region))
    for one in given.get("load", []):
        if one["kind"] in ("obstacle", "temperature"):
            continue
        bodies = {side.split(".")[0] for side in listed(one.get("boundary", one.get("body", "")))}
        add(min(bodies), result.exerted(one["name"]))
        for name in bodies if len(bodies) > 1 else ():
            free[name][:] = False  # what of a common plate's force each body gets is not reported
    if not largest:
        return None
    return max(float(np.abs(sums[name][free[name]]).max(initial=0.0)) for name in sums) / largest
