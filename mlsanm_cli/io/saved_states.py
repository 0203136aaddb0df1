"""/fields of run.h5: the states whose fields are kept."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.io.columns import Column
from mlsanm_cli.io.kept import checked_name, floats, keep, ordered

if TYPE_CHECKING:
    from collections.abc import Mapping


class SavedStates:
    """The saved states of an open run.h5, behind ``count`` of an earlier process."""

    def __init__(self, root: Any, count: int = 0) -> None:
        self._root = root
        self._count = count
        self._positions: Column | None = None

    @property
    def positions(self) -> list[float]:
        """Where the states saved so far are on the path."""
        found: list[float] = self._root["fields/position"][: self._count].tolist() if self._count else []
        return found

    def add(
        self,
        position: float,
        bodies: Mapping[str, Mapping[str, NDArray[np.float64]]],
        attributes: Mapping[str, str | int | float],
    ) -> int:
        """Store one state as /fields/<k>/<body>/<field>, and return k."""
        index = self._count
        fields = self._root.require_group("fields")
        if self._positions is None:
            self._positions = Column(fields.id, "position", (), np.dtype(np.float64))
        state = ordered(fields, str(index))
        state.attrs.update(attributes)
        for body, arrays in bodies.items():
            group = state.require_group(checked_name(body))
            for name, array in arrays.items():
                keep(group, name, floats(array))
        self._positions.write(index, self._positions.solve_with_error(position))
        self._count += 1
        return index

    def truncate(self) -> None:
        """Drop the position of a state that was cut short, and let go of the datasets."""
        if self._positions is not None:
            self._positions.truncate(self._count)
            self._positions = None
