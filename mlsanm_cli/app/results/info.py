"""``mlsanm info`` and ``mlsanm collect``: summary and provenance of a run; one row per run."""

from __future__ import annotations

import csv
import io
import time
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mlsanm_cli.case import stored_case
from mlsanm_cli.case.reading.overrides import flat
from mlsanm_cli.cloud.cloud import at_axis
from mlsanm_cli.contact.geometry.profile import half_width
from mlsanm_cli.errors import RunError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.files import read_summary, write_text
from mlsanm_cli.io.run_reader import RunData, read_origin, read_run


def info(rundir: Path) -> Mapping[str, Any]:
    """The summary of a run, or without one the figures of its steps, and its provenance. Raises RunError."""
    run = read_run(rundir, ("path", "contacts"))
    summary_file = run.directory / run_dir.SUMMARY_FILE
    summary = read_summary(summary_file) if summary_file.is_file() else _unfinished(run)
    keys = ("mlsanm_version", "git", "versions", "argv", "host", "cpu", "threads", "resumed", "case_path")
    origin = {key: run.attributes.get(key) for key in (*keys, "case_hash", "cache_hash")}
    provenance = {key: value for key, value in origin.items() if value not in (None, "")}
    return {"directory": str(run.directory), **summary, "provenance": provenance}


def _unfinished(run: RunData) -> dict[str, Any]:
    age = time.time() - (run.directory / run_dir.RUN_FILE).stat().st_mtime
    writer, path = run_dir.holder(run.directory), run.path
    known: dict[str, Any] = {"status": run.status}
    if writer:
        known["stop_reason"] = f"no summary: still running, {writer}; last written {age:.0f} s ago"
    else:
        known["stop_reason"] = f"killed or out of disk space: ended without a summary {age:.0f} s ago"
        known["hint"] = f"continue with: {run_dir.resume_command(run.directory)}"
    known |= {"steps": max(run.rows - 1, 0), "nodes": int(run.attributes.get("nodes", 0))}
    if not run.rows:
        return known
    revolved, contacts = stored_case(run.case_resolved).model.revolved, {}
    for name, contact in run.contacts.items():
        pressure, axis = contact.pressure[-1], at_axis(contact.points, revolved)
        contacts[name] = {
            "peak_pressure": float(pressure.max(initial=0.0)),
            "half_width": half_width(contact.arc_length, pressure, axis),
            "min_gap": float(contact.gap[-1].min()),
        }
    counts = {name: int(path[name].sum()) for name in ("factorizations", "solves")}
    known |= {"position": float(path.position[-1]), **counts, "residual": float(path.residual.max())}
    return {**known, "contacts": contacts}


FIGURES = (
    *("position", "steps", "factorizations", "solves", "nodes", "contact_unknowns", "contacts", "forces"),
    *("residual", "linear_residual", "force_balance", "energy_error", "stability", "error_estimate"),
    *("warnings", "seconds", "peak_memory_mb"),
)
"""Entries of a summary that become columns."""

Row = dict[str, Any]


def collect(rundirs: Sequence[Path]) -> list[Row]:
    """One row per run: directory, status, the keys that differ between the cases, the figures available;
    files among the arguments, as ``sweep.csv``, are ignored."""
    runs = [_run(place) for place in rundirs if not place.is_file() or place.name == run_dir.RUN_FILE]
    cases = [case for _, case, _ in runs if case]
    keys = dict.fromkeys(key for case in cases for key in case)
    varied = [key for key in keys if any(case.get(key) != cases[0].get(key) for case in cases)]
    columns = dict.fromkeys(name for _, _, figures in runs for name in figures)
    return [
        {**head, **{key: case.get(key) for key in varied}, **{name: figures.get(name) for name in columns}}
        for head, case, figures in runs
    ]


def as_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """The rows as CSV with a header; lists in one cell, empty cells for missing figures."""
    stream = io.StringIO()
    if rows:
        writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        for row in rows:
            # Text that spreadsheets would compute as a formula begins with an apostrophe.
            texts = {key: one for key, one in row.items() if isinstance(one, str)}
            formulas = {key: f"'{one}" for key, one in texts.items() if one[:1] in set("=+-@\t\r")}
            writer.writerow({**row, **formulas})
    return stream.getvalue()


def write_rows(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Writes the rows as a CSV file, atomically. Raises RunError if that fails."""
    write_text(path, as_csv(rows))


def _run(directory: Path) -> tuple[Row, dict[str, Any], dict[str, Any]]:
    """Directory and status of a run, its case and its figures."""
    row: Row = {"directory": str(directory), "status": "unreadable", "stop_reason": None}
    case: dict[str, Any] = {}
    columns: dict[str, Any] = {}
    try:
        head = read_origin(directory)
        case, row["status"] = flat(tomllib.loads(head.case_resolved)), head.status
        if not (directory / run_dir.SUMMARY_FILE).is_file():
            raise RunError("no summary: still running or killed")
        known = read_summary(directory / run_dir.SUMMARY_FILE)
    except RunError as error:
        return {**row, "stop_reason": error.message}, case, columns
    row |= {"status": known.get("status"), "stop_reason": known.get("stop_reason")}
    chosen = flat({name: known[name] for name in FIGURES if name in known})
    chosen["warnings"] = chosen.get("warnings") or None
    for name, value in chosen.items():
        # Vectors by component.
        if isinstance(value, list) and len(value) == 2 and not any(isinstance(part, str) for part in value):
            columns |= {f"{name}_x": value[0], f"{name}_y": value[1]}
        elif not isinstance(value, Mapping):
            columns[name] = value
    return row, case, columns
