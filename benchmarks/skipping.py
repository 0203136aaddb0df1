"""What is left out when a scene does not need it, and what each of these saves.

    python benchmarks/skipping.py [--repeat 5] [--only NAME ...] [--out benchmarks/results]

Every line is one scene run as it is and run with what was left out forced upon it: by a key of the case, or,
where no key does it, by putting the general way in place of the short one (``FORCED``). CPU seconds of whole
processes (user and system), one thread, compiled kernels, both ways in turn, medians. Writes skipping.json.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
FAR = """
[[body]]
name = "far"
material = "steel"
spacing = 0.1
shape = { kind = "rectangle", x = [100.0, 110.0], y = [0.0, 4.0] }
[[support]]
boundary = "far.left"
ux = 0.0
uy = 0.0
[[load]]
name = "pull"
boundary = "far.right"
kind = "traction"
traction = [1.0, 0.0]
"""


@dataclass(frozen=True)
class Line:
    """A scene: ``case`` of cases/ and ``text`` added to it, the ``options`` of both runs, those of the run
    ``left_out`` and of the one ``forced``, and the patch of the latter."""

    name: str
    case: str
    options: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    forced: tuple[str, ...] = ()
    patch: str = ""
    text: str = ""


LEVELS = f"output.at={[0.1 * k for k in range(1, 11)]}"
PROBE = 'probe=[{name="deep", body="lower", point=[0.0, -0.5]}]'
COARSE = tuple(f"body.{body}.refine.0.spacing={0.02}" for body in ("cylinder", "block"))
LINES = (
    Line("friction", "two_cylinders", forced=("contact.interface.friction=0.01",)),
    Line("contact", "kirsch", patch="solve"),
    Line("candidates", "hertz", forced=("contact.interface.reach=1.0",)),
    Line("passes", "hertz", (*COARSE, "adapt.passes=3"), patch="passes", text=FAR),
    Line("fields", "cattaneo_mindlin", left_out=("output.fields=[]",)),
    Line("vtu", "cattaneo_mindlin", left_out=("output.vtu=false",)),
    Line("probe", "two_cylinders", (LEVELS, PROBE), ("output.fields=[]",)),
    Line("orders", "hertz", patch="orders"),
    Line("numba", "patch", patch="numba"),
)


def solve_fields() -> None:
    """Fields by a solve of their own where the answers to the loads are kept."""
    from mlsanm_cli.contact.response.condensed import Condensed

    solution = Condensed.solution
    Condensed.solution = lambda self, *given: solution(replace(self, solutions={}), *given)  # type: ignore[method-assign]


def build_anew() -> None:
    """All bodies made anew in every pass."""
    from mlsanm_cli.app.checks import refinement as adapt

    place, condense_scene = adapt.place, adapt.condense_scene
    adapt.place = lambda *given: place(*given[:3])
    adapt.condense_scene = lambda *given: condense_scene(*given[:3])


def factorise_orders() -> None:
    """A tangent factorised for every order of a series."""
    from mlsanm_cli.continuation import expansion

    expand = expansion.expand

    def expanded(problem: Any, metric: Any, start: Any, order: int, *more: Any) -> Any:
        for _ in range(order - 1):
            problem.tangent(start.x, start.lam)
        return expand(problem, metric, start, order, *more)

    from mlsanm_cli.continuation import anm

    anm.expand = expanded


def import_numba() -> None:
    """The compiler imported though nothing is to be compiled."""
    __import__("numba")


FORCED: dict[str, Callable[[], None]] = {
    "solve": solve_fields,
    "passes": build_anew,
    "orders": factorise_orders,
    "numba": import_numba,
}


def run(line: Line, forced: bool) -> tuple[float, dict[str, Any]]:
    """CPU seconds of one process, and what its summary says."""
    environment = {**os.environ, **dict.fromkeys(THREADS, "1")}
    own = line.forced if forced else line.left_out
    with tempfile.TemporaryDirectory() as folder:
        case = Path(folder) / "case.toml"
        case.write_text((ROOT / "cases" / f"{line.case}.toml").read_text() + line.text)
        out = Path(folder) / "run"
        settings = [part for key in (*line.options, *own) for part in ("--set", key)]
        arguments = ["run", str(case), "--quiet", "--out", str(out), *settings]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [sys.executable, __file__, "--child", line.patch if forced else "", *arguments]
        subprocess.run(command, check=True, env=environment, cwd=ROOT)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        summary = json.loads((out / "summary.json").read_text())
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, summary


def measure(line: Line, repeat: int) -> dict[str, Any]:
    """Medians of both ways, taken in turn."""
    taken: dict[bool, list[float]] = {False: [], True: []}
    found: dict[str, Any] = {}
    for _ in range(repeat):
        for forced, seconds in taken.items():
            cpu, summary = run(line, forced)
            seconds.append(cpu)
            found["forced" if forced else "left_out"] = {
                key: summary[key]
                for key in (
                    "nodes",
                    "contact_unknowns",
                    "elastic_factorizations",
                    "condensation_solves",
                    "steps",
                )
            }
    return {
        "name": line.name,
        "case": line.case,
        "runs": repeat,
        "cpu": statistics.median(taken[False]),
        "cpu_forced": statistics.median(taken[True]),
        **found,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--only", nargs="+", choices=[line.name for line in LINES])
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks" / "results")
    wishes = parser.parse_args()
    subprocess.run([sys.executable, "-m", "mlsanm_cli", "warmup"], check=True, cwd=ROOT)
    wishes.out.mkdir(parents=True, exist_ok=True)
    path = wishes.out / "skipping.json"
    kept = {one["name"]: one for one in json.loads(path.read_text())} if path.exists() else {}
    for line in LINES:
        if wishes.only and line.name not in wishes.only:
            continue
        one = kept[line.name] = measure(line, wishes.repeat)
        saved = one["cpu_forced"] - one["cpu"]
        print(
            f"{line.name:12} {one['cpu']:.2f} s, forced {one['cpu_forced']:.2f} s, saved {saved:.2f} s",
            flush=True,
        )
        path.write_text(json.dumps([kept[line.name] for line in LINES if line.name in kept], indent=1) + "\n")


def child(patch: str, arguments: list[str]) -> int:
    """The command line, patched."""
    from mlsanm_cli.cli import main as command

    if patch:
        FORCED[patch]()
    return command(arguments)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        sys.exit(child(sys.argv[2], sys.argv[3:]))
    main()
