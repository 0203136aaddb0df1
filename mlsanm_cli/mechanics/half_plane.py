"""Surface compliance of an anisotropic half-plane."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray

DIRECTIONS = 720
"""Points of the trapezoidal rule, which converges exponentially; for E1/E2 = 1000 it has 12 digits."""


def surface_compliance(stiffness: FloatArray) -> FloatArray:
    """Tensor M (2, 2) of the surface displacement -M f log(r) / pi due to line forces f at distance r.

    M is the inverse of the Barnett-Lothe tensor L, with Q, R, T the matrices of the plane ``stiffness`` (3,
    3) in a rotating frame::

        L = 1/pi int_0^pi (Q - R T^-1 R^T) d theta

    It is independent of the orientation of the surface, and 2/E' times the identity for an isotropic material
    of plane modulus E' (Ting, Anisotropic Elasticity, Oxford University Press 1996, ISBN 9780195074475).
    Frictionless contact along the normal n is that of an isotropic half-plane with 1/E' = n M n / 2.
    """
    angle = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    # voigt[i, j] is the position of the stress component ij among xx, yy, xy.
    voigt = np.array([[0, 2], [2, 1]])
    c = stiffness[voigt[:, :, None, None], voigt[None, None, :, :]]
    q = np.einsum("ijks,tj,ts->tik", c, along, along)
    r = np.einsum("ijks,tj,ts->tik", c, along, across)
    t = np.einsum("ijks,tj,ts->tik", c, across, across)
    lothe = (q - r @ np.linalg.solve(t, r.transpose(0, 2, 1))).mean(axis=0)
    compliance: FloatArray = np.linalg.inv(0.5 * (lothe + lothe.T))
    return compliance
