"""Continuation: paths R(x, lam) = 0 followed as continuous functions of the load factor."""

from __future__ import annotations

from mlsanm_cli.continuation.bifurcation import bifurcation, branching
from mlsanm_cli.continuation.corrector import Correction, correct
from mlsanm_cli.continuation.follow import follow
from mlsanm_cli.continuation.path import Follower, Outcome, Step, StopReason
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
    "FloatArray",
    "Follower",
    "NewtonOptions",
    "Outcome",
    "PathOptions",
    "Problem",
    "SingularTangentError",
    "Step",
    "StopReason",
    "Tangent",
    "bifurcation",
    "branching",
    "correct",
    "follow",
]
