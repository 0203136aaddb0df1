"""How the commands show what is happening; the command line supplies one, tests another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol


class Console(Protocol):
    """Messages of a run, all on stderr."""

    def phase(self, text: str) -> None:
        """What is being done now."""

    def step(self, index: int, position: float, residual: float, text: str) -> None:
        """One finished step of the path."""

    def note(self, text: str) -> None:
        """Something worth knowing."""

    def warning(self, text: str) -> None:
        """Something that may make the result worse."""

    def table(self, title: str, rows: Sequence[tuple[str, str]]) -> None:
        """A small table of names and values."""
