"""``[model]``: the kinds of plane problems and of strains."""

from typing import Literal

from mlsanm_cli.case.model.section import Section


class Model(Section):
    """Plane strain or plane stress, small or finite strain."""

    plane: Literal["strain", "stress"]
    """Plane strain (no displacement out of the plane) or plane stress (thin sheet)."""
    strain: Literal["small", "finite"] = "small"
    """Linear elasticity (small strains and rotations), or equilibrium of the deformed body (finite), which
    needs a hyperelastic `law` of the material."""

    @property
    def confined(self) -> bool:
        """Whether strains out of the plane are prescribed, so that constants in that direction count."""
        return self.plane != "stress"


UNSUPPORTED = "with finite strain is not supported yet"
"""End of messages about features that finite strain does not have."""
NEEDS_FINITE = 'write strain = "finite" in [model], or remove the key'
"""Hint for features of finite strain only."""
