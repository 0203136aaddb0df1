"""One point of a sweep, as a process solves it that solves others before and after."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from mlsanm_cli.app.run import run
from mlsanm_cli.errors import MlsanmError
from mlsanm_cli.memo import Memo

_ONE_AT_A_TIME = threading.Lock()
"""Workers of a cluster may have several threads; CPU times and signals belong to the process."""


@dataclass(frozen=True)
class SweepPoint:
    """A run still to be made: the case, its changes, where it goes, and how; ``memory`` is how many results
    its process keeps. ``done`` means that it need not be made."""

    case: Path
    overrides: tuple[str, ...]
    directory: Path
    name: str
    threads: int
    memory: int
    argv: tuple[str, ...]
    done: bool


def solve_point(point: SweepPoint) -> Mapping[str, Any]:
    """Run one point; its name, status and stop reason, whatever happens to it."""
    with _ONE_AT_A_TIME:
        try:
            summary = run(
                point.case,
                overrides=point.overrides,
                out=point.directory,
                # What lies there is a run of the same case that did not end well.
                force=True,
                threads=point.threads,
                console=Silent(),
                argv=point.argv,
                memo=_memo(point.memory),
            )
        except MlsanmError as error:
            return outcome(point, "failed", error.message)
        except KeyboardInterrupt:
            return outcome(point, "stopped", "stopped by a signal")
        warnings = len(summary["warnings"])
        return outcome(point, str(summary["status"]), str(summary["stop_reason"]), warnings)


def outcome(point: SweepPoint, status: str, reason: str, warnings: int = 0) -> Mapping[str, Any]:
    """How a point ended, and how many warnings its summary has."""
    return {
        "name": point.name,
        "directory": str(point.directory),
        "status": status,
        "stop_reason": reason,
        "warnings": warnings,
    }


@lru_cache(maxsize=1)
def _memo(memory: int) -> Memo:
    """The process's memo."""
    return Memo(memory)


class Silent:
    """A console for runs whose results speak for themselves: warnings are counted and in their summaries."""

    def phase(self, text: str) -> None:
        """Says nothing."""

    def step(self, index: int, position: float, residual: float, text: str) -> None:
        """Says nothing."""

    def note(self, text: str) -> None:
        """Says nothing."""

    def warning(self, text: str) -> None:
        """Says nothing."""

    def table(self, title: str, rows: Sequence[tuple[str, str]]) -> None:
        """Says nothing."""
