"""Parameters and scales of the regularised laws."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.errors import NumericalError
from mlsanm_cli.solve.condensed_scene import CondensedScene

LENGTH = 0.1
"""Reference gap over the elastic change of the gaps."""
LEAST_SHARE = 0.01
"""Least reference value of a contact over the largest one of the scene."""


class Law:
    """Tensions ``eta`` and lengths ``delta`` (m,); friction coefficients ``mu``, ``compliance`` c, its
    ``elastic_slip`` c mu p at the largest pressure, and products ``eps`` (n,). ``pressure``, ``gap``,
    ``elastic`` (of displacements) and ``slip`` are scales."""

    def __init__(self, built: CondensedScene) -> None:
        """The law of a case, relative to the exact states at the ends of its stages: units and sizes of loads
        do not matter. Raises NumericalError if no state has any pressure."""
        c, law = built.condensed, {contact.name: contact.regularization for contact in built.case.touching}
        nodes, pressures = c.friction_nodes, [state.pressure for state in built.ends]
        largest = np.max(pressures, axis=0)
        pressure = float(largest.max(initial=0.0))
        if pressure <= 0.0:
            raise NumericalError(
                "no contact carries any pressure at the end of a stage, so the hyperbolic law has no scale",
                'check the direction of the loads, or use contact.regularization.law = "exact"',
            )
        elastic = max(c.elastic_gap(one) for one in pressures)
        eta, apart, reference = np.empty((3, len(largest)))
        for pairing in c.pairings:
            own, drawn = c.spans[pairing.name], pairing.gap[pairing.candidate]
            eta[own], apart[own] = law[pairing.name].eta, drawn - drawn.min()
            reference[own] = max(largest[own].max(), LEAST_SHARE * pressure)
        cone = c.friction * reference[nodes]
        slips = np.max([np.abs(c.slip.traction @ (c.friction * one[nodes])) for one in pressures], axis=0)
        slip, elastic_slip = float(slips.max(initial=0.0)), np.empty(len(nodes))
        for name, own in c.tangential.items():
            elastic_slip[own] = law[name].stick * max(slips[own].max(), LEAST_SHARE * slip)
        # Far from contact the law pulls with eta: the farther, the less, with the same product.
        self.eta = eta * reference / np.maximum(apart / elastic, 1.0)
        self.delta = np.maximum(apart, LENGTH * elastic)
        self.mu, self.compliance, self.elastic_slip = c.friction, elastic_slip / cone, elastic_slip
        self.eps = eta[nodes] * elastic_slip * cone
        self.pressure, self.gap, self.elastic, self.slip = pressure, LENGTH * elastic, elastic, slip
