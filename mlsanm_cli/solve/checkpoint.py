"""Where a path begins: before the first load, or behind a step of a run that was cut short.

Every step carries its method's mark, a dataclass of all that the next one depends on. Packed it is what a run
keeps of its path, and what the path is taken up from, to the same bits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

from mlsanm_cli.errors import RunError
from mlsanm_cli.packing import unpacked

Mark = TypeVar("Mark")


def restored(kind: type[Mark], content: bytes) -> Mark:
    """What a run packed to go on from; RunError if it is damaged, or of another version."""
    try:
        return unpacked(kind, content)
    except ValueError as error:
        raise RunError(
            f"the checkpoint of the run cannot be read: {error}",
            "it is damaged, or of another version of mlsanm; run the case again with --force",
        ) from error


@dataclass(frozen=True)
class Start:
    """``steps`` are done, and the last one's mark is ``packed``; nothing is, before the first load."""

    steps: int = 0
    packed: bytes = b""

    def mark(self, kind: type[Mark]) -> Mark | None:
        """The mark, of a method's own class; None at the beginning. RunError if it is of another."""
        return restored(kind, self.packed) if self.packed else None


BEGINNING = Start()
