"""Matrices of radial fields, and their sums, against the closed forms."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from mlsanm_cli.mechanics.near_field import NO_PAIRS, Isotropic, SurfaceForces, summed


@pytest.mark.parametrize("center", [None, 0.3 + 0.1j])
@pytest.mark.parametrize("masked", [False, True])
def test_matrices_and_sums_are_those_of_the_fields_of_all_forces(
    center: complex | None, masked: bool
) -> None:
    random = np.random.default_rng(0)
    place, z = (random.normal(size=n) + 1j * random.normal(size=n) for n in (7, 5))
    forces = SurfaceForces(Isotropic(1.3, 1.8), place, np.exp(1j * random.normal(size=7)), center)
    left_out = random.random((5, 7)) < 0.3 if masked else NO_PAIRS
    for of_all, field in (
        (partial(forces.displacements, left_out=left_out), forces.displacement(z)),
        (partial(forces.stresses, left_out=left_out), forces.stress(z)),
    ):
        if masked:
            field[left_out] = 0.0
        assert of_all(z) == pytest.approx(field.transpose(2, 0, 3, 1).reshape(-1, 5, 14), abs=1e-13)
        force = random.normal(size=(7, 2, 3))
        total = np.einsum("ekcd,kdm->ecm", field, force)
        assert summed(of_all, z, force) == pytest.approx(total, abs=1e-13)
