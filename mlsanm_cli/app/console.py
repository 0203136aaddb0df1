"""The interface through which commands show progress, implemented by the command line and tests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol


class Console(Protocol):
    """Messages of a run, all on stderr."""

    def phase(self, text: str) -> None:
        """Starts a phase."""

    def step(self, index: int, position: float, residual: float, text: str) -> None:
        """A finished step of the path."""

    def note(self, text: str) -> None:
        """A note."""

    def warning(self, text: str) -> None:
        """A warning about the accuracy or validity of the result."""

    def table(self, title: str, rows: Sequence[tuple[str, str]]) -> None:
        """A small table of names and values."""
