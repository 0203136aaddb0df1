"""Run files for the tests: made-up steps, written and read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from mlsanm_cli.io.columns import row
from mlsanm_cli.io.run_file import RunFile

M = 7  # slave nodes of the contact
LOADS = ["squeeze", "press"]
RESULTANTS = ["press", "block.bottom"]


def contact_values(step: int) -> dict[str, Any]:
    base, status = np.linspace(0.0, 1.0, M) + step, np.array([0, 1, 2, 0, 1, 2, step % 3], dtype=np.int8)
    values = {name: base + k / 4 for k, name in enumerate(("pressure", "traction", "gap", "slip"))}
    return {**values, "status": status, "dissipated_work": 0.0}


def step_row(step: int, seconds: float = 0.5, contacts: dict[str, dict[str, Any]] | None = None) -> Any:
    path = {"position": step / 8, "step_length": 0.125, "residual": 1e-9 * step, "order": 20}
    path |= {"factorizations": step, "solves": 20 * step, "seconds": seconds}
    return row(
        path,
        {
            "factors": {"squeeze": 1.0, "press": step / 8},
            "resultants": {"press": np.array([0.0, -step]), "block.bottom": np.array([0.5, step])},
            "contacts": {"interface": contact_values(step)} if contacts is None else contacts,
        },
    )


def start_run(path: Path) -> RunFile:
    run = RunFile.create(path, {"argv": "mlsanm run a.toml", "threads": 1, "wall_limit": 2.5})
    points, line = np.arange(10.0).reshape(5, 2), np.linspace(-1.0, 1.0, M)
    run.confirm({"case/raw": 'title = "é"\n', "case/resolved": "format = 1\n"})
    for name, index, normal, names in (
        ("upper", [0, 3], [[0.0, 1.0], [1.0, 0.0]], ["arc", "flat"]),
        ("block", [4], [[0.0, -1.0]], ["bottom"]),
    ):
        boundary = f"bodies/{name}/boundary"
        run.confirm({f"bodies/{name}/points": points, f"{boundary}/index": np.array(index)})
        run.confirm({f"{boundary}/normal": np.array(normal), f"{boundary}/name": names})
    geometry = {
        "points": np.column_stack([line, line**2]),
        "normal": np.tile([0.0, 1.0], (M, 1)),
        "arc_length": line + 1,
        "weight": np.full(M, 1 / 3),
    }
    run.confirm({f"contacts/interface/{key}": array for key, array in geometry.items()})
    return run


def write_steps(run: RunFile, steps: range, seconds: float = 0.5) -> None:
    for step in steps:
        series = {f"series/{step}/pressure": np.full((21, M), float(step))}
        numbers = {f"series/{step}": {"length": 0.125, "start": step / 8}}
        run.add([step_row(step, seconds)], series, numbers)


def write_fields(run: RunFile, number: int, position: float, fields: dict[str, Any]) -> None:
    datasets = {f"fields/{number}/{name}": array for name, array in fields.items()}
    run.add([{"fields/position": position}], datasets)


def datasets(path: Path) -> dict[str, np.ndarray]:
    found = {}
    with h5py.File(path, "r") as file:
        file.visititems(
            lambda name, item: found.update({name: item[...]}) if isinstance(item, h5py.Dataset) else None
        )
    return found
