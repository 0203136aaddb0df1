"""Sums of radial fields against the tables of all of them."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.mechanics.near_field import Isotropic, SurfaceForces


@pytest.mark.parametrize("center", [None, 0.3 + 0.1j])
@pytest.mark.parametrize("masked", [False, True])
def test_sums_are_those_of_the_fields_of_all_forces(center: complex | None, masked: bool) -> None:
    random = np.random.default_rng(0)
    place, z = (random.normal(size=n) + 1j * random.normal(size=n) for n in (7, 5))
    forces = SurfaceForces(Isotropic(1.3, 1.8), place, np.exp(1j * random.normal(size=7)), center)
    force, left_out = random.normal(size=(7, 2, 3)), random.random((5, 7)) < 0.3 * masked
    for by_all, field in (
        (forces.displacement_by, forces.displacement(z)),
        (forces.stress_by, forces.stress(z)),
    ):
        field[left_out] = 0.0
        given = (left_out,) if masked else ()
        assert by_all(force, z, *given) == pytest.approx(np.einsum("ekcd,kdm->ecm", field, force), abs=1e-13)
