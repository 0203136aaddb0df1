"""Run files for the tests: made-up steps, written and read."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from mlsanm_cli.io.run_file import ContactRecord, RunFile, StepRecord

M = 7  # slave nodes of the contact
LOADS = ["squeeze", "press"]
RESULTANTS = ["press", "block.bottom"]


def contact_record(step: int) -> ContactRecord:
    base = np.linspace(0.0, 1.0, M) + step
    return ContactRecord(
        pressure=base,
        traction=base + 0.1,
        gap=base + 0.2,
        slip=base + 0.3,
        status=np.array([0, 1, 2, 0, 1, 2, step % 3], dtype=np.int8),
    )


def step_record(step: int, seconds: float = 0.5) -> StepRecord:
    return StepRecord(
        position=step / 8,
        step_length=0.125,
        residual=1e-9 * step,
        order=20,
        factorizations=step,
        solves=20 * step,
        seconds=seconds,
        factors={"press": step / 8, "squeeze": 1.0},
        resultants={"press": np.array([0.0, -step]), "block.bottom": np.array([0.5, step])},
        contacts={"interface": contact_record(step)},
    )


def start_run(path: Path) -> RunFile:
    run = RunFile.create(path, {"argv": "mlsanm run a.toml", "threads": 1, "wall_limit": 2.5})
    run.write_case('title = "é"\n', "format = 1\n")
    points = np.arange(10.0).reshape(5, 2)
    run.write_body("upper", points, np.array([0, 3]), np.array([[0.0, 1.0], [1.0, 0.0]]), ["arc", "flat"])
    run.write_body("block", points + 1, np.array([4]), np.array([[0.0, -1.0]]), ["bottom"])
    line = np.linspace(-1.0, 1.0, M)
    nodes = np.column_stack([line, line**2])
    run.write_contact("interface", nodes, np.tile([0.0, 1.0], (M, 1)), line + 1, np.full(M, 1 / 3))
    run.start_path(LOADS, RESULTANTS)
    return run


def write_steps(run: RunFile, steps: range, seconds: float = 0.5) -> None:
    for step in steps:
        coefficients = np.full((21, M), float(step))
        run.write_series(step, {"pressure": coefficients}, {"length": 0.125, "start": step / 8})
        run.append_step(step_record(step, seconds))
        run.commit()


def datasets(path: Path) -> dict[str, np.ndarray]:
    found = {}
    with h5py.File(path, "r") as file:
        file.visititems(
            lambda name, item: found.update({name: item[...]}) if isinstance(item, h5py.Dataset) else None
        )
    return found
