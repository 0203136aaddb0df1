"""What gets a row with every step: /path, the contacts' histories and those of the probes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mlsanm_cli.io.columns import Column
from mlsanm_cli.io.kept import check_keys, checked_name, ordered
from mlsanm_cli.io.records import CONTACT_COLUMNS, CONTACT_TOTALS, PATH_COLUMNS, PROBE_COLUMNS, StepRecord

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike


class History:
    """The columns of an open run.h5, behind ``rows`` rows of an earlier process."""

    def __init__(self, root: Any, rows: int = 0) -> None:
        self._root = root
        self._rows = rows
        self._columns: dict[str, Column] = {}
        self._contacts: list[str] = []
        self._loads: list[str] | None = None
        self._resultants: list[str] = []
        self._displacements: list[str] = []
        self._probes: list[str] = []

    @property
    def started(self) -> bool:
        """Whether /path is there: no contact may come after it."""
        return self._loads is not None

    def add_contact(self, group: Any, name: str, count: int) -> None:
        """The empty history (0, ``count``) of the contact ``name``, whose ``group`` is given."""
        for key, dtype in CONTACT_COLUMNS.items():
            self._add(group, f"contacts/{name}/{key}", key, (count,), dtype)
        for key, dtype in CONTACT_TOTALS.items():
            self._add(group, f"contacts/{name}/{key}", key, (), dtype)
        self._contacts.append(name)

    def start(
        self,
        loads: Sequence[str],
        resultants: Sequence[str],
        displacements: Sequence[str],
        probes: Sequence[str],
    ) -> None:
        """The empty /path and probes: a column for all that is named."""
        group = self._root.require_group("path")
        for key, dtype in PATH_COLUMNS.items():
            self._add(group, key, key, (), dtype)
        factors = ordered(group, "factors")
        for name in loads:
            self._add(factors, f"factors/{name}", checked_name(name), (), np.float64)
        forces = ordered(group, "resultants")
        for name in resultants:
            self._add(forces, f"resultants/{name}", checked_name(name), (2,), np.float64)
        moves = ordered(group, "displacements")
        for name in displacements:
            self._add(moves, f"displacements/{name}", checked_name(name), (2,), np.float64)
        if probes:
            observed = ordered(self._root, "probes")
        for name in probes:
            point = observed.require_group(checked_name(name))
            for key, tail in PROBE_COLUMNS.items():
                self._add(point, f"probes/{name}/{key}", key, tail, np.float64)
        self._loads = list(loads)
        self._resultants = list(resultants)
        self._displacements = list(displacements)
        self._probes = list(probes)

    def append(self, step: StepRecord) -> None:
        """One row more in every column; ValueError for names and shapes other than it was started with."""
        check_keys("load factors", step.factors, self._loads or [])
        check_keys("resultants", step.resultants, self._resultants)
        check_keys("displacements", step.displacements, self._displacements)
        check_keys("contacts", step.contacts, self._contacts)
        check_keys("probes", step.probes, self._probes)
        values: dict[str, ArrayLike] = {key: getattr(step, key) for key in PATH_COLUMNS}
        values |= {f"factors/{name}": value for name, value in step.factors.items()}
        values |= {f"resultants/{name}": value for name, value in step.resultants.items()}
        values |= {f"displacements/{name}": value for name, value in step.displacements.items()}
        for name, record in step.contacts.items():
            values |= {
                f"contacts/{name}/{key}": getattr(record, key) for key in (*CONTACT_COLUMNS, *CONTACT_TOTALS)
            }
        for name, probe in step.probes.items():
            values |= {f"probes/{name}/{key}": getattr(probe, key) for key in PROBE_COLUMNS}
        rows = {key: self._columns[key].solve_with_error(value) for key, value in values.items()}
        for key, row in rows.items():
            self._columns[key].write(self._rows, row)
        self._rows += 1

    def truncate(self) -> None:
        """Drop what a step that was cut short left behind the last row, and let go of the columns."""
        for column in self._columns.values():
            column.truncate(self._rows)
        self._columns.clear()

    def _add(self, group: Any, key: str, name: str, tail: tuple[int, ...], dtype: type[np.generic]) -> None:
        self._columns[key] = Column(group.id, name, tail, np.dtype(dtype))
