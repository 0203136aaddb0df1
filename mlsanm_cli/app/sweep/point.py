"""One point of a sweep, solved by a process that may solve others."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from mlsanm_cli.app.run import run
from mlsanm_cli.errors import Interrupted, MlsanmError
from mlsanm_cli.memo import Memo

_ONE_AT_A_TIME = threading.Lock()
"""Workers of a cluster may have several threads; CPU times and signals belong to the process."""


class SweepPoint(NamedTuple):
    """A run to be made: the case, its changes, directory and options; ``memory`` is the number of results
    that its process keeps, and ``done`` points are skipped."""

    case: Path
    overrides: tuple[str, ...]
    directory: Path
    name: str
    threads: int
    memory: int
    argv: tuple[str, ...]
    done: bool


def solve_point(point: SweepPoint) -> Mapping[str, Any]:
    """Run one point; returns its name, status and stop reason, also if it fails."""
    with _ONE_AT_A_TIME:
        try:
            summary = run(
                point.case,
                overrides=point.overrides,
                out=point.directory,
                # The directory holds an unsuccessful run of the same case.
                force=True,
                threads=point.threads,
                console=Silent(),
                argv=point.argv,
                memo=_memo(point.memory),
            )
        except (KeyboardInterrupt, Interrupted):
            return outcome(point, "stopped", "stopped by a signal")
        except MlsanmError as error:
            return outcome(point, "failed", error.message)
        warnings = len(summary["warnings"])
        return outcome(point, str(summary["status"]), str(summary["stop_reason"]), warnings)


def outcome(point: SweepPoint, status: str, reason: str, warnings: int = 0) -> Mapping[str, Any]:
    """Status of a point and the number of warnings in its summary."""
    return {
        "name": point.name,
        "directory": str(point.directory),
        "status": status,
        "stop_reason": reason,
        "warnings": warnings,
    }


@lru_cache(maxsize=1)
def _memo(memory: int) -> Memo:
    """Memo of the process."""
    return Memo(memory)


class Silent:
    """Console without output: warnings are counted and stored in summaries."""

    def phase(self, *given: Any, **named: Any) -> None:
        """No output."""

    step = note = warning = error = table = phase
