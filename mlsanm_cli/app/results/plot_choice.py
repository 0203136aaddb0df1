"""What of a run is to be drawn, and the words that pictures share."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mlsanm_cli.app.results.path_lookup import level_at
from mlsanm_cli.case import Case
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.run_reader import RunData

KINDS = ("pressure", "traction", "loop", "hysteresis", "force", "peak", "bodies", "line")
"""Kinds of pictures; hysteresis and line only come when they are asked for."""
OF_CONTACT = frozenset({"pressure", "traction", "loop", "hysteresis"})
FIELDS = {
    "von_mises": ("von Mises stress", "stress"),
    "xx": ("stress xx", "stress"),
    "yy": ("stress yy", "stress"),
    "xy": ("stress xy", "stress"),
    "ux": ("displacement in x", "length"),
    "uy": ("displacement in y", "length"),
    "displacement": ("displacement", "length"),
}
"""What a body can be coloured by and drawn along a line, its name and unit."""
MOST_LOADS = 3


@dataclass(frozen=True)
class Choice:
    """Which pictures: their kinds, all that there are by default; of which contact; coloured by which field;
    at which positions; along which line; into which file; moving or not."""

    what: tuple[str, ...] = ()
    contact: str | None = None
    field: str | None = None
    at: tuple[float, ...] = ()
    along: str | None = None
    out: Path | None = None
    animate: bool = False

    def wants(self, kind: str, contact: str = "") -> bool:
        """Whether a picture is wanted; of a ``contact`` if it is one's."""
        if self.contact is not None and (kind not in OF_CONTACT or contact != self.contact):
            return False
        if self.what:
            return kind in self.what
        if self.along is not None:
            return kind == "line"
        if self.field is not None:
            return kind == "bodies"
        return kind not in ("hysteresis", "line")


def refuse_nonsense(choice: Choice, runs: int) -> None:
    """RunError for choices that do not go together."""
    if choice.contact is not None and choice.what and not set(choice.what) & OF_CONTACT:
        raise RunError(
            f"--contact does not apply to {', '.join(choice.what)}",
            f"it applies to {', '.join(sorted(OF_CONTACT))}",
        )
    if "line" in choice.what and choice.along is None:
        raise RunError("a line is missing", "as in --along block.top or --along 0,0:0,-1")
    if choice.along is not None and choice.what and "line" not in choice.what:
        raise RunError("--along applies to --what line only", "omit --what, or write --what line")
    if choice.animate and (runs > 1 or choice.along is not None):
        raise RunError("--animate shows pressures or bodies of one run", "omit the other options")
    if runs > 1 and choice.out is None:
        raise RunError("several runs are drawn into one picture", "name its file, as in -o both.png")


def load_words(run: RunData, case: Case, position: float) -> str:
    """A position in words: the stage if there are several, and the factors of the loads that change in it."""
    stages = len(case.stage)
    number = min(max(int(np.ceil(position)), 1), stages)
    factors = dict(zip(run.path.factors, level_at(run, position).factors, strict=True))
    moving = [name for name in case.stage[number - 1] if name in factors][:MOST_LOADS]
    parts = [f"stage {number} of {stages}"] if stages > 1 else []
    return ", ".join([*parts, *(f"{name} x {factors[name]:.4g}" for name in moving)])
