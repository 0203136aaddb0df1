"""Whether two run directories hold the same results."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from mlsanm_cli.io.run_reader import read_run


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
    events = [[event["index"] for event in _events(place) if "index" in event] for place in (one, other)]
    rows = first.path.rows, second.path.rows
    return found + [f"events {k}" for k in (0, 1) if events[k] != list(range(rows[k]))]


def _events(directory: Path) -> list[dict[str, Any]]:
    events = [json.loads(line) for line in (directory / "events.jsonl").read_text().splitlines()]
    return [event for event in events if event["event"] in {"step", "warning"}]
