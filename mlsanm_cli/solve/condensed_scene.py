"""A scene ready for its load path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.contact.laws.active_set import ExactState
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.mechanics.scene import Scene


@dataclass(frozen=True)
class CondensedScene:
    """A scene ready for its load path.

    ``stages`` (T + 1, L) are the load factors before the first stage and at the end of each; ``ends`` the
    exact contact states there (none without contact), with friction after one increment per stage: good
    enough for scales, reach and refinement. A stage whose end cannot be reached and those after it have none,
    but the last may be that of a part of it.
    ``stability`` is the certificate, ``weak`` warns of motions that are hardly resisted.
    """

    case: Case
    scene: Scene
    condensed: Condensed
    stages: FloatArray
    ends: tuple[ExactState, ...]
    stability: float
    weak: tuple[str, ...] = ()

    @property
    def stays_open(self) -> bool:
        """Whether no contact carries any pressure at the end of any stage: laws have nothing to smooth."""
        return not self.ends_early and not any(state.pressure.any() for state in self.ends)

    @property
    def ends_early(self) -> bool:
        """Whether there are loads along its stages that contacts cannot carry."""
        whole = len(self.ends) == len(self.stages) - 1
        return not whole or any(
            not np.array_equal(end.factors, stage)
            for end, stage in zip(self.ends, self.stages[1:], strict=True)
        )

    @property
    def follows_exactly(self) -> bool:
        """Whether the path is that of the exact laws, whatever the case says: laws have nothing to smooth, or
        the smooth one, without friction, follows what comes off its contacts on and on."""
        return self.stays_open or (self.ends_early and not len(self.condensed.friction_nodes))

    @property
    def is_holonomic(self) -> bool:
        """Whether friction is to depend on the total slip alone."""
        return any(
            contact.friction and contact.regularization.friction_law == "holonomic"
            for contact in self.case.touching
        )
