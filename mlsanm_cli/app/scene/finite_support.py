"""What finite strain does not know yet is refused by name."""

from __future__ import annotations

from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.mechanics import scene as mechanics


def refuse_unsupported(prepared: SceneModel) -> None:
    """Raise CaseError for what clouds and pairs show that finite strain cannot do yet: bodies that can move
    freely, sides in contact of several pieces."""
    for mover in prepared.rigid_constraints:
        if isinstance(mover, mechanics.FloatingBody):
            message = f"body {mover.body} can move freely, which finite strain does not support yet"
            problem = CaseProblem(f"body.{mover.body}", message, hint="hold it with a [[support]]")
            raise CaseError((problem,))
    for pairing in prepared.pairings:
        if pairing.slave.parts:
            message = "a side of several pieces with finite strain is not supported yet"
            problem = CaseProblem(f"contact.{pairing.name}.slave", message, hint="one smooth side")
            raise CaseError((problem,))
