"""The checkpoint of a run: conversion to and from the datasets of /checkpoint in run.h5."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, is_dataclass
from typing import Any, TypeVar

import numpy as np

from mlsanm_cli.app.checks.refinement import Pass, Refinement
from mlsanm_cli.contact.laws.contact_status import ContactStatus
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.run_file import Value
from mlsanm_cli.io.run_reader import RunOrigin
from mlsanm_cli.solve.state import Checkpoint, FrictionHistory, State

REFINEMENT = "checkpoint/refinement"

Record = TypeVar("Record")


@dataclass(frozen=True)
class EarlierRun:
    """An interrupted run: the rows of its path, the seconds that they took, and the ``figures`` counted so
    far."""

    rows: int
    seconds: float
    figures: Mapping[str, Any]


@dataclass(frozen=True)
class InterruptedRun(EarlierRun):
    """If there are any rows, the state of the ``last`` one and the checkpoint from which the path continues;
    the refinement of its clouds, if that was complete."""

    last: State | None
    checkpoint: Checkpoint | None
    refinement: Refinement | None


def plain_checkpoint(
    last: State, checkpoint: Checkpoint | None, figures: Mapping[str, Any]
) -> dict[str, Value]:
    """The state of the last row, the checkpoint of the path, and the figures, as datasets."""
    found = {**flattened("checkpoint/last", last), **flattened("checkpoint/path", checkpoint)}
    return {**found, "checkpoint/figures": as_text(figures)}


def interrupted_run(origin: RunOrigin) -> InterruptedRun:
    """The stored data of an interrupted run. Raises RunError if they are damaged or of another version."""
    stored = origin.checkpoint
    try:
        # Without rows there may be no checkpoint.
        started = origin.rows > 0 or "last" in stored
        return InterruptedRun(
            rows=origin.rows,
            seconds=origin.seconds,
            last=restored(State, stored["last"]) if started else None,
            checkpoint=_checkpoint(stored["path"]) if started else None,
            figures=json.loads(stored["figures"]) if started else {},
            refinement=_refinement(stored["refinement"]) if "refinement" in stored else None,
        )
    except (KeyError, TypeError, ValueError) as error:
        raise unreadable(error) from error


def unreadable(error: Exception) -> RunError:
    """The RunError for a checkpoint whose reading raised an ``error``."""
    return RunError(
        f"the checkpoint of the run cannot be read: {error!r}",
        "it is damaged or from another version of mlsanm; run the case again with --force",
    )


def as_text(value: Any) -> str:
    """Plain values as JSON."""
    # Unlike in summary.json, nan is kept.
    return json.dumps(value, default=_plain)


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else asdict(value)


def flattened(name: str, value: Any) -> dict[str, Value]:
    """All numbers and arrays of a dataclass and those nested in it, by path; None is omitted."""
    if value is None:
        return {}
    if is_dataclass(value):
        parts = [flattened(f"{name}/{one.name}", getattr(value, one.name)) for one in fields(value)]
        return {key: array for part in parts for key, array in part.items()}
    return {name: np.asarray(value)}


def restored(kind: type[Record], stored: Mapping[str, Any], **more: Any) -> Record:
    """A dataclass from its arrays and numbers, and from ``more`` values for its nested dataclasses."""
    own = {name: value for name, value in stored.items() if name not in more}
    return kind(**{name: value if value.ndim else value.item() for name, value in own.items()}, **more)


def _checkpoint(stored: Mapping[str, Any]) -> Checkpoint:
    history = stored.get("history")
    remembered = None
    if history is not None:
        remembered = restored(FrictionHistory, history, sets=restored(ContactStatus, history["sets"]))
    return restored(Checkpoint, stored, state=restored(State, stored["state"]), history=remembered)


def _refinement(stored: str) -> Refinement:
    plain = json.loads(stored)
    zones = np.array(plain["zones"], dtype=np.float64).reshape(-1, 5)
    return Refinement(zones, tuple(Pass(**one) for one in plain["passes"]), plain["failed"])
