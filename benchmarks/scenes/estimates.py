"""How far error estimates are from the errors, for every figure of every scene that has one.

    python benchmarks/scenes/estimates.py [--only NAME ...] [--coarse] [--finer FOLDER] [--out FILE]

The error is the difference from a run with a quarter to half of the spacing everywhere, of forces,
displacements (all nodes, and probes), pressures (L2 norm) and peak stresses, as summary.json defines them;
where there are finite elements, of forces and probes, both are asked. Figures agree within a factor of 3, or
if estimate and error are below 0.1 %; they are unknown where references disagree, or by what the finer run
does not know by its own estimate. ``--coarse`` judges runs with twice the spacing, whose errors are larger.
``--finer`` keeps finer runs, and takes those it has. Writes estimates.json.
"""

from __future__ import annotations

import copy
import json
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.scenes.compared import SIZED, spacings
from benchmarks.scenes.judge import Ran, by_elements, run_case
from benchmarks.scenes.scene import Array, Scene, Table, names, options, scene
from benchmarks.scenes.variants import respaced

OUT = Path(__file__).resolve().parents[1] / "results" / "estimates.json"
FACTOR, FLOOR = 3.0, 1e-3
"""How far estimates may be from errors; both may be below the second instead."""
KNOWN = 0.3
"""Differences count where the finer run knows them to this part."""
FINE_NODES = 5000
"""Nodes of finer runs, unless spacings are then not within a quarter and half of the others."""
NODES = 30
"""Nodes of each body at which displacements are compared."""
FINE_PATIENCE = 150.0
"""CPU seconds."""
SMALL = 0.05
"""Probes that move by less than this part of the largest displacement are compared with it, and peak stresses
closer than this part of a body."""
ENDS = 0.02
"""Part of a contact next to each end that does not count if pressures have no bound there."""
QUIET, LOUD = 0.005, 0.02
"""Below the first no warning is due, above the second it is."""


@dataclass(frozen=True)
class Compared:
    """A figure with its estimate, the ``errors`` against the references that there are, and how far the finer
    run is off by its own estimate."""

    what: str
    estimate: float | None
    errors: tuple[float, ...]
    unsure: float = 0.0

    @property
    def error(self) -> float:
        return max(self.errors)

    @property
    def verdict(self) -> str:
        told = self.estimate
        if told is None:
            return "none"
        found = {self._against(told, error) for error in self.errors}
        if len(found) == 1 and "unknown" not in found:
            return found.pop()
        return "right" if found <= {"right", "small"} else "unknown"

    def _against(self, told: float, error: float) -> str:
        if max(told, error) < FLOOR:
            return "small"
        if error < FACTOR * told and told < FACTOR * error:
            return "right"
        if self.unsure > KNOWN * error:
            # What the finer run does not know may explain it.
            least, most = error - self.unsure, error + self.unsure
            if least < FACTOR * told and told < FACTOR * most:
                return "unknown"
        return "low" if told < error else "high"


def compared(scene: Scene, base: Ran, fine: Ran) -> Iterator[Compared]:
    """All figures of a run with an estimate."""
    told, finer = ((one.summary.get("error_estimate") or {}) for one in (base, fine))
    others = {one.what: abs(one.error(one.got(base.result))) / 100.0 for one in by_elements(scene)}
    largest = most(fine)
    yield Compared(
        "displacement", told.get("displacement"), (moved(base, fine),), finer.get("displacement") or 0.0
    )
    for kind in ("force", "contacts", "pressure", "probes"):
        for name, estimate in (told.get(kind) or {}).items():
            also, unsure = "", (finer.get(kind) or {}).get(name) or 0.0
            if kind == "pressure":
                error = pressures(base, fine, name)
            elif kind == "probes":
                there = fine.result.moved(name)
                size = max(float(np.hypot(*there)), SMALL * largest)
                error, also = _apart(base.result.moved(name), there, size), f"moved {name} (FE)"
            else:
                size = fine.result.pressed(name)
                error = _apart(base.result.force(name), fine.result.force(name), size)
                also = f"force {name} (FE)"
            if error is not None:
                errors = (error, others[also]) if also in others else (error,)
                yield Compared(f"{kind} {name}", estimate, errors, unsure)
    for name, one in (base.summary.get("peak_stress") or {}).items():
        other = (fine.summary.get("peak_stress") or {}).get(name)
        extent = np.ptp(base.result.read(f"bodies/{name}/points"), axis=0).max()
        # Peaks of nearly equal size may change places.
        if other and np.hypot(*np.subtract(one["place"], other["place"])) < SMALL * extent:
            error = abs(one["stress"] / other["stress"] - 1.0)
            yield Compared(f"stress {name}", one["error"], (error,), other["error"])


