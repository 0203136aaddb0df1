"""Where the time of whole runs goes, function by function, from samples of their stacks.

    pip install py-spy
    python benchmarks/profile_runs.py [--case hertz] [--set KEY=VALUE ...] [--scale 1.0 0.147] [--flame DIR]

A case of ``cases/`` with all spacings multiplied by each scale, and other keys as ``--set`` has them, one
thread, compiled kernels, no cache of operators. A sample counts for the innermost function of mlsanm on the
stack: what numpy, scipy, h5py or a kernel do on its behalf is its own. Samples during imports count as
imports, those before the package is entered as Python's start; sampling slows imports more than the rest.
Writes profile.json; ``--flame`` writes a flame graph (SVG) of every run besides.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

from scale import THREADS, finer, given

ROOT = Path(__file__).resolve().parents[1]
RATE = 200
"""Samples per second."""
FRAME = re.compile(r"(?P<function>.+) \((?P<file>[^()]+):\d+\)$")
CALLS = ("kernels/aot/jit.py", "kernels/aot/machine.py")
"""Call the kernels' machine code, which no stack shows: their callers tell more."""
SHOWN = 16


def record(case: Path, settings: list[str], scale: float, form: str, out: Path) -> dict[str, Any]:
    """One sampled run: its summary."""
    environment = {**os.environ, **dict.fromkeys(THREADS, "1")}
    with tempfile.TemporaryDirectory() as directory:
        results = Path(directory) / "run"
        command = ["py-spy", "record", "--rate", str(RATE), "--format", form, "--output", str(out), "--"]
        command += [sys.executable, "-m", "mlsanm_cli", "run", str(case), "--quiet"]
        command += ["--out", str(results), *finer(case, scale), *given(settings)]
        subprocess.run(command, check=True, env=environment, cwd=ROOT, capture_output=True)
        return dict(json.loads((results / "summary.json").read_text()))


def place(stack: str) -> str:
    """What a stack, outermost frame first, counts for."""
    frames = [found for part in stack.split(";") if (found := FRAME.match(part))]
    own = [one for one in frames if "mlsanm_cli/" in one["file"] and not one["file"].endswith(CALLS)]
    # A module's own lines run once, while it is imported; those of the command line run it all.
    if any(one["function"] == "<module>" and "/cli/" not in one["file"] for one in own):
        return "imports"
    called = [one for one in own if one["function"] != "<module>"]
    if not called:
        return "start of Python, imports of the command line"
    if any("importlib" in one["file"] for one in frames[frames.index(called[-1]) :]):
        return "imports"
    file = called[-1]["file"].split("mlsanm_cli/")[-1]
    return f"{file}: {called[-1]['function']}"


def shares(samples: Path) -> list[tuple[str, float]]:
    """Every place's share of all samples, the largest first."""
    counts: Counter[str] = Counter()
    for line in samples.read_text().splitlines():
        stack, _, count = line.rpartition(" ")
        counts[place(stack)] += int(count)
    total = counts.total()
    return [(name, count / total) for name, count in counts.most_common()]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--case", default="hertz")
    parser.add_argument("--set", dest="settings", action="append", default=[])
    parser.add_argument("--scale", type=float, nargs="+", default=[1.0, 0.36, 0.147])
    parser.add_argument("--flame", type=Path)
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks" / "results")
    wishes = parser.parse_args()
    if shutil.which("py-spy") is None:
        sys.exit("no py-spy on the path: pip install py-spy")
    subprocess.run([sys.executable, "-m", "mlsanm_cli", "warmup"], check=True, cwd=ROOT)
    wishes.out.mkdir(parents=True, exist_ok=True)
    if wishes.flame:
        wishes.flame.mkdir(parents=True, exist_ok=True)
    path, here = wishes.out / "profile.json", (wishes.case, wishes.settings)
    kept = json.loads(path.read_text()) if path.exists() else []
    lines = [line for line in kept if (line["case"], line["set"]) != here]
    case = ROOT / "cases" / f"{wishes.case}.toml"
    with tempfile.TemporaryDirectory() as directory:
        for scale in sorted(wishes.scale, reverse=True):
            samples = Path(directory) / "samples.txt"
            nodes = record(case, wishes.settings, scale, "raw", samples)["nodes"]
            told = shares(samples)[:SHOWN]
            lines.append({"case": wishes.case, "set": wishes.settings, "nodes": nodes, "shares": dict(told)})
            path.write_text(json.dumps(lines, indent=1) + "\n")
            print(f"{wishes.case}, {nodes} nodes")
            for where, share in told:
                print(f"  {share:6.1%}  {where}", flush=True)
            if wishes.flame:
                picture = wishes.flame / f"{wishes.case}_{nodes}.svg"
                record(case, wishes.settings, scale, "flamegraph", picture)


if __name__ == "__main__":
    main()
