"""Factorisation and condensation of one body, against SuperLU under the same nested dissection.

    python benchmarks/linear_algebra.py [--scale 1.0 0.7 0.43 0.17] [--repeat 5] [--out benchmarks/results]

The block of cases/hertz.toml with all spacings multiplied by each scale, with friction and without. CPU
seconds, medians, all in one process with one thread:

- ``factor`` and ``superlu``: normal equations, bordered by the pieces' rows, to factor, nested dissection and
  our check included;
- ``condense``: all functionals of all contact columns; ``blocks`` the same by solutions refined 64 at a time
  with our factor; ``superlu_solves`` one back-substitution by SuperLU for every column, without refinement;
- ``error`` and ``blocks_error``: of a few columns against refinement in extended precision, relatively;
- ``solve``: one right-hand side with our factor.

Writes linear_algebra.json after every line.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import numpy as np  # noqa: E402
import scipy.sparse as sparse  # noqa: E402

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from mlsanm_cli.app.scene.assemble import assemble_bodies, prepare  # noqa: E402
from mlsanm_cli.app.scene.boundaries import Boundaries  # noqa: E402
from mlsanm_cli.app.scene.clouds import clouds  # noqa: E402
from mlsanm_cli.arrays import FloatArray  # noqa: E402
from mlsanm_cli.case import load_case  # noqa: E402
from mlsanm_cli.contact.response.functionals import gap_rows, slip_rows  # noqa: E402
from mlsanm_cli.contact.response.linear_map import Columns  # noqa: E402
from mlsanm_cli.contact.response.load_vectors import body_load_vectors  # noqa: E402
from mlsanm_cli.operators.least_squares import LeastSquares  # noqa: E402
from mlsanm_cli.operators.linear.cholesky import factor_definite  # noqa: E402
from mlsanm_cli.operators.linear.interface import Matrix  # noqa: E402
from mlsanm_cli.operators.normal import bordered  # noqa: E402
from mlsanm_cli.operators.refinement import BLOCK_COLUMNS, FUNCTIONAL_TOLERANCE  # noqa: E402

CASE, BODY = ROOT / "cases" / "hertz.toml", "block"
JUDGED = 12
UPDATES = 8


def cpu_of(work: Callable[[], Any], repeat: int) -> float:
    """Median CPU seconds."""
    taken = []
    for _ in range(repeat):
        start = time.process_time()
        work()
        taken.append(time.process_time() - start)
    return statistics.median(taken)


def exactly(system: LeastSquares, observed: sparse.csr_array, sources: sparse.csc_array) -> FloatArray:
    """Functionals of solutions whose residuals are summed in extended precision."""
    rows, strong = system.rows.astype(np.longdouble), system.strong.rows.astype(np.longdouble)
    wanted = system.scaled(sources).astype(np.longdouble)
    solution = np.zeros((rows.shape[1], sources.shape[1]), dtype=np.longdouble)
    for _ in range(UPDATES):
        lack = wanted - np.concatenate([rows @ solution, strong @ solution])
        gradient = rows.T @ lack[: rows.shape[0]] + strong.T @ lack[rows.shape[0] :]
        solution += system.factor.solve(np.asarray(gradient, dtype=float))
    return np.asarray(observed @ solution, dtype=float)


def bordered_equations(system: LeastSquares, nodes: FloatArray) -> tuple[Matrix, FloatArray, int]:
    """What a system of ``nodes`` (n, 2) factorised: the matrix, the places of all vertices, and how many of
    them are of multipliers."""
    places = np.repeat(system.strong.places, 2, axis=0)
    matrix = bordered(system.rows, system.strong.rows, system.strong.owner, len(places))
    return matrix, np.concatenate([nodes, places]), len(places)


def measure(scale: float, friction: float, repeat: int) -> dict[str, Any]:
    """One line of the tables."""
    sizes = [f"body.{name}.spacing={0.1 * scale}" for name in ("cylinder", "block")]
    sizes += [
        f"body.{name}.refine.{number}.spacing={value * scale}"
        for name in ("cylinder", "block")
        for number, value in enumerate((0.004, 0.0005, 0.0005))
    ]
    case = load_case(CASE, (*sizes, f"contact.interface.friction={friction}")).case
    boundaries = Boundaries.of(case)
    prepared = prepare(boundaries, clouds(boundaries))
    scene = assemble_bodies(case, prepared, "auto")
    pairings = prepared.pairings
    count = sum(int(pairing.candidate.sum()) for pairing in pairings)
    rough = tuple(pairing for pairing in pairings if pairing.friction)
    columns = Columns(len(scene.loads), len(scene.unknown_motions), count, count if rough else 0)
    body = scene.bodies[BODY]
    sources = body_load_vectors(scene, BODY, pairings, columns)
    sources = sources[:, np.flatnonzero(np.diff(sources.indptr))]
    relative = [gap_rows(body, BODY, pairings), slip_rows(body, BODY, rough)]
    observed = sparse.csr_array(sparse.vstack(relative, format="csr"))
    system = body.system
    assert isinstance(system, LeastSquares)
    equations = bordered_equations(system, body.model.cloud.points)
    matrix = equations[0]
    factor, own = factor_definite(*equations, solver="superlu"), factor_definite(*equations)
    block = np.random.default_rng(0).normal(size=(matrix.shape[0], BLOCK_COLUMNS))

    def blocks() -> FloatArray:
        parts = [
            observed @ system.solve(sources[:, first : first + BLOCK_COLUMNS], FUNCTIONAL_TOLERANCE)
            for first in range(0, sources.shape[1], BLOCK_COLUMNS)
        ]
        return np.concatenate(parts, axis=1)

    judged = np.linspace(0, sources.shape[1] - 1, JUDGED).astype(int)
    exact = exactly(system, observed, sources[:, judged])
    size = np.linalg.norm(exact, axis=0)

    def error(found: FloatArray) -> float:
        return float((np.linalg.norm(found[:, judged] - exact, axis=0) / size).max())

    return {
        "nodes": len(body.model.cloud.points),
        "columns": sources.shape[1],
        "functionals": observed.shape[0],
        "factor": cpu_of(lambda: factor_definite(*equations), repeat),
        "superlu": cpu_of(lambda: factor_definite(*equations, solver="superlu"), repeat),
        "condense": cpu_of(lambda: system.functionals(observed, sources), repeat),
        "blocks": cpu_of(blocks, repeat),
        "superlu_solves": cpu_of(lambda: factor.solve(block), repeat) / BLOCK_COLUMNS * sources.shape[1],
        "error": error(system.functionals(observed, sources)),
        "blocks_error": error(blocks()),
        "solve": cpu_of(lambda: own.solve(block[:, 0]), repeat),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--scale", type=float, nargs="+", default=[1.0, 0.7, 0.43, 0.17])
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks" / "results")
    wishes = parser.parse_args()
    wishes.out.mkdir(parents=True, exist_ok=True)
    lines = []
    for scale in wishes.scale:
        for friction in (0.0, 0.3):
            line = measure(scale, friction, wishes.repeat)
            lines.append(line)
            (wishes.out / "linear_algebra.json").write_text(json.dumps(lines, indent=1) + "\n")
            print(
                f"{line['nodes']:6} nodes {line['columns']:4} columns: "
                f"factor {line['factor']:.3f}, SuperLU {line['superlu'] / line['factor']:.2f} times; "
                f"condense {line['condense'] / line['factor']:.2f} of the factor, "
                f"SuperLU's solves {line['superlu_solves'] / line['condense']:.1f} times, "
                f"blocks {line['blocks'] / line['condense']:.1f} times; "
                f"error {line['error']:.0e}, blocks {line['blocks_error']:.0e}",
                flush=True,
            )


if __name__ == "__main__":
    main()
