"""A scene ready for its load path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from mlsanm_cli.app.output.fine_views import View, fine_views
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.contact.laws.active_set import ExactState
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.mechanics.scene import Scene


@dataclass(frozen=True)
class CondensedScene:
    """A scene ready for its load path.

    ``stages`` (T + 1, L) are the load factors before the first stage and at the end of each; ``ends`` the
    exact contact states there (none without contact), with friction after one increment per stage: good
    enough for scales, reach and refinement. A stage whose end cannot be reached and those after it have none.
    ``stability`` is the certificate.
    """

    case: Case
    scene: Scene
    condensed: Condensed
    stages: FloatArray
    ends: tuple[ExactState, ...]
    stability: float

    @cached_property
    def views(self) -> Mapping[str, View]:
        """Bodies whose fields are written at other points than their nodes."""
        return fine_views(self.case, self.scene, self.condensed, self.ends)

    def shown(self, body: str) -> Cloud:
        """The cloud at whose points a body's fields are written."""
        view = self.views.get(body)
        return self.scene.bodies[body].model.cloud if view is None else view.cloud

    @property
    def is_holonomic(self) -> bool:
        """Whether friction is to depend on the total slip alone."""
        return any(
            contact.friction and contact.regularization.friction_law == "holonomic"
            for contact in self.case.touching
        )
