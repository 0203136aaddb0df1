"""What finite strain does not know yet is refused by name."""

from __future__ import annotations

from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.errors import CaseError, CaseProblem


def refuse_unsupported(prepared: SceneModel) -> None:
    """Raise CaseError for what pairs show that finite strain cannot do yet: sides in contact of several
    pieces."""
    for pairing in prepared.pairings:
        for key, side in (("slave", pairing.slave), ("master", pairing.master)):
            if side is not None and side.parts:
                message = "a side of several pieces with finite strain is not supported yet"
                problem = CaseProblem(f"contact.{pairing.name}.{key}", message, hint="one smooth side")
                raise CaseError((problem,))
