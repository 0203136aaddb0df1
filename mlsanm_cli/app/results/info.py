"""``mlsanm info``: summary and provenance of a run, complete or not; whether it is of a given case."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mlsanm_cli import __version__
from mlsanm_cli.contact.geometry.profile import half_width
from mlsanm_cli.errors import RunError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.lock import holder
from mlsanm_cli.io.run_reader import RunData, read_origin, read_run
from mlsanm_cli.io.summary import read_json

PROVENANCE = (
    "mlsanm_version",
    "git",
    "versions",
    "argv",
    "host",
    "cpu",
    "threads",
    "resumed",
    "case_path",
    "case_hash",
    "cache_hash",
)


def info(rundir: Path) -> Mapping[str, Any]:
    """The summary of a run and its provenance. A run without summary.json is still running or was killed,
    which the lock of the directory distinguishes; its figures are those of the steps in run.h5. Raises
    RunError for a directory without a readable run."""
    run = read_run(rundir, ("path", "contacts"))
    summary_file = run.directory / run_dir.SUMMARY_FILE
    summary = read_json(summary_file) if summary_file.is_file() else _unfinished(run)
    provenance = {key: run.attributes[key] for key in PROVENANCE if run.attributes.get(key) not in (None, "")}
    return {"directory": str(run.directory), **summary, "provenance": provenance}


def _unfinished(run: RunData) -> dict[str, Any]:
    """The figures in run.h5 of a run without summary.json."""
    age = time.time() - (run.directory / run_dir.RUN_FILE).stat().st_mtime
    writer = holder(run.directory)
    if writer:
        ending = {"stop_reason": f"no summary: still running, {writer}; last written {age:.0f} s ago"}
    else:
        ending = {
            "stop_reason": f"killed or out of disk space: ended without a summary {age:.0f} s ago",
            "hint": f"continue with: {run_dir.resume_command(run.directory)}",
        }
    path = run.path
    known: dict[str, Any] = {
        "status": run.status,
        **ending,
        "steps": max(run.rows - 1, 0),
        "nodes": int(run.attributes.get("nodes", 0)),
    }
    if not run.rows:
        return known
    known |= {
        "position": float(path.position[-1]),
        "factorizations": int(path.factorizations.sum()),
        "solves": int(path.solves.sum()),
        "residual": float(path.residual.max()),
        "contacts": {
            name: {
                "peak_pressure": float(contact.pressure[-1].max(initial=0.0)),
                "half_width": half_width(contact.arc_length, contact.pressure[-1]),
                "min_gap": float(contact.gap[-1].min()),
            }
            for name, contact in run.contacts.items()
        },
    }
    return known


def held_case(directory: Path) -> str | None:
    """The hash of the case of the run in ``directory``, complete or not; None without a readable run."""
    try:
        return str(read_origin(directory).attributes.get("case_hash", ""))
    except RunError:
        return None


def finished(directory: Path, case_hash: str) -> Mapping[str, Any] | None:
    """The summary of a completed run of this case by this version, None if there is none."""
    try:
        known = read_origin(directory).attributes
        wanted = {"case_hash": case_hash, "mlsanm": __version__, "status": "done"}
        if any(known.get(key) != value for key, value in wanted.items()):
            return None
        summary = read_json(directory / run_dir.SUMMARY_FILE)
    except RunError:
        return None
    return summary if summary.get("status") == "done" else None
