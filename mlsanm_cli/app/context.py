"""What all phases of a command share: its clock, its console, what it may reuse, and what may stop it."""

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
    """``memo`` keeps what other runs of the process can use; without a ``stopper`` nothing but the end of the
    process stops a command."""

    clock: Clock
    console: Console
    memo: Memo = NO_CACHE
    stopper: Stopper | None = None

    @contextmanager
    def phase(self, name: str, announced: str = "") -> Iterator[None]:
        """Count the block's CPU time under ``name``, and announce it on the console."""
        with self.clock.phase(name):
            if announced:
                self.console.phase(announced)
            yield

    def stop_gently(self) -> None:
        """From now on the command stops between steps only, where nothing done is lost."""
        if self.stopper is not None:
            self.stopper.gentle = True
        self.check_stop()

    def check_stop(self) -> None:
        """Raise KeyboardInterrupt if the command is to stop here."""
        if self.stopper is not None:
            self.stopper.check()
