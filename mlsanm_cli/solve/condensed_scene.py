"""Condensed scene with all that its load path needs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from typing import Any

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.contact.laws.contact_state import ContactState
from mlsanm_cli.contact.response.coercivity import BULK_LIMIT, CONTACT_LIMIT
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.mechanics.laws.von_mises import VonMises, plastic_stress
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.records import dataclass
from mlsanm_cli.solve.state import Checkpoint, PathStep, State


@dataclass(frozen=True)
class CondensedScene:
    """Condensed scene with all that its load path needs: load factors ``stages`` (T + 1, L) before the first
    stage and at the end of each, and the exact contact states at these ``ends``, with friction from one
    increment per stage, as far as loads can be carried; the last one may be that of a part of a stage.
    ``stability`` is the coercivity estimate, ``laws`` are those of bodies that flow."""

    case: Case
    scene: Scene
    condensed: Condensed
    stages: FloatArray
    ends: tuple[ContactState, ...]
    stability: float
    laws: Mapping[str, VonMises] = field(default_factory=dict)

    def at(self, state: State) -> CondensedScene:
        """The scene under the eigenstresses of the plastic strains in a ``state``."""
        if self.condensed.eigen is None or not state.solver:
            return self
        stresses = {name: plastic_stress(law.linear, state.history(name)) for name, law in self.laws.items()}
        return replace(self, condensed=self.condensed.eigen.within(self.condensed, stresses))

    @property
    def outputs(self) -> tuple[float, ...]:
        """Positions with fields in order; the end of the path by default."""
        return tuple(sorted(set(self.case.output.at))) or (float(len(self.case.stage)),)

    @property
    def stops(self) -> list[float]:
        """The start, the ends of the stages and the positions with fields, in order."""
        return sorted({*map(float, range(len(self.case.stage) + 1)), *self.outputs})

    def step(self, state: State, **more: Any) -> PathStep:
        """The step that ends at a ``state``."""
        saved = (state,) if state.position in self.outputs else ()
        return PathStep(state, saved, **({"checkpoint": Checkpoint(state)} | more))

    @property
    def stability_limit(self) -> float:
        """Limit of the stability: of contacts, if some node touches."""
        return CONTACT_LIMIT if any(state.closed.any() for state in self.ends) else BULK_LIMIT

    @property
    def stays_open(self) -> bool:
        """Whether no contact carries pressure at the end of any stage."""
        return not self.ends_early and not any(state.pressure.any() for state in self.ends)

    @property
    def ends_early(self) -> bool:
        """Whether some loads of the stages exceed a limit load of the contacts."""
        return not np.array_equal([end.factors for end in self.ends], self.stages[1:])

    @property
    def follows_exactly(self) -> bool:
        """Whether the path uses the exact laws whatever the case says: without pressure a regularised law has
        no scales, and without friction it would follow a separating body without end."""
        return self.stays_open or (self.ends_early and not len(self.condensed.friction_nodes))


def stage_factors(case: Case) -> FloatArray:
    """Load factors (T + 1, L): zero initially, then the values at the end of every stage; factors not named
    are kept."""
    factors = [np.zeros(len(case.moved))]
    for stage in case.stage:
        factors.append(np.array([stage.get(n, old) for n, old in zip(case.moved, factors[-1], strict=True)]))
    return np.array(factors)


def factors_at(stages: FloatArray, position: float) -> FloatArray:
    """Load factors (L,) at a path position."""
    stage = min(int(position), len(stages) - 2)
    fraction = position - stage
    return np.asarray((1.0 - fraction) * stages[stage] + fraction * stages[stage + 1])
