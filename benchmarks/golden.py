"""Golden table: the figures of all published cases and all scenes, rerun and compared.

    python benchmarks/golden.py [--only NAME ...] [--jobs 2] [--quick]      # rerun and compare
    python benchmarks/golden.py --record [--only NAME ...]                  # write new entries
    python benchmarks/golden.py --accept NAME ... --reason TEXT --evidence TEXT

The table (``results/golden.json``) holds, for every run, its exit code, all figures of ``summary.json`` but
times and memory, the checks that warned or failed, and its warnings without their numbers. Figures agree if
they differ by at most 1e-6 of the largest of their group (components of a force: of all forces of the run).
NAME is a part of a name.
``--quick`` reruns the runs that took at most 3 CPU seconds when recorded. ``--accept`` replaces the entries
of runs whose figures were meant to change and writes each change, with its reason and evidence, into the
table.
``--package DIR`` runs the package of another checkout. Exit code 1 if anything differs.
"""

from __future__ import annotations

import json
import math
import os
import re
import sys
import tempfile
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.scenes.judge import run_case
from benchmarks.scenes.scene import CASES as SCENES
from benchmarks.scenes.scene import Scene, names, options, plain

TABLE = Path(__file__).parent / "results" / "golden.json"
CASES = Path(__file__).resolve().parents[1] / "cases"
TOLERANCE = 1e-6
"""Largest difference of figures that are equal, relative to the largest figure of their group."""
ROUND_OFF = 1e-9
"""Dimensionless figures (balances, residuals, error estimates) that differ by less are equal."""
QUICK = 3.0
"""CPU seconds of a run that ``--quick`` repeats."""
VOLATILE = ("seconds", "wall_seconds", "peak_memory_mb", "cache", "directory", "checks", "failure")
"""Keys of summary.json that are not compared; the worst nodes of a failed state are often equally bad."""
GROUPS = ("forces", "contacts.*.force", "probes.*.displacement", "probes.*.stress", "plates.*")
"""Figures whose scale is the largest of the group."""

Figures = dict[str, Any]


def scenes() -> dict[str, Scene]:
    """Published cases, as ``case/NAME``, and scenes, as ``scene/NAME``."""
    paths = {f"case/{path.stem}": path for path in sorted(CASES.glob("*.toml"))}
    paths |= {f"scene/{name}": SCENES / f"{name}.toml" for name in sorted(names())}
    return {name: plain(path) for name, path in paths.items()}


def flat(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Leaves of a JSON value with their dotted keys."""
    if isinstance(value, Mapping):
        for name, part in value.items():
            yield from flat(part, f"{key}.{name}" if key else str(name))
    elif isinstance(value, list):
        for number, part in enumerate(value):
            yield from flat(part, f"{key}.{number}")
    else:
        yield key, value


def words(text: str) -> str:
    """A message without its numbers."""
    return re.sub(r"-?\d+(\.\d+)?(e[-+]?\d+)?", "#", text)


def ran(name: str, scene: Scene, folder: Path) -> tuple[str, Figures]:
    """Entry of the table of one run."""
    done = run_case(scene, scene.case, folder / name)
    summary = {key: value for key, value in done.summary.items() if key not in VOLATILE}
    warnings, checks = summary.pop("warnings", []), done.summary.get("checks", [])
    entry = {
        "exit": done.code,
        "cpu": round((done.summary.get("seconds") or {}).get("total", 0.0), 1),
        "warnings": sorted({words(text) for text in warnings}),
        "checks": sorted({one["name"] for one in checks if one["outcome"] != "passed"}),
        "figures": {
            key: float(f"{value:.12g}") if isinstance(value, float) else value for key, value in flat(summary)
        },
    }
    if not done.summary:
        entry["message"] = words(done.message)
    return name, entry


def group(key: str) -> str:
    """Group of a figure, else its own key."""
    parts = key.split(".")
    for pattern in GROUPS:
        wanted = pattern.split(".")
        if len(parts) >= len(wanted) and all(w in ("*", p) for w, p in zip(wanted, parts, strict=False)):
            return "force" if "force" in wanted[-1] else pattern
    return key


def differences(old: Figures, new: Figures) -> Iterator[str]:
    """What differs between two entries, a line each; keys of the new one only are additions."""
    for key in ("exit", "checks", "warnings", "message"):
        if old.get(key, new.get(key) if key == "checks" else None) != new.get(key):
            yield f"{key}: {old.get(key)} -> {new.get(key)}"
    scales: dict[str, float] = {}
    for key, value in (*old["figures"].items(), *new["figures"].items()):
        if number(value):
            scales[group(key)] = max(scales.get(group(key), 0.0), abs(value))
    for key, value in old["figures"].items():
        other = new["figures"].get(key, "missing")
        if number(value) and number(other):
            scale = scales[group(key)]
            if abs(value - other) > TOLERANCE * scale and abs(value - other) > ROUND_OFF:
                yield f"{key}: {value:.9g} -> {other:.9g} ({(other - value) / scale:+.1e})"
        elif value != other:
            told = (words(str(one)) if isinstance(value, str) else one for one in (value, other))
            yield f"{key}: {' -> '.join(map(str, told))}"


def number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def main() -> None:
    """Rerun, then compare, record or accept."""
    parser = options(__doc__)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--record", action="store_true")
    parser.add_argument("--accept", nargs="+", default=[], metavar="NAME")
    parser.add_argument("--reason")
    parser.add_argument("--evidence")
    parser.add_argument("--package", type=Path, help="a checkout whose package is run")
    parser.add_argument("--keep", type=Path, help="a folder for the runs; a temporary one by default")
    given = parser.parse_args()
    if given.accept and not (given.reason and given.evidence):
        parser.error("--accept needs --reason and --evidence")
    os.environ["PYTHONPATH"] = str(given.package or CASES.parent)
    table = json.loads(TABLE.read_text()) if TABLE.exists() else {"runs": {}, "changes": []}
    parts = given.accept or given.only
    chosen = {
        name: scene
        for name, scene in scenes().items()
        if (not parts or any(part in name for part in parts))
        and not (given.quick and table["runs"].get(name, {}).get("cpu", 0.0) > QUICK)
    }
    differ = 0
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(given.jobs) as pool:
        folder = given.keep or Path(scratch)
        for name, entry in pool.map(lambda item: ran(item[0], item[1], folder), chosen.items()):
            old = table["runs"].get(name)
            lines = ["not in the table"] if old is None else list(differences(old, entry))
            if lines:
                differ += 1
                print(f"{name}", *lines, sep="\n    ", flush=True)
            if given.record or (given.accept and lines):
                table["runs"][name] = entry
            if given.accept and lines:
                date = datetime.now(UTC).date().isoformat()
                why = {"run": name, "date": date, "reason": given.reason, "evidence": given.evidence}
                table["changes"].append(why | {"what": lines})
    print(f"{len(chosen)} runs, {differ} differ")
    if given.record or given.accept:
        table["runs"] = dict(sorted(table["runs"].items()))
        TABLE.write_text(json.dumps(table, indent=0) + "\n")
    elif differ:
        sys.exit(1)


if __name__ == "__main__":
    main()