def _apart(first: Array, other: Array, size: float) -> float:
    return float(np.hypot(*(first - other))) / size if size else 0.0


def moved(base: Ran, fine: Ran) -> float:
    """Relative root mean square error of the displacements at nodes that the finer run has probes at."""
    here, there = [], []
    with h5py.File(base.folder / "run.h5") as file:
        for name, one in file[f"fields/{_last(file)}"].items():
            for node in sample(file, name):
                here.append(one["displacement"][node])
                there.append(fine.result.moved(f"{name}-{node}"))
    return float(np.linalg.norm(np.subtract(here, there)) / (np.linalg.norm(there) or 1.0))


def sample(file: h5py.File, body: str) -> list[int]:
    """Some nodes of a body."""
    count = len(file[f"bodies/{body}/points"])
    return sorted(np.random.default_rng(0).permutation(count)[:NODES].tolist())


def most(ran: Ran) -> float:
    """Largest displacement."""
    with h5py.File(ran.folder / "run.h5") as file:
        return max(
            float(np.hypot(*one["displacement"][:].T).max()) for one in file[f"fields/{_last(file)}"].values()
        )


def pressures(base: Ran, fine: Ran, name: str) -> float | None:
    """Relative L2 distance of the pressures of a contact, without ends where they have no bound; None without
    pressures."""
    with h5py.File(base.folder / "run.h5") as one, h5py.File(fine.folder / "run.h5") as other:
        tables = [file[f"contacts/{name}"] for file in (one, other)]
        (s, p), (t, q) = ((table["arc_length"][:], table["pressure"][-1]) for table in tables)
    places = np.unique(np.concatenate([s, t]))
    if any(ran.summary["contacts"][name].get("singular_ends") for ran in (base, fine)):
        cut = ENDS * (places[-1] - places[0])
        places = places[(places >= places[0] + cut) & (places <= places[-1] - cut)]
    first, second = np.interp(places, s, p, 0, 0), np.interp(places, t, q, 0, 0)
    size = np.trapezoid(second**2, places)
    return float(np.sqrt(np.trapezoid((first - second) ** 2, places) / size)) if size else None


def _last(file: h5py.File) -> str:
    return str(max((key for key in file["fields"] if key != "position"), key=int))


def refined(given: Table, ran: Ran, factor: float) -> Table:
    """The case with a ``factor`` times its spacings; finer ones with outlines of meshes filled anew."""
    made = copy.deepcopy(given)
    if factor < 1.0:
        for one in made["body"]:
            if one["shape"]["kind"] == "mesh":
                one["shape"]["use"] = "outline"
        with h5py.File(ran.folder / "run.h5") as file:
            made["probe"] = made.get("probe", []) + [
                {"name": f"{body}-{node}", "body": body, "point": places[node].tolist()}
                for body, places in ((name, one["points"][:]) for name, one in file["bodies"].items())
                for node in sample(file, body)
            ]
    return respaced(made, spacings(ran), factor)


