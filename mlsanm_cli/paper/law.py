"""Parameters and scales of the regularised laws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.solve.condensed_scene import CondensedScene

LENGTH = 0.1
"""Reference gap over the elastic change of the gaps."""
LEAST_SHARE = 0.01
"""Least reference value of a contact over the largest one of the scene."""


@dataclass(frozen=True)
class Law:
    """Tensions ``eta`` and lengths ``delta`` (m,); friction coefficients ``mu``, ``compliance`` c, its
    ``elastic_slip`` c mu p at the largest pressure, and products ``eps`` (n,). ``pressure``, ``gap``,
    ``elastic`` (of displacements) and ``slip`` are scales."""

    eta: FloatArray
    delta: FloatArray
    mu: FloatArray
    compliance: FloatArray
    elastic_slip: FloatArray
    eps: FloatArray
    pressure: float
    gap: float
    elastic: float
    slip: float

    @classmethod
    def of(cls, built: CondensedScene) -> Law:
        """The law of a case, relative to the exact states at the ends of its stages: units and sizes of loads
        do not matter. Raises NumericalError if no state has any pressure."""
        c, law = built.condensed, {contact.name: contact.regularization for contact in built.case.touching}
        pressures = [state.pressure for state in built.ends]
        largest = np.max(pressures, axis=0)
        pressure = float(largest.max(initial=0.0))
        if pressure <= 0.0:
            raise NumericalError(
                "no contact carries any pressure at the end of a stage, so the hyperbolic law has no scale",
                'check the direction of the loads, or use contact.regularization.law = "exact"',
            )
        elastic = max(c.elastic_gap(one) for one in pressures)
        gap, nodes = LENGTH * elastic, c.friction_nodes
        drawn = [pairing.gap[pairing.candidate] for pairing in c.pairings]
        apart = np.concatenate([one - one.min(initial=np.inf) for one in drawn])
        reference = _largest(c.spans, largest)
        eta = _at_nodes(c.spans, {name: one.eta for name, one in law.items()})
        cone = c.friction * reference[nodes]
        slips = np.max([np.abs(c.slip.traction @ (c.friction * one[nodes])) for one in pressures], axis=0)
        stick = _at_nodes(c.tangential, {name: one.stick for name, one in law.items()})
        elastic_slip = stick * _largest(c.tangential, slips)
        return cls(
            # Far from contact the law pulls with eta: the farther, the less, with the same product.
            eta=eta * reference / np.maximum(apart / elastic, 1.0),
            delta=np.maximum(apart, gap),
            mu=c.friction,
            compliance=elastic_slip / cone,
            elastic_slip=elastic_slip,
            eps=eta[nodes] * elastic_slip * cone,
            pressure=pressure,
            gap=gap,
            elastic=elastic,
            slip=float(slips.max(initial=0.0)),
        )


def _at_nodes(spans: Mapping[str, slice], values: Mapping[str, float]) -> FloatArray:
    """The value of its contact at every node."""
    parts = [np.full(span.stop - span.start, values[name]) for name, span in spans.items()]
    return np.concatenate([np.zeros(0), *parts])


def _largest(spans: Mapping[str, slice], values: FloatArray) -> FloatArray:
    """The largest of the ``values`` (r,) in each contact, at every node."""
    least = LEAST_SHARE * float(values.max(initial=0.0))
    return _at_nodes(spans, {name: max(float(values[own].max()), least) for name, own in spans.items()})
