"""Runs killed at random moments and resumed: every one must be readable, and end as if it had not been.

No contact, power series without friction, friction with memory that is reversed by the smooth and by the
exact law, refined clouds, and finite strain in contact and by power series. Each is run once to its end; then
it is killed by SIGKILL at moments drawn evenly from the time between its first file and its end, every second
time once more while it is resumed, and compared with the first: saved states and the last row agree within
the solver's tolerance. Files are written every 0.3 s and not every half a minute, which is longer than these
runs. A run that was over before its moment came, or not begun, is not counted as killed.
Writes kill_and_resume.json next to the other results.

    python benchmarks/kill_and_resume.py [kills per case] [seed]
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from mlsanm_cli.errors import RunError
from mlsanm_cli.io.run_reader import read_run

CASES = Path(__file__).parents[1] / "cases"
RESULTS = Path(__file__).parent / "results"

COARSE = tuple(
    f"body.{body}.{key}"
    for body in ("cylinder", "block")
    for key in ("refine=[{at=[0.0, 0.0], spacing=0.01, radius=0.06, growth=0.25}]", "spacing=0.3")
)
SMOOTH = 'contact.interface.regularization.law="hyperbolic"'
EXACT = 'contact.interface.regularization.law="exact"'
TOLERANCE = 1e-6
"""Of the cases' solvers, to which what is compared agrees."""
SCENES: dict[str, tuple[str, tuple[str, ...]]] = {
    "linear": ("kirsch", (f"output.at={[k / 20 for k in range(1, 21)]}",)),
    "series": (
        "hertz",
        (
            *COARSE,
            f"output.at={[k / 20 for k in range(1, 21)]}",
        ),
    ),
    "friction reversed": (
        "cattaneo_mindlin",
        (*COARSE, SMOOTH, f"output.at={[k / 5 for k in range(1, 21)]}"),
    ),
    "exact friction": (
        "cattaneo_mindlin",
        (*COARSE, EXACT, f"output.at={[k / 5 for k in range(1, 21)]}"),
    ),
    "adapted": ("hertz", (*COARSE, "adapt.passes=1", f"output.at={[k / 20 for k in range(1, 21)]}")),
    "finite strain, contact": ("squeezed_ring", (f"output.at={[k / 10 for k in range(1, 11)]}",)),
    "finite strain, series": ("snap_through", (f"output.at={[k / 10 for k in range(1, 11)]}",)),
}
QUIET = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


def command(*arguments: str) -> subprocess.Popen[bytes]:
    """``mlsanm`` as a process of its own."""
    program = "from mlsanm_cli.cli import main; from mlsanm_cli.io import run_file"
    whole = [
        sys.executable,
        "-c",
        f"{program}; run_file.SAVE_INTERVAL, run_file.MIN_INTERVAL_RATIO = 0.3, 1.0; main()",
    ]
    whole += [*arguments, "--quiet"]
    return subprocess.Popen(whole, env={**os.environ, **QUIET}, stderr=subprocess.PIPE)


