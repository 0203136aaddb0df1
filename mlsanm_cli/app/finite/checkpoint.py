"""Checkpoints of paths at finite strain in run.h5."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mlsanm_cli.app.finite.states import FiniteMark, FiniteState
from mlsanm_cli.app.output.checkpoint import as_text, flattened, restored, unreadable
from mlsanm_cli.contact.finite.exact import Pressed
from mlsanm_cli.contact.finite.sets import NodeSets
from mlsanm_cli.io.run_file import Value
from mlsanm_cli.io.run_reader import RunOrigin


@dataclass(frozen=True)
class FiniteEarlier:
    """Run of an earlier process: the number of rows of its path, its seconds, the checkpoint ``mark`` (None
    if the path had not begun) and the accumulated ``figures``."""

    rows: int
    seconds: float
    mark: FiniteMark | None
    figures: Mapping[str, Any]


def plain_mark(mark: FiniteMark, figures: Mapping[str, Any]) -> dict[str, Value]:
    """The checkpoint as datasets."""
    return {**flattened("checkpoint/path", mark), "checkpoint/figures": as_text(figures)}


def interrupted_run(origin: RunOrigin) -> FiniteEarlier:
    """Read the checkpoint of a run. RunError if it is damaged or of another version."""
    stored = origin.checkpoint
    if not origin.rows:
        return FiniteEarlier(0, origin.seconds, None, {})
    try:
        figures = json.loads(stored["figures"])
        return FiniteEarlier(origin.rows, origin.seconds, _mark(stored["path"]), figures)
    except (KeyError, TypeError, ValueError) as error:
        raise unreadable(error) from error


def _mark(stored: Mapping[str, Any]) -> FiniteMark:
    state, pressed = stored["state"], None
    if "pressed" in state:
        sets = restored(NodeSets, state["pressed"]["sets"])
        pressed = restored(Pressed, state["pressed"], sets=sets)
    return restored(FiniteMark, stored, state=restored(FiniteState, state, pressed=pressed))
