"""The rows of run.h5, and paths in the file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias

from mlsanm_cli.errors import RunError

Quantities: TypeAlias = Mapping[str, Mapping[str, Any]]
"""The quantities of a state: by load the "factors", by load or support the "resultants" (2,), by load on a
platen its "displacements" (2,), and by name the quantities of "contacts" and "probes"."""


def place(*names: str) -> str:
    """The path in run.h5 with these parts. Raises RunError for a name that cannot be part of a path."""
    for name in names:
        if not name or name in {".", ".."} or "/" in name or "\0" in name:
            raise RunError(
                f"the name {name!r} cannot be stored", hint='names must not be empty or contain "/"'
            )
    return "/".join(names)


def row(path: Mapping[str, float], quantities: Quantities) -> dict[str, Any]:
    """One step as a value for every column of run.h5: the position and figures of the step, and the
    ``quantities`` of its state."""
    groups = dict(quantities)
    objects = {kind: groups.pop(kind, {}) for kind in ("contacts", "probes")}
    values: dict[str, Any] = {place("path", name): value for name, value in path.items()}
    for group, named in groups.items():
        values |= {place("path", group, name): value for name, value in named.items()}
    for kind, named in objects.items():
        for name, found in named.items():
            values |= {place(kind, name, key): value for key, value in found.items()}
    return values