def cpu_seconds(process: subprocess.Popen[bytes]) -> float:
    """CPU time of a process so far, as the system tells it: free of how busy the machine is."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def timed(process: subprocess.Popen[bytes], directory: Path) -> tuple[float, float]:
    """CPU seconds until the first file of a run is there and until it ends."""
    first = last = 0.0
    while process.poll() is None:
        last = cpu_seconds(process)
        if not first and (directory / "run.h5").is_file():
            first = last
        time.sleep(0.002)
    if process.returncode:
        raise SystemExit(str(process.communicate()[1]))
    return first, last


def kill_after(process: subprocess.Popen[bytes], seconds: float) -> bool:
    """Whether the process was still there to be killed after so many seconds of its CPU time."""
    while process.poll() is None:
        if cpu_seconds(process) >= seconds:
            process.kill()
            process.wait()
            return True
        time.sleep(0.0005)
    return False


def content(directory: Path) -> dict[str, Any]:
    """All that must agree: saved states and the last row."""
    run = read_run(directory)
    found: dict[str, Any] = {"status": run.status, "position": run.path.position[-1:]}
    for number, state in enumerate(run.states):
        found[f"position {number}"] = state.position
        for body, fields in state.bodies.items():
            found |= {f"{body} {name} {number}": values for name, values in fields.items()}
    for contact, data in run.contacts.items():
        for name in ("pressure", "traction", "gap", "slip", "dissipated_work"):
            found[f"{contact} {name}"] = getattr(data, name)[-1]
    files = ("summary.json", "path.csv", "interface.csv", "fields.pvd", "contacts.pvd")
    return found | {name: (directory / name).is_file() for name in files}


def away(one: Any, other: Any) -> float:
    """By how much two values differ, over the largest number in the first; inf where they are unlike."""
    if isinstance(one, str | bool) or other is None or np.shape(one) != np.shape(other):
        return 0.0 if one is other or (isinstance(one, str) and one == other) else float("inf")
    size = float(np.nanmax(np.abs(one), initial=0.0)) or 1.0
    return float(np.nanmax(np.abs(np.subtract(one, other)), initial=0.0)) / size


def trial(case: list[str], directory: Path, moments: list[float]) -> dict[str, Any]:
    """One run killed at a moment, once more while it is resumed where a second one is given."""
    result: dict[str, Any] = {"moment": moments[0], "readable": True, "error": ""}
    result["killed"] = kill_after(command("run", *case, "--out", str(directory)), moments[0])
    if not (directory / "run.h5").is_file():
        return {**result, "killed": False, "error": "killed before it began"}
    for moment in [*moments[1:], None]:
        try:
            result["rows"] = read_run(directory).rows
        except RunError as error:
            return {**result, "readable": False, "error": error.message}
        process = command("resume", str(directory))
        if moment is not None:
            kill_after(process, moment)
        elif (error_text := process.communicate()[1]) and process.returncode:
            return {**result, "error": error_text.decode()}
    return result


def main() -> None:
    """Kill, resume, compare, count."""
    kills = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    rng = np.random.default_rng(int(sys.argv[2]) if len(sys.argv) > 2 else 0)
    report: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, (stem, settings) in SCENES.items():
            case = [str(CASES / f"{stem}.toml"), *(part for text in settings for part in ("--set", text))]
            whole = Path(folder) / name / "whole"
            command("run", *case, "--out", str(whole.with_name("warm"))).wait()  # kernels compiled
            first, last = timed(command("run", *case, "--out", str(whole)), whole)
            expected, trials = content(whole), []
            number, killed = 0, 0
            while killed < kills:
                cut = Path(folder) / name / str(number)
                moments = [float(rng.uniform(first, last)) for _ in range(1 + number % 2)]
                result = trial(case, cut, moments)
                if not result["error"]:
                    found = content(cut)
                    differing = {key: away(value, found.get(key)) for key, value in expected.items()}
                    result["largest"] = max(differing.values())
                    result["different"] = sorted(key for key in differing if differing[key] > TOLERANCE)
                trials.append(result)
                number, killed = number + 1, killed + bool(result["killed"])
                print(name, number, result, flush=True)
            report[name] = {
                "rows": read_run(whole).rows,
                "cpu_seconds": last,
                "killed": killed,
                "trials_in_all": number,
                "killed_before_it_began": sum("before it began" in trial["error"] for trial in trials),
                "readable": sum(trial["readable"] for trial in trials),
                "alike": sum(trial.get("different") == [] for trial in trials),
                "largest_difference": max((trial.get("largest", 0.0) for trial in trials), default=0.0),
                "trials": trials,
            }
    (RESULTS / "kill_and_resume.json").write_text(json.dumps(report, indent=1) + "\n")
    for name, row in report.items():
        print(name, {key: value for key, value in row.items() if key != "trials"})


if __name__ == "__main__":
    main()
