"""What a run continues from as run.h5 stores it, in /checkpoint, and back."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, is_dataclass
from typing import Any, TypeVar

import numpy as np

from mlsanm_cli.app.assessment.refinement import Pass, Refinement
from mlsanm_cli.contact.laws.contact_status import ContactStatus
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.run_file import Value
from mlsanm_cli.io.run_reader import RunOrigin
from mlsanm_cli.solve.state import Checkpoint, FrictionHistory, State

REFINEMENT = "checkpoint/refinement"

Made = TypeVar("Made")


@dataclass(frozen=True)
class InterruptedRun:
    """What an earlier process left of a run: the rows of its path and the seconds they took; if there are
    any, the ``last`` row's state, what the path continues from, and ``figures`` counted so far; the
    refinement of its clouds, if that is over."""

    rows: int
    seconds: float
    last: State | None
    checkpoint: Checkpoint | None
    figures: Mapping[str, Any]
    refinement: Refinement | None


def plain_checkpoint(
    last: State, checkpoint: Checkpoint | None, figures: Mapping[str, Any]
) -> dict[str, Value]:
    """As datasets: the state of the last row, what the path continues from, and what was counted."""
    found = {**_flat("checkpoint/last", last), **_flat("checkpoint/path", checkpoint)}
    return {**found, "checkpoint/figures": _text(figures)}


def plain_refinement(refinement: Refinement) -> str:
    """The refinement of clouds as a dataset."""
    return _text(asdict(refinement))


def interrupted_run(origin: RunOrigin) -> InterruptedRun:
    """What a run stored to continue from. RunError if it is damaged or of another version."""
    stored = origin.checkpoint
    try:
        # Without rows nothing need be there.
        started = origin.rows > 0 or "last" in stored
        return InterruptedRun(
            rows=origin.rows,
            seconds=origin.seconds,
            last=_made(State, stored["last"]) if started else None,
            checkpoint=_checkpoint(stored["path"]) if started else None,
            figures=json.loads(stored["figures"]) if started else {},
            refinement=_refinement(json.loads(stored["refinement"])) if "refinement" in stored else None,
        )
    except (KeyError, TypeError, ValueError) as error:
        raise RunError(
            f"the checkpoint of the run cannot be read: {error!r}",
            "it is damaged, or of another version of mlsanm; run the case again with --force",
        ) from error


def _text(value: Any) -> str:
    # Unlike in summary.json, nan is stored as such.
    return json.dumps(value, default=_plain)


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else asdict(value)


def _flat(name: str, value: Any) -> dict[str, Value]:
    """All numbers and arrays of a dataclass, and of those in it, by their paths; nothing of None."""
    if value is None:
        return {}
    if is_dataclass(value):
        parts = [_flat(f"{name}/{one.name}", getattr(value, one.name)) for one in fields(value)]
        return {key: array for part in parts for key, array in part.items()}
    return {name: np.asarray(value)}


def _made(kind: type[Made], stored: Mapping[str, Any], **more: Any) -> Made:
    """A dataclass from its arrays and numbers, and ``more`` that is made of several."""
    own = {name: value for name, value in stored.items() if name not in more}
    return kind(**{name: value if value.ndim else value.item() for name, value in own.items()}, **more)


def _checkpoint(stored: Mapping[str, Any]) -> Checkpoint:
    history = stored.get("history")
    remembered = None
    if history is not None:
        remembered = _made(FrictionHistory, history, sets=_made(ContactStatus, history["sets"]))
    return _made(Checkpoint, stored, state=_made(State, stored["state"]), history=remembered)


def _refinement(plain: Mapping[str, Any]) -> Refinement:
    zones = np.array(plain["zones"], dtype=np.float64).reshape(-1, 5)
    return Refinement(zones, tuple(Pass(**one) for one in plain["passes"]), plain["failed"])
