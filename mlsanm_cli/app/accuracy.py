"""Error estimates without a closed formula: of the displacements, and of every contact's pressure.

The exact state at the end of the path is compared with three neighbours of it: the one whose bodies are
corrected by their defect of the next degree, the one found from every second contact node, and the state
reported, which the smooth law leaves a little away from the exact one. Their distances add as squares.
Measured against over-refined runs and closed formulas, see the method's page; none of them is a bound.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.app.build import Built
from mlsanm_cli.app.states import State
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.accuracy import corrected_state, halved_pressure, l2
from mlsanm_cli.contact.active_set import ExactState, solve_exact
from mlsanm_cli.contact.pairing import Pairing
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.defect import Defect, defect_of, response
from mlsanm_cli.operators.refinement import QUICK
from mlsanm_cli.values import dataclass

ROUND_OFF = 1e-9
"""Estimates below this tell of round-off only."""


@dataclass(frozen=True)
class Accuracy:
    """Estimated errors of ``state``, the exact one at the end of the path.

    ``displacement`` is the root mean square over all nodes, relative. ``from_bulk`` and ``from_contact`` map
    contacts to relative L2 norms of what the bodies' errors and the contact's own spacing do to the pressure.
    None where no estimate can be given. ``defects`` are the bodies' own, none for other degrees than those
    that an estimate is known for. ``largest`` is the largest displacement, looked for where
    the clouds may be refined or the errors are told.
    """

    displacement: float | None
    from_bulk: Mapping[str, float | None]
    from_contact: Mapping[str, float | None]
    state: ExactState
    largest: float | None
    defects: Mapping[str, Defect]

    def figures(self, built: Built, state: State | None = None) -> dict[str, Any]:
        """As summary.json tells them, of ``state`` where its pressures may lie away from the exact ones."""
        pressure = {}
        for pairing in built.condensed.pairings:
            away = _distance(built, pairing, self.state, state.pressure) if state is not None else 0.0
            pressure[pairing.name] = _together(
                self.from_bulk[pairing.name], self.from_contact[pairing.name], away
            )
        return {"displacement": self.displacement, "pressure": pressure}

    @property
    def bulk_leads(self) -> bool:
        """Whether the bodies' errors are what limits the result, in one contact at least if there is any."""
        if self.displacement is None or self.displacement <= ROUND_OFF:
            return False
        pairs = [(self.from_bulk[name], self.from_contact[name]) for name in self.from_bulk]
        return not pairs or any(bulk is not None and own is not None and bulk > own for bulk, own in pairs)


def assess_accuracy(built: Built) -> Accuracy:
    """Estimate the errors of a solved scene in its last exact state."""
    condensed, scene = built.condensed, built.scene
    state = built.ends[-1] if built.ends else solve_exact(condensed, built.stages[-1])
    unknowns = (state.factors, state.motion, state.pressure, state.traction)
    untold: dict[str, float | None] = {pairing.name: None for pairing in condensed.pairings}
    # What friction has done on the way there would have to be followed again.
    if len(condensed.rubbing) and not built.case.adapt.passes:
        return Accuracy(None, untold, untold, state, None, {})
    solved = {}
    for name in scene.bodies:
        elastic = condensed.solution(scene, name, unknowns, QUICK)[0][:, 0]
        solved[name] = (elastic + scene.loose_patterns(name) @ state.motion).reshape(-1, 2)
    largest = max(float(np.hypot(*u.T).max()) for u in solved.values())
    nothing = Accuracy(None, untold, untold, state, largest, {})
    if len(condensed.rubbing):
        return nothing
    try:
        defects = {name: defect_of(body, solved[name]) for name, body in scene.bodies.items()}
    except NumericalError:  # the clouds are too small for the next degree
        return nothing
    size = float(sum((u**2).sum() for u in solved.values()))
    try:
        halved = halved_pressure(condensed, state) if condensed.pairings else state.pressure
        errors, pressures = _corrected(built, state, defects)
    except NumericalError:  # what was changed but a little has no contact state at all
        return Accuracy(None, untold, untold, state, largest, defects)
    from_contact = {pair.name: _distance(built, pair, state, halved) for pair in condensed.pairings}
    from_bulk = {
        pair.name: _middle([_distance(built, pair, state, p) for p in pressures])
        for pair in condensed.pairings
    }
    displacement = float(np.sqrt(np.mean(errors) / size)) if size > 0.0 else None
    return Accuracy(displacement, from_bulk, from_contact, state, largest, defects)


def _corrected(
    built: Built, state: ExactState, defects: Mapping[str, Defect]
) -> tuple[FloatArray, list[FloatArray]]:
    """Sum of squares of what the defects change of all displacements, contact and platens solved again, and
    the pressures (m,) then: without the bodies' sums, and with them."""
    condensed, scene = built.condensed, built.scene
    changes = {name: defect.corrections(scene.bodies[name]) for name, defect in defects.items()}
    states = [
        corrected_state(condensed, scene, state, {name: both[:, way] for name, both in changes.items()})
        for way in (0, 1)
    ]
    motion = np.stack([one.motion - state.motion for one in states], axis=1)
    pressure = np.stack([one.pressure - state.pressure for one in states], axis=1)
    moved = np.concatenate([np.zeros((len(state.factors), 2)), motion, pressure])
    errors = np.zeros(2)
    for name, body in scene.bodies.items():
        followed = response(body, sparse.csc_array(condensed.sources[name] @ moved))
        errors += ((changes[name] + followed + scene.loose_patterns(name) @ motion) ** 2).sum(axis=0)
    return errors, [one.pressure for one in states]


def _middle(parts: list[float | None]) -> float | None:
    """Root mean square of two estimates of the same error."""
    known = [part for part in parts if part is not None]
    return float(np.sqrt(np.mean(np.square(known)))) if len(known) == len(parts) else None


def _distance(built: Built, pairing: Pairing, state: ExactState, pressure: FloatArray) -> float | None:
    """L2 distance of a contact's pressures from the exact ones, relative; None where nothing presses."""
    span, arc = built.condensed.spans[pairing.name], pairing.arc[pairing.candidate]
    size = l2(arc, state.pressure[span])
    return l2(arc, (pressure - state.pressure)[span]) / size if size > 0.0 else None


def _together(*parts: float | None) -> float | None:
    """Parts of unlike origin, added as squares."""
    known = [part for part in parts if part is not None]
    return float(np.linalg.norm(known)) if len(known) == len(parts) else None
