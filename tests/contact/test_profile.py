"""Half width of known pressure profiles."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.contact.geometry.profile import THRESHOLD, half_width

PLACES = np.linspace(-0.5, 1.5, 21)
PROFILES = {
    "triangle": (PLACES, np.maximum(0.0, 1.0 - np.abs(PLACES - 0.5) / 0.5), 0.5 * (1.0 - THRESHOLD)),
    "crossings between nodes": ([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 0.0, 0.0], 0.99),
    # 100 falling to 0 over a distance of 4 on the right and 1 on the left.
    "uneven nodes": ([0.0, 1.0, 5.0, 6.0], [0.0, 100.0, 0.0, 0.0], 0.5 * 0.99 * 5.0),
    "outermost crossings": (np.arange(7.0), [0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], 2.0 + 0.99),
    "up to the last node": ([0.0, 0.5, 2.0], np.ones(3), 1.0),
    "unloaded": (np.arange(3.0), np.zeros(3), 0.0),
    "tension": (np.arange(3.0), -np.ones(3), 0.0),
    "no nodes": ([], [], 0.0),
}


@pytest.mark.parametrize(("arc", "pressure", "expected"), PROFILES.values(), ids=PROFILES)
def test_half_width(arc: list[float], pressure: list[float], expected: float) -> None:
    assert half_width(np.array(arc), np.array(pressure)) == pytest.approx(expected, rel=1e-12)
