"""A state of the hyperbolic law as the guess of the state with another eta, at the same load."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.holonomic import HolonomicContact
from mlsanm_cli.contact.laws.hyperbolic import HyperbolicContact


def carried(problem: HyperbolicContact | HolonomicContact, x: FloatArray, eta: FloatArray) -> FloatArray:
    """Unknowns on the hyperbola of ``eta`` (m,), pressures, near those on that of ``problem``.

    Closed nodes keep their pressure, open ones their gap; tractions stay in proportion to what friction can
    carry.
    """
    law, m = problem.law, problem.m
    p, h = problem.split(x)[:2]
    closed = p / law.pressure > h / law.gap
    pressure = np.where(closed, p, eta * (law.delta / h - 1.0))
    gap = np.where(closed, eta * law.delta / (np.maximum(p, 0.0) + eta), h)
    whole = np.concatenate([pressure, gap, x[2 * m :]])
    if isinstance(problem, HolonomicContact):
        rub = problem.condensed.friction_nodes
        problem.split(whole)[3][:] *= (pressure + eta)[rub] / (p + law.eta)[rub]
    return whole
