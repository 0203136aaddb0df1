"""Which results of runs are shown; without numpy, for the options of commands."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from mlsanm_cli.errors import RunError
from mlsanm_cli.io import schema

KINDS = ("pressure", "traction", "loop", "hysteresis", "force", "peak", "bodies", "line")
"""Kinds of pictures; hysteresis and line are drawn on request only."""
OF_CONTACT = frozenset({"pressure", "traction", "loop", "hysteresis"})
FIELDS = tuple(sorted(schema.scalars(schema.FIELDS), key=lambda name: name != "von_mises"))
"""The scalars by which bodies are coloured and that are drawn along lines."""

QUANTITIES = tuple(
    entry.name for entry in schema.CONTACT_HISTORY if entry.dimensions[-1] == "contact_node" and entry.unit
)
"""Quantities of contacts that can be probed: pressure, traction, gap, slip."""
POINT_FIELDS = tuple(entry.name for entry in schema.PROBES)
"""Quantities at points: displacement, stress, von_mises."""


class Choice(NamedTuple):
    """Which pictures: their kinds; contact, field, positions and line shown; the file; animated or not."""

    what: tuple[str, ...] = ()
    contact: str | None = None
    field: str | None = None
    at: tuple[float, ...] = ()
    along: str | None = None
    out: Path | None = None
    animate: bool = False

    def wants(self, kind: str, subject: str = "") -> bool:
        """Whether a picture is wanted; ``subject`` is its contact, if it is of one."""
        if self.contact is not None and (kind not in OF_CONTACT or subject != self.contact):
            return False
        if self.what:
            return kind in self.what
        if self.along is not None or self.field is not None:
            return kind == ("bodies" if self.along is None else "line")
        return kind not in ("hysteresis", "line")

    def check(self, runs: int) -> None:
        """Raises RunError for choices that exclude each other or a number of ``runs``."""
        line = self.along is not None
        if self.contact is not None and self.what and OF_CONTACT.isdisjoint(self.what):
            message = f"--contact does not apply to {', '.join(self.what)}"
            raise RunError(message, f"it applies to {', '.join(sorted(OF_CONTACT))}")
        if "line" in self.what and not line:
            raise RunError("a line is missing", "as in --along block.top or --along 0,0:0,-1")
        if line and self.what and "line" not in self.what:
            raise RunError("--along applies to --what line only", "omit --what, or write --what line")
        if self.animate and (runs > 1 or line):
            raise RunError("--animate shows pressures or bodies of one run", "omit the other options")
        if runs > 1 and self.out is None:
            raise RunError("several runs are drawn into one picture", "name its file, as in -o both.png")
