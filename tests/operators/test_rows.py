"""Sparse rows against the sums they stand for."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from mlsanm_cli.operators.rows import nodal_rows, vector_rows
from mlsanm_cli.operators.settings import MlsSettings
from mlsanm_cli.operators.stencils import build_stencils

POINTS = np.random.default_rng(0).uniform(0.0, 1.0, (60, 2))
STENCILS = build_stencils(POINTS, cKDTree(POINTS), POINTS[:7], 0, MlsSettings(2, 15))
U = np.random.default_rng(1).normal(size=(60, 2))


@pytest.mark.parametrize("components", [(0,), (1,), (0, 1)])
def test_vector_rows_are_sums_over_the_stencils(components: tuple[int, ...]) -> None:
    on = np.random.default_rng(2).normal(size=(len(STENCILS.indices), 2))
    given = [on[:, c].copy() if c in components else None for c in (0, 1)]
    rows = vector_rows(STENCILS, given[0], given[1])
    assert rows.shape == (7, 120)
    for e in range(7):
        entries = range(STENCILS.indptr[e], STENCILS.indptr[e + 1])
        total = sum(on[k, c] * U[STENCILS.indices[k], c] for k in entries for c in components)
        assert (rows @ U.ravel())[e] == pytest.approx(total, rel=1e-12)


@pytest.mark.parametrize("component", [0, 1])
def test_nodal_rows_pick_displacements(component: int) -> None:
    chosen = np.array([3, 59, 3])
    assert np.array_equal(nodal_rows(chosen, component, 60) @ U.ravel(), U[chosen, component])
