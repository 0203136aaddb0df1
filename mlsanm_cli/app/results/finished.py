"""Whether a directory already contains a completed run of a case."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mlsanm_cli import __version__
from mlsanm_cli.errors import RunError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.run_reader import read_origin
from mlsanm_cli.io.summary import read_json


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
