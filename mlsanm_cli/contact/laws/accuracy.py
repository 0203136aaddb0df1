"""Sensitivity of contact pressures to errors of the gaps and to the contact spacing; with friction by the
linearised response of a state to small changes of gaps and slips, with slip status kept."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.laws.active_set import ExactState, solve_exact
from mlsanm_cli.contact.laws.contact_status import ContactSolution, ContactStatus, SetSystem
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.dense import SingularSystemError
from mlsanm_cli.contact.response.drivers import spans
from mlsanm_cli.contact.response.functionals import changes, reaction_rows
from mlsanm_cli.contact.response.linear_map import LinearMap
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.defect import Corrected
from mlsanm_cli.mechanics.scene import Platen, Scene

MAX_CHANGES = 30
"""Largest number of active-set changes, one per round."""


def corrected_state(
    condensed: Condensed, scene: Scene, state: ExactState, bodies: Mapping[str, Corrected]
) -> ExactState:
    """The exact state after the corrections of ``bodies`` are added to their displacements. The corrections
    change gaps, and platen forces computed from the stress field. Raises NumericalError if the changed
    contact problem has no solution."""
    gaps, _, imbalance = changes_of(condensed, scene, bodies)
    changed = replace(
        condensed, gap=_shifted(condensed.gap, gaps), balance=_shifted(condensed.balance, imbalance)
    )
    return solve_exact(changed, state.factors, state.active)


def rough_state(
    condensed: Condensed, scene: Scene, state: ExactState, bodies: Mapping[str, Corrected]
) -> ExactState:
    """The exact state without smoothing of the displacements of ``bodies`` along contact grids. Raises
    NumericalError if it has none."""
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
                imbalance[row] += motion.direction @ carried
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


def frozen_change(
    condensed: Condensed,
    pressure: FloatArray,
    traction: FloatArray,
    gaps: FloatArray,
    closed: BoolArray,
    stuck: BoolArray,
    by: tuple[FloatArray, FloatArray, FloatArray],
) -> ContactSolution:
    """Change of a state with ``pressure`` (m,), ``traction`` (n,) and ``gaps`` (m,) when gaps (m,), slips
    (n,) and the force imbalance of the rigid constraints (k,) change ``by`` given amounts.

    ``closed`` (m,) nodes stay closed unless they would pull, open ones stay open unless they would overlap;
    nodes with friction that are ``stuck`` (n,) keep their slips, the others keep slipping. The change is
    linear but for the edges of contact, so that the load history need not be repeated. Raises NumericalError
    if there is no solution.
    """
    m, n, nodes, still = len(pressure), len(traction), condensed.friction_nodes, np.zeros(len(by[2]))
    least = np.finfo(float).eps ** 0.5 * np.abs(pressure).max(initial=0.0)
    compliance = float(np.abs(np.diagonal(condensed.gap.pressure)).max(initial=0.0))
    overlap = least * min(1.0, compliance or 1.0)
    for _ in range(MAX_CHANGES):
        touching = closed[nodes]
        slides = np.where(touching & ~stuck, np.sign(traction), 0.0)
        # Open nodes carry nothing.
        lost = np.concatenate([np.where(closed, 0.0, -pressure), np.where(touching, 0.0, -traction), still])
        caused = condensed.blocks @ lost
        try:
            system = SetSystem(condensed, ContactStatus(closed, stuck & touching, slides))
        except SingularSystemError as error:
            raise NumericalError("the contact state is singular") from error
        more = system.response(by[0] + gaps + caused[:m], by[1] + caused[m : m + n], by[2] + caused[m + n :])
        found = replace(more, pressure=more.pressure + lost[:m], traction=more.traction + lost[m : m + n])
        changed = np.where(closed, pressure + found.pressure < -least, found.gap < -overlap)
        if not changed.any():
            break
        closed = closed ^ changed
    return found
