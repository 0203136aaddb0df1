"""The rows of run.h5: records of contacts and probes, and their paths in the file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import RunError


@dataclass(frozen=True)
class ContactRecord:
    """State of a contact at a step; arrays (m,) in the order of the slave nodes.

    ``pressure`` > 0 in compression; ``traction`` acts on the slave and ``slip`` is that of the slave relative
    to the master, both along the tangent; ``status`` is int8: 0 open, 1 stick, 2 slip. ``dissipated_work`` is
    the work dissipated by friction so far.
    """

    pressure: FloatArray
    traction: FloatArray
    gap: FloatArray
    slip: FloatArray
    status: NDArray[np.int8]
    dissipated_work: float = 0.0


@dataclass(frozen=True)
class ProbeRecord:
    """Displacement (2,), stress xx, yy, xy (3,) and von Mises stress at a probe."""

    displacement: FloatArray
    stress: FloatArray
    von_mises: float


def place(*names: str) -> str:
    """The path in run.h5 with these parts. Raises RunError for a name that cannot be part of a path."""
    for name in names:
        if not name or name in {".", ".."} or "/" in name or "\0" in name:
            raise RunError(
                f"the name {name!r} cannot be stored", hint='names must not be empty or contain "/"'
            )
    return "/".join(names)


def row(
    *,
    path: Mapping[str, float],
    factors: Mapping[str, float],
    resultants: Mapping[str, FloatArray],
    displacements: Mapping[str, FloatArray],
    contacts: Mapping[str, ContactRecord],
    probes: Mapping[str, ProbeRecord],
) -> dict[str, Any]:
    """One step as a value for every column of run.h5. ``path`` has the position (stage index + fraction) and
    figures of the step; ``factors`` maps each load to its factor, ``resultants`` each load or support to its
    force (2,) on the body, ``displacements`` each load on a platen to the platen's displacement (2,)."""
    values: dict[str, Any] = {place("path", name): value for name, value in path.items()}
    groups = {"factors": factors, "resultants": resultants, "displacements": displacements}
    for group, named in groups.items():
        values |= {place("path", group, name): value for name, value in named.items()}
    for kind, records in (("contacts", contacts), ("probes", probes)):
        for name, record in records.items():
            for one in fields(record):
                values[place(kind, name, one.name)] = getattr(record, one.name)
    return values
