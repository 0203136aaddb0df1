"""Sensitivity of contact pressures to errors of the gaps and to the contact spacing; with friction by the
linearised response of a state to small changes of gaps and slips, with slip status kept."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.complementarity.basis import Basis, SingularError
from mlsanm_cli.contact.complementarity.problem import ContactStatus
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.laws.contact_state import ContactState, response
from mlsanm_cli.contact.laws.frictionless import solve_exact
from mlsanm_cli.contact.response.basis import changes, spans
from mlsanm_cli.contact.response.bonds import Bonds
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.defect import Corrected
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.records import dataclass

MAX_CHANGES = 30
"""Largest number of active-set changes, one per round."""


@dataclass(frozen=True)
class Changes:
    """Changes of ``gaps`` (m,), ``slips`` (n,) and force ``imbalance`` of the rigid constraints (k,), and the
    ``bonds`` with the tractions that follow."""

    gaps: FloatArray
    slips: FloatArray
    imbalance: FloatArray
    bonds: Bonds

    def state(self, condensed: Condensed, before: ContactState) -> ContactState:
        """The exact state after them. Raises NumericalError if there is none."""
        if not (self.gaps.any() or self.imbalance.any()):
            return before
        gap, balance = condensed.gap.shifted(self.gaps), condensed.balance.shifted(self.imbalance)
        return solve_exact(replace(condensed, gap=gap, balance=balance), before.factors, before.closed)


def roughness_of(condensed: Condensed, scene: Scene, bodies: Mapping[str, Corrected]) -> Changes:
    """What smoothing takes from the displacements of ``bodies``."""
    moved = {name: one.displacement for name, one in bodies.items()}
    nothing = np.zeros(len(condensed.balance.constant))
    return Changes(*_summed(condensed, scene, moved, lost=True), nothing, condensed.bonds)


def changes_of(condensed: Condensed, scene: Scene, bodies: Mapping[str, Corrected]) -> Changes:
    """Changes by the displacement corrections of ``bodies``; the imbalance includes the stress of the better
    fits."""
    corrections = {name: one.change.reshape(-1, 2) for name, one in bodies.items()}
    gaps, slips = _summed(condensed, scene, corrections)
    bonds = condensed.bonds
    opened = np.zeros((2, len(bonds.own) // 2))
    for pairing in bonds.pairings:
        opened[:, bonds.spans[pairing.name]] = _moved(pairing, scene, corrections, False)
    bonds = bonds.opened(*opened)
    imbalance = np.zeros(len(condensed.balance.constant))
    for row, (constraint, motion) in enumerate(scene.unknown_motions):
        if constraint.held and not motion.alone:
            for owner, surface in constraint.held:
                body, corrected = scene.bodies[owner], bodies[owner]
                carried = body.reaction_rows(surface, constraint.center) @ corrected.change
                fx, fy, moment = corrected.defect.reactions[surface]
                x, y = constraint.center
                carried = carried + np.array([fx, fy, moment - x * fy + y * fx])
                imbalance[row] += motion.direction @ carried
    if bonds.pairings:
        followed = bonds.effects @ bonds.tractions.constant
        more = np.split(followed, np.cumsum([len(gaps), len(slips)]))
        gaps, slips, imbalance = gaps + more[0], slips + more[1], imbalance + more[2]
    return Changes(gaps, slips, imbalance, bonds)


def _summed(
    condensed: Condensed, scene: Scene, displacements: Mapping[str, FloatArray], lost: bool = False
) -> tuple[FloatArray, FloatArray]:
    """:func:`changes` of gaps (m,) and slips (n,) of all contacts by ``displacements`` (N, 2) of bodies."""
    gaps, slips = np.zeros(len(condensed.weight)), np.zeros(len(condensed.friction_nodes))
    for pairing in condensed.pairings:
        gap, slip = _moved(pairing, scene, displacements, lost)
        gaps[condensed.spans[pairing.name]] = gap
        if pairing.friction:
            slips[condensed.tangential[pairing.name]] = slip
    return gaps, slips


def _moved(pairing: Pairing, scene: Scene, displacements: Mapping[str, FloatArray], lost: bool) -> FloatArray:
    """Gaps and slips (2, m) of one contact."""
    bodies = dict.fromkeys(pairing.bodies)
    parts = (changes(scene.bodies[name], name, pairing, displacements[name], lost) for name in bodies)
    return np.asarray(sum(np.stack(part) for part in parts))


def halved_state(condensed: Condensed, state: ContactState) -> tuple[FloatArray, FloatArray]:
    """Motions (k,) and pressures (m,) of a contact with every second candidate only, linear in between: the
    mean of both choices, which removes most of the scatter by the places of edges relative to the nodes.
    Raises NumericalError if there is no solution."""
    motion, pressure = np.zeros_like(state.motion), np.zeros_like(state.pressure)
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
        maps = condensed.gap.take(rows), condensed.slip, condensed.balance
        gap, slip, balance = (replace(one, pressure=one.pressure @ join) for one in maps)
        thin = replace(
            condensed,
            weight=join.T @ condensed.weight,
            around=condensed.around[rows],
            spans=spans([pairing.name for pairing in condensed.pairings], [len(own) for own in kept]),
            gap=gap,
            slip=slip,
            balance=balance,
        )
        found = solve_exact(thin, state.factors, state.closed[rows])
        motion, pressure = motion + 0.5 * found.motion, pressure + 0.5 * (join @ found.pressure)
    return motion, pressure


def frozen_change(condensed: Condensed, state: ContactState, by: Changes) -> ContactState:
    """Change of a ``state`` when gaps, slips and force imbalance change ``by`` given amounts, linear but for
    the edges of contact: sticking nodes keep their slips, the others keep slipping, and motions that no
    closed node resists are held. Raises NumericalError if there is no solution."""
    pressure, traction, closed, nodes = state.pressure, state.traction, state.closed, condensed.friction_nodes
    m, n, still = len(pressure), len(traction), np.zeros(len(by.imbalance))
    # The residual gaps of a regularised law are no error of the bodies.
    gaps = by.gaps + np.where(closed, 0.0, state.gap)
    least = np.finfo(float).eps ** 0.5 * np.abs(pressure).max(initial=0.0)
    compliance = float(np.abs(np.diagonal(condensed.gap.pressure)).max(initial=0.0))
    overlap = least * min(1.0, compliance or 1.0)
    for _ in range(MAX_CHANGES):
        # Open nodes carry nothing.
        lost = np.concatenate(
            [np.where(closed, 0.0, -pressure), np.where(closed[nodes], 0.0, -traction), still]
        )
        gap, slip, imbalance = np.split(condensed.blocks @ lost, [m, m + n])
        status = ContactStatus.with_tractions(closed, state.status.stuck, traction, nodes)
        try:
            basis = Basis(condensed.problem, status)
            more = response(basis, gaps + gap, by.slips + slip, by.imbalance + imbalance)
        except SingularError as error:
            raise NumericalError(
                "the contact state is singular", "hold the bodies with a [[support]]"
            ) from error
        found = replace(more, pressure=more.pressure + lost[:m], traction=more.traction + lost[m : m + n])
        changed = np.where(closed, pressure + found.pressure < -least, found.gap < -overlap)
        if not changed.any():
            break
        closed = closed ^ changed
    return found
