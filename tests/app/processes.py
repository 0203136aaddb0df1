"""The command as a process of its own, and a case that keeps it busy."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable
from pathlib import Path

from tests.app.scenes import hertz
from tests.processes import python

CLI = ("-m", "mlsanm_cli")
PATIENCE = 120.0

QUICK = hertz().changed("accuracy = 0.01", "accuracy = 0.1")
# Thousands of saved states: the run continues for a minute.
LONG = QUICK.table("output", vtu=False, at=[round(0.2 + 0.0002 * k, 4) for k in range(4001)])


def mlsanm(
    directory: Path, *arguments: str, program: tuple[str, ...] = CLI, **environment: str
) -> subprocess.CompletedProcess[str]:
    """What the command says, or a program that calls it."""
    return python(*program, *arguments, cwd=directory, **environment)


def wait_for_steps(run: Path, steps: int, alive: Callable[[], bool]) -> None:
    """Until a run, of a process that must be alive, has made so many steps."""
    events = run / "events.jsonl"
    end = time.monotonic() + PATIENCE
    while not events.is_file() or events.read_text().count('"step"') < steps:
        assert alive()
        assert time.monotonic() < end
        time.sleep(0.02)
