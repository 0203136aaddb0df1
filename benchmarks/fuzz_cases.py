"""Thousands of broken case files and damaged run directories: every command must end well or say why.

Published cases, made quick, are changed at random and run by the command line in children of this process.
Exit codes other than 0, 2 and 3, tracebacks, children that hang, files outside the run directory, refusals
without a reason and results that contradict themselves are failures; their inputs are kept. Then runs are
damaged, byte by byte, and read by every command that reads runs. Writes fuzz.json next to the other results.

    python benchmarks/fuzz_cases.py [--count N] [--runs N] [--seed S] [--keep DIR] [--first K]
"""

from __future__ import annotations

import argparse
import json
import math
import os
import random
import re
import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import tomli_w

from benchmarks.case_mutations import Table, mutated, published
from benchmarks.forked import Job, Outcome, mlsanm, preload, run_all

RESULTS = Path(__file__).parent / "results"
DEEP = Path("a/b/c/d")
"""Where cases lie in their sandbox: paths that climb out of them still end in it."""
SECONDS = 30.0
"""CPU time after which a command hangs; coarse cases take a hundredth of it."""
BATCH = 20
READERS = (
    ("info", "run"),
    ("plot", "run"),
    ("probe", "run", "--at", "0.5"),
    ("collect", "run"),
    ("resume", "run"),
    ("run", "case.toml", "--out", "run", "--force"),
    ("run", "case.toml", "--out", "run", "--skip-done"),
)


