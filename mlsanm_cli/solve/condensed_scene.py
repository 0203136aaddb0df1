"""A scene ready for its load path."""

from __future__ import annotations

from dataclasses import dataclass

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
    enough for scales, reach and refinement. A stage whose end cannot be reached and those after it have none.
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
        return len(self.ends) == len(self.stages) - 1 and not any(state.pressure.any() for state in self.ends)

    @property
    def is_holonomic(self) -> bool:
        """Whether friction is to depend on the total slip alone."""
        return any(
            contact.friction and contact.regularization.friction_law == "holonomic"
            for contact in self.case.touching
        )
