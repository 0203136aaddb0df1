"""The context shared by the phases of a command: clock, console, memo and stopper."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from mlsanm_cli.app.clock import Clock
from mlsanm_cli.app.console import Console
from mlsanm_cli.app.signals import Stopper
from mlsanm_cli.memo import NO_CACHE, Memo


@dataclass(frozen=True)
class RunContext:
    """``memo`` keeps results for other runs of the process; ``stopper`` handles signals and the wall time."""

    clock: Clock
    console: Console
    memo: Memo = NO_CACHE
    stopper: Stopper | None = None

    @contextmanager
    def phase(self, name: str, announced: str = "") -> Iterator[None]:
        """Counts the CPU time of the block under ``name``, and announces it on the console."""
        with self.clock.phase(name):
            if announced:
                self.console.phase(announced)
            yield

    def stop_gently(self) -> None:
        """From now on the command stops between steps only, where no results are lost."""
        if self.stopper is not None:
            self.stopper.gentle = True
        self.check_stop()

    def check_stop(self) -> None:
        """Raises KeyboardInterrupt if the command is to stop."""
        if self.stopper is not None:
            self.stopper.check()
