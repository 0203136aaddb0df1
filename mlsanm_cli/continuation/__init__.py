"""Continuation: paths R(x, lam) = 0 followed as continuous functions of the load factor."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation.anm import AnmFollower
from mlsanm_cli.continuation.newton import NewtonFollower
from mlsanm_cli.continuation.path import Follower
from mlsanm_cli.continuation.problem import AnmOptions, NewtonOptions, Problem
from mlsanm_cli.continuation.series import Branch


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
    """Return the follower of the path R(x, lam) = 0 from ``x0`` (size,) at ``lam0``, corrected if its
    residual requires it, to where the load factor first is ``lam_end``, by power series or the method of the
    ``options``. It goes on in the direction, and with the step length, of the ``previous`` piece. Steps of
    Newton's method end at the ``levels``; power series contain them, and do not factorise the tangent at the
    ``last`` state."""
    options = options or AnmOptions()
    method = NewtonFollower if isinstance(options, NewtonOptions) else AnmFollower
    return method(problem, x0, lam0, lam_end, options, previous, levels, last)
