"""Contact and Coulomb friction with every inequality replaced by a hyperbola.

Signorini's conditions are p >= 0, h >= 0, p h = 0. Coulomb's law says the same of the plastic slips a and b in
the two directions, each with the margin that the traction t leaves to its side of the cone, L = mu p. The
regularised laws give these products a small constant value::

    (p + eta) h = eta delta        pressure and gap
    a (L - t)   = eps              slip against the tangent; L = mu (p + eta)
    b (L + t)   = eps              slip along it
    s + c t + a - b = r            elastic slip of asperities of compliance c about the stick reference r

A sticking node is an elastic spring about r, a slipping one carries t = +-L; both up to terms of relative size
eta, without a corner between them. All equations are quadratic, which is what power series need. For eta and c
towards zero they become the exact laws.

Plastic slips are monotonic between two positions at which r follows them (:meth:`Law.moved_reference`): this is
backward Euler's integration of Coulomb's law, a return mapping with a smooth corner.

Sources: A. Elhage-Hussein, M. Potier-Ferry, N. Damil, International Journal of Solids and Structures 37 (2000)
6981, for the hyperbola of contact; P. Wriggers, Computational Contact Mechanics (2006), section 5.2, for friction
as elastoplasticity. Equations (13) to (15) of docs/method.md.
"""

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
    """Parameters of the hyperbolas: tension ``eta`` (m,), length ``delta`` (m,), friction coefficients ``mu``
    (n,), ``compliance`` c (n,) and ``elastic_slip`` c mu p (n,) of the asperities at the largest pressure, and
    the products ``eps`` (n,). ``pressure``, ``gap`` and ``slip`` are the scales of their unknowns."""

    eta: FloatArray
    delta: FloatArray
    mu: FloatArray
    compliance: FloatArray
    elastic_slip: FloatArray
    eps: FloatArray
    pressure: float
    gap: float
    slip: float

    @classmethod
    def of(cls, built: CondensedScene) -> Law:
        """The law of a case, with all lengths and pressures relative to those of the exact frictionless states
        at the ends of its stages: neither units nor the size of a load affect the relative result. Raises
        NumericalError if no state has any pressure."""
        c, contacts = built.condensed, built.case.touching
        pressures = [state.pressure for state in built.ends]
        largest = np.max(pressures, axis=0)
        pressure = float(largest.max(initial=0.0))
        if pressure <= 0.0:
            raise NumericalError(
                "no contact carries any pressure at the end of a stage, so the hyperbolic law has no scale",
                'check the direction of the loads, or use contact.regularization.law = "exact"',
            )
        gap = LENGTH * max(c.elastic_gap(one) for one in pressures)
        apart = np.zeros(len(c.weight))
        for pairing in c.pairings:
            drawn = pairing.gap[pairing.candidate]
            apart[c.spans[pairing.name]] = drawn - drawn.min(initial=np.inf)
        # Far from contact the law pulls with eta: the farther, the less, with the same product.
        far = np.maximum(LENGTH * apart / gap, 1.0)
        reference = _of_contacts(c.spans, largest)
        relative = _of_nodes(c.spans, {one.name: one.regularization.eta for one in contacts})
        eta = relative * reference / far
        cone = c.friction * reference[c.friction_nodes]
        slips = np.max([np.abs(c.slip.traction @ (c.friction * p[c.friction_nodes])) for p in pressures], axis=0)
        soft = _of_nodes(c.tangential, {one.name: one.regularization.stick for one in contacts})
        elastic_slip = soft * _of_contacts(c.tangential, slips)
        return cls(
            eta=eta,
            delta=np.maximum(apart, gap),
            mu=c.friction,
            compliance=elastic_slip / cone,
            elastic_slip=elastic_slip,
            eps=relative[c.friction_nodes] * elastic_slip * cone,
            pressure=pressure,
            gap=gap,
            slip=float(slips.max(initial=0.0)) or 1.0,
        )

    def moved_reference(self, reference: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
        """The stick ``reference`` (n,) after plastic slips a and b (n,): it follows what exceeds the elastic slip,
        up to which the node unloads elastically."""
        over = [np.maximum(one - self.elastic_slip, 0.0) for one in (a, b)]
        return np.asarray(reference - over[0] + over[1])


def _of_nodes(spans: Mapping[str, slice], values: Mapping[str, float]) -> FloatArray:
    """The value of its contact at every node."""
    parts = [np.full(span.stop - span.start, values[name]) for name, span in spans.items()]
    return np.concatenate([np.zeros(0), *parts])


def _of_contacts(spans: Mapping[str, slice], values: FloatArray) -> FloatArray:
    """The largest of the ``values`` (r,) in each contact, at every node."""
    least = LEAST_SHARE * float(values.max(initial=0.0))
    return _of_nodes(spans, {name: max(float(values[own].max()), least) for name, own in spans.items()})
