"""The errors of mlsanm and the exit codes they end a command with.

::

    MlsanmError                 70   (never raised itself)
    +-- CaseError                2   the case file is wrong: every problem found, with file and line
    +-- GeometryError            2   a body's geometry cannot be used (reported as CaseError)
    |   +-- OutlineError         2   an outline drawn in the case: every fault with the key of its shape
    +-- RunError                 2   bad usage: run directory exists, file unreadable, scene too large
    |   +-- WriteError           2   a file cannot be written
    +-- UnfinishedError          3   a run cannot write on; what was done is kept, resume continues
    +-- NumericalError           3   the solver could not finish, or a check of the result failed
    |   +-- UnstableError        3   the stability certificate of the discretisation failed
    +-- Interrupted             75   stopped by a signal or a wall-time limit; what was done is kept
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class CaseProblem:
    """One thing wrong in a case file.

    ``key`` is the dotted path as ``--set`` takes it, ``line`` counts from 1 (0: not in the file, for
    instance a value given with ``--set``), ``hint`` says what to write instead.
    """

    key: str
    message: str
    line: int = 0
    source: str = ""
    hint: str = ""

    def __str__(self) -> str:
        place = f"{self.source}:{self.line}: " if self.line else f"{self.source}: " if self.source else ""
        hint = f" ({self.hint})" if self.hint else ""
        return f"{place}{self.key}: {self.message}{hint}"


class MlsanmError(Exception):
    """Base of every error that mlsanm raises on purpose."""

    exit_code = 70

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint


class CaseError(MlsanmError):
    """The case cannot be run as written; carries every problem found, not only the first."""

    exit_code = 2

    def __init__(self, problems: tuple[CaseProblem, ...]) -> None:
        super().__init__("\n".join(str(problem) for problem in problems))
        self.problems = problems


class RunError(MlsanmError):
    """Bad usage outside the case file: an existing run directory, an unreadable file, too large a scene."""

    exit_code = 2


class WriteError(RunError):
    """A file cannot be written: the disk is full, or permission is missing."""


class UnfinishedError(MlsanmError):
    """A run that had begun cannot write on, as its disk is full; what was done is kept."""

    exit_code = 3


class GeometryError(MlsanmError):
    """The geometry of a body cannot be used; the message says what is wrong with it and where.

    Callers that know its key in the case file turn it into a CaseError.
    """

    exit_code = 2


@dataclass(frozen=True)
class Fault:
    """One fault of an outline; ``key`` is the path of the key below its shape."""

    key: tuple[str | int, ...]
    message: str
    hint: str = ""


class OutlineError(GeometryError):
    """An outline is no closed boundary of a body; carries every fault found."""

    def __init__(self, faults: Sequence[Fault]) -> None:
        super().__init__("\n".join(fault.message for fault in faults))
        self.faults = tuple(faults)


class NumericalError(MlsanmError):
    """The numbers cannot be trusted or could not be found; ``hint`` names a key to change."""

    exit_code = 3


class UnstableError(NumericalError):
    """The discretisation failed its stability certificate, whose value is ``stability``."""

    def __init__(self, message: str, hint: str, stability: float) -> None:
        super().__init__(message, hint)
        self.stability = stability


class Interrupted(MlsanmError):
    """A signal or a limit ended the run early; everything up to the last finished step is kept."""

    exit_code = 75
