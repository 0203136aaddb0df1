"""What small changes of gaps and slips do to a contact state with friction: what slips continues to slip."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.laws.contact_status import ContactSolution, ContactStatus, SetSystem
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.dense import SingularSystemError
from mlsanm_cli.errors import NumericalError

MAX_CHANGES = 30
"""Largest number of changes of the set of closed nodes."""


def frozen_change(
    condensed: Condensed,
    pressure: FloatArray,
    traction: FloatArray,
    gaps: FloatArray,
    closed: BoolArray,
    stuck: BoolArray,
    by: tuple[FloatArray, FloatArray, FloatArray],
) -> ContactSolution:
    """How a state with ``pressure`` (m,), ``traction`` (n,) and ``gaps`` (m,) changes when gaps (m,), slips
    (n,) and the force imbalance of the rigid constraints (k,) change ``by`` so much.

    Nodes that are ``closed`` (m,) stay so unless they would pull, open ones unless they would overlap; of the
    nodes with friction those ``stuck`` (n,) keep their slips, the others slip as they do. So the change is
    linear but for the edges: the history of the loads need not be followed again. Raises NumericalError where
    that has no solution.
    """
    m, n, nodes, still = len(pressure), len(traction), condensed.friction_nodes, np.zeros(len(by[2]))
    least = np.finfo(float).eps ** 0.5 * np.abs(pressure).max(initial=0.0)
    compliance = float(np.abs(np.diagonal(condensed.gap.pressure)).max(initial=0.0))
    overlap = least * min(1.0, compliance or 1.0)
    for _ in range(MAX_CHANGES):
        touching = closed[nodes]
        slides = np.where(touching & ~stuck, np.sign(traction), 0.0)
        # What is open carries nothing.
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
