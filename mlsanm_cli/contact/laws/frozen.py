"""Linearised response of a frictional contact state to small changes of gaps and slips, with slip status
kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.laws.contact_status import ContactSolution, ContactStatus, SetSystem
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.dense import SingularSystemError
from mlsanm_cli.errors import NumericalError

MAX_CHANGES = 30
"""Largest number of active-set changes, one per round."""


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