def judged(scene: Scene, folder: Path, coarse: bool, finer: Path) -> Table:
    """Run a scene and a finer one, or one twice as coarse, and compare."""

    def run(given: Table, where: Path) -> Ran:
        return run_case(scene, given, where, patience=FINE_PATIENCE)

    found: Table = {"scene": scene.name}
    given, ran = scene.case, run(scene.case, folder / scene.name / "base")
    if ran.code or scene.refusal:
        return found | {"skipped": "no equilibrium" if scene.refusal else ran.message[:200]}
    if coarse:
        given = refined(given, ran, 2.0)
        ran = run(given, folder / scene.name / "coarse")
        if ran.code:
            return found | {"skipped": ran.message[:200]}
    finer_by = float(np.clip(np.sqrt(ran.summary["nodes"] / FINE_NODES), 0.25, 0.5))
    better, kept = refined(given, ran, finer_by), finer / scene.name
    summary = kept / "run" / "summary.json"
    if summary.exists() and tomllib.loads((kept / "case.toml").read_text()) == better:
        fine = Ran(0, json.loads(summary.read_text()), "", kept / "run")
    else:
        fine = run(better, kept)
    if fine.code:
        return found | {"skipped": fine.message[:200]}
    lines = list(compared(scene, ran, fine))
    found["figures"] = [[one.what, one.estimate, one.error, one.unsure, one.verdict] for one in lines]
    peaks = {
        f"peak {name}": abs(one["peak_pressure"] / fine.summary["contacts"][name]["peak_pressure"] - 1.0)
        for name, one in (ran.summary.get("contacts") or {}).items()
        if fine.summary["contacts"][name]["peak_pressure"]
        and not one.get("singular_ends")
        and "peak_tension" not in one
    }
    off = {
        one.what: one.error
        for one in lines
        if one.what.split()[0] in ("force", "contacts", "displacement", "probes")
    }
    found["worst"] = max((off | peaks).items(), key=lambda one: one[1])
    found["warned"] = [text for text in ran.summary.get("warnings", ()) if SIZED in text]
    return found


def told(found: Table) -> str:
    """What is printed of a scene."""
    if "skipped" in found:
        return f"{found['scene']:<24} {found['skipped']}"
    what, worst = found["worst"]
    warned, mark = bool(found["warned"]), ""
    if (worst > LOUD and not warned) or (worst < QUIET and warned):
        mark = "   <-- warned" if warned else "   <-- not warned"
    lines = [f"{found['scene']:<24} {what} off by {100 * worst:.2g} %{mark}"]
    for what, estimate, error, unsure, verdict in found["figures"]:
        if verdict in ("low", "high", "unknown"):
            lines.append(
                f"    {what:<24} estimate {estimate:.1e}, error {error:.1e} ({unsure:.0e}) {verdict}"
            )
    lines += [f"    {text}" for text in found["warned"]]
    return "\n".join(lines)


def main() -> None:
    """Run, print, write."""
    parser = options(__doc__)
    parser.add_argument("--coarse", action="store_true")
    parser.add_argument("--finer", type=Path, help="a folder that keeps finer runs")
    parser.add_argument("--out", type=Path, default=OUT)
    given = parser.parse_args()
    found = []
    totals: dict[str, dict[str, int]] = {}
    with tempfile.TemporaryDirectory() as scratch:
        for name in names():
            if given.only and not any(part in name for part in given.only):
                continue
            finer = given.finer or Path(scratch) / "finer"
            found.append(judged(scene(name), Path(scratch), given.coarse, finer))
            print(told(found[-1]), flush=True)
    for line in found:
        for what, *_, verdict in line.get("figures", ()):
            counts = totals.setdefault(what.split()[0], {})
            counts[verdict] = counts.get(verdict, 0) + 1
    given.out.write_text(json.dumps({"totals": totals, "scenes": found}) + "\n")
    for kind, counts in sorted(totals.items()):
        print(kind, counts)


if __name__ == "__main__":
    main()
