"""The errors of mlsanm and their exit codes.

::

    MlsanmError                 70   (never raised itself)
    +-- CaseError                2
    +-- GeometryError            2   (reported as CaseError)
    |   +-- OutlineError         2
    +-- RunError                 2
    |   +-- WriteError           2
    +-- UnfinishedError          3
    +-- NumericalError           3
    |   +-- UnstableError        3
    +-- Interrupted             75
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class CaseProblem:
    """A problem in a case file. ``key`` is the dotted path as for ``--set``, ``line`` counts from 1 (0: not
    in the file, for instance a value given by ``--set``), ``hint`` is a correction."""

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
    """Base class of the errors of mlsanm."""

    exit_code = 70
    run: Any = None
    """The run that ended with this error, in the Python interface."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint

    @property
    def advice(self) -> str:
        """The message, followed by the hint if there is one."""
        return f"{self.message}; {self.hint}" if self.hint else self.message


class CaseError(MlsanmError):
    """The case is invalid; ``problems`` are all that were found."""

    exit_code = 2

    def __init__(self, problems: tuple[CaseProblem, ...]) -> None:
        super().__init__("\n".join(str(problem) for problem in problems))
        self.problems = problems


class RunError(MlsanmError):
    """Invalid usage outside the case: an existing run directory, an unreadable file, too large a scene."""

    exit_code = 2


class WriteError(RunError):
    """A file cannot be written: the disk is full, or permission is missing."""


class UnfinishedError(MlsanmError):
    """A run can no longer write, as its disk is full; completed steps are kept."""

    exit_code = 3


class GeometryError(MlsanmError):
    """The geometry of a body is invalid; callers that know its key in the case raise a CaseError instead."""

    exit_code = 2


@dataclass(frozen=True)
class Fault:
    """A fault of an outline; ``key`` is the path of the key below its shape."""

    key: tuple[str | int, ...]
    message: str
    hint: str = ""


class OutlineError(GeometryError):
    """An outline is not a closed boundary of a body; ``faults`` are all that were found."""

    def __init__(self, faults: Sequence[Fault]) -> None:
        super().__init__("\n".join(fault.message for fault in faults))
        self.faults = tuple(faults)


class NumericalError(MlsanmError):
    """No solution was found, or a check of the result failed; ``hint`` names a key to change."""

    exit_code = 3


class UnstableError(NumericalError):
    """The discretisation is not coercive; ``stability`` is the coercivity estimate."""

    def __init__(self, message: str, hint: str, stability: float) -> None:
        super().__init__(message, hint)
        self.stability = stability


class Interrupted(MlsanmError):
    """A signal or a limit ended the run early; completed steps are kept."""

    exit_code = 75
