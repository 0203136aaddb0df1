"""Sensitivity of exact contact pressures to errors of the gaps and to the contact spacing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.active_set import ExactState, solve_exact
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.drivers import spans
from mlsanm_cli.contact.response.functionals import changes, reaction_rows
from mlsanm_cli.contact.response.linear_map import LinearMap
from mlsanm_cli.mechanics.defect import Corrected
from mlsanm_cli.mechanics.scene import Platen, Scene


def corrected_state(
    condensed: Condensed, scene: Scene, state: ExactState, bodies: Mapping[str, Corrected]
) -> ExactState:
    """The exact state after the corrections of ``bodies`` are added to their displacements.

    The corrections change gaps, and platen forces computed from the stress field. Raises NumericalError if
    the changed contact problem has no solution.
    """
    gaps, _, imbalance = changes_of(condensed, scene, bodies)
    changed = replace(
        condensed,
        gap=_shifted(condensed.gap, gaps),
        balance=_shifted(condensed.balance, imbalance),
    )
    return solve_exact(changed, state.factors, state.active)


def rough_state(
    condensed: Condensed, scene: Scene, state: ExactState, bodies: Mapping[str, Corrected]
) -> ExactState:
    """The exact state without smoothing of the displacements of ``bodies`` along contact grids.

    Raises NumericalError if it has none.
    """
    gaps, _ = roughness_of(condensed, scene, bodies)
    if not gaps.any():
        return state
    return solve_exact(replace(condensed, gap=_shifted(condensed.gap, gaps)), state.factors, state.active)


def roughness_of(
    condensed: Condensed, scene: Scene, bodies: Mapping[str, Corrected]
) -> tuple[FloatArray, FloatArray]:
    """What smoothing takes from gaps (m,) and slips (n,) by the displacements of ``bodies``."""
    moved = {name: one.displacement for name, one in bodies.items()}
    return _summed(condensed, scene, moved, lost=True)


def changes_of(
    condensed: Condensed, scene: Scene, bodies: Mapping[str, Corrected]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Changes of gaps (m,), slips (n,) and force imbalance of the rigid constraints (k,) by the displacement
    corrections of ``bodies``; the imbalance includes the stress of the better fits."""
    corrections = {name: one.change.reshape(-1, 2) for name, one in bodies.items()}
    gaps, slips = _summed(condensed, scene, corrections)
    imbalance = np.zeros(len(condensed.balance.constant))
    for row, (constraint, motion) in enumerate(scene.unknown_motions):
        if isinstance(constraint, Platen) and not motion.alone:
            for owner, surface in constraint.held:
                body, corrected = scene.bodies[owner], bodies[owner]
                carried = reaction_rows(body, surface, constraint.center) @ corrected.change
                fx, fy, moment = corrected.defect.reactions[surface]
                x, y = constraint.center
                carried = carried + np.array([fx, fy, moment - x * fy + y * fx])
                imbalance[row] += carried[motion.component]
    return gaps, slips, imbalance


def _summed(
    condensed: Condensed, scene: Scene, displacements: Mapping[str, FloatArray], lost: bool = False
) -> tuple[FloatArray, FloatArray]:
    """:func:`changes` of gaps (m,) and slips (n,) of all contacts by ``displacements`` (N, 2) of bodies."""
    gaps, slips = np.zeros(len(condensed.weight)), np.zeros(len(condensed.friction_nodes))
    for pairing in condensed.pairings:
        for name in dict.fromkeys(pairing.bodies):
            gap, slip = changes(scene.bodies[name], name, pairing, displacements[name], lost)
            gaps[condensed.spans[pairing.name]] += gap
            if pairing.friction:
                slips[condensed.tangential[pairing.name]] += slip
    return gaps, slips


def halved_pressure(condensed: Condensed, state: ExactState) -> FloatArray:
    """Pressures (m,) of a contact with every second candidate only, linear in between: the mean of both
    choices.

    The difference to the full solution measures the error due to spacing and contact edges; averaging removes
    most of the scatter due to the position of an edge relative to the nodes. Raises NumericalError if the
    thinned contact problem has no solution.
    """
    total = np.zeros(len(condensed.weight))
    for first in (0, 1):
        kept, joined = [], []
        for pairing in condensed.pairings:
            span, arc = condensed.spans[pairing.name], pairing.arc[pairing.candidate]
            own = np.arange(first if len(arc) > 1 else 0, len(arc), 2)
            kept.append(span.start + own)
            around = pairing.slave.curve.length if pairing.all_around else None
            units = [np.interp(arc, arc[own], unit, period=around) for unit in np.eye(len(own))]
            joined.append(np.stack(units, axis=1))
        rows = np.concatenate(kept)
        join: FloatArray = sparse.block_diag(joined).toarray()
        thin = replace(
            condensed,
            weight=join.T @ condensed.weight,
            spans=spans([pairing.name for pairing in condensed.pairings], [len(own) for own in kept]),
            gap=_joined(condensed.gap.take(rows), join),
            slip=_joined(condensed.slip, join),
            balance=_joined(condensed.balance, join),
        )
        total += join @ solve_exact(thin, state.factors, state.active[rows]).pressure
    return 0.5 * total


def l2(arc: FloatArray, values: FloatArray) -> float:
    """L2 norm over the surface of piecewise linear ``values`` (m,) at ``arc`` (m,)."""
    a, b = values[:-1], values[1:]
    return float(np.sqrt((np.diff(arc) * (a * a + a * b + b * b) / 3.0).sum()))


def _shifted(linear: LinearMap, change: FloatArray) -> LinearMap:
    return replace(linear, constant=linear.constant + change)


def _joined(linear: LinearMap, join: FloatArray) -> LinearMap:
    return replace(linear, pressure=linear.pressure @ join)
