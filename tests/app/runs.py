"""Whether two run directories hold the same results, bit for bit."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py

VARYING = {"seconds", "wall_seconds", "peak_memory_mb", "cache"}
"""Figures that tell how a run went and not what it found."""


def differences(one: Path, other: Path) -> list[str]:
    """Names of files, arrays and figures in which two runs differ, times, memory and cache apart."""
    names = {path.name for path in one.iterdir()} ^ {path.name for path in other.iterdir()}
    found = sorted(names)
    first, second = _arrays(one), _arrays(other)
    found += sorted(key for key in first.keys() | second.keys() if first.get(key) != second.get(key))
    first, second = _figures(one), _figures(other)
    found += sorted(key for key in first.keys() | second.keys() if first.get(key) != second.get(key))
    special = {"run.h5", "summary.json", "events.jsonl", *names}
    files = [path.name for path in one.iterdir() if path.name not in special]
    found += sorted(name for name in files if (one / name).read_bytes() != (other / name).read_bytes())
    return found + (["events.jsonl"] if _events(one) != _events(other) else [])


def _arrays(directory: Path) -> dict[str, Any]:
    found: dict[str, Any] = {}

    def add(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            text = item.dtype.kind == "O"
            found[name] = (
                item.shape,
                item.dtype.str,
                str(item.asstr()[()]) if text else item[()].tobytes(),
            )

    with h5py.File(directory / "run.h5", "r") as file:
        file.visititems(add)
        found["status"] = file.attrs["status"]
    found.pop("path/seconds", None)
    return found


def _figures(directory: Path) -> dict[str, Any]:
    figures = json.loads((directory / "summary.json").read_text())
    return {key: value for key, value in figures.items() if key not in VARYING}


def _events(directory: Path) -> list[dict[str, Any]]:
    events = [json.loads(line) for line in (directory / "events.jsonl").read_text().splitlines()]
    return [event for event in events if event["event"] in {"step", "warning"}]
