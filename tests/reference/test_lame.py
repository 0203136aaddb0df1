"""The pressed ring against its differential equations and Hooke's law."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.formulas.lame import LameRing


@given(
    inner=st.floats(0.1, 2.0),
    thickness=st.floats(0.05, 5.0),
    pressure=st.floats(-10.0, 10.0),
    poisson=st.floats(0.0, 0.49),
)
def test_ring_is_in_equilibrium_and_takes_its_pressure(
    inner: float, thickness: float, pressure: float, poisson: float
) -> None:
    ring = LameRing(inner, inner + thickness, pressure, 210.0, poisson)
    radial, _ = ring.stress(np.array([ring.inner, ring.outer]))
    assert radial == pytest.approx([-pressure, 0.0], abs=1e-9)
    r = np.linspace(ring.inner, ring.outer, 7)[1:-1]
    step = 1e-4 * ring.inner
    slope = (ring.stress(r + step)[0] - ring.stress(r - step)[0]) / (2.0 * step)
    radial, hoop = ring.stress(r)
    size = max(1.0, abs(pressure)) * (1.0 + ring.inner / thickness)
    assert r * slope + radial - hoop == pytest.approx(0.0, abs=1e-5 * size)
    # Strains of the displacement are those of the stress.
    u = ring.displacement(r)
    e_r = (ring.displacement(r + step) - ring.displacement(r - step)) / (2.0 * step)
    assert 210.0 * u / r == pytest.approx(hoop - poisson * radial, abs=1e-9 * size)
    assert 210.0 * e_r == pytest.approx(radial - poisson * hoop, abs=1e-5 * size)


def test_a_thin_ring_carries_the_boiler_stress() -> None:
    ring = LameRing(10.0, 10.1, 2.0, 1.0, 0.3)
    hoop = ring.stress(np.array([10.05]))[1][0]
    assert hoop == pytest.approx(2.0 * 10.05 / 0.1, rel=6e-3)
