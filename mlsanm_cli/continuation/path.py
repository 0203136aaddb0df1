"""What every method that follows a path hands out: its steps, why it stopped, and where.

A follower is used once::

    follower = follow(problem, x0, lam0, lam_end, options)
    for step in follower.steps():
        ...                        # follower.stop() ends the path after this step
    follower.outcome               # reason, last point, totals
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from mlsanm_cli.continuation.problem import FloatArray
from mlsanm_cli.continuation.series import Branch


class StopReason(StrEnum):
    """Why a path ended; the values are what users read."""

    TARGET_REACHED = "target reached"
    EVENT = "event"
    MAX_STEPS = "max steps"
    STEP_TOO_SMALL = "step too small"
    NOT_ADMISSIBLE = "not admissible"
    SINGULAR_TANGENT = "singular tangent"
    CORRECTION_FAILED = "correction failed"
    STOPPED_BY_CALLER = "stopped by caller"


@dataclass(frozen=True, eq=False)
class Step:
    """One finished step of a path.

    Attributes
    ----------
    index : 1 for the first step
    branch : the path over the step; ``branch.evaluate(branch.length)`` is the end before a correction
    x, lam : end of the step and start of the next: unknowns, shape (size,), and load factor
    residual : largest residual at the end
    arc_length : length of the step along its first tangent, in the scaled units of the path
    iterations : Newton updates; of power series those made at the end
    factorizations, solves : tangents factorised and systems solved for this step, failed trials included
    order : order of the power series; 0 where ``branch`` is none and only its ends are on the path
    """

    index: int
    branch: Branch
    x: FloatArray
    lam: float
    residual: float
    arc_length: float
    iterations: int
    factorizations: int
    solves: int
    order: int


@dataclass(frozen=True, eq=False)
class Outcome:
    """How a path ended: ``reason``, a sentence about it, the last good point, totals of the whole path.

    ``piece`` is the last step as long as it would have been without an event: the ``previous`` of a path that
    goes on, which needs no more of it than its ``tangent``.
    """

    reason: StopReason
    message: str
    x: FloatArray
    lam: float
    residual: float
    steps: int
    iterations: int
    factorizations: int
    solves: int
    piece: Branch | None

    @property
    def reached(self) -> bool:
        """Whether the path came to the load factor asked for."""
        return self.reason is StopReason.TARGET_REACHED


class Follower(Protocol):
    """A method that follows a path step by step."""

    def steps(self) -> Iterator[Step]:
        """Yield the steps as they are finished; may be called once."""
        ...

    def stop(self) -> None:
        """End the path after the step handed out last."""
        ...

    @property
    def outcome(self) -> Outcome:
        """How the path ended, or, while steps are still to come, where it stands (stopped by the caller)."""
        ...
