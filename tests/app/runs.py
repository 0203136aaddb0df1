"""What runs have written, and whether two of them hold the same results."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from mlsanm_cli.io import schema
from mlsanm_cli.io.run_reader import read_run


def warned(summary: Mapping[str, Any]) -> list[str]:
    """Names of the checks that warned."""
    return [check["name"] for check in summary["checks"] if check["outcome"] == "warned"]


def summary_of(directory: Path) -> dict[str, Any]:
    return dict(json.loads((directory / "summary.json").read_text()))


def events_of(directory: Path, *kinds: str) -> list[dict[str, Any]]:
    """The events of these kinds, or all."""
    events = [json.loads(line) for line in (directory / "events.jsonl").read_text().splitlines()]
    return [event for event in events if not kinds or event["event"] in kinds]


def stored(directory: Path) -> dict[str, Any]:
    """Every dataset of a run but its times."""
    found: dict[str, Any] = {}

    def keep(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and name not in ("path/seconds", "case/raw"):
            found[name] = item[()]

    with h5py.File(directory / "run.h5", "r") as root:
        root.visititems(keep)
    return found


def quantity(table: schema.Table, path: str) -> schema.Quantity | None:
    """The quantity of a table that is written at a ``path`` with names for the parts in braces."""
    for entry in table:
        parts = re.split(r"\{\w+\}", entry.path)
        # Names in a path of HDF5 contain no slash; checkpoints are nested further.
        name = ".+" if "/" not in entry.path or entry.path.startswith("checkpoint/") else "[^/]+"
        if re.fullmatch(name.join(map(re.escape, parts)), path):
            return entry
    return None


def undeclared(directory: Path) -> list[str]:
    """What a run has written that is not in the schema: datasets, or their types and shapes, columns of
    path.csv, and entries of the summary."""
    data, wrong = stored(directory), []
    for path, values in data.items():
        declared = quantity(schema.RUN_FILE, path)
        array, group = np.asarray(values), path.rpartition("/")[0]
        kind = "text" if array.dtype.kind in "OSU" else str(array.dtype)
        sizes = {"step": len(data["path/position"]), "contact_node": len(data.get(f"{group}/points", ()))}
        named = zip(getattr(declared, "dimensions", ()), array.shape, strict=False)
        free = {axis: size for axis, size in named if axis not in schema.COMPONENTS}
        sizes = free | sizes
        if declared is None or (
            not path.startswith("checkpoint/")
            and (kind, array.shape) != (declared.dtype, declared.shape(sizes))
        ):
            wrong.append(f"{path}: {kind}, {array.shape}")
    with (directory / "path.csv").open() as stream:
        columns = next(csv.reader(stream))
    plain = [re.sub("_[xy]$", "", name) for name in columns]
    wrong += [name for name in plain if quantity(schema.PATH_COLUMNS, name) is None]
    return wrong + list(summary_of(directory).keys() - {one.path.split(".")[0] for one in schema.SUMMARY})


def assert_same_results(one: Path, other: Path) -> None:
    """Two runs hold the same numbers, but for round-off."""
    first, second = stored(one), stored(other)
    assert first.keys() == second.keys()
    for name, values in first.items():
        if np.asarray(values).dtype.kind == "f":
            size = float(np.abs(values).max(initial=0.0, where=np.isfinite(values)))
            np.testing.assert_allclose(second[name], values, rtol=0.0, atol=1e-9 * size, err_msg=name)
        else:
            np.testing.assert_array_equal(second[name], values, err_msg=name)


def resumed_differences(one: Path, other: Path, tolerance: float = 1e-6) -> list[str]:
    """Names of files, saved states and final values in which a run and one that was resumed differ by more
    than the tolerance of the solver, relative to the largest value; the steps between are their own."""
    found = sorted({path.name for path in one.iterdir()} ^ {path.name for path in other.iterdir()})
    first, second = read_run(one), read_run(other)
    if first.status != second.status or len(first.states) != len(second.states):
        found.append(
            f"status {first.status} {second.status}, {len(first.states)} {len(second.states)} states"
        )
    pairs = [("position", first.path.position[-1], second.path.position[-1])]
    for number, (state, again) in enumerate(zip(first.states, second.states, strict=False)):
        pairs.append((f"position of state {number}", state.position, again.position))
        for body, arrays in state.bodies.items():
            pairs += [(f"{body} {name} {number}", a, again.bodies[body][name]) for name, a in arrays.items()]
    for contact, data in first.contacts.items():
        for name in ("pressure", "traction", "gap", "slip", "dissipated_work"):
            ends = getattr(data, name)[-1], getattr(second.contacts[contact], name)[-1]
            pairs.append((f"{contact} {name}", *ends))
    for name, a, b in pairs:
        size = float(np.nanmax(np.abs(a), initial=0.0))
        if not np.allclose(a, b, rtol=0.0, atol=tolerance * size, equal_nan=True):
            found.append(name)
    events = [[event["index"] for event in events_of(place, "step")] for place in (one, other)]
    rows = first.rows, second.rows
    return found + [f"events {k}" for k in (0, 1) if events[k] != list(range(rows[k]))]
