"""Analyses at small and at finite strain."""

from __future__ import annotations

from mlsanm_cli.app.analysis.small_strain import SmallStrain
from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.output.analysis import Analysis
from mlsanm_cli.app.output.checkpoint import EarlierRun
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.case import Case


def analysis_of(
    case: Case, prepared: SceneModel, context: RunContext, earlier: EarlierRun | None = None
) -> Analysis:
    """The analysis of a case, on the clouds of an ``earlier`` run that is continued."""
    refinement = earlier.refinement if earlier is not None else None
    if case.model.strain == "small":
        return SmallStrain(case, prepared, context, refinement)
    # A run at small strain imports none of it.
    from mlsanm_cli.app.analysis.finite_strain import FiniteStrain

    return FiniteStrain(case, prepared, context, refinement)
