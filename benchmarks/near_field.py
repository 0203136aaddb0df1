"""Contacts by the analytic near field: pressures, forces and work against references, and what levels cost.

    python benchmarks/near_field.py [--only hertz swapped punch loop levels]

Defaults only. Errors are in percent of the same scene on finer clouds, with an accuracy of 2e-5 (1e-4 for
punches):

- ``hertz``: half a disk of radius 1 on a block, contacts of half-widths 0.2 to 1e-4: L2 norm of the pressure,
  peak, half-width, and CPU seconds of a run in a process that is warm;
- ``swapped``: stiffness ratios of 1e-5 to 1e5: largest difference of the pressures when slave and master are
  swapped, and of the forces on the two bodies, both relative;
- ``punch``: an elastic punch with sharp corners on a block: L2 norm of the pressure within 0.9 of the width;
- ``loop``: area of a loop of the tangential force over its displacement over the work that friction
  dissipates, less one;
- ``levels``: CPU seconds of ``cases/cattaneo_mindlin.toml`` with 60 saved levels over those with one, whole
  processes.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np
import tomli_w

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.scenes.scene import Array, Result, Table, body, box, case, held, pair, platen, solid
from mlsanm_cli.app.run import run
from mlsanm_cli.app.sweep.engines import Silent

CATTANEO = Path(__file__).resolve().parents[1] / "cases" / "cattaneo_mindlin.toml"
SHEAR = 33.9849
"""Its tangential force at factor 1."""


def solved(given: Table | Path, folder: Path, *overrides: str) -> tuple[Result, float]:
    """A completed run and its CPU seconds."""
    path = given if isinstance(given, Path) else folder / "case.toml"
    if not isinstance(given, Path):
        path.write_text(tomli_w.dumps(given))
    began = time.process_time()
    summary = run(path, overrides=overrides, out=folder / "run", force=True, console=Silent())
    assert summary["status"] == "done", summary["stop_reason"]
    return Result(dict(summary), folder / "run"), time.process_time() - began


def pressures(result: Result) -> tuple[Array, Array]:
    """Places, increasing, and pressures at the end of a run."""
    with h5py.File(result.folder / "run.h5") as file:
        x, p = file["contacts/face/points"][:, 0], file["contacts/face/pressure"][-1]
    order = np.argsort(x)
    return x[order], p[order]


def apart(ones: tuple[Array, Array], others: tuple[Array, Array], within: float) -> float:
    """L2 norm of the difference of pressures within a distance of the middle, relative, in percent."""
    fine = np.linspace(-within, within, 40_001)
    one, other = (np.interp(fine, *some, 0.0, 0.0) for some in (ones, others))
    return float(100.0 * np.linalg.norm(one - other) / np.linalg.norm(other))


def nose(width: float, ratio: float = 1.0, swapped: bool = False) -> Table:
    """Half a disk, ``ratio`` times as stiff as the block, pressed to a half ``width``."""
    force = 0.25 * np.pi * ratio / (1.0 + ratio) / 0.91 * width**2
    shape = {"center": [0.0, 1.0], "radius": 1.0, "side": "lower"}
    sides = ("cylinder.arc", "block.top")
    return case(
        "strain",
        {"one": solid(ratio, 0.3), "other": solid(1.0, 0.3)},
        [body("cylinder", "one", "half-disk", **shape), box("block", "other", (-2.0, 2.0), (-2.0, 0.0))],
        support=[held("block.bottom")],
        load=[platen("press", "cylinder.flat", force=[0.0, -force])],
        contact=[pair("face", *(sides[::-1] if swapped else sides))],
    )


def sharp(ratio: float) -> Table:
    """A block with sharp corners, ``ratio`` times as stiff as the larger one that it is pressed into."""
    return case(
        "strain",
        {"one": solid(ratio, 0.3), "other": solid(1.0, 0.3)},
        [box("punch", "one", (-5.0, 5.0), (0.0, 10.0)), box("block", "other", (-50.0, 50.0), (-50.0, 0.0))],
        support=[held("block.bottom")],
        load=[platen("press", "punch.top", uy=-0.01)],
        contact=[pair("face", "punch.bottom", "block.top")],
    )


def finer(given: Table, spacings: tuple[float, float], near: float, accuracy: float) -> Table:
    """A scene with other ``spacings`` of its bodies, ``near`` along their contact, and ``accuracy``."""
    contact, bodies = given["contact"][0], []
    for one, spacing in zip(given["body"], spacings, strict=True):
        side = next(contact[role] for role in ("slave", "master") if contact[role].startswith(one["name"]))
        zone = {"along": side, "spacing": near, "radius": 0.0, "growth": 0.15}
        bodies.append(one | {"spacing": spacing, "refine": [zone]})
    return given | {"body": bodies, "contact": [contact | {"accuracy": accuracy}]}


def hertz(folder: Path) -> None:
    for width in (0.2, 0.05, 1e-2, 1e-3, 1e-4):
        found, seconds = solved(nose(width), folder)
        own = pressures(found)
        best, _ = solved(finer(nose(width), (0.05, 0.05), 0.05, 2e-5), folder)
        l2 = apart(own, pressures(best), 1.5 * width)
        peak = 100.0 * (found.peak("face") / best.peak("face") - 1.0)
        half = 100.0 * (found.half_width("face") / best.half_width("face") - 1.0)
        told = f"{found.summary['nodes']} nodes, {seconds:.2f} s"
        print(f"hertz {width:g}: L2 {l2:.4f}, peak {peak:.4f}, half-width {half:.4f} %, {told}")


def swapped(folder: Path) -> None:
    for ratio in (1e-5, 1e-3, 1.0, 1e3, 1e5):
        one, _ = solved(nose(0.05, ratio), folder)
        x, p = pressures(one)
        other, _ = solved(nose(0.05, ratio, swapped=True), folder)
        y, q = pressures(other)
        off = np.abs(p - np.interp(x, y, q)).max() / p.max()
        press, held_by = other.exerted("press"), other.exerted("block.bottom")
        lost = (
            max(np.abs(press + held_by).max(), np.abs(press - other.force("face")).max())
            / np.abs(press).max()
        )
        print(f"swapped, E ratio {ratio:g}: pressures {off:.1e}, forces {lost:.1e}")


def punch(folder: Path) -> None:
    for ratio in (0.1, 1.0, 10.0, 1000.0):
        found, seconds = solved(sharp(ratio), folder)
        own = pressures(found)
        best, _ = solved(finer(sharp(ratio), (0.25, 2.5), 0.25, 1e-4), folder)
        l2, nodes = apart(own, pressures(best), 4.5), found.summary["nodes"]
        print(f"punch, E ratio {ratio:g}: L2 {l2:.4f} %, {nodes} nodes, {seconds:.2f} s")


def loop(folder: Path) -> None:
    stages = "stage=[{press=1.0}, {shear=1.6}, {shear=-1.6}, {shear=1.6}]"
    every = ",".join(f"{2.0 + k / 50.0:g}" for k in range(101))
    result, _ = solved(CATTANEO, folder, stages, f"output.at=[{every}]", "output.fields=[]")
    with h5py.File(result.folder / "run.h5") as file:
        at = file["path/position"][:]
        chosen = (at >= 2.0) & (at <= 4.0)
        force = SHEAR * file["path/factors/shear"][:][chosen]
        moved = file["path/displacements/shear"][:, 0][chosen]
        work = file["contacts/interface/dissipated_work"][:][chosen]
    area = float((0.5 * (force[1:] + force[:-1]) * np.diff(moved)).sum())
    print(f"loop: area over work less one {area / np.ptp(work) - 1.0:.1e}, {len(work)} states")


def levels(folder: Path) -> None:
    taken = []
    for at in ("4.0", ",".join(f"{k / 15.0:.6g}" for k in range(1, 61))):
        command = [sys.executable, "-m", "mlsanm_cli", "run", str(CATTANEO), "--set", f"output.at=[{at}]"]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([*command, "--force", "--quiet", "--out", str(folder / "run")], check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        taken.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    print(f"levels: one {taken[0]:.2f} s, 60 {taken[1]:.2f} s = {taken[1] / taken[0]:.2f} times")


def main() -> None:
    """Command line."""
    parts = {one.__name__: one for one in (hertz, swapped, punch, loop, levels)}
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=parts, default=list(parts))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        solved(nose(0.05), Path(folder))
        for name in options.only:
            parts[name](Path(folder))


if __name__ == "__main__":
    main()