def main() -> None:
    """Fuzz, print a line now and then, write the results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--count", type=int, default=5000)
    parser.add_argument("--runs", type=int, default=500)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, default=Path(tempfile.gettempdir()) / "mlsanm-fuzz")
    parser.add_argument("--out", type=Path, default=RESULTS / "fuzz.json")
    wishes = parser.parse_args()
    preload()
    began = time.monotonic()
    result = {
        "seed": wishes.seed,
        "first": wishes.first,
        "cases": tried(broken_case, wishes, wishes.count),
        "damaged_runs": tried(damaged_run, wishes, wishes.runs),
        "seconds": round(time.monotonic() - began),
    }
    text = json.dumps(result, indent=2, ensure_ascii=False)
    wishes.out.write_text(text + "\n")
    print(text)


def kind_of(outcome: Outcome) -> str:
    """The first thing that a refusal says, without the names and numbers of the case."""
    lines = outcome.err.strip().splitlines() or [""]
    told = [line for line in lines if "case.toml" in line or line.startswith(("error:", "Error:", "--"))]
    text = (told or lines[-1:])[0]
    text = re.sub(r"^case\.toml(:\d+)?: |^error: |^Error: ", "", text)
    text = re.sub(r'"[^"]*"|\([^)]*\)', "_", text)
    return f"{outcome.code}: {re.sub(r'[-+]?[0-9][0-9.e+-]*', '#', text)[:90]}"


@dataclass(frozen=True)
class Trial:
    """A command to be run in a sandbox, and what was done to its input."""

    label: str
    job: Job
    case: str
    damage: str = ""


def tried(
    make: Callable[[int, int, Path], Trial], wishes: argparse.Namespace, count: int
) -> dict[str, object]:
    """How trials ended, a batch at a time; what is wrong is kept with its input."""
    counts = {name: Counter[str]() for name in ("commands", "exit_codes", "reasons")}
    cpu: list[float] = []
    wrong: list[str] = []
    strays, peak = 0, 0.0
    for first in range(wishes.first, wishes.first + count, BATCH):
        with tempfile.TemporaryDirectory() as box:
            for variable, folder in (("HOME", Path(box) / "home"), ("TMPDIR", Path(box) / "tmp")):
                folder.mkdir()
                os.environ[variable] = str(folder)
            numbers = range(first, min(first + BATCH, wishes.first + count))
            trials = [make(wishes.seed, number, Path(box) / str(number)) for number in numbers]
            outcomes = run_all([trial.job for trial in trials], seconds=SECONDS)
            for trial, outcome in zip(trials, outcomes, strict=True):
                counts["commands"][trial.job.arguments[0]] += 1
                counts["exit_codes"]["hung" if outcome.hung else str(outcome.code)] += 1
                if outcome.code in (2, 3):
                    counts["reasons"][kind_of(outcome)] += 1
                cpu.append(outcome.cpu)
                peak = max(peak, outcome.peak_mb)
                if found := faults(trial, outcome):
                    wrong.append(f"{trial.label}: {'; '.join(found)}")
                    print(f"WRONG {wrong[-1]}", flush=True)
                    kept = wishes.keep / trial.label
                    shutil.copytree(trial.job.folder, kept, dirs_exist_ok=True)
                    told = [f"{' '.join(trial.job.arguments)}: {outcome.code} {trial.damage}", *found]
                    (kept / "told.txt").write_text("\n".join([*told, outcome.out, outcome.err]))
            strays += sum(1 for folder in ("home", "tmp") for _ in (Path(box) / folder).iterdir())
        if first // 100 != (first + BATCH) // 100:
            print(f"{first + BATCH} trials: {dict(counts['exit_codes'])}", flush=True)
    return {
        "count": len(cpu),
        **{name: dict(count.most_common(60)) for name, count in counts.items()},
        "wrong": len(wrong),
        "wrong_ones": wrong[:50],
        "files_left_elsewhere": strays,
        "median_cpu_seconds": round(sorted(cpu)[len(cpu) // 2], 2) if cpu else 0.0,
        "largest_cpu_seconds": round(max(cpu, default=0.0), 2),
        "peak_memory_mb": round(peak),
    }


def broken_case(seed: int, number: int, box: Path) -> Trial:
    """A broken case given to a command, most often ``run``."""
    chance = random.Random(f"{seed} {number}")
    name = chance.choice(sorted(CASES))
    text = mutated(CASES[name], chance)
    place = _sandbox(box, text)
    draw = chance.random()
    command = ["run", "case.toml", "--out", "run"]
    if draw < 0.1:
        command = ["check", "case.toml", "--write", "run/model.vtu"]
    elif draw < 0.13:
        command = ["compare", "case.toml", "--newton", "--out", "run"]
    elif draw < 0.16:
        vary = chance.choice(["mls.degree=1,2", "solver.order=5:10:2", "body.0.spacing=0.3,x", "load.0.x=1"])
        command = ["sweep", "case.toml", "--vary", vary, "--out", "run"]
    return Trial(f"case-{seed}-{number}-{name.replace('/', '-')}", Job(command, place), text)


def faults(trial: Trial, outcome: Outcome) -> list[str]:
    """What must not be."""
    place, command = trial.job.folder, trial.job.arguments[0]
    box = place.parents[len(DEEP.parts) - 1]
    files = (path.relative_to(box) for path in box.rglob("*") if not path.is_dir())
    strays = [str(path) for path in files if DEEP / "run" not in path.parents and path != DEEP / "case.toml"]
    # A comparison that finds the methods apart ends with 1.
    disagreed = command == "compare" and outcome.code == 1 and not outcome.traceback
    refused = outcome.code == 2 and not trial.damage
    # A comparison of a case without contact is refused as such.
    named = re.search(r"case\.toml(:\d|.* UTF-8)|--|no \[\[contact\]\]", outcome.err)
    wrong = {
        f"left {', '.join(sorted(strays))}": strays,
        "hung" if outcome.hung else f"ended with {outcome.code}": not (outcome.sound or disagreed),
        "refused without a word": outcome.code in (2, 3) and not outcome.err.strip(),
        "control characters in a message": re.search(r"[\x00-\x08\x0b-\x1f\x7f]", outcome.out + outcome.err),
        "a warning of Python's": "Warning:" in outcome.err,
        f"{len(outcome.err)} characters of messages": len(outcome.err) > 100_000,
        "refused, and yet files in the run directory": refused
        and command != "sweep"
        and any((place / "run").iterdir()),
        "a refusal that names no place": refused and not named,
    }
    found = [text for text, yes in wrong.items() if yes]
    if trial.damage or command != "run" or outcome.code not in (0, 3):
        return found
    summary = place / "run" / "summary.json"
    if summary.is_file():
        return found + judged(json.loads(summary.read_text()), outcome.code)
    return found if outcome.code else [*found, "no summary"]


def _sandbox(box: Path, text: str) -> Path:
    place = box / DEEP
    (place / "run").mkdir(parents=True)
    (place / "case.toml").write_text(text, encoding="utf-8", errors="surrogatepass")
    return place


def judged(summary: Table, code: int) -> list[str]:
    """What is wrong with the figures of a run that ended with ``code``."""
    faults = []
    if summary["status"] != {0: "done", 3: "failed"}[code]:
        faults.append(f"status {summary['status']} with exit code {code}")
    if code == 3 and not summary["stop_reason"]:
        faults.append("failed without a reason")
    if code == 0:
        figures = {key: summary.get(key) for key in ("residual", "force_balance", "stability")}
        for contact, values in summary["contacts"].items():
            figures |= {f"{contact}.{key}": v for key, v in values.items() if isinstance(v, float)}
        faults += [f"{key} is {v}" for key, v in figures.items() if v is not None and not math.isfinite(v)]
        if (summary["force_balance"] or 0.0) > 0.05 and not summary["warnings"]:
            faults.append(f"force balance {summary['force_balance']} without a warning")
        if (summary["residual"] or 0.0) > 0.1:
            faults.append(f"residual {summary['residual']}")
    return faults


def damaged_run(seed: int, number: int, box: Path) -> Trial:
    """A run directory damaged somewhere, to be read by some command."""
    chance = random.Random(f"{seed} run {number}")
    name = chance.choice(("cases/patch", "cases/block_slide", "starters/ring"))
    text = tomli_w.dumps(CASES[name])
    place = _sandbox(box, text)
    shutil.copytree(_whole_run(name), place / "run", dirs_exist_ok=True)
    done = damage(place / "run", chance)
    return Trial(f"run-{seed}-{number}", Job(chance.choice(READERS), place), text, done)


_RUNS: dict[str, Path] = {}


def _whole_run(name: str) -> Path:
    if name not in _RUNS:
        place = Path(tempfile.mkdtemp(prefix="mlsanm-fuzz-run-", dir="/tmp"))
        (place / "case.toml").write_text(tomli_w.dumps(CASES[name]))
        mlsanm(["run", "case.toml", "--out", "run"], place)
        _RUNS[name] = place / "run"
    return _RUNS[name]


def damage(run: Path, chance: random.Random) -> str:
    """Damage one file of a run directory; what was done."""
    names = ("run.h5", "run.h5", "run.h5", "summary.json", "events.jsonl", "resolved.toml")
    file = run / chance.choice(names)
    content = bytearray(file.read_bytes())
    how = chance.choice(("cut", "flipped", "overwritten", "removed", "emptied", "a directory"))
    if how == "cut":
        content = content[: chance.randrange(len(content))]
    elif how == "flipped":
        for _ in range(chance.choice((1, 10, 100))):
            # The beginning of the file says where everything is.
            where = chance.randrange(min(len(content), chance.choice((2000, 10**9))))
            content[where] ^= 1 << chance.randrange(8)
    elif how == "overwritten":
        start = chance.randrange(len(content))
        content[start : start + 512] = chance.randbytes(512)
    elif how == "emptied":
        content.clear()
    file.unlink()
    if how == "a directory":
        file.mkdir()
    elif how != "removed":
        file.write_bytes(content)
    return f"{file.name} {how}"


CASES = published()

if __name__ == "__main__":
    main()
