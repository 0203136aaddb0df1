"""Continuation: paths R(x, lam) = 0 followed as continuous functions of the load factor."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from mlsanm_cli.continuation.anm import AnmFollower
from mlsanm_cli.continuation.corrector import Correction, Effort, correct
from mlsanm_cli.continuation.newton import NewtonFollower
from mlsanm_cli.continuation.path import Follower, Step, StopReason
from mlsanm_cli.continuation.problem import (
    AnmOptions,
    FloatArray,
    NewtonOptions,
    PathOptions,
    Problem,
    SingularTangentError,
    Tangent,
)
from mlsanm_cli.continuation.series import Branch

__all__ = [
    "AnmOptions",
    "Branch",
    "Correction",
    "Effort",
    "FloatArray",
    "Follower",
    "NewtonOptions",
    "PathOptions",
    "Problem",
    "SingularTangentError",
    "Step",
    "StopReason",
    "Tangent",
    "correct",
    "follow",
]


def follow(
    problem: Problem,
    x0: FloatArray,
    lam0: float,
    lam_end: float,
    options: AnmOptions | NewtonOptions | None = None,
    previous: Branch | None = None,
    levels: Sequence[float] = (),
    last: Callable[[FloatArray, float], bool] | None = None,
) -> Follower:
    """Return the follower of the path R(x, lam) = 0 from (x0, lam0) to the load factor ``lam_end``.

    Parameters
    ----------
    x0 : (size,), start point; corrected at fixed ``lam0`` if its residual requires it (after a ``previous``
        piece: if it exceeds the tolerance)
    lam_end : the path ends where the load factor first takes this value
    options : they also select the method: power series (default) or Newton-Raphson
    previous : the piece of path that led to the start point; the path continues in its direction with its
        step length, as if it had not been interrupted
    levels : load factors at which states are wanted. Steps of Newton's method end there; power series
        contain them anyway
    last : whether the caller leaves the path at a state, the end of a step: power series then do not
        factorise the tangent there
    """
    options = options or AnmOptions()
    method = NewtonFollower if isinstance(options, NewtonOptions) else AnmFollower
    return method(problem, x0, lam0, lam_end, options, previous, levels, last)
